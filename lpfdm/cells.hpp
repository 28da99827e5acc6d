#pragma once
/// Cell averages of LPFDM.

#include "core/grid.hpp"
#include "core/kinematics.hpp"

namespace testbed
{
struct Cells
{
    std::vector<double> mass;              ///< M_j, eq. (7) [kg/m]; zero marks a cell without points
    std::vector<SymTensor<>> stress;       ///< <sigma>_j, eq. (8) [Pa]
    std::vector<Gradient<>> gradient;      ///< eq. (5), of the increment over a step [-]

    explicit Cells(std::size_t n) : mass(n), stress(n), gradient(n) {}
    void clear(std::size_t c)
    {
        mass[c] = 0;
        stress[c] = {};
        gradient[c] = {};
    }
    std::size_t bytes() const { return mass.size() * (sizeof(double) + sizeof(SymTensor<>) + sizeof(Gradient<>)); }
};

/// Corner nodes [1]..[4] of a cell and the cells around a node; offsets of array indices.
struct Neighbours
{
    std::size_t node_stride, cell_stride;

    explicit Neighbours(const Lattice& lattice) : node_stride(lattice.node_stride()), cell_stride(lattice.cell_stride()) {}
    std::size_t corner(std::size_t first, int k) const { return first + (k & 1) + (k >> 1) * node_stride; }
    /// The cell of which the node is corner k, from the cell of which it is corner [1].
    std::size_t around(std::size_t first, int k) const { return first - (k & 1) - (k >> 1) * cell_stride; }
};
}  // namespace testbed
