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

    void apply(Nodes& nodes, double t) const { apply(nodes, nodes.mass, t); }
    /// @param mass of the nodes, that has weight
    void apply(Nodes& nodes, const std::vector<double>& mass, double t) const
    {
        const Pack gx(factor(t) * acceleration[0]), gy(factor(t) * acceleration[1]);
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                const Pack m = lanes.load(&mass[i]);
                lanes.store(&nodes.fx[i], lanes.load(&nodes.fx[i]) + gx * m);
                lanes.store(&nodes.fy[i], lanes.load(&nodes.fy[i]) + gy * m);
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

    Pack damped(Pack force, Pack velocity) const
    {
        Pack resistance = Pack(alpha) * max(force, -force);
        stdx::where(velocity == Pack(0.0), resistance) = Pack(0.0);
        stdx::where(velocity < Pack(0.0), resistance) = -resistance;
        return force - resistance;
    }
    void apply(Nodes& nodes) const
    {
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                lanes.store(&nodes.fx[i], damped(lanes.load(&nodes.fx[i]), lanes.load(&nodes.vx[i])));
                lanes.store(&nodes.fy[i], damped(lanes.load(&nodes.fy[i]), lanes.load(&nodes.vy[i])));
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
    /// @param mass of the nodes, that has weight
    void apply_forces(const Lattice& lattice, Nodes& nodes, const std::vector<double>& mass, double t);
    void apply_forces(const Lattice& lattice, Nodes& nodes, double t) { apply_forces(lattice, nodes, nodes.mass, t); }
    /// Supports and walls prescribe the velocity.
    void restrain(const Lattice& lattice, const Nodes& nodes, std::vector<double>& vx, std::vector<double>& vy)
    {
        find_driven(lattice, nodes);
        driven_.drive(restraints_, nodes, vx, vy);
    }
    bool restrains() const { return !restraints_.empty(); }
    std::vector<RestraintRecord> records() const;
    const std::vector<Restraint>& restraints() const { return restraints_; }

private:
    void find_driven(const Lattice& lattice, const Nodes& nodes)
    {
        if (nodes.version() == seen_)
            return;
        seen_ = nodes.version();
        driven_.find(restraints_, lattice, nodes);
    }

    std::optional<Gravity> gravity_;
    std::optional<LocalDamping> damping_;
    std::vector<Restraint> restraints_;  ///< of the boundaries, then of the walls: where two prescribe, the later one does
    std::vector<Wall> walls_;
    std::size_t first_wall_ = 0;
    DrivenNodes driven_;
    std::size_t seen_ = 0;  ///< version of the nodes for which driven_ was found; 0: none
};

/// Eqs. (12), (14): v += F / m dt.
inline void accelerate(Nodes& nodes, double dt)
{
    nodes.for_each(
        [&](std::size_t i, const auto& lanes)
        {
            const Pack step = inverse_mass(nodes, i, lanes) * Pack(dt);
            lanes.store(&nodes.vx[i], lanes.load(&nodes.vx[i]) + lanes.load(&nodes.fx[i]) * step);
            lanes.store(&nodes.vy[i], lanes.load(&nodes.vy[i]) + lanes.load(&nodes.fy[i]) * step);
        });
}

inline double force_norm(const Nodes& nodes)
{
    const auto& runs = nodes.runs();
    const auto s = ordered_sum<1>(
        runs.size(),
        [&](std::size_t r)
        {
            Pack square(0.0);
            for_each_pack(runs[r].begin, runs[r].begin + runs[r].count,
                          [&](std::size_t i, const auto& lanes)
                          {
                              const Pack fx = lanes.keep(lanes.load(&nodes.fx[i])), fy = lanes.keep(lanes.load(&nodes.fy[i]));
                              square += fx * fx + fy * fy;
                          });
            return std::array<double, 1>{sum(square)};
        },
        4);
    return std::sqrt(s[0]);
}

inline std::size_t nodes_with_mass(const Nodes& nodes)
{
    return static_cast<std::size_t>(
        std::count_if(nodes.active().begin(), nodes.active().end(), [&](std::uint32_t i) { return nodes.mass[i] > 0; }));
}
}  // namespace testbed
