#include "fem_reference/mesh.hpp"

#include "core/bodies/body.hpp"
#include "core/scene/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <numbers>

namespace testbed
{
namespace
{
using Cell = std::pair<int, int>;  ///< row, column

void check_box_on_lattice(const Scene& scene, const BodySpec& body, const Lattice<2>& lattice)
{
    for (const Vec<2>& corner : {*body.min, *body.max})
        for (std::size_t k = 0; k < 2; ++k)
        {
            const double cells = (corner[k] - lattice.origin[k]) / lattice.cell_size;
            if (std::abs(cells - std::round(cells)) > 1e-6)
                throw SceneError(fmt::format("{}: body '{}': its corner ({}, {}) m is off the lines of the FEM mesh, which start "
                                             "at the corner of the first box and are grid.cell_size = {} m apart; move the corner or "
                                             "change the cell size",
                                             scene.path, body.name, corner[0], corner[1], lattice.cell_size));
        }
}

/// Area of a polygon by its corners, pi R^2 of a disk [m^2].
double area(const BodySpec& body)
{
    if (body.shape == BodySpec::Shape::disk)
        return std::numbers::pi * *body.radius * *body.radius;
    double twice = 0;
    const auto& v = body.vertices;
    for (std::size_t k = 0, last = v.size() - 1; k < v.size(); last = k++)
        twice += v[last][0] * v[k][1] - v[k][0] * v[last][1];
    return 0.5 * std::abs(twice);
}

/// Cells of one body: its points, were there one per cell, stand at their centres.
std::vector<Cell> covered_cells(const Scene& coarse, const BodySpec& body, const Lattice<2>& lattice)
{
    std::vector<Cell> cells;
    for (const Vec<2>& centre : fill(coarse, body))
    {
        const int i = static_cast<int>(std::floor((centre[0] - lattice.origin[0]) / lattice.cell_size));
        const int j = static_cast<int>(std::floor((centre[1] - lattice.origin[1]) / lattice.cell_size));
        cells.emplace_back(j, i);
    }
    if (cells.empty())
        throw SceneError(
            fmt::format("{}: body '{}' holds the centre of no lattice cell; make grid.cell_size smaller", coarse.path, body.name));
    return cells;
}

std::map<Cell, unsigned int> bodies_by_cell(const Scene& scene, const Lattice<2>& lattice, const Warn& warn)
{
    Scene coarse = scene;
    coarse.grid = {lattice.origin, {lattice.size[0] * lattice.cell_size, lattice.size[1] * lattice.cell_size}, lattice.cell_size};
    for (BodySpec& body : coarse.bodies)
        body.points_per_cell = 1;
    std::map<Cell, unsigned int> owner;
    for (unsigned int b = 0; b < scene.bodies.size(); ++b)
    {
        const BodySpec& body = scene.bodies[b];
        if (body.shape == BodySpec::Shape::box)
            check_box_on_lattice(scene, body, lattice);
        const std::vector<Cell> cells = covered_cells(coarse, coarse.bodies[b], lattice);
        for (const Cell& cell : cells)
            if (const auto [at, is_new] = owner.emplace(cell, b); !is_new)
                throw SceneError(fmt::format("{}: body '{}' overlaps body '{}' in the lattice cell at ({}, {}) m; FEM cells belong to one "
                                             "body",
                                             scene.path, body.name, scene.bodies[at->second].name,
                                             lattice.origin[0] + cell.second * lattice.cell_size,
                                             lattice.origin[1] + cell.first * lattice.cell_size));
        if (body.shape != BodySpec::Shape::box)
            warn(fmt::format("body '{}': the FEM mesh is made of whole lattice cells, so its boundary is stepped and its area is "
                             "{:.4g} m^2 instead of {:.4g} m^2",
                             body.name, static_cast<double>(cells.size()) * lattice.cell_size * lattice.cell_size, area(body)));
    }
    return owner;
}
}  // namespace

Lattice<2> mesh_lattice(const Scene& scene)
{
    const Lattice<2> lattice = make_lattice(scene.grid);
    const auto box =
        std::find_if(scene.bodies.begin(), scene.bodies.end(), [](const BodySpec& body) { return body.shape == BodySpec::Shape::box; });
    if (box == scene.bodies.end())
        return lattice;
    Vec<2> origin = lattice.origin;
    Index<2> cells = lattice.size;
    for (std::size_t k = 0; k < 2; ++k)
    {
        const double place = ((*box->min)[k] - lattice.origin[k]) / lattice.cell_size;
        const double part = place - std::floor(place + 1e-6);
        if (part < 1e-6)
            continue;
        origin[k] += (part - 1) * lattice.cell_size;
        ++cells[k];
    }
    return {origin, lattice.cell_size, cells};
}

void make_mesh(const Scene& scene, const Lattice<2>& lattice, const Warn& warn, dealii::Triangulation<2>& mesh)
{
    std::vector<dealii::Point<2>> vertices;
    std::map<Cell, unsigned int> vertex_at;
    const auto vertex = [&](int j, int i)
    {
        const auto [at, is_new] = vertex_at.emplace(Cell{j, i}, static_cast<unsigned int>(vertices.size()));
        if (is_new)
            vertices.emplace_back(lattice.origin[0] + i * lattice.cell_size, lattice.origin[1] + j * lattice.cell_size);
        return at->second;
    };
    std::vector<dealii::CellData<2>> cells;
    for (const auto& [cell, body] : bodies_by_cell(scene, lattice, warn))
    {
        const auto [j, i] = cell;
        dealii::CellData<2> data(4);
        data.vertices = {vertex(j, i), vertex(j, i + 1), vertex(j + 1, i), vertex(j + 1, i + 1)};
        data.material_id = body;
        cells.push_back(std::move(data));
    }
    mesh.create_triangulation(vertices, cells, dealii::SubCellData());
    mesh.refine_global(static_cast<unsigned int>(scene.options<FemSpec>().refinements));
}
}  // namespace testbed
