#pragma once
/// What limits the time step. Each explicit method lists its own limits (lpfdm/time_step.hpp, mpm/time_step.hpp).

#include "core/bodies/body.hpp"

#include <optional>
#include <vector>

namespace testbed
{
/// One reason why a step may not be longer.
struct StepLimit
{
    const char* name;
    double seconds;
    const char* way_out = "";  ///< a setting without this limit
};

/// The least of all. @param limits not empty
const StepLimit& governing(const std::vector<StepLimit>& limits);
/// "stiffness 1.2e-03 s, convection 0.1 s"
std::string description(const std::vector<StepLimit>& limits);

/// A cell that is full of one material and has no neighbours, with a quarter of its mass at each node: dt = L / sqrt(kappa / rho), that is
/// (L / c_p) sqrt(1 - nu) for nu >= 0 and (L / c_p) sqrt((1 - nu) / (1 - 2 nu)) below; the least over all points, with the density and
/// stiffness that they have now. By Irons' theorem no lattice of such cells asks for less [s].
double isolated_cell_limit(const std::vector<Body>& bodies, double cell_size);

/// Local damping opposes the velocity: in a mode that changes its sign in each step it adds alpha times the force.
inline double damping_factor(double alpha)
{
    return 1 / std::sqrt(1 + alpha);
}

/// The step that goes no farther than one cell with this speed, none at rest [s].
std::optional<double> courant_limit(double cell_size, double speed);
}  // namespace testbed
