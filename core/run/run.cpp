#include "core/run/run.hpp"

#include "core/base/provenance.hpp"
#include "core/run/diagnosis.hpp"
#include "core/run/guards.hpp"
#include "core/run/observer.hpp"
#include "core/run/step_control.hpp"
#include "core/scene/method_limits.hpp"
#include "core/scene/trial.hpp"

#include <atomic>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

namespace testbed
{
namespace
{
std::atomic<bool> interrupted{false};

/// Ctrl-C and termination finish the step; a full disk or file limit is an error of write(), not a signal.
void catch_signals()
{
    std::signal(SIGINT, [](int) { interrupted = true; });
    std::signal(SIGTERM, [](int) { interrupted = true; });
    std::signal(SIGXFSZ, SIG_IGN);
}

/// One line that is overwritten, on a terminal only.
class Progress
{
public:
    Progress(bool on, double end) : on_(on && isatty(STDERR_FILENO)), end_(end) {}
    void show(double t, std::int64_t step)
    {
        if (!on_ || watch_.seconds() < last_ + 0.2)
            return;
        last_ = watch_.seconds();
        fmt::print(stderr, "\r{:5.1f} %  t = {:.4g} s  step {}  {:.0f} s left ", 100 * t / end_, t, step,
                   t > 0 ? last_ * (end_ - t) / t : 0.0);
        std::fflush(stderr);
    }
    void clear() const
    {
        if (on_)
            fmt::print(stderr, "\r{:60}\r", "");
    }

private:
    bool on_;
    double end_, last_ = 0;
    Stopwatch watch_;
};

struct Outcome
{
    std::string status = "completed", reason;
    ExitCode code = ExitCode::completed;
    std::int64_t steps = 0;
    double solve_seconds = 0, output_seconds = 0, guard_seconds = 0;
    std::vector<Finding> findings;
    std::string note;
    Diagnosis diagnosis;
    bool remedy_was_run = false;  ///< and held, if there still is one

