#pragma once
/// Guards that look at whole fields, once, at the end of a run of elastic bodies: what the lattice does not resolve.

#include "core/guards.hpp"

namespace testbed
{
/// What the fields differ by from their average over neighbouring cells.
struct Unresolved
{
    double stress = 0, velocity = 0;  ///< energies [J/m]
    double stress_share = 0;          ///< of the stress itself, in the L2 norm: in energy, pressures count for nothing near nu = 1/2
};

/// Points to nodes by volume, nodes to points, with bilinear shape functions and for each body alone: the recovered field of
/// Zienkiewicz & Zhu (Int. J. Numer. Meth. Engng 24, 1987), whose distance estimates the error. A wave of n cells leaves
/// ((1 - cos(2 pi / n)) / 3)^2 of its energy: 1 % at eight, 11 % at four.
/// @param cell_size of the mesh that carries the stress [m] @param velocity (body, point), in the frame that counts
Unresolved unresolved_energy(const std::vector<Body>& bodies, const Lattice& lattice, double cell_size,
                             const std::function<Vec2(std::size_t, std::size_t)>& velocity);

/// noise, crossing, mixed_cells: for scenes without a law that may flow; else none.
std::vector<std::unique_ptr<Guard>> field_guards(const Scene& scene);
}  // namespace testbed
