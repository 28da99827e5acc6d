#pragma once
/// The fixed square lattice. Cell (i, j) has its nodes [1] (i, j), [2] (i+1, j), [3] (i, j+1), [4] (i+1, j+1).

#include "core/base/parallel.hpp"
#include "core/base/simd.hpp"
#include "core/base/types.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <tuple>
#include <vector>

namespace testbed
{
/// A node by its column and line, whatever its number; ordered as nodes are numbered, line by line.
struct NodeIndex
{
    int i, j;
    bool operator==(const NodeIndex&) const = default;
    friend auto operator<=>(const NodeIndex& a, const NodeIndex& b) { return std::tie(a.j, a.i) <=> std::tie(b.j, b.i); }
};

/// Cells [i0, i1) x [j0, j1).
struct CellBox
{
    int i0, j0, i1, j1;
    bool operator==(const CellBox&) const = default;
    void extend(const CellBox& other)
    {
        *this = {std::min(i0, other.i0), std::min(j0, other.j0), std::max(i1, other.i1), std::max(j1, other.j1)};
    }
};
inline constexpr CellBox no_cells{std::numeric_limits<int>::max(), std::numeric_limits<int>::max(), std::numeric_limits<int>::min(),
                                  std::numeric_limits<int>::min()};

/// Numbers go to the cells and nodes of a part of the lattice, row by row; the arrays of a method have room for no others. One ring of
/// cells around that part takes what a point's box spreads over the edge of the lattice, and a second, always empty one lets every node of
/// the first look at four cells.
struct Lattice
{
    Vec2 origin;
    double cell_size;         ///< L [m]
    double cells_per_length;  ///< 1/L, without a division for each bin [1/m]
    int nx, ny;               ///< cells
    CellBox numbered;         ///< without the rings

    /// All of it is numbered.
    Lattice(const Vec2& corner, double L, int columns, int rows)
        : origin(corner),
          cell_size(L),
          cells_per_length(1 / L),
          nx(columns),
          ny(rows),
          numbered{0, 0, columns, rows}
    {
    }
    /// Which part is numbered.
    template <class Archive>
    void state(Archive& a)
    {
        a.group("numbered",
                [&]
                {
                    a.value("i0", "-", numbered.i0);
                    a.value("j0", "-", numbered.j0);
                    a.value("i1", "-", numbered.i1);
                    a.value("j1", "-", numbered.j1);
                });
    }
    std::size_t cell_stride() const { return static_cast<std::size_t>(numbered.i1 - numbered.i0) + 4; }
    std::size_t node_stride() const { return static_cast<std::size_t>(numbered.i1 - numbered.i0) + 3; }
    std::size_t cell(int i, int j) const
    {
        return static_cast<std::size_t>(i - numbered.i0 + 2) + static_cast<std::size_t>(j - numbered.j0 + 2) * cell_stride();
    }
    std::size_t node(int i, int j) const
    {
        return static_cast<std::size_t>(i - numbered.i0 + 1) + static_cast<std::size_t>(j - numbered.j0 + 1) * node_stride();
    }
    std::size_t cells() const { return cell_stride() * (static_cast<std::size_t>(numbered.j1 - numbered.j0) + 4); }
    std::size_t nodes() const { return node_stride() * (static_cast<std::size_t>(numbered.j1 - numbered.j0) + 3); }
    bool has_node(int i, int j) const
    {
        return i >= numbered.i0 - 1 && i <= numbered.i1 + 1 && j >= numbered.j0 - 1 && j <= numbered.j1 + 1;
    }
    bool has_cell(int i, int j) const
    {
        return i >= numbered.i0 - 2 && i <= numbered.i1 + 1 && j >= numbered.j0 - 2 && j <= numbered.j1 + 1;
    }
    int cell_i(std::size_t c) const { return static_cast<int>(c % cell_stride()) - 2 + numbered.i0; }
    int cell_j(std::size_t c) const { return static_cast<int>(c / cell_stride()) - 2 + numbered.j0; }
    int node_i(std::size_t n) const { return static_cast<int>(n % node_stride()) - 1 + numbered.i0; }
    int node_j(std::size_t n) const { return static_cast<int>(n / node_stride()) - 1 + numbered.j0; }
    Vec2 node_position(const NodeIndex& n) const { return {origin[0] + n.i * cell_size, origin[1] + n.j * cell_size}; }
    Vec2 node_position(std::size_t n) const { return node_position(NodeIndex{node_i(n), node_j(n)}); }
};

/// Nothing but the rings around no cells has a number.
inline Lattice without_numbers(Lattice lattice)
{
    lattice.numbered = {0, 0, 0, 0};
    return lattice;
}

/// The lattice with numbers for a box, which may reach over its edges as far as supports do. The same one if it has them already; else for
/// a margin around the box, too, so that points may go some way before it changes again: arrays take no room where the lattice is empty.
inline Lattice with_numbers_for(const Lattice& lattice, CellBox reach)
{
    reach.i1 = std::min(reach.i1, lattice.nx + 1);  // nodes have one line more than cells have columns
    reach.j1 = std::min(reach.j1, lattice.ny + 1);
    const CellBox& has = lattice.numbered;  // the first ring may be reached, too
    if (has.i0 < has.i1 && reach.i0 >= has.i0 - 1 && reach.j0 >= has.j0 - 1 && reach.i1 <= has.i1 + 1 && reach.j1 <= has.j1 + 1)
        return lattice;
    constexpr int margin = 16;
    Lattice other = lattice;
    other.numbered = {std::max(reach.i0 - margin, 0), std::max(reach.j0 - margin, 0), std::min(reach.i1 + margin, lattice.nx),
                      std::min(reach.j1 + margin, lattice.ny)};
    return other;
}

/// Takes nodal values to other numbers: those of the nodes that both lattices number; the other nodes have zero.
inline void renumber(std::vector<double>& values, const Lattice& from, const Lattice& to)
{
    const CellBox &a = from.numbered, &b = to.numbered;
    const int i0 = std::max(a.i0, b.i0) - 1, i1 = std::min(a.i1, b.i1) + 1, j0 = std::max(a.j0, b.j0) - 1, j1 = std::min(a.j1, b.j1) + 1;
    std::vector<double> moved(to.nodes(), 0.0);
    if (i0 <= i1)
        for (int j = j0; j <= j1; ++j)
            std::copy_n(&values[from.node(i0, j)], i1 - i0 + 1, &moved[to.node(i0, j)]);
    values.swap(moved);
}

/// Consecutive numbers of cells or nodes, for loops without an index per entity.
struct Run
{
    std::uint32_t begin, count;
};

/// Runs of an ascending list, none across a multiple of `stride`, short enough to be shared out between threads.
inline std::vector<Run> runs_of(const std::vector<std::uint32_t>& ascending, std::size_t stride)
{
    constexpr std::uint32_t longest = 128;
    std::vector<Run> runs;
    for (const auto n : ascending)
        if (!runs.empty() && runs.back().begin + runs.back().count == n && runs.back().count < longest && n % stride != 0)
            ++runs.back().count;
        else
            runs.push_back({n, 1});
    return runs;
}

/// f(run) for all runs.
template <class F>
void for_each_run(const std::vector<Run>& runs, F&& f)
{
    parallel_for(
        runs.size(), [&](std::size_t r) { f(runs[r]); }, 16);
}

/// Nodal unknowns, and which nodes are in use at present.
class Nodes
{
public:
    std::vector<double> mass, vx, vy, fx, fy;  ///< kg/m, m/s, N/m

