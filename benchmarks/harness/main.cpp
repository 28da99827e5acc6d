#include "benchmarks/harness/bench.hpp"
#include "benchmarks/harness/bench_scenes.hpp"
#include "benchmarks/harness/modes.hpp"
#include "core/base/provenance.hpp"
#include "core/run/observer.hpp"
#include "core/run/point_driver.hpp"
#include "core/run/results.hpp"
#include "core/run/run.hpp"
#include "core/run/run_options.hpp"
#include "core/run/step_control.hpp"
#include "core/scene/geometry.hpp"
#include "core/scene/method_limits.hpp"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <iostream>
#include <sstream>
#include <unistd.h>

/// The `testbed` command.
namespace testbed
{
namespace
{
std::filesystem::path own_directory()
{
    return std::filesystem::read_symlink("/proc/self/exe").parent_path();
}

/// Replaces this process by `program`, looked for beside this executable and then on PATH, with the same arguments.
[[noreturn]] void become(const std::string& program, std::vector<std::string> arguments)
{
    const auto self = std::filesystem::read_symlink("/proc/self/exe");
    ::setenv("TESTBED", self.c_str(), 0);
    const auto beside = own_directory() / program;
    arguments.insert(arguments.begin(), program);
    std::vector<char*> argv;
    for (auto& a : arguments)
        argv.push_back(a.data());
    argv.push_back(nullptr);
    std::cout.flush();
    if (std::filesystem::exists(beside))
        ::execv(beside.c_str(), argv.data());
    ::execvp(program.c_str(), argv.data());
    throw SceneError(
        fmt::format("'{}' is not built or not installed ({}); the FEM reference needs deal.II, study, report and plot need Python", program,
                    std::strerror(errno)));
}

std::string fields_and_modules(const Scene& scene, Solver& solver)
{
    std::vector<std::string> fields, modules{method_of(scene).name};
    for (const Body& body : solver.bodies())
        body.points.for_each_field(
            [&](const auto& f)
            {
                if (std::find(fields.begin(), fields.end(), f.name()) == fields.end())
                    fields.emplace_back(f.name());
            });
    if (scene.gravity)
        modules.emplace_back("gravity");
    if (scene.damping && scene.damping->local > 0)
        modules.emplace_back("local damping");
    if (scene.damping && scene.damping->kinetic)
        modules.emplace_back("kinetic damping");
    if (!scene.boundaries.empty())
        modules.push_back(fmt::format("{} fixities", scene.boundaries.size()));
    if (!scene.walls.empty())
        modules.push_back(fmt::format("{} walls", scene.walls.size()));
    if (!scene.tractions.empty())
        modules.push_back(fmt::format("{} tractions", scene.tractions.size()));
    if (scene.body_force)
        modules.emplace_back("body force expression");
    if (!scene.probes.empty())
        modules.push_back(fmt::format("{} probes", scene.probes.size()));
    if (scene.exact.count(name_of(solver.kinematics())))
        modules.push_back(fmt::format("exact solution ({})", name_of(solver.kinematics())));
    return fmt::format("fields           {}\nmodules          {}\n", fmt::join(fields, ", "), fmt::join(modules, ", "));
}

/// What a run does before its first step. @throws SceneError where it would fail
void try_first_sample(const Scene& scene, Solver& solver)
{
    try
    {
        solver.prepare(0, time_step(scene, solver));
        solver.update_points();
        Observer(scene, solver).sample(0, time_step(scene));
    }
    catch (const Diverged& e)
    {
        throw SceneError(fmt::format("{}: at the start: {}", scene.path, e.what()));
    }
}

void check(const RunOptions& options, bool resolved)
{
    const Scene scene = load_and_warn(options);
    if (resolved)
    {
        fmt::print("{}", resolved_toml(scene));
        return;
    }
    fmt::print("scene            {}\nmethod           {}\n", scene.path, variant_label(scene));
    fmt::print("lattice          {:.0f} x {:.0f} cells of {} m\n", scene.grid.size[0] / scene.grid.cell_size,
               scene.grid.size[1] / scene.grid.cell_size, scene.grid.cell_size);
    for (const MaterialSpec& m : scene.materials)
    {
        const ElasticModuli moduli(largest_youngs_modulus(scene, m), m.poissons_ratio);
        fmt::print("material {:<7} {}, M = {:.5g} Pa, c_p = {:.5g} m/s, c_s = {:.5g} m/s\n", m.name, name_of(m.law), moduli.constrained(),
                   std::sqrt(moduli.constrained() / m.density), std::sqrt(moduli.shear() / m.density));
    }
    std::size_t points = 0;
    for (const BodySpec& body : scene.bodies)
        points += fill(scene, body).size();
    fmt::print("points           {}\n", points);
    const Method& method = method_of(scene);
    if (!method.make)
    {
        fmt::print("time step        {:.5g} s, critical {:.5g} s, {:.0f} steps\n", time_step(scene), critical_time_step(scene),
                   std::ceil(scene.time.end / time_step(scene)));
        fmt::print("testbed-{} samples its solution at these points; it keeps no particle fields\n", method.name);
        return;
    }
    const std::unique_ptr<Solver> solver = method.make(scene);
    if (const std::string warning = step_warning(scene, *solver); !warning.empty())
        warn(options, warning);
    const double dt = time_step(scene, *solver);
    fmt::print("time step        {:.5g} s{}, {}{:.0f} steps\nlimits           {}\n", dt,
               scene.time.follows_limit ? " at the start, then as the limit lets it" : "", scene.time.follows_limit ? "about " : "",
               std::ceil(scene.time.end / dt), description(solver->step_limits()));
    if (const auto sharp = solver->sharp_step_limit())
        fmt::print("sharp limit      {:.5g} s of stiffness, for the points as they stand at the start\n", *sharp);
    try_first_sample(scene, *solver);
    fmt::print("cells in use     {}\nunknowns         {}\n{}", solver->active_cells(), solver->unknowns(),
               fields_and_modules(scene, *solver));
    fmt::print("bytes per point  {:.1f} (all arrays, {:.3g} MB)\n", static_cast<double>(solver->bytes()) / static_cast<double>(points),
               1e-6 * static_cast<double>(solver->bytes()));
}

void list()
{
    fmt::print("methods (for `method` in a scene, or --method)\n");
    for (const Method& method : methods())
        for (const Variant& v : method.variants)
            fmt::print("  {:<16} {}\n", v.name, v.description);
    fmt::print("laws (for `law` of a material)\n");
    for (const std::string& law : names_of<Law>())
        fmt::print("  {}\n", law);
}

std::vector<std::string> rest_of(int argc, char** argv, int from)
{
    return {argv + std::min(from, argc), argv + argc};
}

void add_bench_options(CLI::App& command, BenchOptions& options)
{
    command.add_option("--method", options.methods, "only these methods");
    command.add_option("--scene", options.scenes, "only these scenes")->check(CLI::IsMember(bench_scene_names()));
    command.add_option("--law", options.laws, "only scenes with these laws")->check(CLI::IsMember({"elastic", "mohr_coulomb"}));
    command.add_option("--points", options.points,
                       "numbers of points, about, 16 to 1e9 (default: 300, 1e4, 1e5, 1e6; flows: as their study has it)");
    command.add_option("--points-per-cell", options.points_per_cell, "in each direction (default: 4 and 2; flows: as their study has it)")
        ->check(CLI::Range(1, 16));
    command.add_option("--threads", options.threads, "default: 1 and all")->check(CLI::Range(1, 1024));
    command.add_option("--seconds", options.seconds, "of each measurement, at most 3600");
    command.add_option("-o,--output", options.output,
                       "write a CSV file, too; named bench.csv in a folder given to `testbed report` it goes into the report");
}

void add_modes_options(CLI::App& command, ModesOptions& options)
{
    add_scene_options(command, options.scene);
    command.add_option("--at", options.at, "time of the state [s]; at least one step is made")->check(CLI::NonNegativeNumber);
    command.add_option("--steps", options.steps, "steps of the map, such as those in which a body moves by a cell")
        ->check(CLI::Range(1, 100000));
    command.add_option("--top", options.top, "modes of each sort that are shown")->check(CLI::Range(1, 1000));
    command.add_option("--frequency", options.frequency, "exact frequency of the mode that is shown first [Hz]")
        ->check(CLI::PositiveNumber);
    command.add_option("--tolerance", options.tolerance, "growth in the map that is not yet called unstable")->check(CLI::PositiveNumber);
    command.add_flag("--no-critical-step", options.leave_out_critical, "leave out the bisection for the critical step");
    command.add_flag("--json", options.json, "print JSON");
    command.add_option("-o,--output", options.scene.output, "write shapes (.h5), a picture of them (.png) or a table (.csv)");
}

/// The subcommands, and what their options say.
struct CommandLine
{
    CLI::App app{"Verification and research testbed: LPFDM, MPM and FEM for large soil deformation"};
    RunOptions options;  ///< of run and check
    bool resolved = false;
    std::string law, csv, table;
    BenchOptions bench_options;
    ModesOptions modes_options;
    CLI::App* run = app.add_subcommand("run", "run a scene and write a result file");
    CLI::App* check = app.add_subcommand("check", "parse a scene and say what it would use");
    CLI::App* point = app.add_subcommand("point", "drive a law alone along a strain path; CSV on stdout");
    CLI::App* doc = app.add_subcommand("doc", "every table and key of a scene");
    CLI::App* bench = app.add_subcommand("bench", "speed of the particle methods on this machine");
    CLI::App* modes = app.add_subcommand("modes", "what small disturbances of a state grow to: modes, null modes, critical step");

