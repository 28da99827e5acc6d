#pragma once
/// Steps in time and what limits them. Each explicit method lists its own limits (lpfdm/time_step.hpp, mpm/time_step.hpp).

#include "core/body.hpp"

#include <optional>
#include <vector>

namespace testbed
{
/// A step from t to t + dt. The velocity lives on half steps, at t - last_dt/2 before the kick of this step and at t + dt/2 after it:
/// convection and what else brings the past step to its end takes last_dt, the kick (last_dt + dt)/2, points and walls dt [s].
struct Step
{
    double t, dt;
    double last_dt;  ///< zero in the first step: the initial velocity is that of t = 0, and the first kick is half a step

    double kick() const { return 0.5 * (last_dt + dt); }
};

/// One reason why a step may not be longer.
struct StepLimit
{
    const char* name;
    double seconds;
};

/// The least of all. @param limits not empty
const StepLimit& governing(const std::vector<StepLimit>& limits);
/// "stiffness 1.2e-03 s, convection 0.1 s"
std::string description(const std::vector<StepLimit>& limits);

/// Largest ratio of eps : D : eps over |grad u|^2, by which no cell is stiffer: 2 (lambda + mu) of in-plane dilatation, or 2 mu of shear
/// where Poisson's ratio is negative [Pa].
inline double gradient_stiffness(const ElasticModuli& m)
{
    return 2 * m.shear() + 2 * std::max(m.lame(), 0.0);
}
/// Young's modulus of point p over that of its body's material.
inline double stiffness_ratio(const Points& q, std::size_t p)
{
    return q.stiffness.active() ? q.stiffness[p] : 1.0;
}

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
