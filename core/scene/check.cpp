#include "core/scene/geometry.hpp"
#include "core/scene/problems.hpp"
#include "core/scene/wall_path.hpp"

#include <algorithm>
#include <cmath>
#include <map>
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
            problems.add(key + "." + name, fmt::format("not used by shape '{}'", name_of(body.shape)));
    };
    const auto ask = [&](bool present, const char* name)
    {
        if (!present)
            problems.add(key + "." + name, fmt::format("missing, shape '{}' needs it", name_of(body.shape)));
        return present;
    };
    bool known = false;
    if (body.shape == BodySpec::Shape::box)
    {
        const bool has_min = ask(body.min.has_value(), "min"), has_max = ask(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        refuse(!body.vertices.empty(), "vertices");
        known = has_min && has_max;
        for (std::size_t k = 0; known && k < 2 && grid.cell_size > 0; ++k)
            if (const double length = (*body.max)[k] - (*body.min)[k]; length <= 0)
                problems.add(key + ".max", "must lie above and to the right of min");
            else if (body.inside.empty() && !is_multiple(length, grid.cell_size))
                problems.add(key + ".max",
                             fmt::format("the extent {} m in {} is not a multiple of the cell size {} m", length, "xy"[k], grid.cell_size));
    }
    else if (body.shape == BodySpec::Shape::disk)
    {
        const bool has_center = ask(body.center.has_value(), "center"), has_radius = ask(body.radius.has_value(), "radius");
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(!body.vertices.empty(), "vertices");
        if (has_radius && *body.radius <= 0)
            problems.add(key + ".radius", "must be positive");
        known = has_center && has_radius;
    }
    else if (body.shape == BodySpec::Shape::polygon)
    {
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        known = body.vertices.size() >= 3;
        if (!known)
            problems.add(key + ".vertices", "at least three corners are asked");
        else if (const auto edges = crossing_edges(body.vertices))
            problems.add(key + ".vertices", fmt::format("the edges after corners {} and {} cross", (*edges)[0] + 1, (*edges)[1] + 1));
    }
    if (!known)
        return;
    const auto [low, high] = extent(body);
    const double slack = 1e-9 * grid.cell_size;
    for (std::size_t k = 0; k < 2; ++k)
        if (!(low[k] >= grid.origin[k] - slack && high[k] <= grid.origin[k] + grid.size[k] + slack))
        {
            problems.add(key, fmt::format("body '{}' spans {} = {} .. {} m, outside the lattice, {} .. {} m", body.name, "xy"[k], low[k],
                                          high[k], grid.origin[k], grid.origin[k] + grid.size[k]));
            break;
        }
}

/// Of the squares around the bodies, of which each holds all points that a body can have.
void check_number_of_points(const Scene& scene, double most, Problems& problems)
{
    double points = 0;
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
    {
        const BodySpec& body = scene.bodies[k];
        const auto [low, high] = extent(body);
        const double h = spacing(body, scene.grid);
        points += (high[0] - low[0]) / h * ((high[1] - low[1]) / h);
        if (!(points <= most))
            return problems.add(fmt::format("body[{}]", k),
                                fmt::format("the bodies up to '{}' have some {:.2g} points, more than {:.0g}; make "
                                            "grid.cell_size larger or points_per_cell smaller",
                                            body.name, points, most));
    }
}

/// Two bodies in one place would count their mass twice. Boxes are compared as such, other shapes by the points of either in the other.
void check_overlap(const Scene& scene, Problems& problems)
{
    const double slack = 1e-6 * scene.grid.cell_size;
    const auto boxes_overlap = [&](const BodySpec& a, const BodySpec& b)
    {
        bool overlap = true;
        for (std::size_t d = 0; d < 2; ++d)
            overlap &= (*a.min)[d] < (*b.max)[d] - slack && (*b.min)[d] < (*a.max)[d] - slack;
        return overlap;
    };
    std::map<const BodySpec*, std::vector<Vec2>> filled;  // of those that are asked for, once
    const auto has_points_in = [&](const BodySpec& a, const BodySpec& b)
    {
        auto& points = filled[&a];
        if (points.empty())
            points = fill(scene, a);
        return std::any_of(points.begin(), points.end(), [&](const Vec2& p) { return contains(b, p, -slack); });
    };
    const auto apart = [&](const BodySpec& a, const BodySpec& b)
    {
        const auto [low, high] = extent(a);
        const auto [other_low, other_high] = extent(b);
        return low[0] > other_high[0] || low[1] > other_high[1] || other_low[0] > high[0] || other_low[1] > high[1];
    };
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        for (std::size_t other = 0; other < k; ++other)
        {
            const BodySpec &a = scene.bodies[other], &b = scene.bodies[k];
            if (!a.inside.empty() || !b.inside.empty() || apart(a, b))
                continue;  // an inclusion: see check_inclusion()
            const bool boxes = a.min && a.max && b.min && b.max;
            if (boxes ? boxes_overlap(a, b) : has_points_in(a, b) || has_points_in(b, a))
                problems.add(fmt::format("body[{}]", k),
                             fmt::format("body '{0}' overlaps body '{1}'; if it is meant to take the place of points of "
                                         "'{1}', it needs inside = \"{1}\"",
                                         b.name, a.name));
        }
}

