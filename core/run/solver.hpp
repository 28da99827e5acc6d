#pragma once
/// What the run loop knows of a method: the one boundary of type erasure, crossed a few times per step.

#include "core/base/phase_timer.hpp"
#include "core/base/step.hpp"
#include "core/bodies/body.hpp"
#include "core/lattice/archive.hpp"
#include "core/loads/node_ops.hpp"
#include "core/run/time_step.hpp"
#include "core/scene/method_limits.hpp"

#include <cmath>

namespace testbed
{
/// Sums over the system at one time, per metre of thickness.
struct MotionSums
{
    double kinetic_energy = 0;    ///< sum of m v(t - dt/2) . v(t + dt/2) / 2 [J/m]: what is constant beside the strain energy at t
    double kinetic_before = 0;    ///< sum over nodes of m v(t - dt/2)^2 / 2 [J/m]: never negative
    Vec<2> momentum{0, 0};        ///< kg/s
    double angular_momentum = 0;  ///< kg m/s, about the lattice origin
    double unbalanced = 0;        ///< norm of the nodal forces out of balance over that of the internal ones
};

/// Sums over nodes whose velocity is `lag` seconds behind their forces. A light node may be accelerated beyond measure for half a step;
/// the product of the velocities before and after does not take that for motion, as the square at the time of the forces would.
/// @param place of a node, by its number, from where angular momentum is taken @param internal norm of the internal nodal forces
template <class Place>
MotionSums nodal_sums(Place&& place, const Nodes<2>& nodes, double lag, double internal)
{
    const auto s = ordered_sum<5>(nodes.active().size(),
                                  [&](std::size_t a)
                                  {
                                      const std::size_t i = nodes.active()[a];
                                      const Vec<2> x = place(i);
                                      const double m = nodes.mass[i], step = inverse_mass(nodes, i) * lag;
                                      const Vec<2> before = at(nodes.v, i);
                                      Vec<2> v;
                                      for (std::size_t d = 0; d < 2; ++d)
                                          v[d] = before[d] + nodes.f[d][i] * step;
                                      const double square = total<2>([&](auto d) { return before[d] * before[d]; });
                                      const double product = total<2>([&](auto d) { return before[d] * v[d]; });
                                      const double spin = x[0] * v[1] - x[1] * v[0];
                                      return std::array{m * (product - 0.5 * square), 0.5 * m * square, m * v[0], m * v[1], m * spin};
                                  });
    return {s[0], s[1], {s[2], s[3]}, s[4], internal > 0 ? force_norm(nodes) / internal : 0};
}

inline MotionSums nodal_sums(const Lattice<2>& lattice, const Nodes<2>& nodes, double lag, double internal)
{
    const auto place = [&](std::size_t i)
    {
        const Vec<2> x = lattice.node_position(i);
        return Vec<2>{x[0] - lattice.origin[0], x[1] - lattice.origin[1]};
    };
    return nodal_sums(place, nodes, lag, internal);
}

/// The motion of the points at the half step before.
struct PointMotion
{
    double kinetic_energy = 0;  ///< J/m
    double speed = 0;           ///< largest [m/s]
    Vec<2> momentum{0, 0};      ///< kg/s
    double mass = 0;            ///< kg/m
};

/// @param velocity (body, point) -> Vec<2>
template <class Velocity>
PointMotion point_motion_of(const std::vector<Body>& bodies, Velocity&& velocity)
{
    PointMotion motion;
    double square = 0;
    std::vector<Vec<2>> v;  // a velocity may have to be interpolated: once is enough
    for (std::size_t b = 0; b < bodies.size(); ++b)
    {
        const Points<2>& q = bodies[b].points;
        v.resize(q.count);
        parallel_for(q.count, [&](std::size_t p) { v[p] = velocity(b, p); });
        const auto squared = [&](std::size_t p) { return v[p][0] * v[p][0] + v[p][1] * v[p][1]; };
        const auto s = ordered_sum<3>(q.count, [&](std::size_t p) { return std::array{squared(p), v[p][0], v[p][1]}; });
        motion.kinetic_energy += 0.5 * q.mass * s[0];
        motion.mass += q.mass * static_cast<double>(q.count);
        motion.momentum[0] += q.mass * s[1];
        motion.momentum[1] += q.mass * s[2];
        square = std::max(square, parallel_max(q.count, squared));
    }
    motion.speed = std::sqrt(square);
    return motion;
}

class Solver
{
public:
    virtual ~Solver() = default;

