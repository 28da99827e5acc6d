#pragma once
/// Material Point Method: velocity lives on the points and is mapped to the nodes anew in each step.

#include "core/run/solver.hpp"

#include <memory>

namespace testbed
{
/// Its row in the list of methods.
Method mpm_method(MakeSolver make = {});

/// @throws SceneError
std::unique_ptr<Solver> make_mpm(const Scene& scene);
}  // namespace testbed
