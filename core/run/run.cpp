#include "core/run/run.hpp"

#include "core/run/restart.hpp"
#include "core/run/run_loop.hpp"
#include "core/scene/trial.hpp"

#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace testbed
{
namespace
{
Scene say_warnings(const RunOptions& options, LoadedScene loaded)
{
    if (options.strict && !loaded.warnings.empty())
        throw SceneError(fmt::format("{}", fmt::join(loaded.warnings, "\n")));
    for (const auto& w : loaded.warnings)
        fmt::print(stderr, "warning: {}\n", w);
    try_expressions(loaded.scene);
    return std::move(loaded.scene);
}
}  // namespace

LoadedScene load(const RunOptions& options)
{
    return options.restart.empty() ? load_scene(options.scene, options.method, options.overrides)
                                   : load_restarted_scene(read_restart(options.restart), options.scene, options.method, options.overrides);
}

Scene load_and_warn(const RunOptions& options)
{
    return say_warnings(options, load(options));
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

Outcome run_once(const RunOptions& options, const MakeSolver& make_solver);

/// Runs the scene with the remedy; one that does not hold is none.
void try_remedy(const RunOptions& options, const MakeSolver& make_solver, const std::string& output, Outcome& out)
{
    RunOptions again = options;
    again.overrides.push_back(out.diagnosis.remedy);
    again.output = std::filesystem::path(output).replace_extension(".remedy.h5").string();
    again.quiet = true;
    again.diagnose = false;
    const char* what = "was run and does not hold";
    try
    {
        const Outcome other = run_once(again, make_solver);
        if (other.completed() && other.sound())
            what = nullptr;
    }
    catch (const SceneError&)
    {
        what = "does not go with this scene";
    }
    out.remedy_was_run = true;
    if (!what)
        return;
    fmt::print(stderr, "{} {}\n", out.diagnosis.remedy, what);
    out.diagnosis.remedy.clear();
}

/// @throws SceneError where the file cannot be written: nothing was computed yet, and it is the user's to mend
ResultFile open_result(const std::string& output)
{
    try
    {
        return ResultFile(output);
    }
    catch (const OutputError& e)
    {
        throw SceneError(e.what());
    }
}

void write_xdmf(const std::filesystem::path& output, const Observer& observer)
{
    try
    {
        write_text(std::filesystem::path(output).replace_extension(".xdmf"), observer.xdmf(output.filename().string()));
    }
    catch (const OutputError& e)
    {
        throw OutputError(fmt::format("{}; the result itself is whole", e.what()));
    }
}

Outcome run_once(const RunOptions& options, const MakeSolver& make_solver)
{
    const Stopwatch setup;
    set_threads(options.threads);
    std::optional<Restart> restart;
    if (!options.restart.empty())
        restart = read_restart(options.restart);
    const Scene scene = restart ? say_warnings(options, load_restarted_scene(*restart, options.scene, options.method, options.overrides))
                                : load_and_warn(options);
    const std::string output = options.output.empty() ? default_output(scene) : options.output;
    check_output(output);
    if (std::error_code ignored; restart && std::filesystem::equivalent(output, restart->path, ignored))
        throw SceneError(fmt::format("output '{}' is the restart file itself: name another one", output));
    const std::unique_ptr<Solver> solver = make_solver(scene);
    if (const std::string warning = step_warning(scene, *solver); !warning.empty())
        warn(options, warning);
    Observer observer(scene, *solver);
    StepControl clock(scene, *solver);
    catch_signals();
    ResultFile file = open_result(output);
    write_header(file, scene, *solver);
    RunLoop loop(scene, *solver, clock, observer, file, restart_path(output), options.quiet);
    if (restart)
    {
        loop.restore(restart->state);
        file.copy(restart->path, "/snapshots");
        if (!options.quiet)
            fmt::print(stderr, "restarted at t = {:.6g} s from {}\n", clock.t(), options.restart);
    }
    const double setup_seconds = setup.seconds();

    Outcome out = loop.run();
    if (options.diagnose && !out.diagnosis.remedy.empty() && !restart && !is_interrupted())
        try_remedy(options, make_solver, output, out);
    observer.write_history(file);
    write_performance(file, *solver, clock, observer, out, setup_seconds);
    write_verdict(file, out);
    file.commit();
    write_xdmf(output, observer);
    if (!options.quiet)
        tell_ending(scene, *solver, clock, out, output);
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
