#pragma once
/// Points kept contiguous by bin. A bin is the cell that holds the lower left corner of a point's support, so that all its
/// points touch the same S x S (x S) cells or nodes. Points are sorted only in a step in which one changed its bin, the list of bins
/// changes only if one is new or empty.

#include "core/lattice/lattice.hpp"
#include "core/lattice/points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <optional>
#include <span>
#include <utility>
#include <vector>

namespace testbed
{
/// Rounding must not move a box that ends on a lattice line into the next cell [cells].
inline constexpr double bin_tolerance = 1e-9;

template <int dim>
struct Bin
{
    Index<dim> at{};                   ///< cell
    std::uint32_t begin = 0, end = 0;  ///< points
};

template <int dim>
class Bins
{
public:
    explicit Bins(const Lattice<dim>& lattice) : lattice_(lattice), slots_(without_numbers(lattice)) {}

    const std::vector<Bin<dim>>& list() const { return bins_; }
    /// The number that bin b had before the last rebuild() if the same points are in it, which then were not marked.
    std::optional<std::uint32_t> unchanged(std::size_t b) const { return before_[b] == none ? std::nullopt : std::optional(before_[b]); }
    std::size_t size_before() const { return size_before_; }
    /// The bins that are not unchanged, if the last rebuild() left the list as it was; else none.
    const std::vector<std::uint32_t>& changed() const { return changed_; }

    /// Notes that a point of bin number `b` may have left it. Different bins may be marked by different threads.
    void mark(std::size_t b) { marked_[b] = 1; }

    /// Sorts the points by bin, the first time all of them, then those of marked bins: the others go where they go as a block.
    /// Returns whether the list of bins is another one than before.
    /// @param workspace grows to the number of points
    /// @throws Diverged when a point has left the lattice or its position is not finite.
    template <class Support>
    bool rebuild(Points<dim>& points, std::vector<double>& workspace)
    {
        const bool is_first = bins_.empty();
        size_before_ = bins_.size();
        if (is_first)
        {
            bins_.push_back({{}, 0, static_cast<std::uint32_t>(points.count)});
            marked_.assign(1, 1);
        }
        before_.resize(bins_.size());
        std::iota(before_.begin(), before_.end(), 0u);
        list_marked();
        find_keys<Support>(points);
        if (const auto lost = find_lost())
        {
            if (is_first)
                bins_.clear();
            throw_left_lattice(points, *lost);
        }
        if (is_first)
            bins_[0].at = lattice_.cell_index(key_[0]);
        make_slots();
        const bool has_new = insert_new();
        exchange();
        const bool has_lost = erase_empty();
        if (has_new || has_lost)
            changed_.clear();
        marked_.assign(bins_.size(), 0);
        if (!moves_.empty())
            reorder(points, workspace);
        return is_first || has_new || has_lost;
    }

    /// The marks, too: between two steps points may have left the bins in which they still stand.
    template <class Archive>
    void state(Archive& a)
    {
        a.indices(bins_, &Bin<dim>::at);
        a.column("begin", "-", bins_, &Bin<dim>::begin);
        a.column("end", "-", bins_, &Bin<dim>::end);
        a.column("marked", "-", marked_);
        if constexpr (Archive::reads)
        {
            slots_ = without_numbers(lattice_);
            before_.assign(bins_.size(), none);
        }
    }
    bool has_marks() const { return std::find(marked_.begin(), marked_.end(), 1) != marked_.end(); }

    std::size_t bytes() const
    {
        return slot_.capacity() * sizeof(slot_[0]) + bins_.capacity() * sizeof(Bin<dim>) + moves_.capacity() * sizeof(Move) +
               marked_.capacity() +
               (key_.capacity() + before_.capacity() + marks_.capacity() + changed_.capacity() + next_.capacity()) * sizeof(std::uint32_t);
    }

private:
    /// Block by block, or all between the first and the last that moves by one permutation where most of these move alone.
    void reorder(Points<dim>& points, std::vector<double>& workspace);

    static constexpr std::uint32_t none = ~std::uint32_t{0};

