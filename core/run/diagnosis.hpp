#pragma once
/// Why a run failed or is suspect, and which setting would have held: read off the state that it ended with.

#include "core/run/guards.hpp"

namespace testbed
{
/// What is known of the run beside the state of its solver.
struct RunFacts
{
    double dt = 0, dt_critical = 0;  ///< [s]
    std::vector<Finding> findings;
};

struct Diagnosis
{
    std::string cause;   ///< time_step, sliver, null_mode, tension, locking, separation, crossing; empty if none was found
    std::string remedy;  ///< "key=value" as for --set; empty if none is known
};

Diagnosis diagnose(const Scene& scene, const Solver& solver, const RunFacts& facts);

/// Share of the nodal kinetic energy in the pattern (+1, -1, -1, +1) of the cells, which has no strain, 0 to 1.
double checkerboard_share(const Lattice<2>& lattice, const Nodes<2>& nodes);
/// Mass of the fastest node over that of a full one.
double mass_of_fastest(const Nodes<2>& nodes, double full);
/// Standard deviation of the mean stress within cells over that of all points, 0 to 1: near 1 when neighbours have nothing in common.
double stress_oscillation(const std::vector<Body>& bodies, const Lattice<2>& lattice);
}  // namespace testbed
