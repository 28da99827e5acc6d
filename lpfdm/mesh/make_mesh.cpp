#include "lpfdm/mesh/make_mesh.hpp"

#include "core/bodies/body.hpp"
#include "core/bodies/random_field.hpp"
#include "core/scene/reader.hpp"
#include "lpfdm/options.hpp"

#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <set>

namespace testbed
{
namespace
{
using Cells = LpfdmSpec::Cells;
constexpr double nowhere = std::numeric_limits<double>::quiet_NaN();

std::vector<Vec<2>> places_of(const Lattice<2>& lattice)
{
    std::vector<Vec<2>> places(lattice.nodes());
    for (std::size_t n = 0; n < places.size(); ++n)
        places[n] = lattice.node_position(n);
    return places;
}

/// Which nodes must stay where they are: at the edges of the lattice, of supports and of walls.
std::vector<char> held_nodes(const Scene& scene, const Lattice<2>& lattice)
{
    std::vector<char> held(lattice.nodes(), 1);
    for_each_index(all<2>(1), lattice.size, [&](const Index<2>& n) { held[lattice.node(n)] = 0; });
    NodeOps ops(scene, lattice);
    ops.begin_step({0, 0, 0});
    for (const Restraint& restraint : ops.restraints())
        for (const ComponentRestraint& component : restraint.components)
        {
            for (const Index<2>& n : component.nodes)
                held[lattice.node(n)] = 1;
            for (const FacePair& pair : component.pairs)
                held[lattice.node(pair.low)] = held[lattice.node(pair.high)] = 1;
        }
    return held;
}

/// Moves each node that may move by up to `most` in each direction, evenly distributed [m]. Streams 0 and 1 are those of random strength.
void shake(std::vector<Vec<2>>& places, const std::vector<char>& held, double most, int seed)
{
    for (std::size_t n = 0; n < places.size(); ++n)
        for (std::uint64_t d = 0; d < 2; ++d)
            if (!held[n])
                places[n][d] += most * std::erf(standard_normal(static_cast<std::uint64_t>(seed), 2 + d, n) / std::numbers::sqrt2);
}

MeshCells cells_of(const Lattice<2>& lattice, Cells kind)
{
    MeshCells cells;
    for_each_index(all<2>(0), lattice.size,
                   [&](const Index<2>& at)
                   {
                       const auto node = [&](int i, int j) { return static_cast<std::uint32_t>(lattice.node(at + Index<2>{i, j})); };
                       const std::uint32_t a = node(0, 0), b = node(1, 0), c = node(1, 1), d = node(0, 1);
                       if (kind == Cells::quadrilaterals)
                           return cells.push_back({a, b, c, d});
                       cells.push_back({a, b, c});
                       cells.push_back({a, c, d});
                   });
    return cells;
}

/// A mesh file as `testbed mesh` writes it: nodes = [[x, y], ...] [m], cells = [[node, ...], ...], numbers from zero.
class MeshFile
{
public:
    explicit MeshFile(const std::string& path) : path_(path), table_(parse_toml(read_text(path), path)) {}

    std::vector<Vec<2>> nodes() const
    {
        std::vector<Vec<2>> places;
        for (const toml::array* row : rows("nodes"))
        {
            const auto x = row->size() == 2 ? (*row)[0].value<double>() : std::nullopt, y = x ? (*row)[1].value<double>() : std::nullopt;
            if (!y || !std::isfinite(*x) || !std::isfinite(*y))
                refuse(*row, "a node is two numbers, [x, y] in m");
            places.push_back({*x, *y});
        }
        return places;
    }
    MeshCells cells() const
    {
        MeshCells cells;
        for (const toml::array* row : rows("cells"))
        {
            std::vector<std::uint32_t>& corners = cells.emplace_back();
            for (const toml::node& corner : *row)
            {
                const auto number = corner.value_exact<std::int64_t>();
                if (!number || *number < 0 || *number >= std::int64_t{1} << 31)
                    refuse(*row, "a cell is a list of numbers of nodes, from zero");
                corners.push_back(static_cast<std::uint32_t>(*number));
            }
        }
        return cells;
    }

private:
    std::vector<const toml::array*> rows(const char* key) const
    {
        const toml::array* list = table_[key].as_array();
        if (!list || list->empty())
            throw SceneError(fmt::format("{}: {}: a list of lists is asked", path_, key));
        std::vector<const toml::array*> rows;
        for (const toml::node& row : *list)
        {
            if (!row.is_array())
                refuse(row, fmt::format("{}: a list of lists is asked", key));
            rows.push_back(row.as_array());
        }
        return rows;
    }
    [[noreturn]] void refuse(const toml::node& at, const std::string& why) const
    {
        throw SceneError(fmt::format("{}:{}: {}", path_, at.source().begin.line, why));
    }