    /// Forces and accelerations at time t, from the state at t. dt is the coming step [s]; it may be another one than the last.
    void prepare(double t, double dt)
    {
        step_ = {t, dt, last_dt_};
        do_prepare(step_);
    }
    /// Sums at the time of the last prepare().
    virtual MotionSums sums() const = 0;
    /// The state from t to t + dt, the step that was prepared. @throws Diverged
    void advance(double dt)
    {
        step_.dt = dt;
        do_advance(step_);
        last_dt_ = dt;
    }
    /// Takes the last step, if there was one, for one of this length: the map of equal steps about a state that others led to.
    void assume_last_step(double dt)
    {
        if (last_dt_ > 0)
            last_dt_ = dt;
    }

    /// Brings the points of bodies() to the state of the last prepare(): for methods whose points are samples, not unknowns.
    virtual void update_points() {}
    virtual const std::vector<Body>& bodies() const = 0;
    /// Velocity of a point, at the half step before the last prepare().
    virtual Vec<2> velocity(std::size_t body, std::size_t point) const = 0;
    virtual PointMotion point_motion() const
    {
        return point_motion_of(bodies(), [&](std::size_t body, std::size_t point) { return velocity(body, point); });
    }
    /// Work at the nodes up to the time of the last prepare(); none for methods that are no leap-frog on the lattice.
    virtual std::optional<NodalWork> work() const { return std::nullopt; }
    /// The same up to the last kick, which no step depends on: a restart keeps it. Null without work().
    virtual NodalWork* work_done() { return nullptr; }
    /// The nodes and their lattice at the last prepare(), for the diagnosis of a run that failed.
    virtual std::pair<const Lattice<2>*, const Nodes<2>*> nodes() const { return {nullptr, nullptr}; }
    virtual std::size_t unknowns() const = 0;  ///< nodal unknowns that carry mass
    virtual std::size_t active_cells() const = 0;
    virtual std::size_t bytes() const = 0;  ///< of all arrays
    virtual const PhaseTimer& timer() const = 0;
    /// Supports and walls at the last prepare().
    virtual std::vector<RestraintRecord> restraints() const = 0;
    virtual Kinematics kinematics() const = 0;  ///< which [exact.*] applies
    /// What limits the coming step, in the present state and on the safe side; nothing for an implicit method.
    virtual std::vector<StepLimit> step_limits() { return {}; }
    /// The limit of small motions about the present state, without a safe side, from the largest eigenvalue of its own stiffness; takes the
    /// time of some hundred steps, more memory than the solver itself, and counts no convection [s]. None for an implicit method.
    virtual std::optional<double> sharp_step_limit() { return std::nullopt; }
    /// What time.cfl is a share of: the least limit, or for an implicit method what it would be about [s].
    virtual double critical_time_step(const Scene& scene)
    {
        const std::vector<StepLimit> limits = step_limits();
        return limits.empty() ? testbed::critical_time_step(scene) : governing(limits).seconds;
    }
    /// What the next prepare() and advance() depend on, beside their arguments; between two steps, so after advance().
    virtual void write_state(StateWriter&) { throw std::logic_error("this method cannot write its state"); }
    /// The steps that follow have the same bits as if nothing had been between.
    virtual void read_state(StateReader&) { throw std::logic_error("this method cannot read its state"); }
    /// One implicit step to the end instead of many explicit ones.
    virtual bool is_static() const { return false; }

protected:
    /// Of the nodal velocity behind the forces of the last prepare() [s].
    double lag() const { return 0.5 * step_.last_dt; }

    double last_dt_ = 0;  ///< of the step that led here; zero at the start [s]

private:
    virtual void do_prepare(const Step& step) = 0;
    virtual void do_advance(const Step& step) = 0;

    Step step_{0, 0, 0};
};

/// The scene's dt, or its cfl times the critical one in the present state [s].
inline double time_step(const Scene& scene, Solver& solver)
{
    return scene.time.dt ? *scene.time.dt : scene.time.cfl * solver.critical_time_step(scene);
}

inline State state_of(Solver& solver)
{
    State state;
    StateWriter writer(state);
    solver.write_state(writer);
    return state;
}
inline void restore(Solver& solver, const State& state)
{
    StateReader reader(state);
    solver.read_state(reader);
}
}  // namespace testbed