/// An inclusion takes points of another body: all of its shape must lie there.
void check_inclusion(const Scene& scene, const BodySpec& body, const std::string& key, Problems& problems)
{
    std::vector<std::string> names;
    for (const BodySpec& other : scene.bodies)
        if (other.name != body.name && other.inside.empty())
            names.push_back(other.name);
    if (std::find(names.begin(), names.end(), body.inside) == names.end())
        return problems.add(key + ".inside", fmt::format("no body '{}' that could hold an inclusion", body.inside) +
                                                 (names.empty() ? "" : suggestion(body.inside, names)));
    const BodySpec& host = scene.body(body.inside);
    const std::vector<Vec2> own = fill(scene, body);
    for (const BodySpec& other : scene.bodies)
    {
        if (&other == &body)
            break;
        if (other.inside != body.inside)
            continue;
        for (const Vec2& p : own)
            if (contains(other, p))
                return problems.add(key,
                                    fmt::format("inclusion '{}' overlaps inclusion '{}' at ({}, {}) m", body.name, other.name, p[0], p[1]));
    }
    for (const Vec2& corner : outline(body))
        if (!contains(host, corner, 1e-6 * scene.grid.cell_size))
            return problems.add(
                key, fmt::format("inclusion '{}' reaches ({}, {}) m, outside body '{}'", body.name, corner[0], corner[1], host.name));
}

/// A number is checked here; an expression when it is evaluated at the points.
template <class IsValid>
void check_number(const std::string& text, const std::string& key, IsValid&& is_valid, const std::string& rule, Problems& problems)
{
    if (text.empty() || !is_number(text))
        return;
    if (const double value = std::strtod(text.c_str(), nullptr); !is_valid(value))
        problems.add(key, fmt::format("{}, not {}", rule, value));
}

