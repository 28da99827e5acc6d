#include "core/scene/checks.hpp"
#include "core/scene/wall_path.hpp"

#include <algorithm>

namespace testbed
{
namespace
{
double slack(const GridSpec& grid)
{
    return 1e-6 * grid.cell_size;
}

bool reaches_out(const GridSpec& grid, const Vec<2>& min, const Vec<2>& max)
{
    bool out = false;
    for (std::size_t k = 0; k < 2; ++k)
        out |= min[k] < grid.origin[k] - slack(grid) || max[k] > grid.origin[k] + grid.size[k] + slack(grid);
    return out;
}

/// Whether a wall is a block or a plate in the lattice.
bool check_extent(const GridSpec& grid, const WallSpec& wall, const std::string& key, Problems& problems)
{
    if (wall.max[0] < wall.min[0] || wall.max[1] < wall.min[1] || (wall.max[0] == wall.min[0] && wall.max[1] == wall.min[1]))
        problems.add(key + ".max", "must lie above or to the right of min");
    else if (reaches_out(grid, wall.min, wall.max))
        problems.add(key, fmt::format("wall '{}' spans ({}, {}) .. ({}, {}) m, outside the lattice", wall.name, wall.min[0], wall.min[1],
                                      wall.max[0], wall.max[1]));
    else
        return true;
    return false;
}

/// Whether the nodes can follow the wall's faces.
bool check_faces(const GridSpec& grid, const WallSpec& wall, const std::string& key, Problems& problems)
{
    for (std::size_t k = 0; k < 2 && wall.motion == WallSpec::Motion::hand_off; ++k)
        for (const double face : {wall.min[k], wall.max[k]})
            if (const double cells = (face - grid.origin[k]) / grid.cell_size; std::abs(cells - std::round(cells)) > 1e-6)
            {
                problems.add(key, fmt::format("the face of wall '{}' at {} = {} m lies between lines of nodes; move it to a multiple of "
                                              "the cell size {} m, or set motion = \"smooth\"",
                                              wall.name, "xy"[k], face, grid.cell_size));
                return false;
            }
    for (std::size_t k = 0; k < 2 && wall.motion == WallSpec::Motion::smooth; ++k)
        if (const double width = wall.max[k] - wall.min[k]; width > 0 && width < 2 * grid.cell_size - slack(grid))
        {
            problems.add(key, fmt::format("wall '{}' is {} m wide: a smooth wall is a plate, or at least two cells, {} m, wide, so that "
                                          "its faces share no node",
                                          wall.name, width, 2 * grid.cell_size));
            return false;
        }
    return true;
}

void check_door(const GridSpec& grid, const WallSpec& wall, const std::string& key, Problems& problems)
{
    const std::size_t along = door_direction(wall);
    const auto [from, to] = *wall.door;
    if (from >= to)
        problems.add(key, "an opening [from, to] with from < to is asked");
    else if (from < wall.min[along] - slack(grid) || to > wall.max[along] + slack(grid))
        problems.add(key, fmt::format("the door spans {} .. {} m and is wider than its wall, {} .. {} m", from, to, wall.min[along],
                                      wall.max[along]));
    else if (to - from < 2 * grid.cell_size - slack(grid))
        problems.add(
            key, fmt::format("an opening of {} m has no free node: at least two cells, {} m, are asked", to - from, 2 * grid.cell_size));
}

void check_travel(const Scene& scene, const WallSpec& wall, const std::string& key, Problems& problems)
{
    try
    {
        const auto path = wall_path(wall, scene.expression_constants(), scene.time.end);
        for (std::size_t n = 0; n < path.size(); ++n)
            if (const Vec<2>& u = path[n];
                reaches_out(scene.grid, {wall.min[0] + u[0], wall.min[1] + u[1]}, {wall.max[0] + u[0], wall.max[1] + u[1]}))
                return problems.add(
                    key,
                    fmt::format("wall '{}' leaves the lattice at t = {:.4g} s, after a travel of ({:.4g}, {:.4g}) m; make the "
                                "lattice larger or the travel shorter",
                                wall.name, static_cast<double>(n) * scene.time.end / static_cast<double>(path.size() - 1), u[0], u[1]));
    }
    catch (const ExpressionError& e)
    {
        problems.add(key, e.what());
    }
}

void check_wall(const Scene& scene, const WallSpec& wall, const std::string& key, Problems& problems)
{
    if (!check_extent(scene.grid, wall, key, problems) || !check_faces(scene.grid, wall, key, problems))
        return;
    if (wall.door)
        check_door(scene.grid, wall, key + ".door", problems);
    if (wall.door_opens < 0)
        problems.add(key + ".door_opens", "must not be negative");
    if (scene.time.end > 0)
        check_travel(scene, wall, key + ".velocity", problems);
}
}  // namespace

void check_walls(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.walls.size(); ++k)
    {
        const std::string key = fmt::format("wall[{}]", k);
        const auto same = [&](const BoundarySpec& b) { return b.name == scene.walls[k].name; };
        if (std::any_of(scene.boundaries.begin(), scene.boundaries.end(), same))
            problems.add(key + ".name", fmt::format("'{}' is the name of a boundary, too", scene.walls[k].name));
        if (scene.grid.cell_size > 0)
            check_wall(scene, scene.walls[k], key, problems);
    }
}
}  // namespace testbed
