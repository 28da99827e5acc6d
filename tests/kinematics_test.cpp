#include "core/kinematics.hpp"
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
        const Gradient<> g{random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1)};
        std::vector<Vec2> u;
        for (const Vec2& p : x)
            u.push_back({0.3 + g.xx * p[0] + g.xy * p[1], -0.7 + g.yx * p[0] + g.yy * p[1]});
        const Gradient<> found = polygon_gradient(x, u);
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
        const SymTensor<> s = random.stress();
        const Gradient<> g = polygon_gradient(x, u);
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
    const std::vector<Vec2> corners{{0, 0}, {L, 0}, {L, L}, {0, L}};
    const int number[] = {0, 1, 3, 2};
    for (int trial = 0; trial < 50; ++trial)
    {
        std::array<double, 4> ux, uy;
        std::vector<Vec2> u(4);
        for (int k = 0; k < 4; ++k)
        {
            u[k] = {random(-1, 1), random(-1, 1)};
            ux[number[k]] = u[k][0];
            uy[number[k]] = u[k][1];
        }
        const Gradient<> fast = square_gradient<double>(ux, uy, 1 / (2 * L)), slow = polygon_gradient(corners, u);
        EXPECT_NEAR(fast.xx, slow.xx, 1e-13);
        EXPECT_NEAR(fast.yy, slow.yy, 1e-13);
        EXPECT_NEAR(fast.xy, slow.xy, 1e-13);
        EXPECT_NEAR(fast.yx, slow.yx, 1e-13);
        const SymTensor<> s = random.stress();
        const auto force = polygon_forces(corners, s);
        for (int k = 0; k < 4; ++k)
        {
            const Vec2 f = square_force(number[k], s, L / 2);
            EXPECT_NEAR(f[0], force[k][0], 1e-13);
            EXPECT_NEAR(f[1], force[k][1], 1e-13);
        }
    }
}

TEST(Gradient, ShearAndRotation)
{
    const Gradient<> spin{0, 0, -0.2, 0.2};  // rigid rotation by 0.2, anticlockwise
    EXPECT_DOUBLE_EQ(spin.rotation(), 0.2);
    EXPECT_DOUBLE_EQ(spin.shear(), 0);
}