    CommandLine()
    {
        app.require_subcommand(1);
        app.set_version_flag("--version", fmt::format("testbed {} ({})", build().version, build().commit));
        add_run_options(*run, options);
        add_scene_options(*check, options);
        check->add_flag("--resolved", resolved, "print the scene with all its defaults, as TOML");
        point->add_option("law", law, "path file (TOML)")->required();
        point->add_option("-o,--output", csv, "write here instead of stdout");
        doc->add_option("table", table, "only this table");
        add_bench_options(*bench, bench_options);
        add_modes_options(*modes, modes_options);
        app.add_subcommand("list", "methods and material laws");
        app.add_subcommand("study", "run a study: testbed study STUDY.toml... [-j N] [-o DIR]");
        app.add_subcommand("report", "report on studies: testbed report DIR... [-o DIR]");
        app.add_subcommand("plot", "picture of results: testbed plot RESULT.h5... [--field F] [-o FILE]");
        app.add_subcommand("mesh", "a mesh of Gmsh for lpfdm.cells = \"file\": testbed mesh IN.msh OUT.toml");
        app.add_subcommand("import", "check a result of another code: testbed import RESULT.h5 [--study DIR]");
    }
};

/// @param csv where the curve goes; to stdout if empty
void point(const std::string& law, const std::string& csv)
{
    const std::string text = drive_point(law);
    if (csv.empty())
        fmt::print("{}", text);
    else
        try
        {
            write_text(csv, text);
        }
        catch (const OutputError& e)
        {
            throw SceneError(e.what());  // nothing was lost: the user's to mend
        }
}

int run(int argc, char** argv)
{
    // these are programs of their own, found the way git finds its subcommands
    for (const char* name : {"study", "report", "plot", "import", "mesh"})
        if (argc > 1 && std::string(argv[1]) == name)
            become(std::string("testbed-") + name, rest_of(argc, argv, 2));

    CommandLine line;
    try
    {
        line.app.parse(argc, argv);
    }
    catch (const CLI::ParseError& e)
    {
        return line.app.exit(e) == 0 ? 0 : static_cast<int>(ExitCode::bad_scene);
    }
    if (line.run->parsed())
    {
        const Method& method = method_of(load(line.options).scene);
        if (!method.make)
            become("testbed-" + method.name, rest_of(argc, argv, 2));
        return static_cast<int>(run_scene(line.options, method.make));
    }
    if (line.check->parsed())
        check(line.options, line.resolved);
    else if (line.point->parsed())
        point(line.law, line.csv);
    else if (line.bench->parsed())
        bench(line.bench_options);
    else if (line.modes->parsed())
    {
        if (const auto picture = modes(line.modes_options))
            become("testbed-modes-plot", {picture->first, picture->second});
    }
    else if (line.doc->parsed())
        fmt::print("{}", scene_documentation(line.table));
    else
        list();
    return 0;
}
}  // namespace
}  // namespace testbed

int main(int argc, char** argv)
{
    return testbed::guarded_main([&] { return testbed::run(argc, argv); });
}
