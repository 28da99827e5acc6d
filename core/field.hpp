#pragma once
/// A named array of one number per point. A field that a scene does not need is never allocated.

#include "core/parallel.hpp"
#include "core/simd.hpp"

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace testbed
{
/// Room for n numbers whose old values are not needed: no more than that, where resize() may take twice as much.
inline void make_room(std::vector<double>& workspace, std::size_t n)
{
    if (workspace.size() < n)
        std::vector<double>(n).swap(workspace);
}

template <class T>
class Field
{
public:
    constexpr Field(std::string_view name, std::string_view unit) : name_(name), unit_(unit) {}

    std::string_view name() const { return name_; }
    std::string_view unit() const { return unit_; }
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

    /// Value p goes to place[p], by way of `workspace`, which must hold as many.
    void reorder(std::span<const std::uint32_t> place, double* workspace)
    {
        parallel_for(place.size(), [&](std::size_t p) { workspace[place[p]] = static_cast<double>(data_[p]); });
        parallel_for(place.size(), [&](std::size_t p) { data_[p] = static_cast<T>(workspace[p]); });
    }

private:
    std::string_view name_, unit_;
    std::vector<T> data_;
};
}  // namespace testbed
