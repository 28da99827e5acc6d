#pragma once
/// Time step limits of the explicit methods.

#include "core/materials/elastic.hpp"
#include "core/scene/scene.hpp"

namespace testbed
{
/// Largest value of the Young's modulus that the scene's points see [Pa].
double largest_youngs_modulus(const Scene& scene, const MaterialSpec& material);

/// Limit of an isolated cell with local damping alpha, the least over all materials: (L / c_p) sqrt(1 - nu) / sqrt(1 + alpha), for nu < 0,
/// where the shear mode governs, (L / c_p) sqrt((1 - nu) / (1 - 2 nu)) / sqrt(1 + alpha) [s]. What a method without limits of its own
/// takes.
double critical_time_step(const Scene& scene);

/// The scene's dt, or its cfl times that limit: an estimate as long as there is no solver, see Solver::step_limits() [s].
double time_step(const Scene& scene);
}  // namespace testbed
