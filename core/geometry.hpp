#pragma once
/// Bodies of a scene as material points.

#include "core/scene.hpp"

namespace testbed
{
/// Initial positions of a body's points, in order [m]: squares of side L / points_per_cell whose centre lies in the body.
/// A box starts its pattern at its own corner, other shapes at the lattice.
std::vector<Vec2> fill(const BodySpec& body, const GridSpec& grid);

/// Side of the square that one point stands for [m].
inline double spacing(const BodySpec& body, const GridSpec& grid)
{
    return grid.cell_size / body.points_per_cell;
}

/// Whether the text is a plain number rather than an expression.
bool is_number(const std::string& text);
}  // namespace testbed
