#include "core/scene/checks.hpp"

#include <algorithm>
#include <set>

namespace testbed
{
namespace
{
template <class T>
void check_unique_names(const std::vector<T>& list, const std::string& key, Problems& problems)
{
    std::set<std::string> seen;
    constexpr std::size_t longest = 200;
    for (std::size_t k = 0; k < list.size(); ++k)
        if (const std::string& name = list[k].name; name.size() > longest)
            problems.add(fmt::format("{}[{}].name", key, k), fmt::format("a name of more than {} bytes", longest));
        else if (name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos ||
                 std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 32; }))
            problems.add(fmt::format("{}[{}].name", key, k), "a name is not empty and holds no '/' and no control characters");
        else if (!seen.insert(list[k].name).second)
            problems.add(fmt::format("{}[{}].name", key, k), fmt::format("'{}' is used twice", list[k].name));
}

void check_grid(const GridSpec& grid, const SceneBounds& bounds, Problems& problems)
{
    check_positive(grid.cell_size, "grid.cell_size", problems);
    for (std::size_t k = 0; k < 2 && grid.cell_size > 0; ++k)
        if (!is_multiple(grid.size[k], grid.cell_size))
            problems.add("grid.size", fmt::format("the extent {} m in {} is not a multiple of the cell size {} m", grid.size[k], "xy"[k],
                                                  grid.cell_size));
        else if (grid.size[k] / grid.cell_size > 1e6)
            problems.add("grid.size", fmt::format("{} cells in {} are more than 1e6", grid.size[k] / grid.cell_size, "xy"[k]));
    if (grid.cell_size > 0 && grid.size[0] / grid.cell_size * (grid.size[1] / grid.cell_size) > bounds.cells)
        problems.add("grid.size", fmt::format("the lattice has more than {:.0g} cells", bounds.cells));
}

/// Masses may be raised only where the way to rest does not matter.
void check_density_scaling(const Scene& scene, Problems& problems)
{
    if (!scene.damping || !scene.damping->acts())
        problems.add("time.density_scaling", "changes every motion: it is for scenes on their way to rest and needs [damping]");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (scene.bodies[k].velocity)
            problems.add(fmt::format("body[{}].velocity", k), "an initial velocity and time.density_scaling exclude each other: with other "
                                                              "masses it is another motion");
}

void check_time(const Scene& scene, Problems& problems)
{
    check_positive(scene.time.end, "time.end", problems);
    check_positive(scene.time.cfl, "time.cfl", problems);
    check_positive(scene.time.dt, "time.dt", problems);
    if (scene.time.density_scaling)
        check_density_scaling(scene, problems);
    check_positive(scene.time.stop_unbalanced, "time.stop_unbalanced", problems);
    check_positive(scene.time.wall_clock_limit, "time.wall_clock_limit", problems);
}

/// Stopping is lawful where only rest is asked for, and nothing keeps anything in motion.
void check_kinetic_damping(const Scene& scene, Problems& problems)
{
    const auto refuse = [&](const std::string& key, const char* why)
    {
        problems.add(
            key, fmt::format("{} and damping.kinetic, which stops all that moves, exclude each other; damping.local goes with it", why));
    };
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (scene.bodies[k].velocity)
            refuse(fmt::format("body[{}].velocity", k), "an initial velocity");
    if (scene.may_flow())
        problems.warn("damping.kinetic",
                      "what yields remembers the way to rest, and between two stops a body swings beyond its equilibrium: "
                      "for elastic bodies; damping.local with a slow gravity.ramp does not overshoot");
    for (std::size_t k = 0; k < scene.walls.size(); ++k)
        if (scene.walls[k].velocity)
            refuse(fmt::format("wall[{}].velocity", k), "a moving wall");
}

void check_damping(const Scene& scene, Problems& problems)
{
    if (!scene.damping)
        return;
    if (!(scene.damping->local >= 0 && scene.damping->local < 1))
        problems.add("damping.local", fmt::format("must lie in [0, 1), not {}", scene.damping->local));
    if (scene.damping->kinetic)
        check_kinetic_damping(scene, problems);
}

void check_loads(const Scene& scene, Problems& problems)
{
    if (scene.gravity && scene.gravity->ramp < 0)
        problems.add("gravity.ramp", "must not be negative");
    if (scene.confinement && !(scene.confinement->pressure >= 0))
        problems.add("confinement.pressure", fmt::format("must not be negative, not {}", scene.confinement->pressure));
    check_damping(scene, problems);
}

