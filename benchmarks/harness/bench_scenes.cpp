#include "benchmarks/harness/bench_scenes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
using Settings = std::vector<std::string>;

/// Cells along a side of a square with so many points.
double cells_of_square(double points, int points_per_cell)
{
    return std::max(1.0, std::round(std::sqrt(points) / points_per_cell));
}
/// A multiple of five, as the size of some lattices asks for.
double fives_of_square(double points, int points_per_cell)
{
    return 5 * std::max(1.0, std::round(std::sqrt(points) / points_per_cell / 5));
}
Settings with(int points_per_cell, const std::string& size)
{
    return {fmt::format("constants.ppc={}", points_per_cell), size};
}
std::string cell_size(double L)
{
    return fmt::format("grid.cell_size={:.17g}", L);
}

Settings block(double points, int points_per_cell)
{
    return with(points_per_cell, fmt::format("constants.cells={}", cells_of_square(points, points_per_cell)));
}
/// The section of the cliff is 461 m2; its width of 50 m is a whole number of cells.
Settings cliff(double points, int points_per_cell)
{
    const double across = points_per_cell * std::sqrt(461 / points), L = 50 / std::max(1.0, std::round(50 / across / 5)) / 5;
    Settings settings = with(points_per_cell, cell_size(L));
    settings.push_back(fmt::format("time.dt={:.17g}", 5e-4 * L));
    return settings;
}
/// Two squares of the width a, one on the other.
Settings dam_break(double points, int points_per_cell)
{
    return with(points_per_cell, fmt::format("grid.cell_size=a/{}", fives_of_square(points / 2, points_per_cell)));
}
/// Two squares of the height of 0.1 m beside each other.
Settings collapse(double points, int points_per_cell)
{
    return with(points_per_cell, cell_size(0.1 / fives_of_square(points / 2, points_per_cell)));
}
/// 20 m by 20 m, and the door of 2 m is a whole number of cells.
Settings trapdoor(double points, int points_per_cell)
{
    const double L = 1 / std::max(1.0, std::round(cells_of_square(points, points_per_cell) / 20));
    Settings settings = with(points_per_cell, cell_size(L));
    settings.push_back(fmt::format("time.dt={:.17g}", 5e-4 * L));
    return settings;
}

constexpr std::array<BenchScene, 5> scenes{{
    {"block", "elastic/speed/scene.toml", "elastic", block, 0, {}},
    {"cliff", "soil/cliff/scene.toml", "mohr_coulomb", cliff, 0, {}},
    {"dam_break", "soil/dam_break/scene.toml", "mohr_coulomb", dam_break, 0.1, BenchScene::Own{3200, 2}},
    {"collapse", "soil/granular_collapse/scene.toml", "mohr_coulomb", collapse, 0.1, BenchScene::Own{20000, 2}},
    {"trapdoor", "soil/trapdoor/scene.toml", "mohr_coulomb", trapdoor, 1, BenchScene::Own{6400, 4}},
}};
}  // namespace

std::span<const BenchScene> bench_scenes()
{
    return scenes;
}

std::vector<std::string> bench_scene_names()
{
    std::vector<std::string> names;
    for (const BenchScene& scene : scenes)
        names.emplace_back(scene.name);
    return names;
}
}  // namespace testbed
