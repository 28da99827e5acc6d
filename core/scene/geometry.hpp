#pragma once
/// Bodies of a scene as material points.

#include "core/scene/scene.hpp"

#include <optional>

namespace testbed
{
/// Whether a place lies in the body's shape, or within `slack` of a box or disk [m].
bool contains(const BodySpec& body, const Vec<2>& place, double slack = 0);

/// The corners, low and high, of the box around a body's shape [m].
std::array<Vec<2>, 2> extent(const BodySpec& body);

/// Two edges of a closed polygon that cross, by the numbers of their first corners, if there are any.
std::optional<std::array<std::size_t, 2>> crossing_edges(const std::vector<Vec<2>>& vertices);

/// Places on the outline of a body's shape: its corners, or points around a disk.
std::vector<Vec<2>> outline(const BodySpec& body);

/// Initial positions of a body's points, in order [m]: squares of side L / points_per_cell whose centre lies in the body.
/// A box starts its pattern at its own corner, other shapes at the lattice; an inclusion has the pattern of the body it lies in,
/// which goes without those points.
std::vector<Vec<2>> fill(const Scene& scene, const BodySpec& body);

/// Initial positions of the points of all bodies, body after body: by id [m]. Points need not carry them.
std::vector<Vec<2>> initial_positions(const Scene& scene);

/// For each point of a body its number among those that the body would have without inclusions.
std::vector<std::uint32_t> numbers_without_inclusions(const Scene& scene, const BodySpec& body);

/// Side of the square that one point stands for [m].
inline double spacing(const BodySpec& body, const GridSpec& grid)
{
    return grid.cell_size / body.points_per_cell;
}

/// Whether the text is a plain number rather than an expression.
bool is_number(const std::string& text);
}  // namespace testbed
