#pragma once

#include "core/bodies/support.hpp"

namespace testbed
{
/// Quadratic B-spline about each node, evaluated at the point (Steffen, Kirby & Berzins 2008). At the edge of the lattice see
/// LatticeEdges.
struct BSplineShape
{
    static constexpr int S = 3;
    static constexpr bool has_box = false;
    static constexpr bool is_smooth = true;
    static constexpr bool reaches_beyond = true;
    static constexpr double half_width = 0.5;

    template <class T>
    TESTBED_INLINE static std::array<T, S> weights(T a, T)
    {
        const T low = T(0.5) * (T(1.0) - a) * (T(1.0) - a), high = T(0.5) * a * a;
        return {low, T(1.0) - low - high, high};
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> slopes(T a, T)
    {
        return {a - T(1.0), T(1.0) - T(2.0) * a, a};
    }
};
}  // namespace testbed
