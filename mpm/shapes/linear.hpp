#pragma once
/// Nodal shape functions as a point sees them, in one direction: values at the S nodes from the bin's first on, and slopes
/// per cell. `a` and `width` as in core/bodies/support.hpp.

#include "core/bodies/support.hpp"

namespace testbed
{
/// Bilinear, evaluated at the point (Sulsky, Chen & Schreyer 1994).
struct LinearShape
{
    static constexpr int S = 2;
    static constexpr bool has_box = false;
    static constexpr bool is_smooth = false;       ///< slopes do not jump at lines of nodes
    static constexpr bool reaches_beyond = false;  ///< the edge of the lattice
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
