#include "core/scene/checks.hpp"
#include "core/scene/geometry.hpp"

#include <algorithm>
#include <map>

namespace testbed
{
namespace
{
/// One body alone: its material, the keys that its shape needs and those that it has no use for, its place.
class BodyCheck
{
public:
    BodyCheck(const Scene& scene, const BodySpec& body, std::string key, Problems& problems)
        : scene_(scene),
          body_(body),
          key_(std::move(key)),
          problems_(problems)
    {
    }

    void run() const
    {
        check_material();
        if (body_.points_per_cell < 1 || body_.points_per_cell > 64)
            problems_.add(key_ + ".points_per_cell", fmt::format("between 1 and 64 per direction is asked, not {}", body_.points_per_cell));
        if (is_whole())
            check_place();
    }

private:
    void check_material() const
    {
        std::vector<std::string> names;
        for (const auto& m : scene_.materials)
            names.push_back(m.name);
        if (std::find(names.begin(), names.end(), body_.material) == names.end())
            problems_.add(key_ + ".material", fmt::format("no material '{}'", body_.material) + suggestion(body_.material, names));
    }

    void refuse(bool present, const char* name) const
    {
        if (present)
            problems_.add(key_ + "." + name, fmt::format("not used by shape '{}'", name_of(body_.shape)));
    }
    bool ask(bool present, const char* name) const
    {
        if (!present)
            problems_.add(key_ + "." + name, fmt::format("missing, shape '{}' needs it", name_of(body_.shape)));
        return present;
    }

    /// Whether the shape has an extent.
    bool is_whole() const
    {
        switch (body_.shape)
        {
        case BodySpec::Shape::box: return is_whole_box();
        case BodySpec::Shape::disk: return is_whole_disk();
        case BodySpec::Shape::polygon: return is_whole_polygon();
        }
        return false;
    }
    bool is_whole_box() const
    {
        const bool has_min = ask(body_.min.has_value(), "min"), has_max = ask(body_.max.has_value(), "max");
        refuse(body_.center.has_value(), "center");
        refuse(body_.radius.has_value(), "radius");
        refuse(!body_.vertices.empty(), "vertices");
        const bool known = has_min && has_max;
        const double cell_size = scene_.grid.cell_size;
        for (std::size_t k = 0; known && k < 2 && cell_size > 0; ++k)
            if (const double length = (*body_.max)[k] - (*body_.min)[k]; length <= 0)
                problems_.add(key_ + ".max", "must lie above and to the right of min");
            else if (body_.inside.empty() && !is_multiple(length, cell_size))
                problems_.add(key_ + ".max",
                              fmt::format("the extent {} m in {} is not a multiple of the cell size {} m", length, "xy"[k], cell_size));
        return known;
    }
    bool is_whole_disk() const
    {
        const bool has_center = ask(body_.center.has_value(), "center"), has_radius = ask(body_.radius.has_value(), "radius");
        refuse(body_.min.has_value(), "min");
        refuse(body_.max.has_value(), "max");
        refuse(!body_.vertices.empty(), "vertices");
        if (has_radius && *body_.radius <= 0)
            problems_.add(key_ + ".radius", "must be positive");
        return has_center && has_radius;
    }
    bool is_whole_polygon() const
    {
        refuse(body_.min.has_value(), "min");
        refuse(body_.max.has_value(), "max");
        refuse(body_.center.has_value(), "center");
        refuse(body_.radius.has_value(), "radius");
        const bool known = body_.vertices.size() >= 3;
        if (!known)
            problems_.add(key_ + ".vertices", "at least three corners are asked");
        else if (const auto edges = crossing_edges(body_.vertices))
            problems_.add(key_ + ".vertices", fmt::format("the edges after corners {} and {} cross", (*edges)[0] + 1, (*edges)[1] + 1));
        return known;
    }

    void check_place() const
    {
        const GridSpec& grid = scene_.grid;
        const auto [low, high] = extent(body_);
        const double slack = 1e-9 * grid.cell_size;
        for (std::size_t k = 0; k < 2; ++k)
            if (!(low[k] >= grid.origin[k] - slack && high[k] <= grid.origin[k] + grid.size[k] + slack))
                return problems_.add(key_, fmt::format("body '{}' spans {} = {} .. {} m, outside the lattice, {} .. {} m", body_.name,
                                                       "xy"[k], low[k], high[k], grid.origin[k], grid.origin[k] + grid.size[k]));
    }

    const Scene& scene_;
    const BodySpec& body_;
    std::string key_;
    Problems& problems_;
};

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
    const std::vector<Vec<2>> own = fill(scene, body);
    for (const BodySpec& other : scene.bodies)
    {
        if (&other == &body)
            break;
        if (other.inside != body.inside)
            continue;
        for (const Vec<2>& p : own)
            if (contains(other, p))
                return problems.add(key,
                                    fmt::format("inclusion '{}' overlaps inclusion '{}' at ({}, {}) m", body.name, other.name, p[0], p[1]));
    }
    for (const Vec<2>& corner : outline(body))
        if (!contains(host, corner, 1e-6 * scene.grid.cell_size))
            return problems.add(
                key, fmt::format("inclusion '{}' reaches ({}, {}) m, outside body '{}'", body.name, corner[0], corner[1], host.name));
}
}  // namespace

void check_bodies(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        BodyCheck(scene, scene.bodies[k], fmt::format("body[{}]", k), problems).run();
}

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

void check_inclusions(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (!scene.bodies[k].inside.empty())
            check_inclusion(scene, scene.bodies[k], fmt::format("body[{}]", k), problems);
}

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
    std::map<const BodySpec*, std::vector<Vec<2>>> filled;  // of those that are asked for, once
    const auto has_points_in = [&](const BodySpec& a, const BodySpec& b)
    {
        auto& points = filled[&a];
        if (points.empty())
            points = fill(scene, a);
        return std::any_of(points.begin(), points.end(), [&](const Vec<2>& p) { return contains(b, p, -slack); });
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
}  // namespace testbed
