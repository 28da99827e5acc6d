#pragma once
/// Operations at nodes, common to LPFDM and MPM: what a scene does not have is absent from the lists.

#include "core/grid.hpp"
#include "core/parallel.hpp"
#include "core/scene.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <variant>

namespace testbed
{
/// Eq. (11): F += g m, growing from zero as (1 - cos) / 2 over the ramp.
struct Gravity
{
    Vec2 acceleration;
    double ramp;

    double factor(double t) const { return t >= ramp ? 1 : 0.5 * (1 - std::cos(std::numbers::pi * t / ramp)); }

    void apply(Nodes& nodes, double t) const
    {
        const double f = factor(t), gx = f * acceleration[0], gy = f * acceleration[1];
        parallel_for(nodes.active.size(),
                     [&](std::size_t a)
                     {
                         const std::size_t i = nodes.active[a];
                         nodes.fx[i] += gx * nodes.mass[i];
                         nodes.fy[i] += gy * nodes.mass[i];
                     });
    }
};

/// Eq. (15), local non-viscous damping: F -= alpha |F| sgn(v).
struct LocalDamping
{
    double alpha;

    double damped(double force, double velocity) const { return force - alpha * std::abs(force) * ((velocity > 0) - (velocity < 0)); }
    void apply(Nodes& nodes, double) const
    {
        parallel_for(nodes.active.size(),
                     [&](std::size_t a)
                     {
                         const std::size_t i = nodes.active[a];
                         nodes.fx[i] = damped(nodes.fx[i], nodes.vx[i]);
                         nodes.fy[i] = damped(nodes.fy[i], nodes.vy[i]);
                     });
    }
};

/// Fixed velocity components at chosen nodes.
struct Fixity
{
    std::vector<std::uint32_t> x, y;

    void stop(std::vector<double>& vx, std::vector<double>& vy) const
    {
        for (const auto i : x)
            vx[i] = 0;
        for (const auto i : y)
            vy[i] = 0;
    }
};

using ForceOp = std::variant<Gravity, LocalDamping>;

struct NodeOps
{
    std::vector<ForceOp> forces;  ///< in this order: damping acts on all that stands before it
    std::vector<Fixity> fixities;

    void apply_forces(Nodes& nodes, double t) const
    {
        for (const ForceOp& op : forces)
            std::visit([&](const auto& o) { o.apply(nodes, t); }, op);
    }
    /// To velocities, or to forces (a fixed component is not out of balance).
    void apply_fixities(std::vector<double>& x, std::vector<double>& y) const
    {
        for (const Fixity& f : fixities)
            f.stop(x, y);
    }
};

/// @throws SceneError when a boundary takes no node
NodeOps make_node_ops(const Scene& scene, const Lattice& lattice);

/// 1/m, and zero for a node that carries no mass.
inline double inverse_mass(const Nodes& nodes, std::size_t i)
{
    return nodes.mass[i] > 0 ? 1 / nodes.mass[i] : 0;
}

/// Eqs. (12), (14): v += F / m dt.
inline void accelerate(Nodes& nodes, double dt)
{
    parallel_for(nodes.active.size(),
                 [&](std::size_t a)
                 {
                     const std::size_t i = nodes.active[a];
                     const double step = inverse_mass(nodes, i) * dt;
                     nodes.vx[i] += nodes.fx[i] * step;
                     nodes.vy[i] += nodes.fy[i] * step;
                 });
}

inline double force_norm(const Nodes& nodes)
{
    const auto s = ordered_sum<1>(nodes.active.size(),
                                  [&](std::size_t a)
                                  {
                                      const std::size_t i = nodes.active[a];
                                      return std::array<double, 1>{nodes.fx[i] * nodes.fx[i] + nodes.fy[i] * nodes.fy[i]};
                                  });
    return std::sqrt(s[0]);
}

inline std::size_t nodes_with_mass(const Nodes& nodes)
{
    return static_cast<std::size_t>(
        std::count_if(nodes.active.begin(), nodes.active.end(), [&](std::uint32_t i) { return nodes.mass[i] > 0; }));
}
}  // namespace testbed
