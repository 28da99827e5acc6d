#include "core/run/guards.hpp"

#include "core/run/balance_guards.hpp"
#include "core/run/field_guards.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
bool has_strength(const Scene& scene, const BodySpec& body)
{
    return scene.material(body.material).has_strength();
}

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

/// An elastic body that is in more parts than at the start was torn by the lattice, not by its law.
class SeparationGuard final : public Remembering<SeparationGuard>
{
public:
    explicit SeparationGuard(const Scene& scene) : reach_(reach_of(scene))
    {
        for (const BodySpec& body : scene.bodies)
            bodies_.push_back({body.name, has_strength(scene, body)});
    }
    void watch(const GuardSample& s, const Solver& solver) override
    {
        if (!s.is_fresh)
            return;
        for (std::size_t b = 0; b < bodies_.size(); ++b)
        {
            Parts& own = bodies_[b];
            own.now = connected_parts(solver.bodies()[b].bins.list(), reach_);
            own.at_start = started_ ? own.at_start : own.now;
            own.most = std::max(own.most, own.now);
        }
        started_ = true;
    }
    std::optional<Finding> finding(bool) const override
    {
        for (const Parts& b : bodies_)
            if (!b.may_break && b.most > b.at_start)
                return Finding{"separated", fmt::format("body '{}' came apart: {} parts between which no force passes, {} at the start",
                                                        b.name, b.most, b.at_start)};
        return std::nullopt;
    }
    std::string note() const
    {
        std::size_t off = 0;
        for (const Parts& b : bodies_)
            off += b.may_break && b.now > b.at_start ? b.now - b.at_start : 0;
        return off ? fmt::format("parts that came off: {}", off) : "";
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("started", "-", started_);
        a.column("at_start", "-", bodies_, &Parts::at_start);
        a.column("now", "-", bodies_, &Parts::now);
        a.column("most", "-", bodies_, &Parts::most);
    }

private:
    struct Parts
    {
        std::string name;
        bool may_break;
        std::size_t at_start = 0, now = 0, most = 0;
    };
    int reach_;
    bool started_ = false;
    std::vector<Parts> bodies_;
};

