#pragma once
/// One step of LPFDM on cells of any shape, a function for each group of equations of Konagai & Johansson (2000), as lpfdm/equations.hpp
/// has them for squares. Sums go over points and cells in their order: the same bits for any number of threads.

#include "core/bodies/stress_runs.hpp"
#include "core/bodies/support.hpp"
#include "core/lattice/kinematics.hpp"
#include "core/lattice/nodes.hpp"
#include "lpfdm/mesh/mesh.hpp"
#include "lpfdm/options.hpp"

namespace testbed
{
/// The mesh with what lives on it.
struct MeshGrid
{
    Mesh mesh;
    std::vector<double> mass;  ///< M_j, eq. (7), of cells [kg/m]
    VectorField<3> stress;     ///< volume times stress beyond the confining pressure, of cells: A <sigma>, eq. (8) [N]
    VectorField<4> gradient;   ///< eq. (5), of cells, of the increment over a step [-]
    Nodes<2> nodes;
    std::vector<double> mass_before;  ///< of nodes, in the step before [kg/m]

    explicit MeshGrid(Mesh m) : mesh(std::move(m)), mass(mesh.cells()), nodes(mesh.nodes()), mass_before(mesh.nodes())
    {
        for (auto& values : stress)
            values.resize(mesh.cells());
        for (auto& values : gradient)
            values.resize(mesh.cells());
    }
    Gradient<2> gradient_at(std::size_t c) const { return tensor_of<Gradient<2>>(at(gradient, c)); }
    /// kernel(n) for the nodes in use.
    template <class Kernel>
    void for_each_node(Kernel&& kernel) const
    {
        const auto& active = nodes.active();
        parallel_for(
            active.size(), [&](std::size_t a) TESTBED_NOINLINE { kernel(active[a]); }, 64);
    }
    std::size_t bytes() const { return mesh.bytes() + nodes.bytes() + (8 * mass.capacity() + mass_before.capacity()) * sizeof(double); }
};

/// Numbers of the cells of points, by body.
using CellsOfPoints = std::vector<std::vector<std::uint32_t>>;

/// f(body, its number, point, cell) for all points in their order.
template <class F>
void for_each_point(const std::vector<Body>& bodies, const CellsOfPoints& cells, F&& f)
{
    for (std::size_t b = 0; b < bodies.size(); ++b)
        for (std::size_t p = 0; p < bodies[b].points.count; ++p)
            f(bodies[b], b, p, cells[b][p]);
}

/// The cell of each point of a body. @throws Diverged when one has left the mesh
inline void find_points(const Mesh& mesh, const Body& body, std::vector<std::uint32_t>& cells)
{
    constexpr std::uint32_t none = ~std::uint32_t{0};
    cells.resize(body.points.count);
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     for (std::size_t p = bins[b].begin; p < bins[b].end; ++p)
                         cells[p] = mesh.find(bins[b].at, at(body.points.x, p)).value_or(none);
                 });
    if (const auto lost = std::find(cells.begin(), cells.end(), none); lost != cells.end())
    {
        const auto p = static_cast<std::size_t>(lost - cells.begin());
        throw Diverged(fmt::format("point {} left the mesh: position ({:.6g}, {:.6g}) m", body.points.id[p], body.points.x[0][p],
                                   body.points.x[1][p]));
    }
}

/// Eqs. (7), (8): mass and stress of each cell.
inline void cell_averages(MeshGrid& grid, const std::vector<Body>& bodies, const CellsOfPoints& cells)
{
    std::fill(grid.mass.begin(), grid.mass.end(), 0.0);
    for (auto& values : grid.stress)
        std::fill(values.begin(), values.end(), 0.0);
    for_each_point(bodies, cells,
                   [&](const Body& body, std::size_t, std::size_t p, std::uint32_t c)
                   {
                       const Points<2>& q = body.points;
                       const double volume = std::min(q.volume[p], body.counted_volume);
                       grid.mass[c] += q.mass;
                       for (std::size_t k = 0; k < 3; ++k)
                           grid.stress[k][c] += volume * (q.stress[k][p] + (k < 2 ? body.confinement : 0.0));
                   });
}

