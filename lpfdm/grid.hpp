#pragma once
/// The lattice of LPFDM with what lives on it: averages of cells, unknowns of nodes.

#include "core/gather.hpp"
#include "core/kinematics.hpp"

namespace testbed
{
struct Cells
{
    std::vector<double> mass;          ///< M_j, eq. (7) [kg/m]; zero marks a cell without points
    std::vector<SymTensor<>> stress;   ///< <sigma>_j, eq. (8) [Pa]
    std::vector<Gradient<>> gradient;  ///< eq. (5), of the increment over a step [-]

    explicit Cells(std::size_t n) : mass(n), stress(n), gradient(n) {}
    void clear(std::size_t c)
    {
        mass[c] = 0;
        stress[c] = {};
        gradient[c] = {};
    }
    std::size_t bytes() const { return mass.size() * (sizeof(double) + sizeof(SymTensor<>) + sizeof(Gradient<>)); }
};

struct LpfdmGrid
{
    Lattice lattice;
    Cells cells;
    Nodes nodes;
    Gather gather;                          ///< from points to cells
    std::vector<std::uint32_t> first_cell;  ///< for each active node the cell of which it is corner [1]

    explicit LpfdmGrid(const Lattice& l) : lattice(l), cells(l.cells()), nodes(l.nodes()), gather(l.cells()) {}

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
        std::set_difference(nodes.active.begin(), nodes.active.end(), used.begin(), used.end(), std::back_inserter(left));
        nodes.active = std::move(used);
        first_cell.resize(nodes.active.size());
        for (std::size_t a = 0; a < nodes.active.size(); ++a)
            first_cell[a] = static_cast<std::uint32_t>(lattice.cell(lattice.node_i(nodes.active[a]), lattice.node_j(nodes.active[a])));
        return left;
    }

    /// f(cell)
    template <class F>
    void for_each_cell(F&& f) const
    {
        parallel_for(gather.active().size(), [&](std::size_t a) { f(gather.active()[a]); });
    }
    /// f(node, first cell)
    template <class F>
    void for_each_node(F&& f) const
    {
        parallel_for(nodes.active.size(), [&](std::size_t a) { f(nodes.active[a], first_cell[a]); });
    }
    void corner_velocities(std::size_t cell, double (&ux)[4], double (&uy)[4]) const
    {
        const std::size_t first = first_node(cell);
        for (int k = 0; k < 4; ++k)
        {
            ux[k] = nodes.vx[corner(first, k)];
            uy[k] = nodes.vy[corner(first, k)];
        }
    }
    std::size_t bytes() const { return cells.bytes() + nodes.bytes() + gather.bytes() + first_cell.capacity() * sizeof(std::uint32_t); }
};
}  // namespace testbed