    explicit Nodes(std::size_t n) : mass(n), vx(n), vy(n), fx(n), fy(n) {}
    const std::vector<std::uint32_t>& active() const { return active_; }  ///< ascending
    const std::vector<Run>& runs() const { return runs_; }                ///< the same
    std::size_t version() const { return version_; }                      ///< grows with each set_active()
    void set_active(std::vector<std::uint32_t> ascending)
    {
        active_ = std::move(ascending);
        runs_ = runs_of(active_, mass.size() + 1);
        ++version_;
    }
    /// Takes all values to other numbers; nodes without one are no longer active.
    void renumber(const Lattice& from, const Lattice& to)
    {
        for (auto* values : {&mass, &vx, &vy, &fx, &fy})
            testbed::renumber(*values, from, to);
        std::vector<std::uint32_t> active;
        for (const auto n : active_)
            if (const int i = from.node_i(n), j = from.node_j(n); to.has_node(i, j))
                active.push_back(static_cast<std::uint32_t>(to.node(i, j)));
        set_active(std::move(active));
    }
    /// kernel(i, lanes) for the active nodes [i, i + lanes).
    template <class Kernel>
    void for_each(Kernel&& kernel) const
    {
        for_each_run(runs_, [&](const Run& run) TESTBED_FLATTEN { for_each_pack(run.begin, run.begin + run.count, kernel); });
    }
    /// Zero everywhere: for other values to be read.
    void clear()
    {
        for (auto* values : {&mass, &vx, &vy, &fx, &fy})
            std::fill(values->begin(), values->end(), 0.0);
    }
    std::size_t bytes() const
    {
        return 5 * mass.capacity() * sizeof(double) + active_.capacity() * sizeof(active_[0]) + runs_.capacity() * sizeof(Run);
    }

private:
    std::vector<std::uint32_t> active_;
    std::vector<Run> runs_;
    std::size_t version_ = 0;
};

/// 1/m, and zero for nodes that carry no mass.
template <class Lanes>
Pack inverse_mass(const Nodes& nodes, std::size_t i, const Lanes& lanes)
{
    const Pack m = lanes.load(&nodes.mass[i]);
    Pack inverse = Pack(1.0) / m;
    stdx::where(!(m > Pack(0.0)), inverse) = Pack(0.0);
    return inverse;
}
inline double inverse_mass(const Nodes& nodes, std::size_t i)
{
    return nodes.mass[i] > 0 ? 1 / nodes.mass[i] : 0;
}
}  // namespace testbed
