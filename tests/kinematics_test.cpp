#include "core/lattice/kinematics.hpp"
#include "tests/polygon.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>

using namespace testbed;
using test::Random;

/// Eq. (4) is exact for a linear field on any polygon.
TEST(Polygon, GradientOfLinearField)
{
    Random random(1);
    for (int trial = 0; trial < 200; ++trial)
    {
        const auto x = random.convex_polygon(3 + trial % 6);
        const Gradient<2> g{random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1)};
        std::vector<Vec<2>> u;
        for (const Vec<2>& p : x)
            u.push_back({0.3 + g.xx * p[0] + g.xy * p[1], -0.7 + g.yx * p[0] + g.yy * p[1]});
        const Gradient<2> found = polygon_gradient(x, u);
        EXPECT_NEAR(found.xx, g.xx, 1e-12);
        EXPECT_NEAR(found.yy, g.yy, 1e-12);
        EXPECT_NEAR(found.xy, g.xy, 1e-12);
        EXPECT_NEAR(found.yx, g.yx, 1e-12);
    }
}

/// Eq. (9): the nodal forces do the work of the stress for any displacement, sum F.u = -A s:grad u.
TEST(Polygon, VirtualWork)
{
    Random random(2);
    for (int trial = 0; trial < 200; ++trial)
    {
        const auto x = random.convex_polygon(3 + trial % 6);
        const auto u = random.vectors(x.size());
        const SymTensor<2> s = random.stress();
        const Gradient<2> g = polygon_gradient(x, u);
        const auto force = polygon_forces(x, s);
        double power = 0;
        for (std::size_t k = 0; k < x.size(); ++k)
            power += force[k][0] * u[k][0] + force[k][1] * u[k][1];
        EXPECT_NEAR(power, -polygon_area(x) * (s.xx * g.xx + s.yy * g.yy + s.xy * g.shear()), 1e-12);
    }
}

/// The fast case equals the polygon with its corners in anticlockwise order [1], [2], [4], [3].
TEST(Square, IsThePolygon)
{
    Random random(3);
    const double L = 0.7;
    const std::vector<Vec<2>> corners{{0, 0}, {L, 0}, {L, L}, {0, L}};
    const int number[] = {0, 1, 3, 2};
    for (int trial = 0; trial < 50; ++trial)
    {
        std::array<std::array<double, 4>, 2> corner;
        std::vector<Vec<2>> u(4);
        for (int k = 0; k < 4; ++k)
        {
            u[k] = {random(-1, 1), random(-1, 1)};
            for (int d = 0; d < 2; ++d)
                corner[d][number[k]] = u[k][d];
        }
        const Gradient<2> fast = cell_gradient(corner, 1 / (2 * L)), slow = polygon_gradient(corners, u);
        EXPECT_NEAR(fast.xx, slow.xx, 1e-13);
        EXPECT_NEAR(fast.yy, slow.yy, 1e-13);
        EXPECT_NEAR(fast.xy, slow.xy, 1e-13);
        EXPECT_NEAR(fast.yx, slow.yx, 1e-13);
        const SymTensor<2> s = random.stress();
        const auto force = polygon_forces(corners, s);
        const std::array<Vec<2>, 4> fast_force{corner_force<0>(s, L / 2), corner_force<1>(s, L / 2), corner_force<2>(s, L / 2),
                                               corner_force<3>(s, L / 2)};
        for (int k = 0; k < 4; ++k)
            for (int d = 0; d < 2; ++d)
                EXPECT_NEAR(fast_force[number[k]][d], force[k][d], 1e-13);
    }
}

TEST(Gradient, ShearAndRotation)
{
    const Gradient<2> spin{0, 0, -0.2, 0.2};  // rigid rotation by 0.2, anticlockwise
    EXPECT_DOUBLE_EQ(spin.rotation(), 0.2);
    EXPECT_DOUBLE_EQ(spin.shear(), 0);
}

