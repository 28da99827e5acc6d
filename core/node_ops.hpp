#pragma once
/// Operations at nodes, common to LPFDM and MPM: what a scene does not have is absent from the lists.

#include "core/parallel.hpp"
#include "core/walls.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

namespace testbed
{
/// Eq. (11): F += g m, growing from zero over the ramp.
struct Gravity
{
    Vec2 acceleration;
    double ramp;
    bool linear = false;

    double factor(double t) const
    {
        if (t >= ramp)
            return 1;
        return linear ? t / ramp : 0.5 * (1 - std::cos(std::numbers::pi * t / ramp));
    }

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

inline Gravity make_gravity(const GravitySpec& spec)
{
    return {spec.acceleration, spec.ramp, spec.profile == "linear"};
}

/// Eq. (15), local non-viscous damping: F -= alpha |F| sgn(v).
struct LocalDamping
{
    double alpha;

    double damped(double force, double velocity) const { return force - alpha * std::abs(force) * ((velocity > 0) - (velocity < 0)); }
    void apply(Nodes& nodes) const
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

/// What is recorded of a support or a wall.
struct RestraintRecord
{
    std::string name;
    Vec2 reaction;                     ///< on the soil [N/m]
    std::optional<Vec2> displacement;  ///< of a wall [m]
};

class NodeOps
{
public:
    /// @throws SceneError when a boundary takes no node
    NodeOps(const Scene& scene, const Lattice& lattice);

    /// Takes the walls to time t, and to their velocity in the coming step.
    /// @throws Diverged when a wall has left the lattice or has reached what stands in its way
    void begin_step(double t, double dt);
    void end_step(double dt)
    {
        for (Wall& wall : walls_)
            wall.end_step(dt);
    }
    /// Gravity, the reactions of supports and walls, and damping of what is then out of balance.
    void apply_forces(Nodes& nodes, double t);
    /// Supports and walls prescribe the velocity.
    void restrain(const Nodes& nodes, std::vector<double>& vx, std::vector<double>& vy) const
    {
        for (const Restraint& r : restraints_)
            r.drive(nodes, vx, vy);
    }
    bool restrains() const { return !restraints_.empty(); }
    std::vector<RestraintRecord> records() const;
    const std::vector<Restraint>& restraints() const { return restraints_; }

private:
    std::optional<Gravity> gravity_;
    std::optional<LocalDamping> damping_;
    std::vector<Restraint> restraints_;  ///< of the boundaries, then of the walls: where two prescribe, the later one does
    std::vector<Wall> walls_;
    std::size_t first_wall_ = 0;
};

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
