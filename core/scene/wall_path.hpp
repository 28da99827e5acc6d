#pragma once
/// Where a wall goes.

#include "core/scene/scene.hpp"

namespace testbed
{
/// The coordinate along which a wall's door opens: that of its longer side.
inline std::size_t door_direction(const WallSpec& wall)
{
    return wall.max[0] - wall.min[0] >= wall.max[1] - wall.min[1] ? 0 : 1;
}

/// Displacement of a wall at equal intervals from 0 to `end` [m]. @throws ExpressionError
std::vector<Vec<2>> wall_path(const WallSpec& spec, const Constants& constants, double end);
}  // namespace testbed
