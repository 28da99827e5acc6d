#pragma once
/// Time step limits of the explicit methods.

#include "core/materials/elastic.hpp"
#include "core/scene.hpp"

namespace testbed
{
/// Largest value of the Young's modulus that the scene's points see [Pa].
double largest_youngs_modulus(const Scene& scene, const MaterialSpec& material);

/// Limit of an isolated cell, (L / c_p) sqrt(1 - nu), times 1 / sqrt(1 + alpha) with local damping, the least over all
/// materials [s]. A full lattice allows L / c_p, so this is on the safe side.
double critical_time_step(const Scene& scene);

/// The scene's dt, or its cfl times the critical one [s].
double time_step(const Scene& scene);
}  // namespace testbed
