#pragma once
/// The FEM solution at the points that the particle methods start from.

#include "fem_reference/elasticity.hpp"

#include <map>

namespace testbed
{
class Sampler
{
public:
    /// Finds the cell of each point. On an edge, a cell of the point's own body comes first, then the one to the upper right; a
    /// point beyond a stepped boundary takes the place on the mesh that is nearest.
    Sampler(const Scene& scene, const Lattice<2>& lattice, const dealii::DoFHandler<2>& dofs, const std::vector<Body>& bodies);

    /// Sets position and stress of all points from the displacement.
    void sample(const Vector& displacement, std::vector<Body>& bodies) const;
    /// A field of the mesh at the initial position of a point.
    Vec<2> value(const Vector& field, std::size_t body, std::size_t point) const;
    std::size_t bytes() const;

private:
    struct Cell
    {
        unsigned int body = 0;
        bool exists = false;
        std::uint32_t number = 0;
    };
    /// A place in the unit cell, with the shape functions of one component there. Points in square patterns have few.
    struct Pattern
    {
        std::vector<double> value, dx, dy;
    };
    struct Location
    {
        std::uint32_t cell, pattern;
    };
    using Patterns = std::map<std::pair<long long, long long>, std::uint32_t>;

    const Cell& cell(int i, int j) const;
    std::pair<int, int> cell_of(const Vec<2>& place, unsigned int body) const;
    std::uint32_t pattern_at(const dealii::Point<2>& unit, const dealii::FiniteElement<2>& element, Patterns& known);

    double cell_size_;
    int nx_, ny_;
    std::size_t shapes_;  ///< per component
    std::vector<Cell> cells_;
    std::vector<std::uint32_t> dofs_;  ///< per cell: x and y of each shape function
    std::vector<Pattern> patterns_;
    std::vector<std::vector<Location>> locations_;  ///< by body and point
};
}  // namespace testbed
