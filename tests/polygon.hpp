#pragma once
/// Gauss's theorem on any polygon (eqs. (1)-(5)) and the nodal forces dual to it (eq. (9)): the oracle of the square cell.

#include "core/base/types.hpp"

#include <span>
#include <vector>

namespace testbed
{
/// Area of a polygon whose corners run anticlockwise [m^2].
inline double polygon_area(std::span<const Vec<2>> x)
{
    double twice = 0;
    for (std::size_t k = 0, n = x.size(); k < n; ++k)
        twice += x[k][0] * x[(k + 1) % n][1] - x[(k + 1) % n][0] * x[k][1];
    return twice / 2;
}

/// Mean gradient of a field that varies linearly along each side, from its nodal values: eq. (4b) in the form that
/// follows from (4a), <du/dx> = 1/(2A) sum u[k] (y[k+1] - y[k-1]), <du/dy> = 1/(2A) sum u[k] (x[k-1] - x[k+1]).
inline Gradient<2> polygon_gradient(std::span<const Vec<2>> x, std::span<const Vec<2>> u)
{
    Gradient<2> g;
    const std::size_t n = x.size();
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec<2>&next = x[(k + 1) % n], &last = x[(k + n - 1) % n];
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
inline std::vector<Vec<2>> polygon_forces(std::span<const Vec<2>> x, const SymTensor<2>& s)
{
    const std::size_t n = x.size();
    std::vector<Vec<2>> force(n);
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec<2>&next = x[(k + 1) % n], &last = x[(k + n - 1) % n];
        const double dy = next[1] - last[1], dx = last[0] - next[0];
        force[k] = {-0.5 * (s.xx * dy + s.xy * dx), -0.5 * (s.xy * dy + s.yy * dx)};
    }
    return force;
}
}  // namespace testbed