void check_traction(const Scene& scene, const TractionSpec& traction, const std::string& key, Problems& problems)
{
    std::vector<std::string> boxes;
    for (const BodySpec& body : scene.bodies)
        if (body.shape == BodySpec::Shape::box && body.inside.empty())
            boxes.push_back(body.name);
    if (std::find(boxes.begin(), boxes.end(), traction.body) == boxes.end())
        problems.add(key + ".body", fmt::format("no box '{}'", traction.body) + suggestion(traction.body, boxes));
}

void check_curves(const ReportSpec& report, Problems& problems)
{
    for (std::size_t k = 0; k < report.curves.size(); ++k)
        if (report.curves[k].x.size() != report.curves[k].y.size() || report.curves[k].x.size() < 2)
            problems.add(fmt::format("report.curve[{}]", k), "x and y must have the same number of values, at least two");
}

void check_output(const OutputSpec& output, Problems& problems)
{
    if (output.history < 0)
        problems.add("output.history", "must not be negative");
    if (!(output.checkpoint >= 0))
        problems.add("output.checkpoint", "must not be negative");
    if (output.snapshots < 0 || output.snapshots > 9999)
        problems.add("output.snapshots", "between 0 and 9999 is asked");
}
}  // namespace

void check_scene(const Scene& scene, const SceneBounds& bounds, Problems& problems)
{
    check_grid(scene.grid, bounds, problems);
    check_time(scene, problems);
    check_loads(scene, problems);
    check_materials(scene, problems, [](std::size_t k) { return fmt::format("material[{}]", k); });
    check_nonlocal(scene, problems);
    check_unique_names(scene.materials, "material", problems);
    if (scene.materials.empty())
        problems.add("material", "no [[material]] in the scene");
    if (scene.bodies.empty())
        problems.add("body", "no [[body]] in the scene");
    check_bodies(scene, problems);
    check_unique_names(scene.bodies, "body", problems);
    if (problems.errors().empty())
        check_number_of_points(scene, bounds.points, problems);
    if (problems.errors().empty())  // shapes are whole, and lie in the lattice
    {
        check_inclusions(scene, problems);
        check_overlap(scene, problems);
    }
    check_unique_names(scene.boundaries, "boundary", problems);
    check_unique_names(scene.walls, "wall", problems);
    check_walls(scene, problems);
    check_unique_names(scene.tractions, "traction", problems);
    for (std::size_t k = 0; k < scene.tractions.size(); ++k)
        check_traction(scene, scene.tractions[k], fmt::format("traction[{}]", k), problems);
    check_curves(scene.report, problems);
    check_unique_names(scene.probes, "probe", problems);
    check_output(scene.output, problems);
    for (const Method& method : methods())
        method.check(scene, problems);
}

void check_limits(const Scene& scene, Problems& problems)
{
    if (scene.gravity && scene.gravity->ramp > 0 && !scene.confinement)
        for (std::size_t k = 0; k < scene.bodies.size(); ++k)
            if (scene.bodies[k].initial_stress)
                problems.warn(
                    fmt::format("body[{}].initial_stress", k),
                    "is there at once, and gravity over gravity.ramp: without the weight that it carries the body heaves first; ramp = 0 "
                    "goes with it");
    if (scene.confinement && scene.confinement->pressure > 0)
        for (std::size_t k = 0; k < scene.bodies.size(); ++k)
            if (!scene.bodies[k].initial_stress)
                problems.warn(fmt::format("body[{}].initial_stress", k),
                              "missing: the confining pressure hits a body without stress at once");
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        if (m.softening && m.softening->nonlocal && scene.grid.cell_size > 0.5 * m.softening->nonlocal->internal_length)
            problems.warn(fmt::format("material[{}].softening.nonlocal", k),
                          fmt::format("the cell size {} m does not resolve the internal length {} m: at most half of it is asked",
                                      scene.grid.cell_size, m.softening->nonlocal->internal_length));
        if (m.softening && m.softening->band_thickness && scene.grid.cell_size < *m.softening->band_thickness)
            problems.warn(fmt::format("material[{}].softening.band_thickness", k),
                          fmt::format("crack-band scaling needs cells at least as large as the band, {} m", *m.softening->band_thickness));
    }
    method_of(scene).warn(scene, problems);
}

void warn_of_locking(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
        if (scene.materials[k].poissons_ratio > 0.45)
            problems.warn(fmt::format("material[{}].poissons_ratio", k),
                          fmt::format("{} locks when nearly incompressible (nu = {})", scene.method, scene.materials[k].poissons_ratio));
}
}  // namespace testbed
