#pragma once
/// The checks of check_scene() by subject: what it puts in order.

#include "core/scene/problems.hpp"

#include <cmath>

namespace testbed
{
inline bool is_multiple(double length, double unit)
{
    const double n = length / unit;
    return std::round(n) >= 1 && std::abs(n - std::round(n)) < 1e-6;
}

/// Of a value that may be absent.
inline void check_positive(const std::optional<double>& value, const std::string& key, Problems& problems)
{
    if (value && !(*value > 0))
        problems.add(key, fmt::format("must be positive, not {}", *value));
}

/// Nonlocal softening averages over all bodies together: they must agree on how.
void check_nonlocal(const Scene& scene, Problems& problems);

/// Each body alone: its shape is whole and lies in the lattice.
void check_bodies(const Scene& scene, Problems& problems);
/// Of the squares around the bodies, of which each holds all points that a body can have.
void check_number_of_points(const Scene& scene, double most, Problems& problems);
/// An inclusion takes points of another body: all of its shape must lie there.
void check_inclusions(const Scene& scene, Problems& problems);
/// Two bodies in one place would count their mass twice. Boxes are compared as such, other shapes by the points of either in the other.
void check_overlap(const Scene& scene, Problems& problems);

void check_walls(const Scene& scene, Problems& problems);
}  // namespace testbed
