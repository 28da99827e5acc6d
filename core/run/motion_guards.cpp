#include "core/run/motion_guards.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace testbed
{
namespace
{
/// The mean of an elastic body's oscillation under a constant weight must stay where it is: else the strains, which balance the weight, and
/// the displacements have parted.
class DriftGuard final : public Remembering<DriftGuard>
{
public:
    explicit DriftGuard(const GravitySpec& gravity) : gravity_(gravity) {}
    void watch(const GuardSample& s, const Solver& solver) override
    {
        const double g = std::hypot(gravity_.acceleration[0], gravity_.acceleration[1]);
        const Vec<2> down{gravity_.acceleration[0] / g, gravity_.acceleration[1] / g};
        body_.add(s.t, (down[0] * s.points.moment[0] + down[1] * s.points.moment[1]) / s.points.mass, s.t >= gravity_.ramp);
        constexpr std::size_t few = 1000;  // points: a look at all of them costs next to nothing
        std::size_t points = 0;
        for (const Body& body : solver.bodies())
            points += body.points.count;
        if (!s.is_fresh && points > few)
            return;
        double top = std::numeric_limits<double>::infinity();
        for (const Body& body : solver.bodies())
            for (std::size_t p = 0; p < body.points.count; ++p)
                top = std::min(top, down[0] * body.points.x[0][p] + down[1] * body.points.x[1][p]);
        top_.add(s.t, top, s.t >= gravity_.ramp);
    }
    std::optional<Finding> finding(bool) const override
    {
        for (const auto& [record, what] : {std::pair{&body_, ""}, std::pair{&top_, " of the top"}})
            if (const auto means = record->first_and_last();
                means && std::abs(means->second - means->first) > limits::drift * std::abs(means->first))
                return Finding{"drift", fmt::format("the mean settlement{} of an undamped oscillation went from {:.4g} to {:.4g} m, though "
                                                    "nothing moves it",
                                                    what, means->first, means->second)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.group("body", [&] { body_.state(a); });
        a.group("top", [&] { top_.state(a); });
    }

private:
    /// How far something has fallen.
    class Fall
    {
    public:
        void add(double t, double depth, bool counts)
        {
            at_start_ = at_start_.value_or(depth);
            if (!counts)
                return;
            t_.push_back(t);
            fall_.push_back(depth - *at_start_);
        }
        template <class Archive>
        void state(Archive& a)
        {
            a.optional("at_start", "m", at_start_);
            a.column("t", "s", t_);
            a.column("fall", "m", fall_);
        }
        /// Means of the first and the last tenth.
        std::optional<std::pair<double, double>> first_and_last() const
        {
            const std::size_t tenth = t_.size() / 10;
            const auto mean = [&](std::size_t from)
            { return mean_of_periods(std::span(t_).subspan(from, tenth), std::span(fall_).subspan(from, tenth)); };
            const auto first = mean(0), last = mean(t_.size() - tenth);
            return first && last ? std::optional(std::pair{*first, *last}) : std::nullopt;
        }

    private:
        std::optional<double> at_start_{};
        std::vector<double> t_{}, fall_{};
    };

    GravitySpec gravity_;
    Fall body_{}, top_{};  ///< of the centre of mass, and of the highest point
};

/// An elastic body that nothing but walls moves. However suddenly they start, a wave carries at most twice their speed: more motion is
/// stress let go, where the body parted or its points crossed cells. Walls that turn back, or start again, may swing it up: then nothing is
/// said.
class ReleaseGuard final : public Remembering<ReleaseGuard>
{
public:
    void watch(const GuardSample& s, const Solver& solver) override
    {
        const std::vector<RestraintRecord> restraints = solver.restraints();
        const bool is_new = walls_.empty();
        walls_.resize(restraints.size());
        for (std::size_t k = 0; k < restraints.size(); ++k)
        {
            const RestraintRecord& r = restraints[k];
            if (!r.displacement)
                continue;
            Wall& wall = walls_[k];
            if (is_new)
                wall.displacement = *r.displacement;
            if (is_new || !(s.t > t_))
                continue;
            const Vec<2> v{((*r.displacement)[0] - wall.displacement[0]) / (s.t - t_),
                           ((*r.displacement)[1] - wall.displacement[1]) / (s.t - t_)};
            const double speed = std::hypot(v[0], v[1]);
            swings_ = swings_ || v[0] * wall.way[0] + v[1] * wall.way[1] < 0 || (wall.slowed && speed > 0.5 * wall.fastest);
            wall.slowed = wall.slowed || speed < 0.5 * wall.fastest;
            wall.fastest = std::max(wall.fastest, speed);
            wall.displacement = *r.displacement;
            if (speed > 0)
                wall.way = v;
            speed_ = std::max(speed_, speed);
        }
        t_ = s.t;
        if (s.is_fresh && s.point_motion.kinetic_energy > limits::is_static * s.energy.elastic)
            kinetic_ = std::max(kinetic_, s.point_motion.kinetic_energy), mass_ = s.point_motion.mass;
    }
    std::optional<Finding> finding(bool) const override
    {
        const double driven = 0.5 * mass_ * speed_ * speed_;
        if (!swings_ && speed_ > 0 && kinetic_ > limits::released * driven)
            return Finding{"released",
                           fmt::format("the walls move at {:.3g} m/s at most, the elastic body at {:.3g} m/s in the mean: stress was "
                                       "let go, as where a body parts or its points cross cells",
                                       speed_, std::sqrt(2 * kinetic_ / mass_))};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("swings", "-", swings_);
        a.value("t", "s", t_);
        a.value("speed", "m/s", speed_);
        a.value("kinetic", "J/m", kinetic_);
        a.value("mass", "kg/m", mass_);
        a.column("displacement_x", "m", walls_, [](Wall& w) -> double& { return w.displacement[0]; });
        a.column("displacement_y", "m", walls_, [](Wall& w) -> double& { return w.displacement[1]; });
        a.column("way_x", "m/s", walls_, [](Wall& w) -> double& { return w.way[0]; });
        a.column("way_y", "m/s", walls_, [](Wall& w) -> double& { return w.way[1]; });
        a.column("fastest", "m/s", walls_, &Wall::fastest);
        a.column("slowed", "-", walls_, &Wall::slowed);
    }

private:
    struct Wall
    {
        Vec<2> displacement{0, 0}, way{0, 0};  ///< last velocity that was not zero
        double fastest = 0;
        bool slowed = false;  ///< to less than half of that
    };
    std::vector<Wall> walls_{};  ///< and supports, which do not move
    bool swings_ = false;
    double t_ = 0, speed_ = 0, kinetic_ = 0, mass_ = 0;
};
}  // namespace

std::optional<double> mean_of_periods(std::span<const double> t, std::span<const double> y)
{
    constexpr std::size_t many = 1000;  // samples of which the mean is good though they are too few to see each period
    if (t.size() < 40)
        return std::nullopt;
    double average = 0;
    for (std::size_t k = 0; k + 1 < t.size(); ++k)
        average += 0.5 * (y[k] + y[k + 1]) * (t[k + 1] - t[k]) / (t.back() - t.front());
    double area = 0, area_at_last = 0, first = 0, last = 0;  // of y - average since the first rise
    std::size_t rises = 0;
    for (std::size_t k = 0; k + 1 < t.size(); ++k)
    {
        const double a = y[k] - average, b = y[k + 1] - average, dt = t[k + 1] - t[k];
        const bool rise = a < 0 && b >= 0;
        const double at = rise ? t[k] + dt * a / (a - b) : 0;
        if (rise)
        {
            area_at_last = rises == 0 ? 0 : area + 0.5 * a * (at - t[k]);
            area = rises == 0 ? 0.5 * b * (t[k + 1] - at) : area + 0.5 * a * (at - t[k]) + 0.5 * b * (t[k + 1] - at);
            first = rises == 0 ? at : first;
            last = at;
            ++rises;
        }
        else if (rises > 0)
            area += 0.5 * (a + b) * dt;
    }
    if (rises < 6 || (8 * rises > t.size() && t.size() < many))
        return std::nullopt;
    return average + area_at_last / (last - first);
}

std::vector<std::unique_ptr<Guard>> motion_guards(const Scene& scene)
{
    std::vector<std::unique_ptr<Guard>> guards;
    const bool is_loaded = !scene.tractions.empty() || scene.body_force || scene.confinement;
    const bool is_held = !scene.boundaries.empty() || !scene.walls.empty();
    const bool is_damped = scene.damping && scene.damping->acts();
    if (!is_loaded && is_held && !is_damped && !scene.may_flow() && scene.walls.empty() && scene.gravity &&
        std::hypot(scene.gravity->acceleration[0], scene.gravity->acceleration[1]) > 0)
        guards.push_back(std::make_unique<DriftGuard>(*scene.gravity));
    if (!is_loaded && !scene.gravity && !scene.may_flow() && !scene.walls.empty() &&
        std::none_of(scene.bodies.begin(), scene.bodies.end(),
                     [](const BodySpec& body) { return body.velocity.has_value() || body.initial_stress.has_value(); }))
        guards.push_back(std::make_unique<ReleaseGuard>());
    return guards;
}
}  // namespace testbed
