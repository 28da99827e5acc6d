#include "core/run/guards.hpp"

#include "core/run/balance_guards.hpp"
#include "core/run/field_guards.hpp"
#include "core/run/parts_guards.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
class VolumeGuard final : public Remembering<VolumeGuard>
{
public:
    explicit VolumeGuard(bool flows) : flows_(flows) {}
    void watch(const GuardSample& s, const Solver&) override
    {
        smallest_ = std::min(smallest_, s.points.smallest);
        largest_ = std::max(largest_, s.points.largest);
    }
    std::optional<Finding> finding(bool) const override
    {
        if (smallest_ < limits::smallest_volume)
            return Finding{"volume", fmt::format("a point was pressed to {:.3g} of its volume", smallest_)};
        if (!flows_ && largest_ > limits::largest_volume)
            return Finding{"volume", fmt::format("an elastic point grew to {:.3g} times its volume", largest_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("smallest", "-", smallest_);
        a.value("largest", "-", largest_);
    }

private:
    bool flows_;
    double smallest_ = 1, largest_ = 1;
};

class OutsideGuard final : public Remembering<OutsideGuard>
{
public:
    void watch(const GuardSample& s, const Solver&) override { outside_ = std::max(outside_, s.points.outside); }
    std::optional<Finding> finding(bool) const override
    {
        if (outside_ > 0)
            return Finding{"outside", fmt::format("{:.0f} points were outside the lattice", outside_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("outside", "-", outside_);
    }

private:
    double outside_ = 0;
};

class CourantGuard final : public Remembering<CourantGuard>
{
public:
    explicit CourantGuard(double cell_size) : cell_size_(cell_size) {}
    void watch(const GuardSample& s, const Solver&) override { largest_ = std::max(largest_, s.point_motion.speed * s.dt / cell_size_); }
    std::optional<Finding> finding(bool) const override
    {
        if (largest_ > limits::courant)
            return Finding{"courant", fmt::format("points moved {:.3g} cells in one step", largest_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("largest", "-", largest_);
    }

private:
    double cell_size_, largest_ = 0;
};

/// For scenes that are to come to rest: over the last tenth of the run, because an oscillation has no kinetic energy where it turns.
class RestGuard final : public Remembering<RestGuard>
{
public:
    explicit RestGuard(double end) : from_(0.9 * end) {}
    void watch(const GuardSample& s, const Solver&) override
    {
        const double ratio = s.motion.kinetic_before / std::max(s.points.strain_energy, 1e-300);
        largest_ = s.t < from_ ? ratio : std::max(largest_, ratio);
    }
    std::optional<Finding> finding(bool completed) const override
    {
        if (completed && largest_ > limits::at_rest)
            return Finding{
                "not_at_rest",
                fmt::format("it was to come to rest and ended with a kinetic energy of {:.3g} times the strain energy", largest_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("largest", "-", largest_);
    }

private:
    double from_, largest_ = 0;
};

/// Largest strain component at the points of a method of small strain.
class StrainGuard final : public Remembering<StrainGuard>
{
public:
    void watch(const GuardSample& s, const Solver& solver) override
    {
        if (!s.is_fresh)
            return;
        for (const Body& body : solver.bodies())
        {
            const Points<2>& q = body.points;
            const ElasticModuli m = moduli(body.material);
            largest_ = std::max(largest_,
                                parallel_max(q.count,
                                             [&](std::size_t p)
                                             {
                                                 const double softer = stiffness_ratio(q, p);
                                                 const double szz = out_of_plane_stress(body.material, q, p);
                                                 const double mean = m.poissons_ratio() * (q.stress[0][p] + q.stress[1][p] + szz);
                                                 const double a = (1 + m.poissons_ratio()) * q.stress[0][p] - mean,
                                                              b = (1 + m.poissons_ratio()) * q.stress[1][p] - mean,
                                                              c = (1 + m.poissons_ratio()) * q.stress[2][p];
                                                 return std::max({std::abs(a), std::abs(b), std::abs(c)}) / (m.youngs_modulus() * softer);
                                             }));
        }
    }
    std::optional<Finding> finding(bool) const override
    {
        if (largest_ > limits::small_strain)
            return Finding{"small_strain", fmt::format("strains of {:.3g} are beyond small-strain elasticity", largest_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("largest", "-", largest_);
    }

private:
    double largest_ = 0;
};

class TimeStepGuard final : public Remembering<TimeStepGuard>
{
public:
    explicit TimeStepGuard(double critical) : critical_(critical) {}
    void watch(const GuardSample& s, const Solver&) override { dt_ = std::max(dt_, s.dt); }
    std::optional<Finding> finding(bool) const override
    {
        if (dt_ > critical_ * (1 + 1e-9))
            return Finding{"time_step", fmt::format("the time step of {:.4g} s is above the critical one, {:.4g} s", dt_, critical_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("dt", "s", dt_);
    }

private:
    double critical_, dt_ = 0;
};

/// Whether the scene is meant to end at rest: it says so, or elastic bodies under gravity that grows slowly are damped.
bool is_to_rest(const Scene& scene)
{
    const bool moving = std::any_of(scene.walls.begin(), scene.walls.end(), [](const WallSpec& w) { return w.velocity.has_value(); });
    const bool damped = scene.damping && scene.damping->acts();
    const bool ramped = scene.gravity && scene.gravity->ramp > 0 && scene.gravity->ramp < scene.time.end;
    return scene.time.stop_unbalanced || (!scene.may_flow() && damped && ramped && !moving);
}
}  // namespace

Guards::Guards(const Scene& scene, const Solver& solver, double dt_critical)
{
    const bool small_strain = solver.kinematics() == Kinematics::small_strain;
    if (is_to_rest(scene) && !solver.is_static())
        guards_.push_back(std::make_unique<RestGuard>(scene.time.end));
    const auto add = [&](auto&& guards) { std::move(guards.begin(), guards.end(), std::back_inserter(guards_)); };
    add(field_guards(scene));
    if (small_strain)
    {
        guards_.push_back(std::make_unique<StrainGuard>());
        return;
    }
    guards_.push_back(std::make_unique<TimeStepGuard>(dt_critical));
    add(balance_guards(scene));
    guards_.push_back(std::make_unique<VolumeGuard>(scene.may_flow()));
    guards_.push_back(std::make_unique<OutsideGuard>());
    guards_.push_back(std::make_unique<CourantGuard>(scene.grid.cell_size));
    add(parts_guards(scene));
}

void Guards::watch(const GuardSample& sample, const Solver& solver)
{
    for (const auto& guard : guards_)
        guard->watch(sample, solver);
    last_ = sample;
}

void Guards::at_end(const Solver& solver)
{
    if (last_)
        for (const auto& guard : guards_)
            guard->at_end(*last_, solver);
}

std::vector<Finding> Guards::findings(bool completed) const
{
    std::vector<Finding> found;
    for (const auto& guard : guards_)
        if (auto finding = guard->finding(completed))
            found.push_back(std::move(*finding));
    return found;
}

std::string Guards::note() const
{
    std::string notes;
    for (const auto& guard : guards_)
        notes += guard->note();
    return notes;
}
}  // namespace testbed
