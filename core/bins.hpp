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
#include <optional>
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
    /// The number that bin b had before the last rebuild() if the same points are in it, which then were not marked.
    std::optional<std::uint32_t> unchanged(std::size_t b) const { return before_[b] == changed ? std::nullopt : std::optional(before_[b]); }
    std::size_t size_before() const { return size_before_; }

    /// Notes that a point of bin number `b` may have left it. Different bins may be marked by different threads.
    void mark(std::size_t b) { marked_[b] = 1; }

    /// Sorts the points by bin, the first time all of them, then those of marked bins: the others go where they go as a block.
    /// Returns whether the list of bins is another one than before.
    /// @param workspace grows to the number of points
    /// @throws Diverged when a point has left the lattice or its position is not finite.
    template <class Support>
    bool rebuild(Points& points, std::vector<double>& workspace)
    {
        std::vector<Bin> before = std::move(bins_);
        const bool is_first = before.empty();
        if (is_first)
        {
            before.push_back({0, 0, 0, static_cast<std::uint32_t>(points.count)});
            marked_.assign(1, 1);
        }
        bins_.clear();
        count<Support>(points, before);
        order(before.size());
        arrange(before);
        marked_.assign(bins_.size(), 0);
        size_before_ = is_first ? 0 : before.size();
        if (!moves_.empty())
        {
            make_room(workspace, points.count);
            points.for_each_field([&](auto& field) { field.reorder(moves_, workspace.data()); });
        }
        return is_first || !std::equal(before.begin(), before.end(), bins_.begin(), bins_.end(),
                                       [](const Bin& a, const Bin& b) { return a.i == b.i && a.j == b.j; });
    }

    std::size_t bytes() const
    {
        return slot_.capacity() * sizeof(slot_[0]) + bins_.capacity() * sizeof(Bin) + key_.capacity() * sizeof(std::uint32_t) +
               moves_.capacity() * sizeof(Move) + marked_.capacity() + before_.capacity() * sizeof(std::uint32_t);
    }

