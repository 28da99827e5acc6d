#pragma once
/// The law that a scene's material means.

#include "core/materials/material.hpp"
#include "core/materials/material_spec.hpp"

namespace testbed
{
/// What differs from point to point in a body.
struct Varying
{
    bool stiffness = false, strength = false;
};

/// @param strength that of all points, or anything if it varies @param cell_size L [m], for crack-band scaling
Material make_material(const MaterialSpec& spec, const ElasticModuli& moduli, const Strength<>& strength, double cell_size,
                       Varying varying);
}  // namespace testbed
