#pragma once
/// Gauss's theorem on a cell (eqs. (1)-(5)) and the nodal forces dual to it (eq. (9)), with nodes
/// [1]..[4] in the numbering of grid.hpp.

#include "core/base/simd.hpp"
#include "core/base/types.hpp"

#include <array>

namespace testbed
{
/// Strain, rotation and stretch of a step from the displacement gradient G over the configuration at its start: G (I + theta G)^-1, the
/// gradient over the configuration at theta (generalised midpoint rule, Hughes & Winget 1980). theta = 1/2 is second order: an increment of
/// rotation strains nothing, a stretch and its inverse cancel; theta = 0 leaves G, first order.
struct StrainIncrement
{
    double theta = 0.5;

    /// The inverse of the determinant is taken as 1 - e + e^2: what is left out is of third order in the strain of one step, as is what the
    /// midpoint itself leaves out, and a division costs as much as all else.
    template <class T>
    TESTBED_INLINE Gradient<T> of(const Gradient<T>& g) const
    {
        const T det = g.xx * g.yy - g.xy * g.yx, share(theta), half = share * det;
        const T e = share * (g.trace() + half), inverse = T(1.0) - e * (T(1.0) - e);
        return {(g.xx + half) * inverse, (g.yy + half) * inverse, g.xy * inverse, g.yx * inverse};
    }
    /// Ratio of new to old length, or volume, for an increment of strain, or its trace, by of().
    template <class T>
    TESTBED_INLINE T stretch(const T& d) const
    {
        return T(1.0) + d * (T(1.0) + T(theta) * d);
    }
};

/// Eqs. (5a)-(5d) on a square cell: nodal values ux[4], uy[4] of a velocity [m/s] or increment [m], scale = dt/(2L) or 1/(2L).
template <class T>
Gradient<T> square_gradient(const std::array<T, 4>& ux, const std::array<T, 4>& uy, T scale)
{
    return {(ux[1] + ux[3] - ux[0] - ux[2]) * scale, (uy[2] + uy[3] - uy[0] - uy[1]) * scale, (ux[2] + ux[3] - ux[0] - ux[1]) * scale,
            (uy[1] + uy[3] - uy[0] - uy[2]) * scale};
}

/// Eq. (9) on a square cell: force at node k = 0..3 from the smeared stress s [Pa]; half_side = L/2.
template <class T>
std::array<T, 2> square_force(int k, const SymTensor<T>& s, double half_side)
{
    const T a((k == 1 || k == 3) ? -half_side : half_side);  // -1/2 (y[k+1] - y[k-1])
    const T b((k >= 2) ? -half_side : half_side);            // -1/2 (x[k-1] - x[k+1])
    return {s.xx * a + s.xy * b, s.xy * a + s.yy * b};
}
}  // namespace testbed
