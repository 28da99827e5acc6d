#pragma once
/// A unit square of four nodes that stands on a smooth base and is pressed from above, for any law and any way to integrate over it: what
/// FEM and FLAC ask of the point function of a law.

#include "core/materials/material.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace testbed::test
{
/// A place where the law is asked: dN/dx and dN/dy of the nodes (0, 0), (1, 0), (1, 1), (0, 1), and the area that it stands for.
struct IntegrationPoint
{
    std::array<double, 4> dx{}, dy{};
    double area = 0;
};

/// Two overlays of two constant-strain triangles, each with half of its area (Marti & Cundall 1982).
inline std::vector<IntegrationPoint> triangles()
{
    constexpr std::array<Vec<2>, 4> node{{{0, 0}, {1, 0}, {1, 1}, {0, 1}}};
    std::vector<IntegrationPoint> points;
    for (const auto& t : std::array<std::array<std::size_t, 3>, 4>{{{0, 1, 2}, {0, 2, 3}, {0, 1, 3}, {1, 2, 3}}})
    {
        IntegrationPoint point;
        point.area = 0.25;
        for (std::size_t k = 0; k < 3; ++k)
        {
            const Vec<2>&b = node[t[(k + 1) % 3]], &c = node[t[(k + 2) % 3]];
            point.dx[t[k]] = b[1] - c[1];  // over twice the area, 1
            point.dy[t[k]] = c[0] - b[0];
        }
        points.push_back(point);
    }
    return points;
}

/// Pressure on the top face after the height has fallen by `strain` in `steps`, with free sides [Pa].
template <class Law>
double pressure_on_top(const Law& law, const std::vector<IntegrationPoint>& points, double strain, int steps)
{
    using State = typename Law::template State<double>;
    std::vector<State> before(points.size()), now;
    const double stiffness = law.moduli.constrained();
    std::array<Vec<2>, 4> force{};
    for (int step = 0; step < steps; ++step)
    {
        std::array<Vec<2>, 4> u{{{0, 0}, {0, 0}, {0, -strain / steps}, {0, -strain / steps}}};
        for (int round = 0; round < 200; ++round)
        {
            now = before;
            force = {};
            for (std::size_t k = 0; k < points.size(); ++k)
            {
                const IntegrationPoint& at = points[k];
                Gradient<2> d{};
                for (std::size_t n = 0; n < 4; ++n)
                    d = d + Gradient<2>{at.dx[n] * u[n][0], at.dy[n] * u[n][1], at.dy[n] * u[n][0], at.dx[n] * u[n][1]};
                law.update(now[k], d);
                const SymTensor<2>& s = now[k].stress;
                for (std::size_t n = 0; n < 4; ++n)
                    force[n] = {force[n][0] + at.area * (s.xx * at.dx[n] + s.xy * at.dy[n]),
                                force[n][1] + at.area * (s.xy * at.dx[n] + s.yy * at.dy[n])};
            }
            if (std::max(std::abs(force[1][0]), std::abs(force[2][0])) < 1e-6 * std::abs(force[2][1]))
                break;
            for (const std::size_t side : {1, 2})  // the right side is free, the left one glides on a wall
                u[side][0] -= force[side][0] / stiffness;
        }
        before = now;
    }
    return -(force[2][1] + force[3][1]);
}
}  // namespace testbed::test