/// Bodies on one lattice that touch are bonded; elastic ones have no reason to come off each other.
class ContactGuard final : public Remembering<ContactGuard>
{
public:
    explicit ContactGuard(const Scene& scene) : reach_(reach_of(scene))
    {
        for (const BodySpec& body : scene.bodies)
            names_.push_back(body.name);
        for (std::size_t a = 0; a < scene.bodies.size(); ++a)
            for (std::size_t b = a + 1; b < scene.bodies.size(); ++b)
                if (!has_strength(scene, scene.bodies[a]) && !has_strength(scene, scene.bodies[b]))
                    bonds_.push_back({a, b});
    }
    void watch(const GuardSample& s, const Solver& solver) override
    {
        if (!s.is_fresh)
            return;
        const auto touch = [&](const Bond& bond)
        { return in_contact(solver.bodies()[bond.a].bins.list(), solver.bodies()[bond.b].bins.list(), reach_); };
        if (!started_)
            std::erase_if(bonds_, [&](const Bond& bond) { return !touch(bond); });
        started_ = true;
        for (const Bond& bond : bonds_)
            if (!lost_ && !touch(bond))
                lost_ = bond;
    }
    std::optional<Finding> finding(bool) const override
    {
        if (lost_)
            return Finding{"contact_lost",
                           fmt::format("bodies '{}' and '{}' were bonded and came off each other", names_[lost_->a], names_[lost_->b])};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("started", "-", started_);
        a.column("a", "-", bonds_, &Bond::a);
        a.column("b", "-", bonds_, &Bond::b);
        std::size_t first = lost_ ? lost_->a : 0, second = lost_ ? lost_->b : 0;  // a body has no bond with itself
        a.value("lost_a", "-", first);
        a.value("lost_b", "-", second);
        if constexpr (Archive::reads)
            lost_ = first == second ? std::nullopt : std::optional(Bond{first, second});
    }

private:
    struct Bond
    {
        std::size_t a, b;
    };
    int reach_;
    bool started_ = false;
    std::vector<Bond> bonds_;
    std::optional<Bond> lost_;
    std::vector<std::string> names_;  ///< of the bodies
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
            const Points& q = body.points;
            const ElasticModuli m = moduli(body.material);
            largest_ = std::max(largest_,
                                parallel_max(q.count,
                                             [&](std::size_t p)
                                             {
                                                 const double softer = q.stiffness.active() ? q.stiffness[p] : 1.0;
                                                 const double szz = out_of_plane_stress(m, q, p);
                                                 const double mean = m.poissons_ratio() * (q.sxx[p] + q.syy[p] + szz);
                                                 const double a = (1 + m.poissons_ratio()) * q.sxx[p] - mean,
                                                              b = (1 + m.poissons_ratio()) * q.syy[p] - mean,
                                                              c = (1 + m.poissons_ratio()) * q.sxy[p];
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
    const bool damped = scene.damping && scene.damping->local > 0;
    const bool ramped = scene.gravity && scene.gravity->ramp > 0 && scene.gravity->ramp < scene.time.end;
    return scene.time.stop_unbalanced || (!scene.may_flow() && damped && ramped && !moving);
}

using Key = std::pair<int, int>;

std::vector<Key> places(const std::vector<Bin>& bins)
{
    std::vector<Key> keys;
    keys.reserve(bins.size());
    for (const Bin& bin : bins)
        keys.emplace_back(bin.j, bin.i);
    std::sort(keys.begin(), keys.end());
    return keys;
}

/// f(number) for the keys within reach of one.
template <class F>
void for_each_near(const std::vector<Key>& keys, const Key& at, int reach, F&& f)
{
    for (int j = at.first - reach; j <= at.first + reach; ++j)
        for (auto k = std::lower_bound(keys.begin(), keys.end(), Key{j, at.second - reach});
             k != keys.end() && k->first == j && k->second <= at.second + reach; ++k)
            f(static_cast<std::size_t>(k - keys.begin()));
}
}  // namespace

std::size_t connected_parts(const std::vector<Bin>& bins, int reach)
{
    const std::vector<Key> keys = places(bins);
    std::vector<bool> seen(keys.size());
    std::vector<std::size_t> open;
    std::size_t parts = 0;
    for (std::size_t start = 0; start < keys.size(); ++start)
    {
        if (seen[start])
            continue;
        ++parts;
        seen[start] = true;
        open.assign(1, start);
        while (!open.empty())
        {
            const Key at = keys[open.back()];
            open.pop_back();
            for_each_near(keys, at, reach,
                          [&](std::size_t k)
                          {
                              if (!seen[k])
                                  open.push_back(k);
                              seen[k] = true;
                          });
        }
    }
    return parts;
}

bool in_contact(const std::vector<Bin>& a, const std::vector<Bin>& b, int reach)
{
    const std::vector<Key> keys = places(b);
    bool touch = false;
    for (const Bin& bin : a)
        for_each_near(keys, {bin.j, bin.i}, reach, [&](std::size_t) { touch = true; });
    return touch;
}

int reach_of(const Scene& scene)
{
    if (family_of(scene) == Family::mpm)
        return scene.mpm.shape == MpmSpec::Shape::linear ? 1 : 2;
    return scene.lpfdm.support == LpfdmSpec::Support::point ? 1 : 2;
}

Guards::Guards(const Scene& scene, const Solver& solver, double dt_critical)
{
    const bool small_strain = std::string(solver.kinematics()) == "small_strain";
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
    guards_.push_back(std::make_unique<ContactGuard>(scene));
    auto separation = std::make_unique<SeparationGuard>(scene);
    note_ = [guard = separation.get()] { return guard->note(); };
    guards_.push_back(std::move(separation));
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
    return note_ ? note_() : "";
}
}  // namespace testbed
