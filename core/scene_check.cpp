#include "core/method_limits.hpp"
#include "core/scene_problems.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace testbed
{
namespace
{
bool is_multiple(double length, double unit)
{
    const double n = length / unit;
    return std::round(n) >= 1 && std::abs(n - std::round(n)) < 1e-6;
}

template <class T>
void check_unique_names(const std::vector<T>& list, const std::string& key, Problems& problems)
{
    std::set<std::string> seen;
    for (std::size_t k = 0; k < list.size(); ++k)
        if (const std::string& name = list[k].name; name.empty() || name == "." || name == ".." || name.find('/') != std::string::npos ||
                                                    std::any_of(name.begin(), name.end(), [](unsigned char c) { return c < 32; }))
            problems.add(fmt::format("{}[{}].name", key, k), "a name is not empty and holds no '/' and no control characters");
        else if (!seen.insert(list[k].name).second)
            problems.add(fmt::format("{}[{}].name", key, k), fmt::format("'{}' is used twice", list[k].name));
}

void check_body(const Scene& scene, const BodySpec& body, const std::string& key, Problems& problems)
{
    const GridSpec& grid = scene.grid;
    std::vector<std::string> names;
    for (const auto& m : scene.materials)
        names.push_back(m.name);
    if (std::find(names.begin(), names.end(), body.material) == names.end())
        problems.add(key + ".material", fmt::format("no material '{}'", body.material) + suggestion(body.material, names));
    if (body.points_per_cell < 1 || body.points_per_cell > 64)
        problems.add(key + ".points_per_cell", fmt::format("between 1 and 64 per direction is asked, not {}", body.points_per_cell));

    const auto refuse = [&](bool present, const char* name)
    {
        if (present)
            problems.add(key + "." + name, fmt::format("not used by shape '{}'", body.shape));
    };
    const auto ask = [&](bool present, const char* name)
    {
        if (!present)
            problems.add(key + "." + name, fmt::format("missing, shape '{}' needs it", body.shape));
        return present;
    };
    Vec2 low{0, 0}, high{0, 0};
    bool known = false;
    if (body.shape == "box")
    {
        const bool has_min = ask(body.min.has_value(), "min"), has_max = ask(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        refuse(!body.vertices.empty(), "vertices");
        if (has_min && has_max)
        {
            low = *body.min;
            high = *body.max;
            known = true;
            for (std::size_t k = 0; k < 2 && grid.cell_size > 0; ++k)
                if (high[k] <= low[k])
                    problems.add(key + ".max", "must lie above and to the right of min");
                else if (!is_multiple(high[k] - low[k], grid.cell_size))
                    problems.add(key + ".max", fmt::format("the extent {} m in {} is not a multiple of the cell size {} m",
                                                           high[k] - low[k], "xy"[k], grid.cell_size));
        }
    }
    else if (body.shape == "disk")
    {
        const bool has_center = ask(body.center.has_value(), "center"), has_radius = ask(body.radius.has_value(), "radius");
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(!body.vertices.empty(), "vertices");
        if (has_radius && *body.radius <= 0)
            problems.add(key + ".radius", "must be positive");
        if (has_center && has_radius)
        {
            low = {(*body.center)[0] - *body.radius, (*body.center)[1] - *body.radius};
            high = {(*body.center)[0] + *body.radius, (*body.center)[1] + *body.radius};
            known = true;
        }
    }
    else if (body.shape == "polygon")
    {
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        if (body.vertices.size() < 3)
            problems.add(key + ".vertices", "at least three corners are asked");
        else
        {
            known = true;
            low = high = body.vertices[0];
            for (const Vec2& v : body.vertices)
                for (std::size_t k = 0; k < 2; ++k)
                {
                    low[k] = std::min(low[k], v[k]);
                    high[k] = std::max(high[k], v[k]);
                }
        }
    }
    const double slack = 1e-9 * grid.cell_size;
    for (std::size_t k = 0; known && k < 2; ++k)
        if (low[k] < grid.origin[k] - slack || high[k] > grid.origin[k] + grid.size[k] + slack)
        {
            problems.add(key, fmt::format("body '{}' spans {} = {} .. {} m, outside the lattice, {} .. {} m", body.name, "xy"[k], low[k],
                                          high[k], grid.origin[k], grid.origin[k] + grid.size[k]));
            break;
        }
}

/// Two boxes in one place would count their mass twice.
void check_overlap(const Scene& scene, Problems& problems)
{
    const double slack = 1e-6 * scene.grid.cell_size;
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        for (std::size_t other = 0; other < k; ++other)
        {
            const BodySpec &a = scene.bodies[other], &b = scene.bodies[k];
            if (!a.min || !a.max || !b.min || !b.max)
                continue;
            bool overlap = true;
            for (std::size_t d = 0; d < 2; ++d)
                overlap &= (*a.min)[d] < (*b.max)[d] - slack && (*b.min)[d] < (*a.max)[d] - slack;
            if (overlap)
                problems.add(fmt::format("body[{}]", k), fmt::format("body '{}' overlaps body '{}'", b.name, a.name));
        }
}
}  // namespace

void check_scene(const Scene& scene, Problems& problems)
{
    const GridSpec& grid = scene.grid;
    const auto positive = [&](double v, const std::string& key)
    {
        if (!(v > 0))
            problems.add(key, fmt::format("must be positive, not {}", v));
    };
    positive(grid.cell_size, "grid.cell_size");
    for (std::size_t k = 0; k < 2 && grid.cell_size > 0; ++k)
        if (!is_multiple(grid.size[k], grid.cell_size))
            problems.add("grid.size", fmt::format("the extent {} m in {} is not a multiple of the cell size {} m", grid.size[k], "xy"[k],
                                                  grid.cell_size));
        else if (grid.size[k] / grid.cell_size > 1e6)
            problems.add("grid.size", fmt::format("{} cells in {} are more than 1e6", grid.size[k] / grid.cell_size, "xy"[k]));
    if (grid.cell_size > 0 && grid.size[0] / grid.cell_size * (grid.size[1] / grid.cell_size) > 2e9)
        problems.add("grid.size", "the lattice has more than 2e9 cells");
    positive(scene.time.end, "time.end");
    positive(scene.time.cfl, "time.cfl");
    if (scene.time.dt)
        positive(*scene.time.dt, "time.dt");
    if (scene.time.stop_unbalanced)
        positive(*scene.time.stop_unbalanced, "time.stop_unbalanced");
    if (scene.time.wall_clock_limit)
        positive(*scene.time.wall_clock_limit, "time.wall_clock_limit");
    if (scene.gravity && scene.gravity->ramp < 0)
        problems.add("gravity.ramp", "must not be negative");
    if (scene.damping && !(scene.damping->local >= 0 && scene.damping->local < 1))
        problems.add("damping.local", fmt::format("must lie in [0, 1), not {}", scene.damping->local));
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        const std::string key = fmt::format("material[{}]", k);
        positive(m.density, key + ".density");
        if (!(m.poissons_ratio > -1 && m.poissons_ratio < 0.5))
            problems.add(key + ".poissons_ratio",
                         fmt::format("must lie in (-1, 0.5), not {}: at 0.5 an explicit method has no stable time step", m.poissons_ratio));
        if (const char* end = m.youngs_modulus.c_str(); !m.youngs_modulus.empty())
        {
            char* stop = nullptr;
            const double value = std::strtod(end, &stop);
            if (*stop == '\0')
                positive(value, key + ".youngs_modulus");
        }
    }
    check_unique_names(scene.materials, "material", problems);
    if (scene.materials.empty())
        problems.add("material", "no [[material]] in the scene");
    if (scene.bodies.empty())
        problems.add("body", "no [[body]] in the scene");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        check_body(scene, scene.bodies[k], fmt::format("body[{}]", k), problems);
    check_unique_names(scene.bodies, "body", problems);
    check_overlap(scene, problems);
    check_unique_names(scene.boundaries, "boundary", problems);
    check_unique_names(scene.probes, "probe", problems);
    if (scene.output.history < 0)
        problems.add("output.history", "must not be negative");
    if (scene.output.snapshots < 0 || scene.output.snapshots > 9999)
        problems.add("output.snapshots", "between 0 and 9999 is asked");
    if (scene.lpfdm.hourglass < 0 || scene.lpfdm.hourglass > 0.5)
        problems.add("lpfdm.hourglass", fmt::format("must lie in [0, 0.5], beyond that it is unstable at the critical time step; not {}",
                                                    scene.lpfdm.hourglass));
    if (scene.mpm.flip < 0 || scene.mpm.flip > 1)
        problems.add("mpm.flip", fmt::format("must lie in [0, 1], not {}", scene.mpm.flip));
    if (scene.mpm.strain == "b_bar" && scene.mpm.shape != "linear")
        problems.add("mpm.strain", "b_bar averages over a cell and needs shape = \"linear\"");
    if (scene.fem.degree != 1 && scene.fem.degree != 2)
        problems.add("fem.degree", fmt::format("1 or 2 is asked, not {}", scene.fem.degree));
    if (scene.fem.refinements < 0 || scene.fem.refinements > 10)
        problems.add("fem.refinements", "between 0 and 10 is asked");
}

void check_limits(const Scene& scene, Problems& problems)
{
    const double critical = critical_time_step(scene);
    const double dt = time_step(scene);
    if (dt > critical * (1 + 1e-12))
        problems.warn(scene.time.dt ? "time.dt" : "time.cfl",
                      fmt::format("the time step {:.4g} s is above the critical one, {:.4g} s", dt, critical));
    const std::string family = find_variant(scene.method).family;
    const bool locks = (family == "mpm" && scene.mpm.strain == "four_point") || (family == "fem" && scene.fem.degree == 1);
    for (std::size_t k = 0; k < scene.materials.size() && locks; ++k)
        if (scene.materials[k].poissons_ratio > 0.45)
            problems.warn(fmt::format("material[{}].poissons_ratio", k),
                          fmt::format("{} locks when nearly incompressible (nu = {})", scene.method, scene.materials[k].poissons_ratio));
}
}  // namespace testbed
