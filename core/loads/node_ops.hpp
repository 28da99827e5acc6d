#pragma once
/// Operations at nodes, common to LPFDM and MPM: what a scene does not have is absent from the lists.

#include "core/base/parallel.hpp"
#include "core/base/step.hpp"
#include "core/loads/nodal_work.hpp"
#include "core/loads/walls.hpp"

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
    return {spec.acceleration, spec.ramp, spec.profile == GravitySpec::Profile::linear};
}

/// Eq. (15), local non-viscous damping: F -= alpha |F| sgn(v), alpha in [0, 1).
struct LocalDamping
{
    double alpha;

    Pack damped(Pack force, Pack velocity) const { return force - along(Pack(alpha) * max(force, -force), velocity); }
    /// What was taken from the force that is left.
    Pack taken(Pack left, Pack velocity) const
    {
        Pack share(alpha / (1 + alpha));  // the force was against the motion
        stdx::where(left * velocity > Pack(0.0), share) = Pack(alpha / (1 - alpha));
        return along(share * max(left, -left), velocity);
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

private:
    /// A size with the sign of the velocity, zero at rest.
    static Pack along(Pack size, Pack velocity)
    {
        stdx::where(velocity == Pack(0.0), size) = Pack(0.0);
        stdx::where(velocity < Pack(0.0), size) = -size;
        return size;
    }
};

/// None: accelerate() then has nothing to add up for it.
struct NoDamping
{
    static Pack taken(Pack, Pack) { return Pack(0.0); }
};

/// Eqs. (12), (14): v += F / m dt. Returns the work of the forces, exact to rounding, with the velocity in the middle of the kick.
/// @param weight mass of the nodes, that has weight @param damping that the forces have gone through
template <class Damping = NoDamping>
Kick accelerate(Nodes& nodes, const std::vector<double>& weight, double dt, const Damping& damping = {})
{
    const Pack half(0.5);
    const auto s = sum_over_nodes<4>(nodes,
                                     [&](std::size_t i, const auto& lanes)
                                     {
                                         const Pack step = inverse_mass(nodes, i, lanes) * Pack(dt), m = lanes.load(&nodes.mass[i]);
                                         const Pack fx = lanes.load(&nodes.fx[i]), fy = lanes.load(&nodes.fy[i]);
                                         const Pack vx = lanes.load(&nodes.vx[i]), vy = lanes.load(&nodes.vy[i]);
                                         const Pack dx = fx * step, dy = fy * step;
                                         lanes.store(&nodes.vx[i], vx + dx);
                                         lanes.store(&nodes.vy[i], vy + dy);
                                         const Pack mean_x = vx + half * dx, mean_y = vy + half * dy;
                                         const Pack w = lanes.load(&weight[i]);
                                         return std::array{m * (dx * mean_x + dy * mean_y), w * mean_x, w * mean_y,
                                                           damping.taken(fx, vx) * mean_x + damping.taken(fy, vy) * mean_y};
                                     });
    return {s[0], {dt * s[1], dt * s[2]}, dt * s[3]};
}

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

    /// Gravity takes these masses of the nodes for those that have weight, from now on.
    void weigh_with(const std::vector<double>& mass) { weight_ = &mass; }
    /// Takes the walls to the start of the step, and to their velocity in it.
    /// @throws Diverged when a wall has left the lattice or has reached what stands in its way
    void begin_step(const Step& step);
    void end_step(const Step& step)
    {
        for (Wall& wall : walls_)
            wall.end_step(step);
    }
    /// Gravity, the reactions of supports and walls, and damping of what is then out of balance.
    void apply_forces(const Lattice& lattice, Nodes& nodes, const Step& step);
    /// Supports and walls prescribe the velocity. @param counts whether the motion of the soil takes over what that changes
    void restrain(const Lattice& lattice, const Nodes& nodes, std::vector<double>& vx, std::vector<double>& vy, bool counts = true)
    {
        find_driven(lattice, nodes);
        if (const double work = driven_.drive(restraints_, nodes, vx, vy); counts)
            work_.restraints += work;
    }
    /// Runs load(), which adds forces of the outside, and keeps them for their work.
    template <class Load>
    void apply_load(const Nodes& nodes, Load&& load)
    {
        before_x_ = nodes.fx;
        before_y_ = nodes.fy;
        load_x_.resize(nodes.fx.size());
        load_y_.resize(nodes.fy.size());
        load();
        for (const auto n : nodes.active())
        {
            load_x_[n] += nodes.fx[n] - before_x_[n];
            load_y_[n] += nodes.fy[n] - before_y_[n];
        }
    }
    /// Power that hourglass control takes from the motion in the coming kick [W/m].
    void note_hourglass(double power) { power_.hourglass = power; }
    /// Accelerates, and adds up the work of all forces.
    void kick(Nodes& nodes, double dt);
    /// Work up to the time of the forces, `lag` seconds after that of the nodes' velocity.
    NodalWork work(const Nodes& nodes, double lag) const;
    /// The sums up to the last kick, on which no step depends.
    NodalWork& work_done() { return work_; }
    /// Of the walls: all else is as the scene says.
    template <class Archive>
    void state(Archive& a)
    {
        for (std::size_t k = 0; k < walls_.size(); ++k)
            a.group("wall/" + restraints_[first_wall_ + k].name, [&] { walls_[k].state(a, restraints_[first_wall_ + k]); });
        if constexpr (Archive::reads)
            seen_ = 0;
    }
    bool restrains() const { return !restraints_.empty(); }
    std::vector<RestraintRecord> records() const;
    const std::vector<Restraint>& restraints() const { return restraints_; }

private:
    const std::vector<double>& weight_of(const Nodes& nodes) const { return weight_ ? *weight_ : nodes.mass; }
    /// Power of the loads at the present velocity [W/m].
    double load_power(const Nodes& nodes) const;
    void add_work(const Kick& kick, double loads, double dt, NodalWork& work) const;
    void find_driven(const Lattice& lattice, const Nodes& nodes)
    {
        if (nodes.version() == seen_)
            return;
        seen_ = nodes.version();
        driven_.find(restraints_, lattice, nodes);
    }

    std::optional<Gravity> gravity_;
    const std::vector<double>* weight_ = nullptr;  ///< null: all mass has weight
    std::optional<LocalDamping> damping_;
    std::vector<Restraint> restraints_;  ///< of the boundaries, then of the walls: where two prescribe, the later one does
    std::vector<Wall> walls_;
    std::size_t first_wall_ = 0;
    DrivenNodes driven_;
    NodalWork work_, power_;  ///< power: of the coming step, where it is not known to the kick [W/m]
    Vec2 gravity_now_{0, 0};
    std::vector<double> load_x_, load_y_, before_x_, before_y_;  ///< empty in a scene without loads
    std::size_t seen_ = 0;                                       ///< version of the nodes for which driven_ was found; 0: none
};

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
