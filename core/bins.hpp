#pragma once
/// Points kept contiguous by bin. A bin is the cell that holds the lower left corner of a point's support, so that all its
/// points touch the same S x S cells or nodes. The order is rebuilt only in a step in which a point changed its bin.

#include "core/grid.hpp"
#include "core/points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

namespace testbed
{
/// Rounding must not move a box that ends on a lattice line into the next cell [cells].
inline constexpr double bin_tolerance = 1e-9;

struct Bin
{
    int i = 0, j = 0;
    std::uint32_t begin = 0, end = 0;  ///< points
};

class Bins
{
public:
    explicit Bins(const Lattice& lattice) : lattice_(lattice), slot_(lattice.cells(), -1) {}

    const std::vector<Bin>& list() const { return bins_; }

    /// Sorts the points by bin. @param workspace grows to the number of points
    /// @throws Diverged when a point has left the lattice or its position is not finite.
    template <bool has_box>
    void rebuild(Points& points, std::vector<double>& workspace)
    {
        const std::size_t n = points.count;
        place_.resize(n);  // first the bin of each point, then where it goes
        parallel_for(n, [&](std::size_t p) { place_[p] = key<has_box>(points, p); });
        for (const Bin& b : bins_)
            slot_[lattice_.cell(b.i, b.j)] = -1;
        bins_.clear();
        for (std::size_t p = 0; p < n; ++p)
        {
            const std::uint32_t key = place_[p];
            if (key == outside)
                throw_left_lattice(points, p);
            std::int32_t& slot = slot_[key];
            if (slot < 0)
            {
                slot = static_cast<std::int32_t>(bins_.size());
                bins_.push_back({lattice_.cell_i(key), lattice_.cell_j(key), 0, 0});
            }
            ++bins_[static_cast<std::size_t>(slot)].end;  // a count for now
        }
        std::sort(bins_.begin(), bins_.end(),
                  [&](const Bin& a, const Bin& b) { return lattice_.cell(a.i, a.j) < lattice_.cell(b.i, b.j); });
        std::uint32_t begin = 0;
        for (std::size_t b = 0; b < bins_.size(); ++b)
        {
            const std::uint32_t count = bins_[b].end;
            bins_[b].begin = bins_[b].end = begin;
            begin += count;
            slot_[lattice_.cell(bins_[b].i, bins_[b].j)] = static_cast<std::int32_t>(b);
        }
        bool sorted = true;
        for (std::size_t p = 0; p < n; ++p)
        {
            place_[p] = bins_[static_cast<std::size_t>(slot_[place_[p]])].end++;
            sorted &= place_[p] == p;
        }
        if (sorted)
            return;
        make_room(workspace, n);
        points.for_each_field([&](auto& field) { field.reorder(place_, workspace.data()); });
    }

    std::size_t bytes() const
    {
        return slot_.capacity() * sizeof(slot_[0]) + bins_.capacity() * sizeof(Bin) + place_.capacity() * sizeof(std::uint32_t);
    }

private:
    static constexpr std::uint32_t outside = ~std::uint32_t{0};

    template <bool has_box>
    std::uint32_t key(const Points& points, std::size_t p) const
    {
        const double L = lattice_.cell_size;
        const double cx = (points.x[p] - lattice_.origin[0]) / L, cy = (points.y[p] - lattice_.origin[1]) / L;
        const bool inside = cx >= 0 && cx < lattice_.nx && cy >= 0 && cy < lattice_.ny;  // false for NaN
        if (!inside)
            return outside;
        if constexpr (!has_box)
            if (points.volume.active() && !(points.volume[p] > 0))
                return outside;
        if constexpr (has_box)
        {
            if (!(points.half_x[p] > 0 && points.half_y[p] > 0))
                return outside;
            const double hx = std::min(points.half_x[p] / L, 0.5), hy = std::min(points.half_y[p] / L, 0.5);
            return static_cast<std::uint32_t>(lattice_.cell(static_cast<int>(std::floor(cx - hx + bin_tolerance)),
                                                            static_cast<int>(std::floor(cy - hy + bin_tolerance))));
        }
        return static_cast<std::uint32_t>(lattice_.cell(static_cast<int>(cx), static_cast<int>(cy)));
    }

    [[noreturn]] static void throw_left_lattice(const Points& points, std::size_t p);

    Lattice lattice_;
    std::vector<Bin> bins_;
    std::vector<std::int32_t> slot_;
    std::vector<std::uint32_t> place_;
};

/// Whether a support that began in bin coordinate a = (corner - bin) / L, in [0, 1), no longer does; true for NaN.
template <class T>
auto left_bin(T a)
{
    return !(a >= T(-bin_tolerance) && a < T(1 - bin_tolerance));
}
}  // namespace testbed
