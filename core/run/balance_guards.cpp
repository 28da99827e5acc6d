#include "core/run/balance_guards.hpp"

#include "core/run/motion_guards.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
/// Energy must not come from nowhere. It may be lost, as in any contact of points on a lattice.
class EnergyGuard final : public Remembering<EnergyGuard>
{
public:
    /// Where the motion is that of nodes, their lumped masses hold more of it than the points do, and a share that changes as a body turns
    /// on the lattice: what is made counts as far as the points have it, too.
    void watch(const GuardSample& s, const Solver&) override
    {
        if (s.is_fresh)
            beside_nodes_ = s.point_motion.kinetic_energy - s.energy.kinetic;
        at_start_ = at_start_.value_or(beside_nodes_);
        made_ = std::max(made_, s.energy.numerical + std::min(0.0, beside_nodes_ - *at_start_));
        most_plastic_ = std::max(most_plastic_, s.energy.plastic);
        made_by_law_ = std::max(made_by_law_, most_plastic_ - s.energy.plastic);
        scale_ = s.energy_scale;
    }
    std::optional<Finding> finding(bool) const override
    {
        if (made_ > limits::energy_gain * scale_)
            return Finding{"energy", fmt::format("the numbers made {:.3g} J/m, {:.3g} times what the loads and the start brought in", made_,
                                                 made_ / scale_)};
        if (made_by_law_ > limits::energy_gain * scale_)
            return Finding{"energy", fmt::format("the stresses gave back {:.3g} J/m that had been dissipated, {:.3g} times what the loads "
                                                 "and the start brought in",
                                                 made_by_law_, made_by_law_ / scale_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("made", "J/m", made_);
        a.value("most_plastic", "J/m", most_plastic_);
        a.value("made_by_law", "J/m", made_by_law_);
        a.value("scale", "J/m", scale_);
        a.value("beside_nodes", "J/m", beside_nodes_);
        a.optional("at_start", "J/m", at_start_);
    }

private:
    double made_ = 0, most_plastic_ = 0, made_by_law_ = 0, scale_ = 0;
    double beside_nodes_ = 0;           ///< kinetic energy of the points less that of the nodes, when last looked at
    std::optional<double> at_start_{};  ///< so at the start
};

/// Energy that an elastic body without damping loses to the numbers: to motion and stress that the lattice does not resolve. Some of it is
/// lost in any contact; of a run that lost much of it the motion tells nothing.
class LossGuard final : public Remembering<LossGuard>
{
public:
    void watch(const GuardSample& s, const Solver&) override
    {
        if (s.is_fresh)
            share_ = -s.energy.numerical / std::max(s.energy_scale, 1e-300);
    }
    std::optional<Finding> finding(bool) const override
    {
        if (share_ > limits::energy_loss)
            return Finding{"loss", fmt::format("the numbers took {:.2g} times what the loads and the start brought in, though the body is "
                                               "elastic and nothing damps it",
                                               share_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("share", "-", share_);
    }

private:
    double share_ = 0;
};

/// The weight that nodes carry and the points that have it must fall alike.
class GravityGuard final : public Remembering<GravityGuard>
{
public:
    explicit GravityGuard(bool flows) : limit_(flows ? limits::gravity_work_flow : limits::gravity_work) {}
    void watch(const GuardSample& s, const Solver&) override
    {
        apart_ = std::max(apart_, std::abs(s.energy.gravity - s.gravity_work) - s.gravity_work_error);
        scale_ = s.energy_scale;
    }
    std::optional<Finding> finding(bool) const override
    {
        if (apart_ > limit_ * scale_)
            return Finding{
                "gravity_work",
                fmt::format(
                    "the work of gravity at the nodes and on the points differs by {:.2g} times what the loads and the start brought in",
                    apart_ / scale_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("apart", "J/m", apart_);
        a.value("scale", "J/m", scale_);
    }

private:
    double limit_, apart_ = 0, scale_ = 0;
};

/// Control of hourglass patterns is no part of the body: what it takes must stay small beside the energy of the run.
class HourglassGuard final : public Remembering<HourglassGuard>
{
public:
    void watch(const GuardSample& s, const Solver&) override { share_ = s.energy.hourglass / std::max(s.energy_scale, 1e-300); }
    std::optional<Finding> finding(bool) const override
    {
        if (share_ > limits::hourglass)
            return Finding{"hourglass", fmt::format("hourglass control took {:.2g} times what the loads and the start brought in", share_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("share", "-", share_);
    }

private:
    double share_ = 0;
};

/// Where nothing acts from outside.
class MomentumGuard final : public Remembering<MomentumGuard>
{
public:
    void watch(const GuardSample& s, const Solver&) override
    {
        const Vec<2>& p = s.motion.momentum;
        at_start_ = at_start_.value_or(p);
        change_ = std::max(change_, std::hypot(p[0] - (*at_start_)[0], p[1] - (*at_start_)[1]));
        scale_ = std::max(scale_, std::sqrt(2 * s.point_motion.mass * std::max(0.0, s.point_motion.kinetic_energy)));
    }
    std::optional<Finding> finding(bool) const override
    {
        if (change_ > limits::momentum * scale_)
            return Finding{"momentum", fmt::format("no force acts from outside, yet the momentum changed by {:.2g} of mass times speed",
                                                   change_ / scale_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.optional("at_start", "kg/s", at_start_);
        a.value("change", "kg/s", change_);
        a.value("scale", "kg/s", scale_);
    }

private:
    std::optional<Vec<2>> at_start_{};
    double change_ = 0, scale_ = 0;
};

}  // namespace

std::vector<std::unique_ptr<Guard>> balance_guards(const Scene& scene)
{
    std::vector<std::unique_ptr<Guard>> guards;
    const bool is_loaded = !scene.tractions.empty() || scene.body_force || scene.confinement;
    const bool is_held = !scene.boundaries.empty() || !scene.walls.empty();
    const bool is_damped = scene.damping && scene.damping->acts();
    guards.push_back(std::make_unique<EnergyGuard>());
    if (!is_damped && !scene.may_flow() && traits_of(scene).has_points)
        guards.push_back(std::make_unique<LossGuard>());
    if (scene.gravity)
        guards.push_back(std::make_unique<GravityGuard>(scene.may_flow()));
    if (traits_of(scene).damps_hourglass)
        guards.push_back(std::make_unique<HourglassGuard>());
    if (!is_loaded && !is_held && !is_damped && !scene.gravity)
        guards.push_back(std::make_unique<MomentumGuard>());
    for (auto& guard : motion_guards(scene))
        guards.push_back(std::move(guard));
    return guards;
}
}  // namespace testbed
