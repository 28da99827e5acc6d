#pragma once
/// One cell of any convex shape: its corners run anticlockwise.

#include "core/base/types.hpp"

#include <cmath>
#include <span>
#include <vector>

namespace testbed
{
/// Twice the area of a triangle, positive if a, b, c run anticlockwise [m^2].
inline double twice_area(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c)
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/// A grad N of each corner: half the normal, by length, of the side that would join its neighbours. With it eq. (4b), in the form that
/// follows from (4a), is A <grad u> = sum u[k] slope[k], and eq. (9) is F[k] = -<sigma> . slope[k] [m].
inline std::vector<Vec<2>> polygon_slopes(std::span<const Vec<2>> x)
{
    const std::size_t n = x.size();
    std::vector<Vec<2>> slopes(n);
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec<2>&next = x[(k + 1) % n], &last = x[(k + n - 1) % n];
        slopes[k] = {0.5 * (next[1] - last[1]), 0.5 * (last[0] - next[0])};
    }
    return slopes;
}

/// A side with its inward normal: how far a place lies to the left of it is normal . place - offset [m].
struct Side
{
    Vec<2> normal;
    double offset;

    Side(const Vec<2>& a, const Vec<2>& b)
    {
        const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
        normal = {(a[1] - b[1]) / length, (b[0] - a[0]) / length};
        offset = normal[0] * a[0] + normal[1] * a[1];
    }
    double distance(const Vec<2>& place) const { return normal[0] * place[0] + normal[1] * place[1] - offset; }
};

/// Wachspress' (1975) weights of the corners of a convex polygon at a place in it: rational, linear along the sides, of sum one and
/// exact for linear fields; barycentric on triangles and bilinear, as eq. (6), on rectangles.
inline void polygon_weights(std::span<const Vec<2>> x, const Vec<2>& place, std::vector<double>& weights)
{
    const std::size_t n = x.size();
    weights.resize(n);
    double total = 0;
    for (std::size_t k = 0; k < n; ++k)
    {
        const std::size_t last = (k + n - 1) % n;
        double w = twice_area(x[last], x[k], x[(k + 1) % n]);
        for (std::size_t side = 0; side < n; ++side)  // but the two that meet here
            if (side != k && side != last)
                w *= twice_area(place, x[side], x[(side + 1) % n]);
        total += weights[k] = w;
    }
    for (double& w : weights)
        w /= total;
}
}  // namespace testbed
