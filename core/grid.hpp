#pragma once
/// The fixed square lattice. Cell (i, j) has its nodes [1] (i, j), [2] (i+1, j), [3] (i, j+1), [4] (i+1, j+1).
/// One ring of cells around the lattice takes what a point's box spreads over its edge, and a second, always empty one lets
/// every node of the first look at four cells: cells count from -2 and nodes from -1.

#include "core/types.hpp"

#include <cstddef>
#include <cstdint>
#include <vector>

namespace testbed
{
struct Lattice
{
    Vec2 origin{0, 0};
    double cell_size = 1;  ///< L [m]
    int nx = 0, ny = 0;    ///< cells

    std::size_t cell_stride() const { return static_cast<std::size_t>(nx) + 4; }
    std::size_t node_stride() const { return static_cast<std::size_t>(nx) + 3; }
    std::size_t cell(int i, int j) const { return static_cast<std::size_t>(i + 2) + static_cast<std::size_t>(j + 2) * cell_stride(); }
    std::size_t node(int i, int j) const { return static_cast<std::size_t>(i + 1) + static_cast<std::size_t>(j + 1) * node_stride(); }
    std::size_t cells() const { return cell_stride() * (static_cast<std::size_t>(ny) + 4); }
    std::size_t nodes() const { return node_stride() * (static_cast<std::size_t>(ny) + 3); }
    int cell_i(std::size_t c) const { return static_cast<int>(c % cell_stride()) - 2; }
    int cell_j(std::size_t c) const { return static_cast<int>(c / cell_stride()) - 2; }
    int node_i(std::size_t n) const { return static_cast<int>(n % node_stride()) - 1; }
    int node_j(std::size_t n) const { return static_cast<int>(n / node_stride()) - 1; }
    Vec2 node_position(std::size_t n) const { return {origin[0] + node_i(n) * cell_size, origin[1] + node_j(n) * cell_size}; }
};

/// Nodal unknowns, and which nodes carry mass at present.
struct Nodes
{
    std::vector<double> mass, vx, vy, fx, fy;  ///< kg/m, m/s, N/m
    std::vector<std::uint32_t> active;         ///< indices, ascending

    explicit Nodes(std::size_t n) : mass(n), vx(n), vy(n), fx(n), fy(n) {}
    std::size_t bytes() const { return (5 * mass.capacity()) * sizeof(double) + active.capacity() * sizeof(active[0]); }
};
}  // namespace testbed
