#include "core/run/step_control.hpp"

#include <cmath>
#include <fmt/format.h>

namespace testbed
{
StepControl::StepControl(const Scene& scene, Solver& solver)
    : solver_(solver),
      follows_limit_(scene.time.follows_limit && !solver.step_limits().empty()),
      end_(scene.time.end),
      cfl_(scene.time.cfl),
      critical_(solver.critical_time_step(scene))
{
    if (scene.time.sharp_limit)
        sharp_ = solver.sharp_step_limit();
    dt_ = solver.is_static() ? end_ : scene.time.dt ? *scene.time.dt : cfl_ * critical_;
    if (!(end_ / dt_ < 1e12))
        throw SceneError(fmt::format("{}: time.end = {:.4g} s takes more than 1e12 steps of {:.4g} s", scene.path, end_, dt_));
    total_ = steps_to_end();
    if (!scene.time.dt)
        dt_ = end_ / static_cast<double>(total_);
    shortest_ = longest_ = dt_;
}

std::int64_t StepControl::steps_to_end() const
{
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(end_ / dt_ * (1 - 1e-12))));
}

void StepControl::go_on()
{
    total_ = steps_to_end();
    if (follows_limit_ ? t_ > end_ : taken_ > total_)
        throw SceneError(fmt::format("time.end = {:.6g} s lies before the time of the restart file, {:.6g} s", end_, t_));
}

void StepControl::next()
{
    ++taken_;
    if (!follows_limit_)
    {
        t_ = static_cast<double>(taken_) * dt_;
        return;
    }
    t_ += dt_;
    if (end_ - t_ < 1e-9 * dt_)
        t_ = end_;
    else
        follow();
}

/// Grows by a twentieth at most, so that what is first order in a change of the step stays small, and comes to the end in equal steps.
void StepControl::follow()
{
    const std::vector<StepLimit> limits = solver_.step_limits();
    const StepLimit& least = governing(limits);
    if (!(least.seconds > 1e-6 * critical_))
        throw Diverged(fmt::format("the limit of the time step has fallen from {:.4g} s to {:.4g} s ({}){}", critical_, least.seconds,
                                   least.name, *least.way_out ? fmt::format("; {} has no such limit", least.way_out) : ""));
    const double dt = std::min(cfl_ * least.seconds, 1.05 * dt_), left = end_ - t_;
    dt_ = left / std::ceil(left / dt * (1 - 1e-12));
    shortest_ = std::min(shortest_, dt_);
    longest_ = std::max(longest_, dt_);
}

std::string step_warning(const Scene& scene, Solver& solver)
{
    const std::vector<StepLimit> limits = solver.step_limits();
    if (limits.empty())
        return "";
    const double dt = time_step(scene, solver);
    const StepLimit& least = governing(limits);
    if (!(dt > least.seconds * (1 + 1e-12)))
        return "";
    return fmt::format("{}: {}: the time step {:.4g} s is above the critical one, {:.4g} s ({})", scene.path,
                       scene.time.dt ? "time.dt" : "time.cfl", dt, least.seconds, least.name);
}
}  // namespace testbed