void check_strength(const Scene& scene, const MaterialSpec& m, const std::string& key, Problems& problems)
{
    const auto refuse = [&](bool present, const char* name)
    {
        if (present)
            problems.add(key + "." + name, fmt::format("not used by law '{}'", name_of(m.law)));
    };
    if (!m.has_strength())
    {
        refuse(m.strength.has_value(), "strength");
        refuse(m.softening.has_value(), "softening");
        refuse(m.random.has_value(), "random");
        return;
    }
    if (!m.strength)
        return problems.add(key + ".strength", fmt::format("missing, law '{}' needs it", name_of(m.law)));
    if (!is_number(m.youngs_modulus))
        problems.add(key + ".youngs_modulus", fmt::format("law '{}' takes a plain number, not an expression", name_of(m.law)));
    const std::string angle_rule = "an angle in radians, from 0 to below pi/2, is asked (degrees: \"28.6*pi/180\")";
    const double right_angle = 0.5 * std::numbers::pi;
    check_number(
        m.strength->cohesion, key + ".strength.cohesion", [](double c) { return c >= 0; }, "must not be negative", problems);
    check_number(
        m.strength->friction_angle, key + ".strength.friction_angle", [&](double phi) { return phi >= 0 && phi < right_angle; }, angle_rule,
        problems);
    const double psi = m.strength->dilatancy_angle;
    if (!(psi >= 0 && psi < right_angle))
        problems.add(key + ".strength.dilatancy_angle", fmt::format("{}, not {}", angle_rule, psi));
    else
        check_number(
            m.strength->friction_angle, key + ".strength.friction_angle", [&](double phi) { return phi >= psi; },
            "must not be below the dilatancy angle", problems);
    if (m.strength->tensile_strength && *m.strength->tensile_strength < 0)
        problems.add(key + ".strength.tensile_strength", "must not be negative");

    const auto positive = [&](const std::optional<double>& value, const std::string& name)
    {
        if (value && !(*value > 0))
            problems.add(key + name, fmt::format("must be positive, not {}", *value));
    };
    if (m.softening)
    {
        const SofteningSpec& s = *m.softening;
        const bool linear = s.kind == SofteningSpec::Kind::linear;
        if (!(s.residual >= 0 && s.residual <= 1))
            problems.add(key + ".softening.residual", fmt::format("a share in [0, 1] is asked, not {}", s.residual));
        if (linear && !s.strain)
            problems.add(key + ".softening.strain", "missing, kind = \"linear\" needs it");
        const auto only_linear = [&](bool present, const char* name)
        {
            if (present && !linear)
                problems.add(key + ".softening." + name, "only for kind = \"linear\"");
        };
        only_linear(s.strain.has_value(), "strain");
        only_linear(s.band_thickness.has_value(), "band_thickness");
        only_linear(s.nonlocal.has_value(), "nonlocal");
        positive(s.strain, ".softening.strain");
        positive(s.band_thickness, ".softening.band_thickness");
        if (s.band_thickness && s.nonlocal)
            problems.add(key + ".softening.band_thickness", "crack-band scaling and nonlocal softening exclude each other");
        if (s.nonlocal)
        {
            positive(s.nonlocal->internal_length, ".softening.nonlocal.internal_length");
            if (const double extent = std::max(scene.grid.size[0], scene.grid.size[1]); extent > 0 && s.nonlocal->internal_length > extent)
                problems.add(key + ".softening.nonlocal.internal_length",
                             fmt::format("{} m is longer than the lattice, {} m", s.nonlocal->internal_length, extent));
            if (!(s.nonlocal->over_nonlocal >= 1))
                problems.add(key + ".softening.nonlocal.over_nonlocal",
                             fmt::format("must be at least 1 (nonlocal), above 1 to regularise; not {}", s.nonlocal->over_nonlocal));
        }
    }
    if (m.random)
    {
        const RandomSpec& r = *m.random;
        if (r.seed < 0)
            problems.add(key + ".random.seed", "must not be negative");
        for (const auto& [value, name] :
             {std::pair{r.cohesion_deviation, "cohesion_deviation"}, {r.friction_deviation, "friction_deviation"}})
            if (!(value >= 0 && value <= 2))
                problems.add(key + ".random." + name, fmt::format("a relative deviation in [0, 2] is asked, not {}", value));
        positive(r.correlation_length, ".random.correlation_length");
        if ((r.field == RandomSpec::RandomField::correlated) != r.correlation_length.has_value())
            problems.add(key + ".random.correlation_length",
                         r.correlation_length ? "only for field = \"correlated\"" : "missing, field = \"correlated\" needs it");
    }
}

