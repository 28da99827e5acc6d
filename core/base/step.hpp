#pragma once
/// A step in time.

namespace testbed
{
/// A step from t to t + dt. The velocity lives on half steps, at t - last_dt/2 before the kick of this step and at t + dt/2 after it:
/// convection and what else brings the past step to its end takes last_dt, the kick (last_dt + dt)/2, points and walls dt [s].
struct Step
{
    double t, dt;
    double last_dt;  ///< zero in the first step: the initial velocity is that of t = 0, and the first kick is half a step

    bool is_first() const { return last_dt == 0; }
    double kick() const { return 0.5 * (last_dt + dt); }
};
}  // namespace testbed
