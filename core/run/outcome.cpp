#include "core/run/outcome.hpp"

#include "core/base/provenance.hpp"

#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace testbed
{
namespace
{
std::string joined(const std::vector<Finding>& findings, const char* separator, bool sentences)
{
    std::vector<std::string> lines;
    for (const Finding& f : findings)
        lines.push_back(sentences ? f.code + ": " + f.sentence : f.code);
    return fmt::format("{}", fmt::join(lines, separator));
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

void write_provenance(ResultFile& file)
{
    file.attribute("/provenance", "version", std::string(build().version));
    file.attribute("/provenance", "commit", std::string(build().commit));
    file.attribute("/provenance", "compiler", std::string(build().compiler));
    file.attribute("/provenance", "flags", std::string(build().flags));
    file.attribute("/provenance", "build_type", std::string(build().type));
    file.attribute("/provenance", "cpu", cpu_name());
    file.attribute("/provenance", "threads", std::int64_t{threads()});
    file.attribute("/provenance", "load_average", load_average());
    file.attribute("/provenance", "others_running", std::int64_t{others_running()});
    file.attribute("/provenance", "started", time_stamp());
}

void write_material(ResultFile& file, const Scene& scene, const Solver& solver, const MaterialSpec& m)
{
    const ElasticModuli moduli(largest_youngs_modulus(scene, m), m.poissons_ratio);
    const std::string group = "/materials/" + m.name;
    file.attribute(group, "law", name_of(m.law));
    file.attribute(group, "density", m.density);
    file.attribute(group, "youngs_modulus", moduli.youngs_modulus());
    file.attribute(group, "poissons_ratio", moduli.poissons_ratio());
    file.attribute(group, "constrained_modulus", moduli.constrained());
    if (!m.has_strength())
        return;
    const Constants constants = scene.expression_constants();
    const Place origin{};
    file.attribute(group, "cohesion",
                   Expression(m.strength->cohesion, constants)(origin));  // of the mean; where it varies, that of X = Y = 0
    file.attribute(group, "friction_angle", Expression(m.strength->friction_angle, constants)(origin));
    file.attribute(group, "dilatancy_angle", m.strength->dilatancy_angle);
    if (m.random)
        file.attribute(group, "truncated_share", truncated_share(scene, solver, m));
}
}  // namespace

std::size_t number_of_points(const Solver& solver)
{
    std::size_t points = 0;
    for (const Body& body : solver.bodies())
        points += body.points.count;
    return points;
}

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
    file.attribute("/", "method", method_of(scene).name);
    file.attribute("/", "variant", variant_label(scene));
    file.attribute("/", "kinematics", name_of(solver.kinematics()));
    file.attribute("/scene", "resolved", resolved_toml(scene));
    file.attribute("/scene", "cell_size", scene.grid.cell_size);
    file.attribute("/scene", "cell_origin", std::span<const double>(scene.grid.origin));
    file.attribute("/scene", "points_per_cell", std::int64_t{scene.bodies[0].points_per_cell});
    file.attribute("/scene", "metrics", fmt::format("{}", fmt::join(scene.report.metrics, ",")));
    std::string constants;
    for (const auto& [name, value] : scene.constants)
        constants += fmt::format("{} = {}\n", name, value);
    file.attribute("/scene", "constants", constants);
    write_provenance(file);
    for (const MaterialSpec& m : scene.materials)
        write_material(file, scene, solver, m);
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

void write_performance(ResultFile& file, Solver& solver, const StepControl& clock, const Observer& observer, const Outcome& out,
                       double setup_seconds)
{
    const std::string group = "/performance";
    const std::size_t points = number_of_points(solver);
    const double particle_steps = static_cast<double>(points) * static_cast<double>(out.steps);
    file.attribute(group, "setup_s", setup_seconds);
    file.attribute(group, "solve_s", out.solve_seconds);
    file.attribute(group, "forcing_s", out.forcing_seconds);
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

void tell_ending(const Scene& scene, const Solver& solver, const StepControl& clock, const Outcome& out, const std::string& output)
{
    const auto points = static_cast<double>(number_of_points(solver));
    for (const MaterialSpec& m : scene.materials)
        if (m.random)
            fmt::print(stderr, "material '{}': {:.3g} % of the random strengths were truncated\n", m.name,
                       100 * truncated_share(scene, solver, m));
    fmt::print(stderr,
               "{} {}: {}; {:.0f} points, {} steps of {:.4g} s in {:.3g} s, {:.3g} million particle-steps per second, {:.1f} bytes per "
               "point; {}\n",
               scene.case_name(), variant_label(scene), ending(out), points, out.steps, clock.dt(), out.solve_seconds,
               1e-6 * points * static_cast<double>(out.steps) / out.solve_seconds, static_cast<double>(solver.bytes()) / points, output);
}

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
}  // namespace testbed
