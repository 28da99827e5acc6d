#include "benchmarks/harness/modes.hpp"

#include "benchmarks/harness/findings.hpp"
#include "core/run/results.hpp"
#include "core/run/step_control.hpp"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <limits>

namespace testbed
{
namespace
{
constexpr std::size_t most_unknowns = 3000;

Start run_to(double end, const Scene& scene, Solver& solver)
{
    StepControl clock(scene, solver);
    Start start;
    do
    {
        solver.prepare(clock.t(), clock.dt());
        solver.advance(clock.dt());
        clock.next();
        ++start.steps;
    } while (clock.t() < end * (1 - 1e-12) && !(clock.follows_limit() && clock.is_at_end()));
    start.t = clock.t();
    start.dt = clock.dt();
    start.state = state_of(solver);
    return start;
}

Findings find(const ModesOptions& options, const Scene& scene, Solver& solver)
{
    Findings f;
    f.steps = options.steps;
    f.frequency = options.frequency;
    f.start = run_to(options.at, scene, solver);
    f.claimed = solver.critical_time_step(scene);
    if (const std::size_t n = unknowns_of(solver, f.start.state); n > most_unknowns)
        throw SceneError(fmt::format("{}: the state has {} unknowns, and the modes of at most {} are computed: take a smaller body, larger "
                                     "cells (--set grid.cell_size=...) or fewer points per cell",
                                     scene.path, n, most_unknowns));
    const Lattice<2> lattice = make_lattice(scene.grid);
    const auto map_of = [&](double dt)
    { return one_step_map(solver, f.start.state, lattice, {.t = f.start.t, .dt = dt, .steps = options.steps}); };
    f.map = map_of(f.start.dt);
    if (!f.map.matrix.allFinite())
        throw SceneError(fmt::format("{}: a step from the state at t = {:.6g} s gives values that are not finite", scene.path, f.start.t));
    f.spectrum = spectrum(f.map.matrix);
    f.null = null_modes(f.map);
    for (const Mode& m : f.spectrum.modes)
        (m.growth() > 1 + options.tolerance                                  ? f.unstable
         : m.phase() == 0 || m.phase() > std::numbers::pi * (1 - hardly)     ? f.decaying
         : m.phase() < hardly * f.steps && m.growth() > 1 - hardly * f.steps ? f.hardly_felt
                                                                             : f.swinging)
            .push_back(m);
    std::stable_sort(f.swinging.begin(), f.swinging.end(),
                     [&](const Mode& a, const Mode& b)
                     {
                         const double to = options.frequency.value_or(0);
                         return std::abs(f.hertz(a) - to) < std::abs(f.hertz(b) - to);
                     });
    if (!options.leave_out_critical)
        f.critical = critical_step(
            [&](double dt)
            {
                try
                {
                    return spectral_radius(map_of(dt).matrix);
                }
                catch (const Diverged&)
                {
                    return std::numeric_limits<double>::infinity();
                }
            },
            f.start.dt, options.tolerance);
    return f;
}
}  // namespace

std::optional<std::pair<std::string, std::string>> modes(const ModesOptions& options)
{
    const std::filesystem::path output = options.scene.output;
    if (!output.empty() && output.extension() != ".h5" && output.extension() != ".csv" && output.extension() != ".png")
        throw SceneError(fmt::format("modes: '{}' is none of .h5, .csv, .png", output.string()));
    const Scene scene = load_and_warn(options.scene);
    if (!method_of(scene).make)
        throw SceneError("modes: the FEM reference has no state that is stepped by particles; take an LPFDM or MPM method");
    const std::unique_ptr<Solver> solver = method_of(scene).make(scene);
    const Findings f = [&]
    {
        try
        {
            return find(options, scene, *solver);
        }
        catch (const Diverged& e)
        {
            throw SceneError(fmt::format("{}: the run to --at {:.6g} s or a step from there fails: {}", scene.path, options.at, e.what()));
        }
    }();
    fmt::print("{}", options.json ? as_json(f, scene) : as_text(f, scene, options));
    if (output.empty())
        return std::nullopt;
    try
    {
        if (output.extension() == ".csv")
        {
            write_text(output, as_csv(f));
            return std::nullopt;
        }
        const std::filesystem::path shapes = std::filesystem::path(output).replace_extension(".h5");
        write_shapes(shapes.string(), f, scene, options.top);
        if (output.extension() == ".png")
            return std::pair(shapes.string(), output.string());
    }
    catch (const OutputError& e)
    {
        throw SceneError(e.what());  // nothing was lost: the user's to mend
    }
    return std::nullopt;
}
}  // namespace testbed
