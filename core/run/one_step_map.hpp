#pragma once
/// The derivative of one step (or of some) of a solver with respect to its state, by differences of the steps that it really makes: the
/// state is read, one number of it changed, the steps taken, the state written. No equation of a method stands here.

#include "core/run/solver.hpp"

#include <Eigen/Core>
#include <cmath>

namespace testbed
{
/// What a number of the state is measured by, so that a map without units has entries of order one.
struct StateScales
{
    double length = 1, velocity = 0, stress = 0, mass = 0;  ///< L, the largest c_p and M, that of a full cell

    double of(const std::string& unit) const;
};
StateScales state_scales(const std::vector<Body>& bodies, double cell_size);

/// One number of the state that a step changes.
struct Unknown
{
    enum class Kind
    {
        position,
        velocity,
        stress,
        other  ///< volumes, boxes, what a law keeps
    };
    Kind kind;
    int component;  ///< 0: x, 1: y of a position or velocity
    bool is_nodal;
    Vec<2> place;   ///< of the point or node [m]
    Index<2> node;  ///< if it is one
    double scale;
};

struct StepSettings
{
    double t = 0, dt = 0;
    int steps = 1;             ///< more: the map over all of them, about a state that moves by whole cells in them, for instance
    double difference = 1e-5;  ///< by which each unknown is changed, both ways, and by half of it, in its scale
};

struct OneStepMap
{
    std::vector<Unknown> unknowns;
    Eigen::MatrixXd matrix;  ///< of changes over their scales
    std::size_t kinks = 0;   ///< columns that differ from one side to the other: the matrix has their mean
    /// Largest difference between what all unknowns changed at once do and the sum of what each does alone, over what the step changes: not
    /// zero at a state where limiters or local damping choose by the signs of disturbances. The matrix then is no derivative.
    double excess = 0;

    std::vector<Eigen::Index> all(Unknown::Kind kind) const;
};

/// Nodes are taken at their place in the body: after steps that moved it by whole cells those as many columns and lines on.
/// @param about state between two steps; the solver is left in some other state @param lattice of the solver
/// @throws Diverged when a step fails
OneStepMap one_step_map(Solver& solver, const State& about, const Lattice<2>& lattice, const StepSettings& settings);

/// Number of unknowns of a state.
std::size_t unknowns_of(Solver& solver, const State& state);
}  // namespace testbed
