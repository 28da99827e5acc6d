#pragma once
/// What the lattice does not resolve of the fields of elastic bodies.

#include "core/bodies/body.hpp"

#include <functional>

namespace testbed
{
/// Distance of the stress from its average over neighbouring cells, over the stress, both in the L2 norm of all components (in energy,
/// pressures count for nothing near nu = 1/2). The average goes from points to nodes by volume and back to points, with bilinear shape
/// functions and for each body alone: the recovered field of Zienkiewicz & Zhu (Int. J. Numer. Meth. Engng 24, 1987), whose distance
/// estimates the error. A wave of n cells leaves ((1 - cos(2 pi / n)) / 3)^2 of its square: 1 % at eight, 11 % at four.
/// @param cell_size of the mesh that carries the stress [m]
double stress_error(const std::vector<Body>& bodies, const Lattice<2>& lattice, double cell_size);
/// Energy of what stress and velocity differ by from such averages [J/m]. @param velocity (body, point), in the frame that counts
double unresolved_energy(const std::vector<Body>& bodies, const Lattice<2>& lattice, double cell_size,
                         const std::function<Vec<2>(std::size_t, std::size_t)>& velocity);
}  // namespace testbed
