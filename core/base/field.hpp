#pragma once
/// A named array of one number per point. A field that a scene does not need is never allocated.

#include "core/base/parallel.hpp"
#include "core/base/simd.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

namespace testbed
{
/// Room for n numbers whose old values are not needed: no more than that, where resize() may take twice as much.
inline void make_room(std::vector<double>& workspace, std::size_t n)
{
    if (workspace.size() < n)
        std::vector<double>(n).swap(workspace);
}

/// What result files show of a field.
struct Output
{
    enum class When
    {
        never,
        at_start,
        always
    };
    When when = When::never;
    std::string_view name{}, unit{};    ///< of the field, if empty
    double (*value)(double) = nullptr;  ///< of what the field holds, if it is shown otherwise
};
inline constexpr Output shown_always{Output::When::always}, shown_at_start{Output::When::at_start};

/// `count` values from place `from` to place `to`.
struct Move
{
    std::uint32_t from, to, count;
};

template <class T>
class Field
{
public:
    constexpr Field(std::string_view name, std::string_view unit, Output output = {}) : name_(name), unit_(unit), output_(output) {}

    std::string_view name() const { return name_; }
    std::string_view unit() const { return unit_; }
    const Output& output() const { return output_; }
    bool active() const { return !data_.empty(); }
    std::size_t bytes() const { return data_.capacity() * sizeof(T); }

    /// Allocates n values, padded so that a whole pack may be loaded from any of them.
    void activate(std::size_t n, T value = T{}) { data_.assign(n + pack_size, value); }

    T* data() { return data_.data(); }
    const T* data() const { return data_.data(); }
    T& operator[](std::size_t p)
    {
        assert(p < data_.size());
        return data_[p];
    }
    const T& operator[](std::size_t p) const
    {
        assert(p < data_.size());
        return data_[p];
    }

    /// Moves blocks of values, by way of `workspace`, which must hold as many as there are points.
    void reorder(std::span<const Move> moves, double* workspace)
    {
        parallel_for(moves.size(), [&](std::size_t k) { std::copy_n(&data_[moves[k].from], moves[k].count, workspace + moves[k].to); });
        parallel_for(moves.size(),
                     [&](std::size_t k)
                     {
                         const double* from = workspace + moves[k].to;
                         std::transform(from, from + moves[k].count, &data_[moves[k].to], [](double v) { return static_cast<T>(v); });
                     });
    }

    /// Value `k` from place `begin` on becomes that of place order[k], by way of `workspace`, too, or in its place if it is as long as the
    /// field and most values move.
    void reorder(std::span<const std::uint32_t> order, std::size_t begin, std::vector<double>& workspace)
    {
        parallel_for(
            order.size(), [&](std::size_t k) { workspace[begin + k] = static_cast<double>(data_[order[k]]); }, 4096);
        if constexpr (std::is_same_v<T, double>)
            if (workspace.size() == data_.size() && order.size() > data_.size() / 2)
            {
                const auto end = static_cast<std::ptrdiff_t>(begin + order.size());
                std::copy_n(data_.begin(), begin, workspace.begin());
                std::copy(data_.begin() + end, data_.end(), workspace.begin() + end);
                return data_.swap(workspace);
            }
        parallel_for(
            order.size(), [&](std::size_t k) { data_[begin + k] = static_cast<T>(workspace[begin + k]); }, 4096);
    }

private:
    std::string_view name_, unit_;
    Output output_;
    std::vector<T> data_;
};

/// A list of numbers for each component of a vector or tensor, at points, cells or nodes.
template <class List>
concept ComponentList = requires(List list)
{
    list.data();
};

template <ComponentList List, std::size_t n, class Lanes>
TESTBED_INLINE inline std::array<typename Lanes::Pack, n> load(const std::array<List, n>& lists, std::size_t i, const Lanes& lanes)
{
    std::array<typename Lanes::Pack, n> v;
    unrolled<n>([&](auto d) TESTBED_INLINE { v[d] = lanes.load(&lists[d][i]); });
    return v;
}
template <ComponentList List, std::size_t n, class Lanes>
TESTBED_INLINE inline void store(std::array<List, n>& lists, std::size_t i, const Lanes& lanes,
                                 const std::array<typename Lanes::Pack, n>& v)
{
    unrolled<n>([&](auto d) TESTBED_INLINE { lanes.store(&lists[d][i], v[d]); });
}
template <ComponentList List, std::size_t n>
std::array<double, n> at(const std::array<List, n>& lists, std::size_t i)
{
    std::array<double, n> v;
    for (std::size_t d = 0; d < n; ++d)
        v[d] = lists[d][i];
    return v;
}
template <ComponentList List, std::size_t n>
void set(std::array<List, n>& lists, std::size_t i, const std::array<double, n>& v)
{
    for (std::size_t d = 0; d < n; ++d)
        lists[d][i] = v[d];
}
}  // namespace testbed
