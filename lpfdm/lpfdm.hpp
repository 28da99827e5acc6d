#pragma once
/// Lagrangian Particle Finite Difference Method (Konagai & Johansson 2000): points carry mass and stress, the velocity
/// lives on the nodes of a fixed lattice, and a convection term makes up for the lattice staying where it is.

#include "core/run/solver.hpp"

#include <memory>

namespace testbed
{
/// Its row in the list of methods.
Method lpfdm_method(MakeSolver make = {});

/// @throws SceneError
std::unique_ptr<Solver> make_lpfdm(const Scene& scene);
}  // namespace testbed
