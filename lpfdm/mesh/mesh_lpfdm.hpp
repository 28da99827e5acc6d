#pragma once
/// LPFDM with cells of any convex shape: the same step as on squares, written for any polygon, to test the paper's claim that it carries
/// over (sections 1 and 2). Points belong to one cell (support = "point"). Plain rather than fast.

#include "core/run/solver.hpp"

#include <memory>

namespace testbed
{
/// @throws SceneError
std::unique_ptr<Solver> make_mesh_lpfdm(const Scene& scene);
}  // namespace testbed