void check_wall(const Scene& scene, const WallSpec& wall, const std::string& key, Problems& problems)
{
    const GridSpec& grid = scene.grid;
    const double slack = 1e-6 * grid.cell_size;
    const auto outside = [&](const Vec2& min, const Vec2& max)
    {
        bool out = false;
        for (std::size_t k = 0; k < 2; ++k)
            out |= min[k] < grid.origin[k] - slack || max[k] > grid.origin[k] + grid.size[k] + slack;
        return out;
    };
    if (wall.max[0] < wall.min[0] || wall.max[1] < wall.min[1] || (wall.max[0] == wall.min[0] && wall.max[1] == wall.min[1]))
        return problems.add(key + ".max", "must lie above or to the right of min");
    if (outside(wall.min, wall.max))
        return problems.add(key, fmt::format("wall '{}' spans ({}, {}) .. ({}, {}) m, outside the lattice", wall.name, wall.min[0],
                                             wall.min[1], wall.max[0], wall.max[1]));
    for (std::size_t k = 0; k < 2 && wall.motion == WallSpec::Motion::hand_off; ++k)
        for (const double face : {wall.min[k], wall.max[k]})
            if (const double cells = (face - grid.origin[k]) / grid.cell_size; std::abs(cells - std::round(cells)) > 1e-6)
                return problems.add(key,
                                    fmt::format("the face of wall '{}' at {} = {} m lies between lines of nodes; move it to a multiple of "
                                                "the cell size {} m, or set motion = \"smooth\"",
                                                wall.name, "xy"[k], face, grid.cell_size));
    for (std::size_t k = 0; k < 2 && wall.motion == WallSpec::Motion::smooth; ++k)
        if (const double width = wall.max[k] - wall.min[k]; width > 0 && width < 2 * grid.cell_size - slack)
            return problems.add(key,
                                fmt::format("wall '{}' is {} m wide: a smooth wall is a plate, or at least two cells, {} m, wide, so that "
                                            "its faces share no node",
                                            wall.name, width, 2 * grid.cell_size));
    if (wall.door)
    {
        const std::size_t along = door_direction(wall);
        const auto [from, to] = *wall.door;
        if (from >= to)
            problems.add(key + ".door", "an opening [from, to] with from < to is asked");
        else if (from < wall.min[along] - slack || to > wall.max[along] + slack)
            problems.add(key + ".door", fmt::format("the door spans {} .. {} m and is wider than its wall, {} .. {} m", from, to,
                                                    wall.min[along], wall.max[along]));
        else if (to - from < 2 * grid.cell_size - slack)
            problems.add(key + ".door", fmt::format("an opening of {} m has no free node: at least two cells, {} m, are asked", to - from,
                                                    2 * grid.cell_size));
    }
    if (wall.door_opens < 0)
        problems.add(key + ".door_opens", "must not be negative");
    if (!(scene.time.end > 0))
        return;
    try
    {
        const auto path = wall_path(wall, scene.expression_constants(), scene.time.end);
        for (std::size_t n = 0; n < path.size(); ++n)
            if (const Vec2& u = path[n]; outside({wall.min[0] + u[0], wall.min[1] + u[1]}, {wall.max[0] + u[0], wall.max[1] + u[1]}))
                return problems.add(
                    key + ".velocity",
                    fmt::format("wall '{}' leaves the lattice at t = {:.4g} s, after a travel of ({:.4g}, {:.4g}) m; make the "
                                "lattice larger or the travel shorter",
                                wall.name, static_cast<double>(n) * scene.time.end / static_cast<double>(path.size() - 1), u[0], u[1]));
    }
    catch (const ExpressionError& e)
    {
        problems.add(key + ".velocity", e.what());
    }
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

/// Masses may be raised only where the way to rest does not matter.
void check_density_scaling(const Scene& scene, Problems& problems)
{
    if (!scene.damping || scene.damping->local <= 0)
        problems.add("time.density_scaling", "changes every motion: it is for scenes on their way to rest and needs [damping]");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (scene.bodies[k].velocity)
            problems.add(fmt::format("body[{}].velocity", k), "an initial velocity and time.density_scaling exclude each other: with other "
                                                              "masses it is another motion");
}

/// Nonlocal softening averages over all bodies together: they must agree on how.
void check_nonlocal(const Scene& scene, Problems& problems)
{
    const NonlocalSpec* first = nullptr;
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
        if (const auto& s = scene.materials[k].softening; s && s->nonlocal)
        {
            if (!first)
                first = &*s->nonlocal;
            else if (s->nonlocal->internal_length != first->internal_length || s->nonlocal->weight != first->weight)
                problems.add(fmt::format("material[{}].softening.nonlocal", k),
                             "all nonlocal materials share one internal_length and weight");
        }
}
}  // namespace

void check_materials(const Scene& scene, Problems& problems, const std::function<std::string(std::size_t)>& key_of)
{
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        const std::string key = key_of(k);
        if (!(m.density > 0))
            problems.add(key + ".density", fmt::format("must be positive, not {}", m.density));
        if (!(m.poissons_ratio > -1 && m.poissons_ratio < 0.5))
            problems.add(key + ".poissons_ratio",
                         fmt::format("must lie in (-1, 0.5), not {}: at 0.5 an explicit method has no stable time step", m.poissons_ratio));
        check_number(
            m.youngs_modulus, key + ".youngs_modulus", [](double E) { return E > 0; }, "must be positive", problems);
        check_strength(scene, m, key, problems);
    }
}

