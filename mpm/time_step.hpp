#pragma once
/// What limits the time step of MPM.
///
/// Small motions about points at rest: nodes have lumped mass M and the stiffness K of the points; what a mapping to points and back
/// leaves of nodal values is C = M^-1 M_C, with the consistent mass M_C, eigenvalues in [0, 1]. In the mode that changes its sign in each
/// step FLIP's share f of the past velocity makes that H = C / (1 + f + (1 - f) C), and
///     musl, usf:  dt^2 largest eigenvalue of 2 H M^-1 K = 4
///     usl:        dt^2 largest eigenvalue of 2 (I - H) M^-1 K = 4
/// Stress first and remapped velocities thus see forces smoothed twice; stress last strains with light nodes' own
/// acceleration, and its limit goes to zero with their mass, as 2 (L/c) sqrt(xi (1 - xi) / 2) for points at xi in a cell.

#include "core/run/element_system.hpp"
#include "core/run/time_step.hpp"
#include "mpm/options.hpp"
#include "mpm/transfer.hpp"

namespace testbed
{
/// Limits of the present state.
/// - stiffness: for musl and usf the isolated cell of LPFDM, since H M^-1 K with FLIP is at most M^-1 K / 2: below the sharp limit by a
/// factor
///   of 1.5 to 2.5 where cells hold 2 x 2 points or more, wherever these lie; with one point to a cell and linear shapes the sum over
///   points that sit on nodes asks for a factor of 1/sqrt(2). PIC's share asks for sqrt((1 + f) / 2).
/// - crossing, for linear shapes: stress jumps to other nodes where a point crosses a line of nodes, and steps near the limit of stiffness
/// pump
///   energy with that. XPIC takes it out.
/// - cell content, for usl: see content_limit().
/// - motion: a point crosses at most one cell in a step.
template <class Shape>
std::vector<StepLimit> mpm_step_limits(const Lattice& lattice, const std::vector<Body>& bodies, const MpmSpec& options, double alpha);

/// The points of a bin with its S x S nodes are an element.
template <class Shape, class Strain>
ElementSystem mpm_elements(const Lattice& lattice, const std::vector<Body>& bodies);

/// Sharp limit of points as they stand [s].
double mpm_sharp_limit(const ElementSystem& system, const MpmSpec& options, double alpha);
}  // namespace testbed
