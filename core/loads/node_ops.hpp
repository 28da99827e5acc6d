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
#include <utility>

namespace testbed
{
/// Eq. (11): F += g m, growing from zero over the ramp.
struct Gravity
{
    Vec<2> acceleration;
    double ramp;
    bool linear = false;

    double factor(double t) const
    {
        if (t >= ramp)
            return 1;
        return linear ? t / ramp : 0.5 * (1 - std::cos(std::numbers::pi * t / ramp));
    }

    Vec<2> now(double t) const { return {factor(t) * acceleration[0], factor(t) * acceleration[1]}; }

    /// @param mass of the nodes, that has weight
    void apply(Nodes<2>& nodes, const std::vector<double>& mass, double t) const
    {
        const Vec<2> g = now(t);
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                const Pack m = lanes.load(&mass[i]);
                unrolled<2>([&](auto d) { lanes.store(&nodes.f[d][i], lanes.load(&nodes.f[d][i]) + Pack(g[d]) * m); });
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
    void apply(Nodes<2>& nodes) const
    {
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            { unrolled<2>([&](auto d) { lanes.store(&nodes.f[d][i], damped(lanes.load(&nodes.f[d][i]), lanes.load(&nodes.v[d][i]))); }); });
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
template <int dim, class Damping = NoDamping>
Kick accelerate(Nodes<dim>& nodes, const std::vector<double>& weight, double dt, const Damping& damping = {})
{
    const auto s = sum_over_nodes<dim + 2>(nodes,
                                           [&](std::size_t i, const auto& lanes)
                                           {
                                               const Pack step = inverse_mass(nodes, i, lanes) * Pack(dt), m = lanes.load(&nodes.mass[i]);
                                               const Pack w = lanes.load(&weight[i]);
                                               const auto f = load(nodes.f, i, lanes), v = load(nodes.v, i, lanes);
                                               Vec<dim, Pack> dv, mean;
                                               std::array<Pack, dim + 2> sums;
                                               unrolled<dim>(
                                                   [&](auto d)
                                                   {
                                                       dv[d] = f[d] * step;
                                                       lanes.store(&nodes.v[d][i], v[d] + dv[d]);
                                                       mean[d] = v[d] + Pack(0.5) * dv[d];
                                                       sums[d] = w * mean[d];
                                                   });
                                               sums[dim] = m * total<dim>([&](auto d) { return dv[d] * mean[d]; });
                                               sums[dim + 1] = total<dim>([&](auto d) { return damping.taken(f[d], v[d]) * mean[d]; });
                                               return sums;
                                           });
    Kick kick{s[dim], {}, dt * s[dim + 1]};
    for (int d = 0; d < dim; ++d)
        kick.transport[d] = dt * s[d];
    return kick;
}

/// What is recorded of a support or a wall.
struct RestraintRecord
{
    std::string name;
    Vec<2> reaction;                     ///< on the soil [N/m]
    std::optional<Vec<2>> displacement;  ///< of a wall [m]
};

class NodeOps
{
public:
    /// @param places of the nodes by number, if they are not where the lattice has them; NaN: there is no such node
    /// @throws SceneError when a boundary takes no node
    NodeOps(const Scene& scene, const Lattice<2>& lattice, std::span<const Vec<2>> places = {});

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
    void apply_forces(const Lattice<2>& lattice, Nodes<2>& nodes, const Step& step);
    /// Supports and walls prescribe the velocity. @param counts whether the motion of the soil takes over what that changes
    void restrain(const Lattice<2>& lattice, const Nodes<2>& nodes, VectorField<2>& velocity, bool counts = true)
    {
        find_driven(lattice, nodes);
        if (const double work = driven_.drive(restraints_, nodes, velocity); counts)
            work_.restraints += work;
    }
    /// Runs load(), which adds forces of the outside, and keeps them for their work.
    template <class Load>
    void apply_load(const Nodes<2>& nodes, Load&& load)
    {
        for (auto* field : {&before_, &load_})
            for (auto& component : *field)
                component.resize(nodes.mass.size());
        nodes.for_each([&](std::size_t i, const auto& lanes) { store(before_, i, lanes, testbed::load(nodes.f, i, lanes)); });
        load();
        const bool has_others = std::exchange(is_loaded_, true);
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                unrolled<2>(
                    [&](auto d)
                    {
                        const Pack given = lanes.load(&nodes.f[d][i]) - lanes.load(&before_[d][i]);
                        lanes.store(&load_[d][i], has_others ? lanes.load(&load_[d][i]) + given : given);
                    });
            });
    }
    /// Power that hourglass control takes from the motion in the coming kick [W/m].
    void note_hourglass(double power) { power_.hourglass = power; }
    /// Accelerates, and adds up the work of all forces. Kinetic damping then stops the nodes if the kinetic energy has begun to fall, by
    /// this kick or since the last one, as where points take what nodes gain: the peak, at which the slowest mode passes its equilibrium,
    /// is behind them (Cundall 1976; Barnes 1999, Int. J. Space Struct. 14). Returns the energy that they had before the kick, if it did
    /// [J/m].
    std::optional<double> kick(Nodes<2>& nodes, double dt);
    /// Work up to the time of the forces, `lag` seconds after that of the nodes' velocity.
    NodalWork work(const Nodes<2>& nodes, double lag) const;
    /// The sums up to the last kick, on which no step depends.
    NodalWork& work_done() { return work_; }
    /// Of the walls: all else is as the scene says.
    template <class Archive>
    void state(Archive& a)
    {
        for (std::size_t k = 0; k < walls_.size(); ++k)
            a.group("wall/" + restraints_[first_wall_ + k].name, [&] { walls_[k].state(a, restraints_[first_wall_ + k]); });
        if (has_kinetic_damping_)
            a.value("moving", "J/m", moving_);
        if constexpr (Archive::reads)
        {
            seen_ = 0;
            is_loaded_ = false;
        }
    }
    bool restrains() const { return !restraints_.empty(); }
    std::vector<RestraintRecord> records() const;
    const std::vector<Restraint>& restraints() const { return restraints_; }

private:
    const std::vector<double>& weight_of(const Nodes<2>& nodes) const { return weight_ ? *weight_ : nodes.mass; }
    /// Power of the loads at the present velocity [W/m].
    double load_power(const Nodes<2>& nodes) const;
    void add_work(const Kick& kick, double loads, double dt, NodalWork& work) const;
    /// Puts the nodes at rest in the middle of the kick that they have taken, so that its second half alone moves them.
    /// @param energy kinetic, that they have now [J/m]
    void stop(Nodes<2>& nodes, double dt, double energy);
    void find_driven(const Lattice<2>& lattice, const Nodes<2>& nodes)
    {
        if (nodes.version() == seen_)
            return;
        seen_ = nodes.version();
        driven_.find(restraints_, lattice, nodes);
    }