/// The nodes of cells with points are those in use. Returns those that no longer are: they keep their velocity until reach_nodes().
inline std::vector<std::uint32_t> use_nodes(MeshGrid& grid)
{
    std::vector<std::uint32_t> used, left;
    for (std::uint32_t n = 0; n < grid.mesh.nodes(); ++n)
        if (const auto around = grid.mesh.around(n);
            std::any_of(around.begin(), around.end(), [&](const Mesh::Around& a) { return grid.mass[a.cell] > 0; }))
            used.push_back(n);
    const auto& before = grid.nodes.active();
    if (used != before)
    {
        std::set_difference(before.begin(), before.end(), used.begin(), used.end(), std::back_inserter(left));
        grid.nodes.set_active(std::move(used));
    }
    return left;
}

/// Eqs. (9), (10): an equal part of the mass of the cells around a node, and their forces.
inline void nodal_forces(MeshGrid& grid)
{
    grid.for_each_node(
        [&](std::size_t n)
        {
            double mass = 0;
            Vec<2> f{0, 0};
            for (const auto& [c, corner] : grid.mesh.around(n))
            {
                const Vec<2>& slope = grid.mesh.slopes(c)[corner];
                const double scale = 1 / grid.mesh.area(c);
                const SymTensor<2> s = tensor_of<SymTensor<2>>(at(grid.stress, c));
                mass += grid.mass[c] / static_cast<double>(grid.mesh.corners(c).size());
                f[0] -= scale * (s.xx * slope[0] + s.xy * slope[1]);
                f[1] -= scale * (s.xy * slope[0] + s.yy * slope[1]);
            }
            grid.nodes.mass[n] = mass;
            set(grid.nodes.f, n, f);
        });
}

/// Eq. (4b), in the form that follows from (4a): gradient of the increment over dt in each cell with points.
inline void cell_gradients(MeshGrid& grid, double dt)
{
    parallel_for(
        grid.mesh.cells(),
        [&](std::size_t c) TESTBED_NOINLINE
        {
            if (!(grid.mass[c] > 0))
                return;
            Gradient<2> g;
            const auto corners = grid.mesh.corners(c);
            for (std::size_t k = 0; k < corners.size(); ++k)
            {
                const Vec<2> v = at(grid.nodes.v, corners[k]);
                const Vec<2>& slope = grid.mesh.slopes(c)[k];
                g.xx += v[0] * slope[0];
                g.xy += v[0] * slope[1];
                g.yx += v[1] * slope[0];
                g.yy += v[1] * slope[1];
            }
            const double scale = dt / grid.mesh.area(c);
            set(grid.gradient, c, std::array<double, 4>{scale * g.xx, scale * g.yy, scale * g.xy, scale * g.yx});
        },
        64);
}

/// Nodes that material reaches for the first time take the mean velocity, by mass, of the nodes of the cells around them that had mass
/// before, or start from zero, as printed. Nodes that it left are then cleared.
inline void reach_nodes(MeshGrid& grid, const std::vector<std::uint32_t>& left, const Step& step, LpfdmSpec::Frontier kind)
{
    std::vector<std::pair<std::uint32_t, Vec<2>>> reached;
    for (const auto n : grid.nodes.active())
    {
        if (grid.mass_before[n] > 0 || step.is_first() || kind == LpfdmSpec::Frontier::literal)
            continue;
        std::vector<std::uint32_t> near;
        for (const auto& around : grid.mesh.around(n))
            for (const auto other : grid.mesh.corners(around.cell))
                if (grid.mass_before[other] > 0)
                    near.push_back(other);
        std::sort(near.begin(), near.end());
        near.erase(std::unique(near.begin(), near.end()), near.end());
        double mass = 0;
        Vec<2> momentum{0, 0};
        for (const auto other : near)
        {
            mass += grid.nodes.mass[other];
            for (std::size_t d = 0; d < 2; ++d)
                momentum[d] += grid.nodes.mass[other] * grid.nodes.v[d][other];
        }
        if (mass > 0)
            reached.push_back({n, {momentum[0] / mass, momentum[1] / mass}});
    }
    for (const auto& [n, v] : reached)
        set(grid.nodes.v, n, v);
    for (const auto n : left)
    {
        grid.nodes.clear(n);
        grid.mass_before[n] = 0;
    }
}

