#pragma once

#include "core/bodies/support.hpp"

namespace testbed
{
/// Mean of the linear shape function and of its slope over the point's box (Bardenhagen & Kober 2004); the box stretches
/// with the point, so that neighbours stay contiguous (cpGIMP).
struct GimpShape
{
    static constexpr int S = 3;
    static constexpr bool has_box = true;
    static constexpr bool is_smooth = true;
    static constexpr bool reaches_beyond = false;

    template <class T>
    TESTBED_INLINE static std::array<T, S> weights(T a, T width)
    {
        return weights_by(a, width, T(1.0) / width);
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> weights_by(T a, T width, T inverse)
    {
        const T second = above(a + width - T(1.0), bin_tolerance), first = width - second;
        const T low = first * (T(1.0) - a - T(0.5) * first) * inverse, high = T(0.5) * second * second * inverse;
        return {low, T(1.0) - low - high, high};
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> slopes(T a, T width)
    {
        return slopes_by(a, width, T(1.0) / width);
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> slopes_by(T a, T width, T inverse)
    {
        const T second = above(a + width - T(1.0), bin_tolerance) * inverse, first = T(1.0) - second;
        return {-first, first - second, second};
    }
};
}  // namespace testbed
