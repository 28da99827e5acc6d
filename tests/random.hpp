#pragma once
/// Reproducible random input for tests.

#include "core/base/types.hpp"
#include "core/lattice/points.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

namespace testbed::test
{
class Random
{
public:
    explicit Random(unsigned seed) : engine_(seed) {}
    double operator()(double low, double high) { return low + (high - low) * static_cast<double>(engine_()) / 4294967296.0; }

    /// A convex polygon with n corners on an ellipse, anticlockwise.
    std::vector<Vec<2>> convex_polygon(int n)
    {
        std::vector<double> angle;
        for (int k = 0; k < n; ++k)
            angle.push_back(2 * std::numbers::pi * (k + (*this)(0.1, 0.9)) / n);
        const double a = (*this)(0.5, 2), b = (*this)(0.5, 2), cx = (*this)(-3, 3), cy = (*this)(-3, 3);
        std::vector<Vec<2>> corners;
        for (const double t : angle)
            corners.push_back({cx + a * std::cos(t), cy + b * std::sin(t)});
        return corners;
    }
    std::vector<Vec<2>> vectors(std::size_t n)
    {
        std::vector<Vec<2>> v(n);
        for (Vec<2>& x : v)
            x = {(*this)(-1, 1), (*this)(-1, 1)};
        return v;
    }
    SymTensor<2> stress(double size = 1) { return {(*this)(-size, size), (*this)(-size, size), (*this)(-size, size)}; }

    /// Shifts the points, gives them random stresses, and random boxes or volumes.
    void points(Points<2>& q)
    {
        for (std::size_t p = 0; p < q.count; ++p)
        {
            q.x[0][p] += (*this)(-0.1, 0.1);
            q.x[1][p] += (*this)(-0.1, 0.1);
            q.stress[0][p] = (*this)(-1, 1);
            q.stress[1][p] = (*this)(-1, 1);
            q.stress[2][p] = (*this)(-1, 1);
            if (q.half_width[0].active())
            {
                q.half_width[0][p] *= (*this)(0.5, 3.5);
                q.half_width[1][p] *= (*this)(0.5, 3.5);
            }
            else
                q.volume[p] *= (*this)(0.5, 2);
        }
    }

private:
    std::mt19937 engine_;
};
}  // namespace testbed::test
