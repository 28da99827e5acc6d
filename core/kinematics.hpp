#pragma once
/// Gauss's theorem on a cell (eqs. (1)-(5)) and the nodal forces dual to it (eq. (9)). The polygon forms hold for any cell;
/// the square is their fast case, with nodes [1]..[4] in the numbering of grid.hpp.

#include "core/simd.hpp"
#include "core/types.hpp"

#include <array>
#include <span>
#include <vector>

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

/// Area of a polygon whose corners run anticlockwise [m^2].
inline double polygon_area(std::span<const Vec2> x)
{
    double twice = 0;
    for (std::size_t k = 0, n = x.size(); k < n; ++k)
        twice += x[k][0] * x[(k + 1) % n][1] - x[(k + 1) % n][0] * x[k][1];
    return twice / 2;
}

/// Mean gradient of a field that varies linearly along each side, from its nodal values: eq. (4b) in the form that
/// follows from (4a), <du/dx> = 1/(2A) sum u[k] (y[k+1] - y[k-1]), <du/dy> = 1/(2A) sum u[k] (x[k-1] - x[k+1]).
inline Gradient<> polygon_gradient(std::span<const Vec2> x, std::span<const Vec2> u)
{
    Gradient<> g;
    const std::size_t n = x.size();
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec2 &next = x[(k + 1) % n], &last = x[(k + n - 1) % n];
        g.xx += u[k][0] * (next[1] - last[1]);
        g.yy += u[k][1] * (last[0] - next[0]);
        g.xy += u[k][0] * (last[0] - next[0]);
        g.yx += u[k][1] * (next[1] - last[1]);
    }
    const double scale = 1 / (2 * polygon_area(x));
    return {g.xx * scale, g.yy * scale, g.xy * scale, g.yx * scale};
}

/// Forces at the corners of a polygon that carries the mean stress s: eq. (9) with the signs that virtual work asks for,
/// sum F[k] . u[k] = -A s : <grad u> for every u. [N/m]
inline std::vector<Vec2> polygon_forces(std::span<const Vec2> x, const SymTensor<>& s)
{
    const std::size_t n = x.size();
    std::vector<Vec2> force(n);
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec2 &next = x[(k + 1) % n], &last = x[(k + n - 1) % n];
        const double dy = next[1] - last[1], dx = last[0] - next[0];
        force[k] = {-0.5 * (s.xx * dy + s.xy * dx), -0.5 * (s.xy * dy + s.yy * dx)};
    }
    return force;
}

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
