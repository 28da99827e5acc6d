#include "core/run/run_loop.hpp"

#include "core/run/restart.hpp"

#include <atomic>
#include <cmath>
#include <csignal>
#include <fmt/format.h>
#include <limits>
#include <unistd.h>

namespace testbed
{
namespace
{
std::atomic<bool> interrupted{false};

constexpr std::int64_t now_and_then = 50;  ///< steps, so that looking at all points costs little beside them
}  // namespace

void catch_signals()
{
    std::signal(SIGINT, [](int) { interrupted = true; });
    std::signal(SIGTERM, [](int) { interrupted = true; });
    std::signal(SIGXFSZ, SIG_IGN);
}

bool is_interrupted()
{
    return interrupted;
}

/// One line that is overwritten, on a terminal only.
class RunLoop::Progress
{
public:
    Progress(bool on, double begin, double end) : on_(on && isatty(STDERR_FILENO)), begin_(begin), end_(end) {}
    void show(double t, std::int64_t step)
    {
        if (!on_ || watch_.seconds() < last_ + 0.2)
            return;
        last_ = watch_.seconds();
        fmt::print(stderr, "\r{:5.1f} %  t = {:.4g} s  step {}  {:.0f} s left ", 100 * t / end_, t, step,
                   t > begin_ ? last_ * (end_ - t) / (t - begin_) : 0.0);
        std::fflush(stderr);
    }
    void clear() const
    {
        if (on_)
            fmt::print(stderr, "\r{:60}\r", "");
    }

private:
    bool on_;
    double begin_, end_, last_ = 0;
    Stopwatch watch_;
};

RunLoop::RunLoop(const Scene& scene, Solver& solver, StepControl& clock, Observer& observer, ResultFile& file,
                 const std::filesystem::path& restart, bool quiet)
    : scene_(scene),
      solver_(solver),
      clock_(clock),
      observer_(observer),
      file_(file),
      restart_(restart),
      quiet_(quiet),
      guards_(scene, solver, clock.follows_limit() ? std::numeric_limits<double>::infinity() : clock.critical()),
      history_interval_(scene.output.history > 0 ? scene.output.history : scene.time.end / 200),
      snapshot_interval_(scene.output.snapshots > 0 ? scene.time.end / scene.output.snapshots : 2 * scene.time.end),
      next_checkpoint_(scene.output.checkpoint > 0 ? scene.output.checkpoint : std::numeric_limits<double>::infinity())
{
}

template <class Archive>
void RunLoop::state(Archive& a)
{
    a.group("solver",
            [&]
            {
                if constexpr (Archive::reads)
                    solver_.read_state(a);
                else
                    solver_.write_state(a);
            });
    if (NodalWork* work = solver_.work_done())
        a.group("work", [&] { work->state(a); });
    a.group("clock", [&] { clock_.state(a); });
    a.group("observer", [&] { observer_.state(a); });
    guards_.state(a);
    a.value("steps", "-", out_.steps);
    double history_interval = history_interval_, snapshot_interval = snapshot_interval_;
    a.value("history_interval", "s", history_interval);
    a.value("snapshot_interval", "s", snapshot_interval);
    a.value("next_sample", "s", next_sample_);
    a.value("next_snapshot", "s", next_snapshot_);
    a.value("looked_at", "-", looked_at_);
    double solved = solve_seconds(), forced = forcing_seconds();
    a.value("solve_seconds", "s", solved);
    a.value("forcing_seconds", "s", forced);
    a.value("output_seconds", "s", out_.output_seconds);
    a.value("guard_seconds", "s", out_.guard_seconds);
    if constexpr (Archive::reads)
    {
        if (history_interval != history_interval_)
            next_sample_ = std::ceil(clock_.t() / history_interval_) * history_interval_;
        if (snapshot_interval != snapshot_interval_)
            next_snapshot_ = std::ceil(clock_.t() / snapshot_interval_) * snapshot_interval_;
        solve_seconds_before_ = solved;
        forcing_seconds_before_ = forced;
    }
}

double RunLoop::forcing_seconds() const
{
    return forcing_seconds_before_ + solver_.timer().seconds("forcing");
}

double RunLoop::solve_seconds() const
{
    return solve_seconds_before_ + watch_.seconds() - output_seconds_ - solver_.timer().seconds("forcing");
}

void RunLoop::restore(const State& from)
{
    StateReader reader(from);
    try
    {
        state(reader);
        reader.end();
    }
    catch (const std::logic_error& e)
    {
        throw SceneError(fmt::format("the restart file is of another version of the testbed: {}", e.what()));
    }
}

void RunLoop::write_checkpoint()
{
    State now;
    StateWriter writer(now);
    state(writer);
    try
    {
        write_restart({restart_, std::filesystem::absolute(scene_.path).lexically_normal().string(), resolved_toml(scene_), now}, file_);
    }
    catch (const OutputError& e)
    {
        fmt::print(stderr, "warning: no restart file at t = {:.6g} s: {}\n", clock_.t(), e.what());
    }
}

void RunLoop::checkpoint_if_due(bool stops, bool ends)
{
    if (!stops && !(ends && std::isfinite(next_checkpoint_)) && watch_.seconds() < next_checkpoint_)
        return;
    const Stopwatch output;
    write_checkpoint();
    out_.output_seconds += output.seconds();
    output_seconds_ += output.seconds();
    next_checkpoint_ = watch_.seconds() + (std::isfinite(next_checkpoint_) ? scene_.output.checkpoint : next_checkpoint_);
}

void RunLoop::sample(bool last)
{
    const bool fresh = last || out_.steps == 0 || out_.steps >= looked_at_ + now_and_then;
    looked_at_ = fresh ? out_.steps : looked_at_;
    const GuardSample& now = observer_.sample(clock_.t(), clock_.dt(), fresh);
    const Stopwatch watching;
    guards_.watch(now, solver_);
    out_.guard_seconds += watching.seconds();
    next_sample_ += history_interval_;
}

void RunLoop::record(bool last)
{
    const Stopwatch output;
    const double soon = clock_.t() + 0.5 * clock_.dt();
    const bool is_sample = soon >= next_sample_ || last, is_snapshot = soon >= next_snapshot_ || last;
    if (is_sample || is_snapshot)
        solver_.update_points();
    if (is_sample)
        sample(last);
    if (is_snapshot)
    {
        observer_.snapshot(file_, clock_.t(), out_.steps);
        next_snapshot_ += snapshot_interval_;
    }
    out_.output_seconds += output.seconds();
    output_seconds_ += output.seconds();
}

bool RunLoop::is_at_rest()
{
    const double tolerance = *scene_.time.stop_unbalanced;
    solver_.update_points();
    return solver_.sums().unbalanced < tolerance && Observer::kinetic_ratio(solver_) < tolerance &&
           (!scene_.gravity || clock_.t() >= scene_.gravity->ramp);
}

void RunLoop::stop(const char* status, ExitCode code, const std::string& reason)
{
    out_.status = status;
    out_.code = code;
    out_.reason = reason;
}

void RunLoop::step_through()
{
    Progress progress(!quiet_, clock_.t(), scene_.time.end);
    for (;; ++out_.steps)
    {
        const double t = clock_.t();
        const bool is_time = out_.steps % now_and_then == 0, by_user = interrupted;
        const bool limit = scene_.time.wall_clock_limit && is_time && watch_.seconds() > *scene_.time.wall_clock_limit;
        checkpoint_if_due(by_user || limit, clock_.is_at_end());
        solver_.prepare(t, clock_.dt());
        const bool rest = scene_.time.stop_unbalanced && out_.steps > 0 && is_time && is_at_rest();
        const bool last = clock_.is_at_end() || by_user || limit || rest;
        record(last);
        if (by_user)
            stop("interrupted", ExitCode::interrupted, fmt::format("stopped by the user at t = {:.6g} s", t));
        else if (limit)
            stop("time_limit", ExitCode::time_limit, fmt::format("wall clock limit at t = {:.6g} s", t));
        if (last)
            return progress.clear();
        solver_.advance(clock_.dt());
        progress.show(t, out_.steps);
        clock_.next();
    }
}

Outcome RunLoop::run()
{
    watch_ = {};
    try
    {
        step_through();
    }
    catch (const std::runtime_error& e)  // Diverged, or an expression of t that ceases to be finite
    {
        const bool expression = dynamic_cast<const ExpressionError*>(&e) && out_.steps > 0;
        if (!expression && !dynamic_cast<const Diverged*>(&e))
            throw;
        stop("diverged", ExitCode::diverged, fmt::format("{} (t = {:.6g} s, step {})", e.what(), clock_.t(), out_.steps));
        observer_.snapshot(file_, clock_.t(), out_.steps);
    }
    out_.solve_seconds = solve_seconds();
    out_.forcing_seconds = forcing_seconds();
    if (out_.status != "diverged")
    {
        const Stopwatch looking;
        guards_.at_end(solver_);
        out_.guard_seconds += looking.seconds();
    }
    out_.findings = guards_.findings(out_.completed());
    out_.note = guards_.note();
    if (!out_.sound())
        out_.diagnosis = diagnose(scene_, solver_, {clock_.dt(), clock_.critical(), out_.findings});
    return out_;
}
}  // namespace testbed
