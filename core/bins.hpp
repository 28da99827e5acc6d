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

    /// Sorts the points by bin. @throws Diverged when a point has left the lattice or its position is not finite.
    template <bool has_box>
    void rebuild(Points& points)
    {
        const std::size_t n = points.count;
        key_.resize(n);
        parallel_for(n, [&](std::size_t p) { key_[p] = key<has_box>(points, p); });
        for (const Bin& b : bins_)
            slot_[lattice_.cell(b.i, b.j)] = -1;
        bins_.clear();
        for (std::size_t p = 0; p < n; ++p)
        {
            if (key_[p] == outside)
                throw_left_lattice(points, p);
            std::int32_t& slot = slot_[key_[p]];
            if (slot < 0)
            {
                slot = static_cast<std::int32_t>(bins_.size());
                bins_.push_back({lattice_.cell_i(key_[p]), lattice_.cell_j(key_[p]), 0, 0});
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
        order_.resize(n);
        bool sorted = true;
        for (std::uint32_t p = 0; p < n; ++p)
        {
            const std::uint32_t to = bins_[static_cast<std::size_t>(slot_[key_[p]])].end++;
            order_[to] = p;
            sorted &= to == p;
        }
        if (!sorted)
            points.for_each_field([&](auto& field) { reorder(field); });
    }

    std::size_t bytes() const
    {
        return slot_.capacity() * sizeof(slot_[0]) + bins_.capacity() * sizeof(Bin) +
               (key_.capacity() + order_.capacity()) * sizeof(std::uint32_t) + scratch_.capacity() * sizeof(double) +
               scratch_id_.capacity() * sizeof(std::uint32_t);
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

    void reorder(Field<double>& field) { field.reorder(order_, scratch_); }
    void reorder(Field<std::uint32_t>& field) { field.reorder(order_, scratch_id_); }

    Lattice lattice_;
    std::vector<Bin> bins_;
    std::vector<std::int32_t> slot_;
    std::vector<std::uint32_t> key_, order_;
    std::vector<double> scratch_;
    std::vector<std::uint32_t> scratch_id_;
};

/// Whether a support that began in bin coordinate a = (corner - bin) / L, in [0, 1), no longer does; true for NaN.
template <class T>
auto left_bin(T a)
{
    return !(a >= T(-bin_tolerance) && a < T(1 - bin_tolerance));
}
}  // namespace testbed