    void list_marked()
    {
        marks_.clear();
        for (auto m = std::find(marked_.begin(), marked_.end(), 1); m != marked_.end(); m = std::find(m + 1, marked_.end(), 1))
            marks_.push_back(static_cast<std::uint32_t>(m - marked_.begin()));
    }
    template <class Support>
    void find_keys(const Points<dim>& points)
    {
        key_.resize(points.count);
        parallel_for(marks_.size(),
                     [&](std::size_t m)
                     {
                         for (std::size_t p = bins_[marks_[m]].begin; p < bins_[marks_[m]].end; ++p)
                             key_[p] = key<Support>(points, p);
                     });
    }
    /// f(bin number, point) for the points of marked bins.
    template <class F>
    void for_each_marked(F&& f)
    {
        for (const auto b : marks_)
            for (std::uint32_t p = bins_[b].begin; p < bins_[b].end; ++p)
                f(b, p);
    }
    std::optional<std::size_t> find_lost()
    {
        std::optional<std::size_t> lost;
        for_each_marked(
            [&](std::uint32_t, std::uint32_t p)
            {
                if (key_[p] == none && !lost)
                    lost = p;
            });
        return lost;
    }

    /// Slots for all cells that points of marked bins go to.
    void make_slots();

    /// Empty bins for the points that have none yet, in the order of cells.
    bool insert_new();

    /// Finds how points go to their bins: the blocks that move, neighbours with the same way taken together. All bins between the first
    /// and the last that wins or loses points may shift.
    void exchange();

    bool erase_empty();

    /// Number of the bin to which a point of a marked bin goes.
    std::uint32_t slot(std::uint32_t p) const { return static_cast<std::uint32_t>(slot_[place(key_[p])]); }
    std::size_t place(std::uint32_t cell) const { return slots_.cell(lattice_.cell_index(cell)); }
    std::int32_t& slot_of(const Bin<dim>& bin) { return slot_[slots_.cell(bin.at)]; }

    template <class Support>
    std::uint32_t key(const Points<dim>& points, std::size_t p) const
    {
        const double L = lattice_.cell_size;
        if constexpr (!Support::has_box)
            if (points.volume.active() && !(points.volume[p] > 0))
                return none;
        Index<dim> cell;
        for (int d = 0; d < dim; ++d)
        {
            const double c = (points.x[d][p] - lattice_.origin[d]) / L;
            if (!(c >= 0 && c < lattice_.size[d]))  // NaN, too
                return none;
            if constexpr (Support::has_box)
            {
                if (!(points.half_width[d][p] > 0))
                    return none;
                cell[d] = static_cast<int>(std::floor(c - std::min(points.half_width[d][p] / L, 0.5) + bin_tolerance));
            }
            else
                cell[d] = static_cast<int>(std::floor(c - Support::half_width));
        }
        return static_cast<std::uint32_t>(lattice_.cell(cell));
    }

    [[noreturn]] static void throw_left_lattice(const Points<dim>& points, std::size_t p);

    Lattice<dim> lattice_;
    std::vector<Bin<dim>> bins_;
    Lattice<dim> slots_;              ///< with numbers for the cells around the points
    std::vector<std::int32_t> slot_;  ///< number of the bin of each of these, or -1
    std::vector<char> marked_;
    std::vector<std::uint32_t> marks_;   ///< numbers of the marked bins
    std::vector<std::uint32_t> key_;     ///< cell of each point of a marked bin
    std::vector<std::uint32_t> before_;  ///< number of each bin before the last rebuild if it is unchanged, or `none`
    std::vector<std::uint32_t> changed_;
    std::vector<std::uint32_t> next_;  ///< where the next point of each bin goes
    std::vector<Move> moves_;
    std::size_t size_before_ = 0;
};

/// The lattice with numbers for all that the S x S (x S) cells or nodes of bins touch.
template <int S, int dim>
Lattice<dim> with_numbers_for(const Lattice<dim>& lattice, std::span<const Bins<dim>* const> bins)
{
    auto reach = CellBox<dim>::none();
    for (const Bins<dim>* b : bins)
        for (const Bin<dim>& bin : b->list())
            reach.extend({bin.at, bin.at + all<dim>(S)});
    return with_numbers_for(lattice, reach);
}

/// Whether a support that began in bin coordinate a = (corner - bin) / L, in [0, 1), still does; false for NaN.
template <class T>
TESTBED_INLINE inline auto is_in_bin(T a)
{
    return a >= T(-bin_tolerance) && a < T(1 - bin_tolerance);
}
}  // namespace testbed