namespace
{
Gradient<2> minus_one(const Gradient<2>& f)
{
    return {f.xx - 1, f.yy - 1, f.xy, f.yx};
}
/// I + e A.
Gradient<2> deformation(double e, const Gradient<2>& a)
{
    return {1 + e * a.xx, 1 + e * a.yy, e * a.xy, e * a.yx};
}
Gradient<2> inverse_of(const Gradient<2>& f)
{
    const double det = f.xx * f.yy - f.xy * f.yx;
    return {f.yy / det, f.xx / det, -f.xy / det, -f.yx / det};
}
double largest(const Gradient<2>& g)
{
    return std::max({std::abs(g.xx), std::abs(g.yy), std::abs(g.xy), std::abs(g.yx)});
}
constexpr StrainIncrement midpoint{0.5}, forward{0.0};
}  // namespace

/// A rotation strains nothing, whatever its angle; and its angle is right to third order. Forward it strains by the square of it.
TEST(StrainIncrement, RotationStrainsNothing)
{
    for (const double angle : {0.4, -0.1, 0.01})
    {
        const Gradient<2> g{std::cos(angle) - 1, std::cos(angle) - 1, -std::sin(angle), std::sin(angle)};
        const Gradient<2> d = midpoint.of(g), f = forward.of(g);
        EXPECT_NEAR(d.xx, 0, 1e-16);
        EXPECT_NEAR(d.yy, 0, 1e-16);
        EXPECT_NEAR(d.shear(), 0, 1e-16);
        EXPECT_NEAR(d.rotation(), angle, 0.1 * std::abs(angle * angle * angle));
        EXPECT_NEAR(f.xx, -0.5 * angle * angle, std::pow(angle, 4));
    }
}

/// A deformation and its inverse cancel to third order: an eighth is left at half of it, forward a quarter.
TEST(StrainIncrement, DeformationAndInverseCancel)
{
    Random random(4);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Gradient<2> a{random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1)};
        const auto left = [&](const StrainIncrement& increment, double e)
        {
            const Gradient<2> f = deformation(e, a);
            return largest(increment.of(minus_one(f)) + increment.of(minus_one(inverse_of(f))));
        };
        EXPECT_LT(left(midpoint, 0.01), 5e-6);
        EXPECT_LT(left(midpoint, 0.01), left(midpoint, 0.02) / 7 + 1e-9);
        EXPECT_NEAR(left(forward, 0.02) / left(forward, 0.01), 4, 0.3);
    }
}

/// In one direction the strain is the logarithm of the stretch, and stretch() gives the stretch, to third order.
TEST(StrainIncrement, Logarithm)
{
    for (const double e : {0.02, -0.02})
    {
        const auto strain_error = [&](double x) { return std::abs(midpoint.of(Gradient<2>{x, 0, 0, 0}).xx - std::log1p(x)); };
        const auto stretch_error = [&](double x) { return std::abs(midpoint.stretch(midpoint.of(Gradient<2>{x, 0, 0, 0}).xx) - 1 - x); };
        EXPECT_LT(strain_error(e), 0.3 * std::abs(e * e * e));
        EXPECT_NEAR(strain_error(e) / strain_error(e / 2), 8, 0.5);
        EXPECT_LT(stretch_error(e), 0.3 * std::abs(e * e * e));
        EXPECT_NEAR(stretch_error(e) / stretch_error(e / 2), 8, 0.5);
        EXPECT_EQ(forward.of(Gradient<2>{e, 0, 0, 0}).xx, e);
        EXPECT_EQ(forward.stretch(e), 1 + e);
    }
}

/// The trace of any increment gives the ratio of the volumes to second order; forward the first order alone.
TEST(StrainIncrement, Volume)
{
    Random random(5);
    for (int trial = 0; trial < 50; ++trial)
    {
        const Gradient<2> a{random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1)};
        const auto error = [&](const StrainIncrement& increment, double e)
        {
            const Gradient<2> f = deformation(e, a);
            return std::abs(increment.stretch(increment.of(minus_one(f)).trace()) - (f.xx * f.yy - f.xy * f.yx));
        };
        EXPECT_LT(error(midpoint, 0.01), 3e-6);
        const double det = a.xx * a.yy - a.xy * a.yx;
        EXPECT_NEAR(error(forward, 0.01), std::abs(det) * 1e-4, 1e-12);
    }
}
