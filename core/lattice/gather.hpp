#pragma once
/// Sums of bins meet at cells or nodes. Each bin writes its S x S (x S) blocks to a place of its own, and each active cell or node
/// then adds the blocks that belong to it in a fixed order: no two threads write to one place, no atomics.

#include "core/lattice/bins.hpp"

#include <span>

namespace testbed
{
/// What is in one of two ascending lists or in both, the second one moved on by `shift`.
inline std::vector<std::uint32_t> joined(const std::vector<std::uint32_t>& a, const std::vector<std::uint32_t>& b, std::size_t shift)
{
    std::vector<std::uint32_t> both;
    both.reserve(a.size() + b.size() / 4);
    auto next = a.begin();
    for (const auto n : b)
    {
        const auto moved = static_cast<std::uint32_t>(n + shift);
        for (; next != a.end() && *next < moved; ++next)
            both.push_back(*next);
        if (next == a.end() || *next != moved)
            both.push_back(moved);
    }
    both.insert(both.end(), next, a.end());
    return both;
}

class Gather
{
public:
    /// @param entities number of cells or nodes of the lattice, whichever the sums go to.
    explicit Gather(std::size_t entities) : position_(entities) {}

    const std::vector<std::uint32_t>& active() const { return active_; }  ///< ascending
    std::size_t blocks() const { return block_.size(); }

    /// @param bins of all bodies, in order; block (slot * S^dim + k) is the k-th entity, row by row, of bin number `slot`.
    /// @param number Index<dim> -> number of the entity.
    template <int S, int dim, class Number>
    void rebuild(std::span<const Bins<dim>* const> bins, Number&& number)
    {
        active_ = find_active<S>(bins, number);
        for (std::size_t a = 0; a < active_.size(); ++a)
            position_[active_[a]] = static_cast<std::uint32_t>(a);
        begin_.assign(active_.size() + 2, 0);
        for_each_block<S>(bins, number, [&](std::size_t e, std::uint32_t) { ++begin_[position_[e] + std::size_t{2}]; });
        std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
        block_.resize(begin_.back());
        for_each_block<S>(bins, number,
                          [&](std::size_t e, std::uint32_t block)
                          { block_[begin_[position_[e] + std::size_t{1}]++] = block; });  // which leaves the next one's begin
    }

    /// sink(entity, sums): for every active entity the sum of its blocks of Q numbers.
    template <std::size_t Q, class Sink>
    void sum(const std::vector<double>& partial, Sink&& sink) const
    {
        parallel_for(active_.size(),
                     [&](std::size_t a)
                     {
                         std::array<double, Q> s{};
                         for (std::uint32_t k = begin_[a]; k < begin_[a + 1]; ++k)
                             for (std::size_t q = 0; q < Q; ++q)
                                 s[q] += partial[block_[k] * Q + q];
                         sink(active_[a], s);
                     });
    }

    std::size_t bytes() const
    {
        return position_.capacity() * sizeof(position_[0]) +
               (active_.capacity() + begin_.capacity() + block_.capacity()) * sizeof(std::uint32_t);
    }

private:
    /// The entities of all blocks: those of the bins' own cells, and then, direction by direction, those beside them. Bins are in order,
    /// so that these are ascending lists.
    template <int S, int dim, class Number>
    static std::vector<std::uint32_t> find_active(std::span<const Bins<dim>* const> bins, Number&& number)
    {
        std::vector<std::uint32_t> active;
        for (const Bins<dim>* b : bins)
        {
            std::vector<std::uint32_t> own;
            for (const Bin<dim>& bin : b->list())
                own.push_back(static_cast<std::uint32_t>(number(bin.at)));
            active = joined(active, own, 0);
        }
        for (std::size_t d = 0; d < dim; ++d)
        {
            Index<dim> beside{};
            beside[d] = 1;
            for (int k = 1; k < S; ++k)
                active = joined(active, active, number(beside) - number(Index<dim>{}));
        }
        active.shrink_to_fit();
        return active;
    }
    template <int S, int dim, class Number, class F>
    static void for_each_block(std::span<const Bins<dim>* const> bins, Number&& number, F&& f)
    {
        std::uint32_t block = 0;
        for (const Bins<dim>* b : bins)
            for (const Bin<dim>& bin : b->list())
                for (int k = 0; k < block_size<S, dim>; ++k)
                    f(number(bin.at + block_index<S, dim>(k)), block++);
    }

    std::vector<std::uint32_t> position_;  ///< of an active entity among them
    std::vector<std::uint32_t> active_, begin_, block_;
};
}  // namespace testbed
