#pragma once
/// The lattice of LPFDM with what lives on it: averages of cells, unknowns of nodes.

#include "core/lattice/gather.hpp"
#include "core/lattice/kinematics.hpp"

namespace testbed
{
struct Cells
{
    std::vector<double> mass;            ///< M_j, eq. (7) [kg/m]; zero marks a cell without points
    std::vector<double> sxx, syy, sxy;   ///< <sigma>_j, eq. (8) [Pa]
    std::vector<double> xx, yy, xy, yx;  ///< gradient, eq. (5), of the increment over a step [-]

    explicit Cells(std::size_t n) : mass(n), sxx(n), syy(n), sxy(n), xx(n), yy(n), xy(n), yx(n) {}
    Gradient<> gradient(std::size_t c) const { return {xx[c], yy[c], xy[c], yx[c]}; }
    template <class Lanes>
    Gradient<Pack> gradient(std::size_t c, const Lanes& lanes) const
    {
        return {lanes.load(&xx[c]), lanes.load(&yy[c]), lanes.load(&xy[c]), lanes.load(&yx[c])};
    }
    template <class Lanes>
    SymTensor<Pack> stress(std::size_t c, const Lanes& lanes) const
    {
        return {lanes.load(&sxx[c]), lanes.load(&syy[c]), lanes.load(&sxy[c])};
    }
    void clear(std::size_t c)
    {
        for (auto* field : {&mass, &sxx, &syy, &sxy, &xx, &yy, &xy, &yx})
            (*field)[c] = 0;
    }
    std::size_t bytes() const { return 8 * mass.size() * sizeof(double); }
};

struct LpfdmGrid
{
    Lattice lattice;
    Cells cells;
    Nodes nodes;
    Gather gather;  ///< from points to cells

    explicit LpfdmGrid(const Lattice& l) : lattice(l), cells(l.cells()), nodes(l.nodes()), gather(l.cells()) {}

    /// Takes the nodes to the numbers of another lattice; the cells are empty until the next rebuild().
    void renumber(const Lattice& to)
    {
        nodes.renumber(lattice, to);
        cells = Cells(to.cells());
        gather = Gather(to.cells());
        lattice = to;
    }

    /// Corner k = 0..3, nodes [1]..[4], of the cell whose corner [1] is `first`.
    std::size_t corner(std::size_t first, int k) const
    {
        return first + static_cast<std::size_t>(k & 1) + static_cast<std::size_t>(k >> 1) * lattice.node_stride();
    }
    /// The cell of which a node is corner k, from the cell of which it is corner [1].
    std::size_t around(std::size_t first, int k) const
    {
        return first - static_cast<std::size_t>(k & 1) - static_cast<std::size_t>(k >> 1) * lattice.cell_stride();
    }
    std::size_t first_node(std::size_t cell) const { return lattice.node(lattice.cell_i(cell), lattice.cell_j(cell)); }
    std::size_t first_cell(std::size_t node) const { return lattice.cell(lattice.node_i(node), lattice.node_j(node)); }

    /// Cells and nodes in use, from bins that were sorted anew. Returns the nodes that are no longer in use.
    template <int S>
    std::vector<std::uint32_t> rebuild(std::span<const Bins* const> bins)
    {
        for (const auto c : gather.active())
            cells.clear(c);
        gather.rebuild<S>(bins, [&](int i, int j) { return lattice.cell(i, j); });
        std::vector<std::uint32_t> used;
        for (const auto c : gather.active())
            for (int k = 0; k < 4; ++k)
                used.push_back(static_cast<std::uint32_t>(corner(first_node(c), k)));
        std::sort(used.begin(), used.end());
        used.erase(std::unique(used.begin(), used.end()), used.end());
        used.shrink_to_fit();
        std::vector<std::uint32_t> left;
        std::set_difference(nodes.active().begin(), nodes.active().end(), used.begin(), used.end(), std::back_inserter(left));
        nodes.set_active(std::move(used));
        node_runs_ = runs_of(nodes.active(), lattice.node_stride());
        cell_runs_ = runs_of(gather.active(), lattice.cell_stride());
        return left;
    }

    /// kernel(c, n, lanes) for the cells [c, c + lanes) in use, with their first nodes [n, n + lanes).
    template <class Kernel>
    void for_each_cell(Kernel&& kernel) const
    {
        for_each_run(cell_runs_,
                     [&](const Run& run) TESTBED_FLATTEN
                     {
                         const std::size_t n = first_node(run.begin);
                         for_each_pack(0, run.count, [&](std::size_t k, const auto& lanes) { kernel(run.begin + k, n + k, lanes); });
                     });
    }
    /// The same for a kernel that returns a pack: its sum over all cells, in a fixed order.
    template <class Kernel>
    double sum_over_cells(Kernel&& kernel) const
    {
        return ordered_sum<1>(
            cell_runs_.size(),
            [&](std::size_t r) TESTBED_FLATTEN
            {
                const Run& run = cell_runs_[r];
                const std::size_t n = first_node(run.begin);
                Pack total(0.0);
                for_each_pack(0, run.count,
                              [&](std::size_t k, const auto& lanes) { total += lanes.keep(kernel(run.begin + k, n + k, lanes)); });
                return std::array{sum(total)};
            },
            4)[0];
    }
    /// kernel(n, c, lanes) for the nodes [n, n + lanes) in use, with their first cells [c, c + lanes).
    template <class Kernel>
    void for_each_node(Kernel&& kernel) const
    {
        for_each_run(node_runs_,
                     [&](const Run& run) TESTBED_FLATTEN
                     {
                         const std::size_t c = first_cell(run.begin);
                         for_each_pack(0, run.count, [&](std::size_t k, const auto& lanes) { kernel(run.begin + k, c + k, lanes); });
                     });
    }
    /// Nodal values at the corners of the cells whose first nodes are [n, n + lanes).
    template <class Lanes>
    std::array<Pack, 4> at_corners(const std::vector<double>& values, std::size_t n, const Lanes& lanes) const
    {
        return {lanes.load(&values[n]), lanes.load(&values[corner(n, 1)]), lanes.load(&values[corner(n, 2)]),
                lanes.load(&values[corner(n, 3)])};
    }
    std::size_t bytes() const
    {
        return cells.bytes() + nodes.bytes() + gather.bytes() + (node_runs_.capacity() + cell_runs_.capacity()) * sizeof(Run);
    }

private:
    std::vector<Run> node_runs_, cell_runs_;
};
}  // namespace testbed