    std::string path_;
    toml::table table_;
};

/// Sides that have a cell on one side only, as their nodes.
std::vector<std::pair<std::uint32_t, std::uint32_t>> edges_of(const Mesh& mesh)
{
    std::set<std::pair<std::uint32_t, std::uint32_t>> sides;
    for (std::size_t c = 0; c < mesh.cells(); ++c)
        for (std::size_t k = 0, n = mesh.corners(c).size(); k < n; ++k)
            sides.emplace(mesh.corners(c)[k], mesh.corners(c)[(k + 1) % n]);
    std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
    std::copy_if(sides.begin(), sides.end(), std::back_inserter(edges),
                 [&](const auto& s) {
                     return !sides.contains({s.second, s.first});
                 });
    return edges;
}

/// Cells that meet have whole sides in common, and none lies over another: no node lies on a side of the mesh's edge, and no place of some
/// in a cell in another one. @throws std::invalid_argument
void check_that_cells_fit(const Mesh& mesh, double L)
{
    std::set<std::uint32_t> at_edge;
    const auto edges = edges_of(mesh);
    for (const auto& [a, b] : edges)
        at_edge.insert({a, b});
    for (const auto& [a, b] : edges)
    {
        const Vec<2>&from = mesh.place(a), &to = mesh.place(b);
        const Side side(from, to);
        const double length = std::hypot(to[0] - from[0], to[1] - from[1]);
        for (const auto n : at_edge)
        {
            const Vec<2>& x = mesh.place(n);
            const double along = ((x[0] - from[0]) * (to[0] - from[0]) + (x[1] - from[1]) * (to[1] - from[1])) / length;
            if (n != a && n != b && std::abs(side.distance(x)) < 1e-6 * L && along > -1e-6 * L && along < length + 1e-6 * L)
                throw std::invalid_argument(fmt::format(
                    "two cells meet at ({:.6g}, {:.6g}) m without a node in common: cells side by side need the same nodes there "
                    "(in Gmsh: Coherence, or BooleanFragments)",
                    x[0], x[1]));
        }
    }
    for (std::size_t c = 0; c < mesh.cells(); ++c)
        if (const auto other = mesh.over(c))
            throw std::invalid_argument(fmt::format("cells {} and {} lie over each other near ({:.6g}, {:.6g}) m", c, *other,
                                                    mesh.places(c)[0][0], mesh.places(c)[0][1]));
}

NumberedMesh read_mesh(const Scene& scene, const std::string& name)
{
    const std::string path = (std::filesystem::path(scene.path).parent_path() / name).string();
    const MeshFile file(path);
    const std::vector<Vec<2>> listed = file.nodes();
    MeshCells cells = file.cells();
    const Lattice<2> numbers({0, 0}, scene.grid.cell_size, {static_cast<int>(listed.size()) - 1, 0});
    std::vector<Vec<2>> places(numbers.nodes(), {nowhere, nowhere});
    const auto number = [&](std::uint32_t k) { return static_cast<std::uint32_t>(numbers.node({static_cast<int>(k), 0})); };
    for (std::uint32_t k = 0; k < listed.size(); ++k)
        places[number(k)] = listed[k];
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (auto& corner : cells[c])
        {
            if (corner >= listed.size())
                throw SceneError(fmt::format("{}: cell {} has node {}; the last one is {}", path, c, corner, listed.size() - 1));
            corner = number(corner);
        }
    try
    {
        Mesh mesh(std::move(places), cells, make_lattice(scene.grid));
        check_that_cells_fit(mesh, scene.grid.cell_size);
        return {numbers, std::move(mesh)};
    }
    catch (const std::invalid_argument& e)
    {
        throw SceneError(fmt::format("{}: {}", path, e.what()));
    }
}
}  // namespace

NumberedMesh make_mesh(const Scene& scene)
{
    const auto& lpfdm = scene.options<LpfdmSpec>();
    if (lpfdm.cells == Cells::file)
        return read_mesh(scene, lpfdm.mesh);
    const Lattice<2> lattice = make_lattice(scene.grid);
    std::vector<Vec<2>> places = places_of(lattice);
    if (lpfdm.shake > 0)
        shake(places, held_nodes(scene, lattice), lpfdm.shake * lattice.cell_size, lpfdm.shake_seed);
    return {lattice, Mesh(std::move(places), cells_of(lattice, lpfdm.cells), lattice)};
}

NodeOps node_ops_of(const Scene& scene, const NumberedMesh& mesh)
{
    if (scene.options<LpfdmSpec>().cells != Cells::file)
        return {scene, mesh.numbers};  // what is shaken is not held
    std::vector<Vec<2>> places(mesh.mesh.nodes());
    for (std::size_t n = 0; n < places.size(); ++n)
        places[n] = mesh.mesh.around(n).empty() ? Vec<2>{nowhere, nowhere} : mesh.mesh.place(n);
    return {scene, mesh.numbers, places};
}
}  // namespace testbed