void check_scene(const Scene& scene, const SceneBounds& bounds, Problems& problems)
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
    if (grid.cell_size > 0 && grid.size[0] / grid.cell_size * (grid.size[1] / grid.cell_size) > bounds.cells)
        problems.add("grid.size", fmt::format("the lattice has more than {:.0g} cells", bounds.cells));
    positive(scene.time.end, "time.end");
    positive(scene.time.cfl, "time.cfl");
    if (scene.time.dt)
        positive(*scene.time.dt, "time.dt");
    if (scene.time.density_scaling)
        check_density_scaling(scene, problems);
    if (scene.time.stop_unbalanced)
        positive(*scene.time.stop_unbalanced, "time.stop_unbalanced");
    if (scene.time.wall_clock_limit)
        positive(*scene.time.wall_clock_limit, "time.wall_clock_limit");
    if (scene.gravity && scene.gravity->ramp < 0)
        problems.add("gravity.ramp", "must not be negative");
    if (scene.confinement && !(scene.confinement->pressure >= 0))
        problems.add("confinement.pressure", fmt::format("must not be negative, not {}", scene.confinement->pressure));
    if (scene.damping && !(scene.damping->local >= 0 && scene.damping->local < 1))
        problems.add("damping.local", fmt::format("must lie in [0, 1), not {}", scene.damping->local));
    check_materials(scene, problems, [](std::size_t k) { return fmt::format("material[{}]", k); });
    check_nonlocal(scene, problems);
    check_unique_names(scene.materials, "material", problems);
    if (scene.materials.empty())
        problems.add("material", "no [[material]] in the scene");
    if (scene.bodies.empty())
        problems.add("body", "no [[body]] in the scene");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        check_body(scene, scene.bodies[k], fmt::format("body[{}]", k), problems);
    check_unique_names(scene.bodies, "body", problems);
    if (problems.errors().empty())
        check_number_of_points(scene, bounds.points, problems);
    if (problems.errors().empty())  // shapes are whole, and lie in the lattice
    {
        for (std::size_t k = 0; k < scene.bodies.size(); ++k)
            if (!scene.bodies[k].inside.empty())
                check_inclusion(scene, scene.bodies[k], fmt::format("body[{}]", k), problems);
        check_overlap(scene, problems);
    }
    check_unique_names(scene.boundaries, "boundary", problems);
    check_unique_names(scene.walls, "wall", problems);
    for (std::size_t k = 0; k < scene.walls.size(); ++k)
    {
        const std::string key = fmt::format("wall[{}]", k);
        const auto same = [&](const BoundarySpec& b) { return b.name == scene.walls[k].name; };
        if (std::any_of(scene.boundaries.begin(), scene.boundaries.end(), same))
            problems.add(key + ".name", fmt::format("'{}' is the name of a boundary, too", scene.walls[k].name));
        if (grid.cell_size > 0)
            check_wall(scene, scene.walls[k], key, problems);
    }
    check_unique_names(scene.tractions, "traction", problems);
    for (std::size_t k = 0; k < scene.tractions.size(); ++k)
        check_traction(scene, scene.tractions[k], fmt::format("traction[{}]", k), problems);
    for (std::size_t k = 0; k < scene.report.curves.size(); ++k)
        if (scene.report.curves[k].x.size() != scene.report.curves[k].y.size() || scene.report.curves[k].x.size() < 2)
            problems.add(fmt::format("report.curve[{}]", k), "x and y must have the same number of values, at least two");
    check_unique_names(scene.probes, "probe", problems);
    if (scene.output.history < 0)
        problems.add("output.history", "must not be negative");
    if (!(scene.output.checkpoint >= 0))
        problems.add("output.checkpoint", "must not be negative");
    if (scene.output.snapshots < 0 || scene.output.snapshots > 9999)
        problems.add("output.snapshots", "between 0 and 9999 is asked");
    if (!(scene.lpfdm.volume_cap == 0 || scene.lpfdm.volume_cap >= 1))
        problems.add("lpfdm.volume_cap", fmt::format("0 (no limit) or at least 1 is asked, not {}", scene.lpfdm.volume_cap));
    else if (scene.lpfdm.volume_cap > 0 && scene.lpfdm.support != LpfdmSpec::Support::point)
        problems.add("lpfdm.volume_cap", "only for support = \"point\"");
    if (scene.lpfdm.hourglass < 0 || scene.lpfdm.hourglass > 0.5)
        problems.add("lpfdm.hourglass", fmt::format("must lie in [0, 0.5], beyond that it is unstable at the critical time step; not {}",
                                                    scene.lpfdm.hourglass));
    if (scene.mpm.flip < 0 || scene.mpm.flip > 1)
        problems.add("mpm.flip", fmt::format("must lie in [0, 1], not {}", scene.mpm.flip));
    if (scene.mpm.strain == MpmSpec::Strain::b_bar && scene.mpm.shape != MpmSpec::Shape::linear)
        problems.add("mpm.strain", "b_bar averages over a cell and needs shape = \"linear\"");
    if (scene.mpm.xpic_order < 1 || scene.mpm.xpic_order > 20)
        problems.add("mpm.xpic_order", fmt::format("must lie in [1, 20], not {}", scene.mpm.xpic_order));
    if (scene.mpm.transfer == MpmSpec::Transfer::xpic && scene.mpm.flip != 1)
        problems.add("mpm.flip", "blends FLIP with PIC; transfer = \"xpic\" has no use for it");
    if (scene.mpm.null_space_filter != MpmSpec::Filter::none && scene.mpm.shape != MpmSpec::Shape::linear)
        problems.add("mpm.null_space_filter", "works cell by cell and needs shape = \"linear\"; for wider shapes take transfer = \"xpic\"");
    if (!(scene.mpm.mass_cutoff >= 0 && scene.mpm.mass_cutoff <= 0.25))
        problems.add("mpm.mass_cutoff", fmt::format("must lie in [0, 0.25], not {}", scene.mpm.mass_cutoff));
    if (scene.fem.degree != 1 && scene.fem.degree != 2)
        problems.add("fem.degree", fmt::format("1 or 2 is asked, not {}", scene.fem.degree));
    if (scene.fem.refinements < 0 || scene.fem.refinements > 10)
        problems.add("fem.refinements", "between 0 and 10 is asked");
}

