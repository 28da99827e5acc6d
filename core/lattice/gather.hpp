#pragma once
/// Sums of bins meet at cells or nodes. Each bin writes its S x S (x S) blocks to a place of its own, and each active cell or node
/// then adds the blocks that belong to it in a fixed order: no two threads write to one place, no atomics.

#include "core/lattice/bins.hpp"

#include <span>

namespace testbed
{
class Gather
{
public:
    /// @param entities number of cells or nodes of the lattice, whichever the sums go to.
    explicit Gather(std::size_t entities) : position_(entities, -1) {}

    const std::vector<std::uint32_t>& active() const { return active_; }  ///< ascending
    std::size_t blocks() const { return blocks_; }

    /// @param bins of all bodies, in order; block (slot * S^dim + k) is the k-th entity, row by row, of bin number `slot`.
    /// @param number Index<dim> -> number of the entity.
    template <int S, int dim, class Number>
    void rebuild(std::span<const Bins<dim>* const> bins, Number&& number)
    {
        for (const auto e : active_)
            position_[e] = -1;
        active_.clear();
        for_each_block<S>(bins, number,
                          [&](std::size_t e, std::uint32_t)
                          {
                              if (position_[e] < 0)
                              {
                                  position_[e] = 0;
                                  active_.push_back(static_cast<std::uint32_t>(e));
                              }
                          });
        std::sort(active_.begin(), active_.end());
        active_.shrink_to_fit();
        begin_.assign(active_.size() + 1, 0);
        for (std::size_t a = 0; a < active_.size(); ++a)
            position_[active_[a]] = static_cast<std::int32_t>(a);
        for_each_block<S>(bins, number, [&](std::size_t e, std::uint32_t) { ++begin_[static_cast<std::size_t>(position_[e]) + 1]; });
        std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
        block_.resize(begin_.back());
        std::vector<std::uint32_t> next(begin_.begin(), begin_.end() - 1);
        blocks_ = 0;
        for_each_block<S>(bins, number,
                          [&](std::size_t e, std::uint32_t block)
                          {
                              block_[next[static_cast<std::size_t>(position_[e])]++] = block;
                              blocks_ = block + std::size_t{1};
                          });
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
    template <int S, int dim, class Number, class F>
    static void for_each_block(std::span<const Bins<dim>* const> bins, Number&& number, F&& f)
    {
        std::uint32_t block = 0;
        for (const Bins<dim>* b : bins)
            for (const Bin<dim>& bin : b->list())
                for (int k = 0; k < block_size<S, dim>; ++k)
                    f(number(bin.at + block_index<S, dim>(k)), block++);
    }

    std::vector<std::int32_t> position_;
    std::vector<std::uint32_t> active_, begin_, block_;
    std::size_t blocks_ = 0;
};
}  // namespace testbed