/// Eq. (13) as printed, with the gradient of the cell that holds the departure point x_k - du, none if that is empty. On the side between
/// two cells it is the mean of theirs.
inline void convect(MeshGrid& grid, double dt)
{
    constexpr double on_side = -1e-12;
    grid.for_each_node(
        [&](std::size_t n)
        {
            const Vec<2> v = at(grid.nodes.v, n), du{dt * v[0], dt * v[1]}, from = grid.mesh.place(n);
            const Vec<2> departure{from[0] - du[0], from[1] - du[1]};
            Gradient<2> g;
            int cells = 0;
            for (const auto& [c, corner] : grid.mesh.around(n))
            {
                const auto x = grid.mesh.places(c);
                const Vec<2>&next = x[(corner + 1) % x.size()], &last = x[(corner + x.size() - 1) % x.size()];
                const double reach = on_side * grid.mesh.area(c);
                if (!(grid.mass[c] > 0) || twice_area(from, next, departure) < reach || twice_area(from, departure, last) < reach)
                    continue;
                g += grid.gradient_at(c);
                ++cells;
            }
            if (cells == 0)
                return;
            const double share = 1.0 / cells;
            grid.nodes.v[0][n] -= share * (v[0] * g.xx + v[1] * g.xy);
            grid.nodes.v[1][n] -= share * (v[0] * g.yx + v[1] * g.yy);
        });
}

/// Velocity in a cell, eq. (6).
inline Vec<2> velocity_at(const MeshGrid& grid, std::uint32_t c, const Vec<2>& x, std::vector<double>& weights)
{
    polygon_weights(grid.mesh.places(c), x, weights);
    Vec<2> v{0, 0};
    for (std::size_t k = 0; k < weights.size(); ++k)
        for (std::size_t d = 0; d < 2; ++d)
            v[d] += weights[k] * grid.nodes.v[d][grid.mesh.corners(c)[k]];
    return v;
}

/// Marks the bins that a point left.
inline void mark_bins(const Lattice<2>& lattice, Body& body)
{
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     const BinFrame<2> frame(lattice, bins[b]);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Corner<2> c = frame.template corner<PointSupport>(body.points, p, lanes);
                                       if (lanes.any(frame.template left<PointSupport>(body.points, p, lanes, c)))
                                           body.bins.mark(b);
                                   });
                 });
}

/// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6), for the points of a body.
/// @param lattice whose cells are the bins
inline void move_points(const MeshGrid& grid, const Lattice<2>& lattice, Body& body, const std::vector<std::uint32_t>& cells, double dt)
{
    constexpr std::size_t together = 128;
    Points<2>& q = body.points;
    parallel_for((q.count + together - 1) / together,
                 [&](std::size_t run) TESTBED_NOINLINE
                 {
                     const std::size_t begin = run * together, end = std::min(q.count, begin + together);
                     Increments increments;
                     std::vector<double> weights;
                     increments.begin(end - begin);
                     for (std::size_t p = begin; p < end; ++p)
                         increments.store(p - begin, SomeLanes(1), Pack(1.0) * grid.gradient_at(cells[p]));
                     update_stress(body, begin, end, increments);
                     for (std::size_t p = begin; p < end; ++p)
                     {
                         q.volume[p] *= 1 + grid.gradient_at(cells[p]).trace();
                         const Vec<2> v = velocity_at(grid, cells[p], at(q.x, p), weights);
                         for (std::size_t d = 0; d < 2; ++d)
                             q.x[d][p] += dt * v[d];
                     }
                 },
                 8);
    mark_bins(lattice, body);
}

/// Adds a quantity of the points to the nodes, an equal part to each corner of their cells.
/// @param quantity (body, its number, point) -> array of numbers
template <std::size_t n, class Quantity>
void spread_to_nodes(const Mesh& mesh, const std::vector<Body>& bodies, const CellsOfPoints& cells, Quantity&& quantity,
                     VectorField<n>& sums)
{
    for_each_point(bodies, cells,
                   [&](const Body& body, std::size_t b, std::size_t p, std::uint32_t c)
                   {
                       const auto corners = mesh.corners(c);
                       const std::array<double, n> value = quantity(body, b, p);
                       for (const auto corner : corners)
                           for (std::size_t d = 0; d < n; ++d)
                               sums[d][corner] += value[d] / static_cast<double>(corners.size());
                   });
}
}  // namespace testbed
