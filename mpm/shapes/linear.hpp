#pragma once

#include "core/bodies/support.hpp"

namespace testbed
{
/// Bilinear, evaluated at the point (Sulsky, Chen & Schreyer 1994).
struct LinearShape
{
    static constexpr int S = 2;
    static constexpr bool has_box = false;
    static constexpr bool is_smooth = false;
    static constexpr bool reaches_beyond = false;
    static constexpr double half_width = 0;

    template <class T>
    TESTBED_INLINE static std::array<T, S> weights(T a, T)
    {
        return {T(1.0) - a, a};
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> slopes(T, T)
    {
        return {T(-1.0), T(1.0)};
    }
};
}  // namespace testbed