    std::optional<Gravity> gravity_;
    const std::vector<double>* weight_ = nullptr;  ///< null: all mass has weight
    std::optional<LocalDamping> damping_;
    bool has_kinetic_damping_ = false;
    double moving_ = 0;                  ///< kinetic energy before the last kick, for kinetic damping; zero after a stop [J/m]
    std::vector<Restraint> restraints_;  ///< of the boundaries, then of the walls: where two prescribe, the later one does
    std::vector<Wall> walls_;
    std::size_t first_wall_ = 0;
    DrivenNodes driven_;
    NodalWork work_, power_;  ///< power: of the coming step, where it is not known to the kick [W/m]
    Vec<2> gravity_now_{0, 0};
    bool is_loaded_ = false;        ///< whether load_ is of this step
    VectorField<2> load_, before_;  ///< empty in a scene without loads
    std::size_t seen_ = 0;          ///< version of the nodes for which driven_ was found; 0: none
};

inline double force_norm(const Nodes<2>& nodes)
{
    const auto square = [&](std::size_t i, const auto& lanes)
    {
        const auto f = load(nodes.f, i, lanes);
        return std::array{total<2>([&](auto d) { return f[d] * f[d]; })};
    };
    return std::sqrt(sum_over_nodes<1>(nodes, square)[0]);
}

inline std::size_t nodes_with_mass(const Nodes<2>& nodes)
{
    return static_cast<std::size_t>(
        std::count_if(nodes.active().begin(), nodes.active().end(), [&](std::uint32_t i) { return nodes.mass[i] > 0; }));
}
}  // namespace testbed
