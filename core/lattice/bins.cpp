#include "core/lattice/bins.hpp"

#include <fmt/ranges.h>

namespace testbed
{
template <int dim>
void Bins<dim>::reorder(Points<dim>& points, std::vector<double>& workspace)
{
    constexpr std::uint32_t short_block = 8;
    make_room(workspace, points.count + pack_size);
    std::uint32_t begin = none, end = 0, moved = 0;
    for (const Move& move : moves_)
    {
        begin = std::min(begin, move.to);
        end = std::max(end, move.to + move.count);
        moved += move.count;
    }
    if (moved > short_block * moves_.size() || moved < (end - begin) / 4)
        return points.for_each_field([&](auto& field) { field.reorder(moves_, workspace.data()); });
    std::vector<std::uint32_t> order(end - begin);
    std::iota(order.begin(), order.end(), begin);
    for (const Move& move : moves_)
        std::iota(&order[move.to - begin], &order[move.to - begin] + move.count, move.from);
    points.for_each_field([&](auto& field) { field.reorder(order, begin, workspace); });
}

template <int dim>
void Bins<dim>::make_slots()
{
    auto reach = CellBox<dim>::none();
    const auto take = [&](const Index<dim>& cell) { reach.extend({cell, cell + all<dim>(1)}); };
    for_each_marked([&](std::uint32_t, std::uint32_t p) { take(lattice_.cell_index(key_[p])); });
    if (with_numbers_for(slots_, reach).numbered == slots_.numbered)
        return;
    for (const Bin<dim>& b : bins_)
        take(b.at);
    slots_ = with_numbers_for(slots_, reach);
    slot_.assign(slots_.cells(), -1);
    for (std::size_t b = 0; b < bins_.size(); ++b)
        slot_of(bins_[b]) = static_cast<std::int32_t>(b);
}

template <int dim>
bool Bins<dim>::insert_new()
{
    std::vector<std::uint32_t> cells;
    for_each_marked(
        [&](std::uint32_t, std::uint32_t p)
        {
            if (std::int32_t& slot = slot_[place(key_[p])]; slot < 0)
            {
                slot = 0;
                cells.push_back(key_[p]);
            }
        });
    if (cells.empty())
        return false;
    std::sort(cells.begin(), cells.end());
    const std::vector<Bin<dim>> old = std::exchange(bins_, {});
    const std::vector<char> old_marked = std::exchange(marked_, {});
    before_.clear();
    const auto add = [&](const Bin<dim>& bin, char is_marked, std::uint32_t number)
    {
        slot_of(bin) = static_cast<std::int32_t>(bins_.size());
        bins_.push_back(bin);
        marked_.push_back(is_marked);
        before_.push_back(number);
    };
    auto cell = cells.begin();
    const auto add_up_to = [&](std::size_t end, std::uint32_t place)
    {
        for (; cell != cells.end() && *cell < end; ++cell)
            add({lattice_.cell_index(*cell), place, place}, 0, none);
    };
    for (std::uint32_t b = 0; b < old.size(); ++b)
    {
        add_up_to(lattice_.cell(old[b].at), old[b].begin);
        add(old[b], old_marked[b], b);
    }
    add_up_to(none, old.back().end);
    list_marked();
    return true;
}

template <int dim>
void Bins<dim>::exchange()
{
    moves_.clear();
    changed_.clear();
    std::uint32_t first = none, last = 0;
    const auto touch = [&](std::uint32_t b)
    {
        first = std::min(first, b);
        last = std::max(last, b);
        if (std::exchange(before_[b], none) != none)
            changed_.push_back(b);
    };
    next_.resize(bins_.size());
    for (const auto b : marks_)
        touch(b);
    for_each_marked([&](std::uint32_t, std::uint32_t p) { touch(slot(p)); });
    if (first == none)
        return;
    for (std::uint32_t b = first; b <= last; ++b)
        next_[b] = bins_[b].end - bins_[b].begin;
    for_each_marked(
        [&](std::uint32_t b, std::uint32_t p)
        {
            --next_[b];
            ++next_[slot(p)];
        });
    std::exclusive_scan(next_.begin() + first, next_.begin() + last + 1, next_.begin() + first, bins_[first].begin);
    const auto move = [&](std::uint32_t from, std::uint32_t bin, std::uint32_t n)
    {
        std::uint32_t& to = next_[bin];
        if (!moves_.empty() && moves_.back().from + moves_.back().count == from && moves_.back().to + moves_.back().count == to)
            moves_.back().count += n;
        else if (from != to)
            moves_.push_back({from, to, n});
        to += n;
    };
    const std::uint32_t begin = bins_[first].begin;
    for (std::uint32_t b = first; b <= last; ++b)
        if (!marked_[b])
            move(bins_[b].begin, b, bins_[b].end - bins_[b].begin);
        else
            for (std::uint32_t p = bins_[b].begin; p < bins_[b].end; ++p)
                move(p, slot(p), 1);
    for (std::uint32_t b = first; b <= last; ++b)  // each has been filled up to the next
    {
        bins_[b].begin = b == first ? begin : bins_[b - 1].end;
        bins_[b].end = next_[b];
    }
}

template <int dim>
bool Bins<dim>::erase_empty()
{
    if (std::none_of(marks_.begin(), marks_.end(), [&](std::uint32_t b) { return bins_[b].begin == bins_[b].end; }))
        return false;
    std::size_t kept = 0;
    for (std::size_t b = 0; b < bins_.size(); ++b)
    {
        const bool is_empty = bins_[b].begin == bins_[b].end;
        slot_of(bins_[b]) = is_empty ? -1 : static_cast<std::int32_t>(kept);
        if (is_empty)
            continue;
        bins_[kept] = bins_[b];
        before_[kept++] = before_[b];
    }
    bins_.resize(kept);
    before_.resize(kept);
    return true;
}

template <int dim>
void Bins<dim>::throw_left_lattice(const Points<dim>& points, std::size_t p)
{
    const auto list = [&](const auto& vector) { return fmt::format("({:.6g})", fmt::join(at(vector, p), ", ")); };
    if (points.has_box() && !std::all_of(points.half_width.begin(), points.half_width.end(), [&](const auto& half) { return half[p] > 0; }))
        throw Diverged(fmt::format("the box of point {} has collapsed: half widths {} m", points.id[p], list(points.half_width)));
    throw Diverged(fmt::format("point {} left the lattice or is not finite: position {} m", points.id[p], list(points.x)));
}
template class Bins<2>;
template class Bins<3>;
}  // namespace testbed
