#pragma once
/// Cells of any convex shape with nodes that do not move, in place of the lattice's squares (sections 1 and 2 of the paper).

#include "core/lattice/lattice.hpp"
#include "lpfdm/mesh/polygon.hpp"

#include <optional>
#include <string>

namespace testbed
{
/// A list of lists, one behind the other.
template <class T>
class Lists
{
public:
    void append(std::span<const T> list)
    {
        all_.insert(all_.end(), list.begin(), list.end());
        begin_.push_back(static_cast<std::uint32_t>(all_.size()));
    }
    std::size_t size() const { return begin_.size() - 1; }
    std::span<const T> operator[](std::size_t k) const { return {all_.data() + begin_[k], all_.data() + begin_[k + 1]}; }
    std::size_t bytes() const { return all_.capacity() * sizeof(T) + begin_.capacity() * sizeof(begin_[0]); }

private:
    std::vector<T> all_;
    std::vector<std::uint32_t> begin_{0};
};

using MeshCells = std::vector<std::vector<std::uint32_t>>;

class Mesh
{
public:
    /// A cell with a node, and which of its corners that is.
    struct Around
    {
        std::uint32_t cell, corner;
    };

    /// @param nodes their places [m] @param cells their corners @param lattice whose cells hold the points that are to be found
    /// @throws std::invalid_argument naming a cell that does not run anticlockwise or is not convex
    Mesh(std::vector<Vec<2>> nodes, const MeshCells& cells, const Lattice<2>& lattice);

    std::size_t cells() const { return corners_.size(); }
    std::size_t nodes() const { return place_.size(); }
    const Vec<2>& place(std::size_t node) const { return place_[node]; }
    std::span<const std::uint32_t> corners(std::size_t cell) const { return corners_[cell]; }
    std::span<const Vec<2>> places(std::size_t cell) const { return corner_place_[cell]; }  ///< of its corners
    std::span<const Vec<2>> slopes(std::size_t cell) const { return slopes_[cell]; }
    std::span<const Around> around(std::size_t node) const { return around_[node]; }
    double area(std::size_t cell) const { return area_[cell]; }
    double least_height() const { return least_height_; }  ///< from a side to the corner beyond it, of all cells [m]

    /// The cell that holds a place in a cell of the lattice. What lies on a side goes to the cell around which it lies in the first half of
    /// that side, so that rows of points on a diagonal are shared out evenly between its two cells.
    std::optional<std::uint32_t> find(const Index<2>& at, const Vec<2>& place) const;
    /// The same for a place anywhere: none beyond the lattice.
    std::optional<std::uint32_t> find(const Vec<2>& place) const;
    /// Another cell that holds one of some places inside this one, if that lies in the lattice.
    std::optional<std::uint32_t> over(std::size_t cell) const;
    /// Of all corners and where they are: another mesh has another one.
    std::uint32_t checksum() const;
    std::size_t bytes() const;

private:
    /// Cells that reach into a cell of the lattice.
    std::span<const std::uint32_t> in_square(const Index<2>& at) const;
    /// The cell of the lattice that holds a place.
    std::optional<Index<2>> square_of(const Vec<2>& place) const;
    std::optional<std::uint32_t> another_at(const Vec<2>& place, std::size_t cell) const;
    /// Whether a place within rounding of a side of the cell lies in the first half of that side.
    bool is_in_first_half(std::size_t cell, const Vec<2>& place) const;

    std::vector<Vec<2>> place_;
    std::vector<double> area_;
    Lists<std::uint32_t> corners_;
    Lists<Vec<2>> corner_place_, slopes_;
    Lists<Side> sides_;  ///< from each corner to the next
    Lists<Around> around_;
    Lattice<2> lattice_;
    Lists<std::uint32_t> in_square_;  ///< cells that reach into each cell of the lattice, row by row
    double least_height_;
};
}  // namespace testbed