void check_limits(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (scene.bodies[k].initial_stress && family_of(scene) == Family::fem)
            problems.warn(fmt::format("body[{}].initial_stress", k), "the FEM reference starts without stress: it is left out");
    if (scene.confinement && scene.confinement->pressure > 0)
        for (std::size_t k = 0; k < scene.bodies.size(); ++k)
            if (!scene.bodies[k].initial_stress)
                problems.warn(fmt::format("body[{}].initial_stress", k),
                              "missing: the confining pressure hits a body without stress at once");
    if (scene.confinement && family_of(scene) == Family::fem)
        problems.warn("confinement", "the FEM reference leaves it out, as it does the initial stress that balances it");
    if (!scene.tractions.empty() && family_of(scene) == Family::lpfdm && scene.lpfdm.support == LpfdmSpec::Support::domain)
        problems.warn("traction",
                      "domains reach into the cells outside a loaded face, and what they hold there may run away; use [confinement] "
                      "for a pressure, or lpfdm.support = \"point\"");
    const Family family = family_of(scene);
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        if (family == Family::fem && m.has_strength())
            problems.warn(fmt::format("material[{}].law", k), "the FEM reference is elastic: strength is left out");
        if (m.softening && m.softening->nonlocal && scene.grid.cell_size > 0.5 * m.softening->nonlocal->internal_length)
            problems.warn(fmt::format("material[{}].softening.nonlocal", k),
                          fmt::format("the cell size {} m does not resolve the internal length {} m: at most half of it is asked",
                                      scene.grid.cell_size, m.softening->nonlocal->internal_length));
        if (m.softening && m.softening->band_thickness && scene.grid.cell_size < *m.softening->band_thickness)
            problems.warn(fmt::format("material[{}].softening.band_thickness", k),
                          fmt::format("crack-band scaling needs cells at least as large as the band, {} m", *m.softening->band_thickness));
    }
    if (family == Family::mpm && scene.mpm.shape == MpmSpec::Shape::bspline)
    {
        const auto inside = [&](const Vec2& low, const Vec2& high)
        {
            const double slack = 1e-6 * scene.grid.cell_size;
            bool is_inside = true;
            for (std::size_t k = 0; k < 2; ++k)
                is_inside &= high[k] > scene.grid.origin[k] + slack && low[k] < scene.grid.origin[k] + scene.grid.size[k] - slack;
            return is_inside;
        };
        for (std::size_t k = 0; k < scene.walls.size(); ++k)
            if (inside(scene.walls[k].min, scene.walls[k].max))
                problems.warn(fmt::format("wall[{}]", k),
                              "quadratic B-splines are right at the edges of the lattice alone: at a wall inside it the "
                              "velocity that points see is not the wall's, and the first cells beside it are wrong");
    }
    const bool locks =
        (family == Family::mpm && scene.mpm.strain == MpmSpec::Strain::four_point) || (family == Family::fem && scene.fem.degree == 1);
    for (std::size_t k = 0; k < scene.materials.size() && locks; ++k)
        if (scene.materials[k].poissons_ratio > 0.45)
            problems.warn(fmt::format("material[{}].poissons_ratio", k),
                          fmt::format("{} locks when nearly incompressible (nu = {})", scene.method, scene.materials[k].poissons_ratio));
}
}  // namespace testbed