private:
    static constexpr std::uint32_t outside = ~std::uint32_t{0}, changed = outside;

    /// Counts the points of each bin and lists the bins: first those of before, then new ones.
    template <class Support>
    void count(const Points& points, const std::vector<Bin>& before)
    {
        key_.resize(points.count);
        parallel_for(before.size(),
                     [&](std::size_t b)
                     {
                         if (marked_[b])
                             for (std::size_t p = before[b].begin; p < before[b].end; ++p)
                                 key_[p] = key<Support>(points, p);
                     });
        const auto add = [&](std::size_t cell, std::uint32_t n)
        {
            std::int32_t& slot = slot_[cell];
            if (slot < 0)
            {
                slot = static_cast<std::int32_t>(bins_.size());
                bins_.push_back({lattice_.cell_i(cell), lattice_.cell_j(cell), 0, 0});
            }
            bins_[static_cast<std::size_t>(slot)].end += n;
        };
        for (const Bin& b : before)
        {
            slot_[lattice_.cell(b.i, b.j)] = -1;
            add(lattice_.cell(b.i, b.j), 0);
        }
        for (std::size_t b = 0; b < before.size(); ++b)
            if (!marked_[b])
                add(lattice_.cell(before[b].i, before[b].j), before[b].end - before[b].begin);
            else
                for (std::size_t p = before[b].begin; p < before[b].end; ++p)
                {
                    if (key_[p] == outside)
                    {
                        for (const Bin& met : bins_)
                            slot_[lattice_.cell(met.i, met.j)] = -1;
                        bins_.clear();
                        throw_left_lattice(points, p);
                    }
                    add(key_[p], 1);
                }
    }

    /// Bins in the order of their cells, with the place where the points of each begin. The first `sorted` are in order already.
    void order(std::size_t sorted)
    {
        const auto by_cell = [&](const Bin& a, const Bin& b) { return lattice_.cell(a.i, a.j) < lattice_.cell(b.i, b.j); };
        const auto middle = bins_.begin() + static_cast<std::ptrdiff_t>(sorted);
        std::sort(middle, bins_.end(), by_cell);
        std::inplace_merge(bins_.begin(), middle, bins_.end(), by_cell);
        std::erase_if(bins_,
                      [&](const Bin& b)
                      {
                          if (b.end == 0)
                              slot_[lattice_.cell(b.i, b.j)] = -1;
                          return b.end == 0;
                      });
        std::uint32_t begin = 0;
        for (std::size_t b = 0; b < bins_.size(); ++b)
        {
            const std::uint32_t n = bins_[b].end;
            bins_[b].begin = bins_[b].end = begin;
            begin += n;
            slot_[lattice_.cell(bins_[b].i, bins_[b].j)] = static_cast<std::int32_t>(b);
        }
    }

    /// The blocks of points that move, neighbours with the same way taken together.
    void arrange(const std::vector<Bin>& before)
    {
        moves_.clear();
        before_.assign(bins_.size(), changed);
        for (std::uint32_t b = 0; b < before.size(); ++b)
            if (!marked_[b])
                before_[static_cast<std::size_t>(slot_[lattice_.cell(before[b].i, before[b].j)])] = b;
        const auto move = [&](std::uint32_t from, std::size_t cell, std::uint32_t n)
        {
            std::uint32_t& to = bins_[static_cast<std::size_t>(slot_[cell])].end;
            if (!moves_.empty() && moves_.back().from + moves_.back().count == from && moves_.back().to + moves_.back().count == to)
                moves_.back().count += n;
            else if (from != to)
                moves_.push_back({from, to, n});
            to += n;
        };
        for (std::size_t b = 0; b < before.size(); ++b)
            if (!marked_[b])
                move(before[b].begin, lattice_.cell(before[b].i, before[b].j), before[b].end - before[b].begin);
            else
                for (std::uint32_t p = before[b].begin; p < before[b].end; ++p)
                {
                    before_[static_cast<std::size_t>(slot_[key_[p]])] = changed;
                    move(p, key_[p], 1);
                }
    }

    template <class Support>
    std::uint32_t key(const Points& points, std::size_t p) const
    {
        const double L = lattice_.cell_size;
        const double cx = (points.x[p] - lattice_.origin[0]) / L, cy = (points.y[p] - lattice_.origin[1]) / L;
        const bool inside = cx >= 0 && cx < lattice_.nx && cy >= 0 && cy < lattice_.ny;  // false for NaN
        if (!inside)
            return outside;
        if constexpr (!Support::has_box)
            if (points.volume.active() && !(points.volume[p] > 0))
                return outside;
        if constexpr (Support::has_box)
        {
            if (!(points.half_x[p] > 0 && points.half_y[p] > 0))
                return outside;
            const double hx = std::min(points.half_x[p] / L, 0.5), hy = std::min(points.half_y[p] / L, 0.5);
            return static_cast<std::uint32_t>(lattice_.cell(static_cast<int>(std::floor(cx - hx + bin_tolerance)),
                                                            static_cast<int>(std::floor(cy - hy + bin_tolerance))));
        }
        else
        {
            constexpr double half = Support::half_width;
            return static_cast<std::uint32_t>(
                lattice_.cell(static_cast<int>(std::floor(cx - half)), static_cast<int>(std::floor(cy - half))));
        }
    }

    [[noreturn]] static void throw_left_lattice(const Points& points, std::size_t p);

    Lattice lattice_;
    std::vector<Bin> bins_;
    std::vector<std::int32_t> slot_;
    std::vector<std::uint32_t> key_;  ///< cell of each point of a marked bin
    std::vector<Move> moves_;
    std::vector<char> marked_;
    std::vector<std::uint32_t> before_;  ///< number of each bin before the last rebuild, or `changed`
    std::size_t size_before_ = 0;
};

/// Whether a support that began in bin coordinate a = (corner - bin) / L, in [0, 1), still does; false for NaN.
template <class T>
TESTBED_INLINE inline auto is_in_bin(T a)
{
    return a >= T(-bin_tolerance) && a < T(1 - bin_tolerance);
}
}  // namespace testbed