    bool completed() const { return status == "completed"; }
    bool sound() const { return status != "diverged" && findings.empty(); }
};

/// Steps from 0 to the end; the history and the snapshots go to the observer.
Outcome step_through(const Scene& scene, Solver& solver, StepControl& clock, Observer& observer, ResultFile& file, bool quiet)
{
    const Stopwatch watch;
    Outcome out;
    const double end = scene.time.end;
    const double history_interval = scene.output.history > 0 ? scene.output.history : end / 200;
    const double snapshot_interval = scene.output.snapshots > 0 ? end / scene.output.snapshots : 2 * end;
    Guards guards(scene, solver, clock.follows_limit() ? std::numeric_limits<double>::infinity() : clock.critical());
    double next_sample = 0, next_snapshot = 0, t = 0;
    std::int64_t looked_at = 0;
    Progress progress(!quiet, end);
    const auto record = [&](bool last)
    {
        const Stopwatch output;
        const double half = 0.5 * clock.dt();
        const bool sample = t + half >= next_sample || last, snapshot = t + half >= next_snapshot || last;
        if (sample || snapshot)
            solver.update_points();
        if (sample)
        {
            constexpr std::int64_t steps_between = 50;  // so that looking at all points costs little beside the steps
            const bool fresh = last || out.steps == 0 || out.steps >= looked_at + steps_between;
            looked_at = fresh ? out.steps : looked_at;
            const GuardSample& now = observer.sample(t, clock.dt(), fresh);
            const Stopwatch watching;
            guards.watch(now, solver);
            out.guard_seconds += watching.seconds();
            next_sample += history_interval;
        }
        if (snapshot)
        {
            observer.snapshot(file, t, out.steps);
            next_snapshot += snapshot_interval;
        }
        out.output_seconds += output.seconds();
    };
    const auto is_at_rest = [&]
    {
        const double tolerance = *scene.time.stop_unbalanced;
        solver.update_points();
        return solver.sums().unbalanced < tolerance && Observer::kinetic_ratio(solver) < tolerance &&
               (!scene.gravity || t >= scene.gravity->ramp);
    };
    try
    {
        for (;; ++out.steps)
        {
            t = clock.t();
            solver.prepare(t, clock.dt());
            const bool now_and_then = out.steps % 50 == 0;
            const bool limit = scene.time.wall_clock_limit && now_and_then && watch.seconds() > *scene.time.wall_clock_limit;
            const bool rest = scene.time.stop_unbalanced && out.steps > 0 && now_and_then && is_at_rest();
            const bool last = clock.is_at_end() || interrupted || limit || rest;
            record(last);
            if (interrupted)
                out.status = "interrupted", out.code = ExitCode::interrupted,
                out.reason = fmt::format("stopped by the user at t = {:.6g} s", t);
            else if (limit)
                out.status = "time_limit", out.code = ExitCode::time_limit, out.reason = fmt::format("wall clock limit at t = {:.6g} s", t);
            if (last)
                break;
            solver.advance(clock.dt());
            progress.show(t, out.steps);
            clock.next();
        }
    }
    catch (const std::runtime_error& e)  // Diverged, or an expression of t that ceases to be finite
    {
        const bool expression = dynamic_cast<const ExpressionError*>(&e) && out.steps > 0;
        if (!expression && !dynamic_cast<const Diverged*>(&e))
            throw;
        out.status = "diverged";
        out.code = ExitCode::diverged;
        out.reason = fmt::format("{} (t = {:.6g} s, step {})", e.what(), t, out.steps);
        observer.snapshot(file, t, out.steps);
    }
    progress.clear();
    out.solve_seconds = watch.seconds() - out.output_seconds;
    if (out.status != "diverged")
    {
        const Stopwatch looking;
        guards.at_end(solver);
        out.guard_seconds += looking.seconds();
    }
    out.findings = guards.findings(out.completed());
    out.note = guards.note();
    if (!out.sound())
        out.diagnosis = diagnose(scene, solver, {clock.dt(), clock.critical(), out.findings});
    return out;
}

/// Share of the random strengths of a material that were truncated, over its bodies by their points.
double truncated_share(const Scene& scene, const Solver& solver, const MaterialSpec& material)
{
    double truncated = 0, points = 0;
    for (std::size_t b = 0; b < scene.bodies.size(); ++b)
        if (const Body& body = solver.bodies()[b]; scene.bodies[b].material == material.name)
        {
            truncated += body.truncated_share * static_cast<double>(body.points.count);
            points += static_cast<double>(body.points.count);
        }
    return points > 0 ? truncated / points : 0;
}

void write_header(ResultFile& file, const Scene& scene, const Solver& solver)
{
    file.attribute("/", "format", std::string("testbed-result"));
    file.attribute("/", "format_version", std::int64_t{1});
    file.attribute("/", "case", scene.case_name());
    file.attribute("/", "title", scene.title);
    file.attribute("/", "method", name_of(family_of(scene)));
    file.attribute("/", "variant", variant_label(scene));
    file.attribute("/", "kinematics", std::string(solver.kinematics()));
    file.attribute("/scene", "resolved", resolved_toml(scene));
    file.attribute("/scene", "cell_size", scene.grid.cell_size);
    file.attribute("/scene", "cell_origin", std::span<const double>(scene.grid.origin));
    file.attribute("/scene", "points_per_cell", std::int64_t{scene.bodies[0].points_per_cell});
    file.attribute("/scene", "metrics", fmt::format("{}", fmt::join(scene.report.metrics, ",")));
    std::string constants;
    for (const auto& [name, value] : scene.constants)
        constants += fmt::format("{} = {}\n", name, value);
    file.attribute("/scene", "constants", constants);
    file.attribute("/provenance", "commit", std::string(build().commit));
    file.attribute("/provenance", "compiler", std::string(build().compiler));
    file.attribute("/provenance", "flags", std::string(build().flags));
    file.attribute("/provenance", "build_type", std::string(build().type));
    file.attribute("/provenance", "cpu", cpu_name());
    file.attribute("/provenance", "threads", std::int64_t{threads()});
    file.attribute("/provenance", "load_average", load_average());
    file.attribute("/provenance", "started", time_stamp());
    for (const MaterialSpec& m : scene.materials)
    {
        const ElasticModuli moduli(largest_youngs_modulus(scene, m), m.poissons_ratio);
        const std::string group = "/materials/" + m.name;
        file.attribute(group, "law", name_of(m.law));
        file.attribute(group, "density", m.density);
        file.attribute(group, "youngs_modulus", moduli.youngs_modulus());
        file.attribute(group, "poissons_ratio", moduli.poissons_ratio());
        file.attribute(group, "constrained_modulus", moduli.constrained());
        if (!m.has_strength())
            continue;
        const Constants constants = scene.expression_constants();
        const Place origin{};
        file.attribute(group, "cohesion",
                       Expression(m.strength->cohesion, constants)(origin));  // of the mean; where it varies, that of X = Y = 0
        file.attribute(group, "friction_angle", Expression(m.strength->friction_angle, constants)(origin));
        file.attribute(group, "dilatancy_angle", m.strength->dilatancy_angle);
        if (m.random)
            file.attribute(group, "truncated_share", truncated_share(scene, solver, m));
    }
}

std::string joined(const std::vector<Finding>& findings, const char* separator, bool sentences)
{
    std::vector<std::string> lines;
    for (const Finding& f : findings)
        lines.push_back(sentences ? f.code + ": " + f.sentence : f.code);
    return fmt::format("{}", fmt::join(lines, separator));
}

void write_verdict(ResultFile& file, const Outcome& out)
{
    file.attribute("/", "status", out.status);
    file.attribute("/", "reason", out.reason);
    file.attribute("/", "soundness", std::string(out.sound() ? "sound" : "suspect"));
    file.attribute("/", "suspect", joined(out.findings, "\n", true));
    file.attribute("/", "cause", out.diagnosis.cause);
    file.attribute("/", "remedy", out.diagnosis.remedy);
    if (out.remedy_was_run)
        file.attribute("/", "remedy_was_run", std::int64_t{1});
}

/// How the run ended, for the closing line: "completed, sound", "completed, suspect: energy".
std::string ending(const Outcome& out)
{
    std::string text = out.status + (out.reason.empty() ? "" : ": " + out.reason);
    if (!out.findings.empty())
        text += ", suspect: " + joined(out.findings, ", ", false);
    else if (out.sound())
        text += ", sound";
    if (!out.note.empty())
        text += " (" + out.note + ")";
    return text;
}

/// The findings of a run that is not sound, a line each, and what would help.
void tell_findings(const Outcome& out)
{
    for (const Finding& f : out.findings)
        fmt::print(stderr, "suspect: {}: {}\n", f.code, f.sentence);
    if (!out.diagnosis.cause.empty())
        fmt::print(stderr, "cause: {}{}{}\n", out.diagnosis.cause,
                   out.diagnosis.remedy.empty() ? ""
                   : out.remedy_was_run         ? "; holds with --set "
                                                : "; may hold with --set ",
                   out.diagnosis.remedy);
}

void write_performance(ResultFile& file, Solver& solver, const StepControl& clock, const Observer& observer, const Outcome& out,
                       double setup_seconds, std::size_t points)
{
    const std::string group = "/performance";
    const double particle_steps = static_cast<double>(points) * static_cast<double>(out.steps);
    file.attribute(group, "setup_s", setup_seconds);
    file.attribute(group, "solve_s", out.solve_seconds);
    file.attribute(group, "output_s", out.output_seconds);
    file.attribute(group, "guards_s", out.guard_seconds + observer.guard_seconds());
    file.attribute(group, "steps", out.steps);
    file.attribute(group, "points", static_cast<std::int64_t>(points));
    file.attribute(group, "particle_steps", particle_steps);
    file.attribute(group, "particle_steps_per_second", particle_steps / out.solve_seconds);
    file.attribute(group, "bytes_per_point", static_cast<double>(solver.bytes()) / static_cast<double>(points));
    file.attribute(group, "cells", static_cast<std::int64_t>(solver.active_cells()));
    file.attribute(group, "dofs", static_cast<std::int64_t>(solver.unknowns()));
    file.attribute(group, "dt", clock.dt());
    file.attribute(group, "dt_shortest", clock.shortest());
    file.attribute(group, "dt_longest", clock.longest());
    file.attribute(group, "dt_critical", clock.critical());
    if (clock.sharp())
        file.attribute(group, "dt_sharp", *clock.sharp());
    for (const auto& [phase, seconds] : solver.timer().phases())
        file.attribute(group + "/phases", phase, seconds);
}
}  // namespace

Scene load_and_warn(const RunOptions& options)
{
    LoadedScene loaded = load_scene(options.scene, options.method, options.overrides);
    if (options.strict && !loaded.warnings.empty())
        throw SceneError(fmt::format("{}", fmt::join(loaded.warnings, "\n")));
    for (const auto& w : loaded.warnings)
        fmt::print(stderr, "warning: {}\n", w);
    try_expressions(loaded.scene);
    return std::move(loaded.scene);
}

void warn(const RunOptions& options, const std::string& warning)
{
    if (options.strict)
        throw SceneError(warning);
    fmt::print(stderr, "warning: {}\n", warning);
}
int guarded_main(const std::function<int()>& body)
{
    const auto fail = [](ExitCode code, const char* message)
    {
        fmt::print(stderr, "error: {}\n", message);
        return static_cast<int>(code);
    };
    try
    {
        return body();
    }
    catch (const SceneError& e)
    {
        return fail(ExitCode::bad_scene, e.what());
    }
    catch (const ExpressionError& e)
    {
        return fail(ExitCode::bad_scene, e.what());
    }
    catch (const std::bad_alloc&)
    {
        return fail(ExitCode::internal, "out of memory: make the lattice smaller or the cells larger");
    }
    catch (const std::exception& e)
    {
        return fail(ExitCode::internal, e.what());
    }
}

std::string default_output(const Scene& scene)
{
    const std::string name = scene.case_name();
    return (name.empty() ? "result" : name) + "_" + scene.method + ".h5";
}

namespace
{
/// A result may replace a result, and nothing else. @throws SceneError
void check_output(const std::filesystem::path& output)
{
    std::error_code ignored;
    if (output.extension() != ".h5")
        throw SceneError(fmt::format("output '{}': the name of a result file ends in .h5", output.string()));
    if (std::filesystem::exists(output, ignored) && !std::filesystem::is_regular_file(output, ignored))
        throw SceneError(fmt::format("cannot write '{}': it exists and is no file", output.string()));
}

}  // namespace

namespace
{
Outcome run_once(const RunOptions& options, const MakeSolver& make_solver);

/// Runs the scene with the remedy; one that does not hold is none.
void try_remedy(const RunOptions& options, const MakeSolver& make_solver, const std::string& output, Outcome& out)
{
    RunOptions again = options;
    again.overrides.push_back(out.diagnosis.remedy);
    again.output = std::filesystem::path(output).replace_extension(".remedy.h5").string();
    again.quiet = true;
    again.diagnose = false;
    const Outcome other = run_once(again, make_solver);
    out.remedy_was_run = true;
    if (other.completed() && other.sound())
        return;
    fmt::print(stderr, "{} was run and does not hold\n", out.diagnosis.remedy);
    out.diagnosis.remedy.clear();
}

Outcome run_once(const RunOptions& options, const MakeSolver& make_solver)
{
    const Stopwatch setup;
    set_threads(options.threads);
    const Scene scene = load_and_warn(options);
    const std::string output = options.output.empty() ? default_output(scene) : options.output;
    check_output(output);
    const std::unique_ptr<Solver> solver = make_solver(scene);
    if (const std::string warning = step_warning(scene, *solver); !warning.empty())
        warn(options, warning);
    Observer observer(scene, *solver);
    StepControl clock(scene, *solver);
    std::size_t points = 0;
    for (const Body& body : solver->bodies())
        points += body.points.count;
    const double setup_seconds = setup.seconds();

    catch_signals();
    const auto open = [&]
    {
        try
        {
            return ResultFile(output);
        }
        catch (const OutputError& e)
        {
            throw SceneError(e.what());  // nothing was computed yet: the user's to mend
        }
    };
    ResultFile file = open();
    write_header(file, scene, *solver);
    Outcome out = step_through(scene, *solver, clock, observer, file, options.quiet);
    if (options.diagnose && !out.diagnosis.remedy.empty() && !interrupted)
        try_remedy(options, make_solver, output, out);
    observer.write_history(file);
    write_performance(file, *solver, clock, observer, out, setup_seconds, points);
    write_verdict(file, out);
    file.commit();
    try
    {
        write_text(std::filesystem::path(output).replace_extension(".xdmf"),
                   observer.xdmf(std::filesystem::path(output).filename().string()));
    }
    catch (const OutputError& e)
    {
        throw OutputError(fmt::format("{}; the result itself is whole", e.what()));
    }

    if (!options.quiet)
        for (const MaterialSpec& m : scene.materials)
            if (m.random)
                fmt::print(stderr, "material '{}': {:.3g} % of the random strengths were truncated\n", m.name,
                           100 * truncated_share(scene, *solver, m));
    if (!options.quiet)
        fmt::print(stderr,
                   "{} {}: {}; {} points, {} steps of {:.4g} s in {:.3g} s, {:.3g} million particle-steps per second, {:.1f} bytes per "
                   "point; {}\n",
                   scene.case_name(), variant_label(scene), ending(out), points, out.steps, clock.dt(), out.solve_seconds,
                   1e-6 * static_cast<double>(points) * static_cast<double>(out.steps) / out.solve_seconds,
                   static_cast<double>(solver->bytes()) / static_cast<double>(points), output);
    else if (out.code != ExitCode::completed)
        fmt::print(stderr, "{}: {}\n", out.status, out.reason);
    tell_findings(out);
    return out;
}
}  // namespace

ExitCode run_scene(const RunOptions& options, const MakeSolver& make_solver)
{
    const Outcome out = run_once(options, make_solver);
    return options.strict && out.completed() && !out.sound() ? ExitCode::suspect : out.code;
}
}  // namespace testbed
