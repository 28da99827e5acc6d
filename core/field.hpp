#pragma once
/// A named array of one number per point. A field that a scene does not need is never allocated.

#include "core/parallel.hpp"
#include "core/simd.hpp"

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

namespace testbed
{
template <class T>
class Field
{
public:
    constexpr Field(std::string_view name, std::string_view unit) : name_(name), unit_(unit) {}

    std::string_view name() const { return name_; }
    std::string_view unit() const { return unit_; }
    bool active() const { return !data_.empty(); }
    std::size_t bytes() const { return data_.capacity() * sizeof(T); }

    /// Allocates n values, padded so that a pack may be loaded from any of them. The padding holds the same value: what a kernel
    /// makes of it is masked, but must be finite.
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

    /// Value p becomes the old value order[p]; scratch is swapped in.
    void reorder(const std::vector<std::uint32_t>& order, std::vector<T>& scratch)
    {
        scratch.resize(data_.size());
        parallel_for(order.size(), [&](std::size_t p) { scratch[p] = data_[order[p]]; });
        std::copy(data_.begin() + static_cast<std::ptrdiff_t>(order.size()), data_.end(),
                  scratch.begin() + static_cast<std::ptrdiff_t>(order.size()));
        data_.swap(scratch);
    }

private:
    std::string_view name_, unit_;
    std::vector<T> data_;
};
}  // namespace testbed
