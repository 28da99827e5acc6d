#include "core/bodies/support.hpp"
#include "mpm/shapes/bspline.hpp"
#include "mpm/shapes/cpgimp.hpp"
#include "mpm/shapes/linear.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>

#include <limits>

using namespace testbed;

namespace
{
double hat(double x)
{
    return std::max(0.0, 1 - std::abs(x));
}
/// Mean of f over [a, a + w] by the midpoint rule.
template <class F>
double mean(double a, double w, F&& f)
{
    constexpr int n = 20000;
    double s = 0;
    for (int k = 0; k < n; ++k)
        s += f(a + w * (k + 0.5) / n);
    return s / n;
}
}  // namespace

/// Shares of a box in cells, against their definition.
TEST(DomainSupport, IsTheOverlap)
{
    test::Random random(6);
    for (int trial = 0; trial < 200; ++trial)
    {
        const double a = random(0, 1), w = random(0.05, 1);
        const auto s = DomainSupport::weights(a, w);
        EXPECT_NEAR(s[0], (std::min(a + w, 1.0) - a) / w, 1e-12);
        EXPECT_NEAR(s[1], std::max(a + w - 1, 0.0) / w, 1e-12);
    }
    EXPECT_EQ(DomainSupport::weights(0.75, 0.25 + 1e-12)[1], 0);  // rounding does not reach the next cell
}

TEST(LinearShape, PartitionOfUnityAndLinearFields)
{
    for (const double a : {0.0, 0.3, 0.99})
    {
        const auto N = LinearShape::weights(a, 0.0), G = LinearShape::slopes(a, 0.0);
        EXPECT_DOUBLE_EQ(N[0] + N[1], 1);
        EXPECT_DOUBLE_EQ(N[1], a);
        EXPECT_DOUBLE_EQ(G[0] + G[1], 0);
        EXPECT_DOUBLE_EQ(G[1], 1);
    }
}

/// GIMP weights and slopes are means of the hat function and of its slope over the box.
TEST(GimpShape, IsTheMeanOfTheHat)
{
    test::Random random(7);
    for (int trial = 0; trial < 100; ++trial)
    {
        const double a = random(0, 1), w = random(0.05, 1);
        const auto N = GimpShape::weights(a, w), G = GimpShape::slopes(a, w);
        double unity = 0, linear = 0, slope = 0;
        for (int i = 0; i < 3; ++i)
        {
            EXPECT_NEAR(N[i], mean(a, w, [&](double x) { return hat(x - i); }), 1e-8);
            EXPECT_NEAR(G[i], (hat(a + w - i) - hat(a - i)) / w, 1e-12);
            unity += N[i];
            linear += i * N[i];
            slope += i * G[i];
        }
        EXPECT_NEAR(unity, 1, 1e-14);
        EXPECT_NEAR(linear, a + w / 2, 1e-13);  // reproduces the centre
        EXPECT_NEAR(slope, 1, 1e-13);
    }
}

/// Packs and single numbers give the same.
TEST(GimpShape, PackEqualsScalar)
{
    const auto scalar = GimpShape::weights(0.8, 0.5);
    const auto pack = GimpShape::weights(Pack(0.8), Pack(0.5));
    for (int i = 0; i < 3; ++i)
        EXPECT_DOUBLE_EQ(static_cast<double>(pack[i][0]), scalar[i]);
}

TEST(Lanes, MaskWhatLiesBehindTheEnd)
{
    std::vector<double> data(3 * pack_size, 1.0);
    double total = 0;
    std::size_t calls = 0;
    for_each_pack(2, 2 + pack_size + 3,
                  [&](std::size_t p, const auto& lanes)
                  {
                      const Pack v = lanes.load(&data[p]);
                      total += sum(lanes.keep(v));
                      lanes.store(&data[p], v + Pack(1.0));
                      EXPECT_FALSE(lanes.any(v > Pack(1.5)));
                      ++calls;
                  });
    EXPECT_EQ(calls, 2u);
    EXPECT_DOUBLE_EQ(total, static_cast<double>(pack_size) + 3);
    for (std::size_t k = 0; k < data.size(); ++k)
        EXPECT_DOUBLE_EQ(data[k], k >= 2 && k < 5 + pack_size ? 2 : 1) << k;
}

/// A support leaves its bin beyond the tolerance of rounding on both sides, and counts as having left where it is not a number or the
/// point is turned inside out; lanes behind the end do not count.
TEST(BinFrame, SeesWhoLeft)
{
    const Lattice<2> lattice{{0, 0}, 1.0, {4, 4}};
    const BinFrame frame(lattice, Bin<2>{{1, 1}, 0, 1});
    Points<2> q;
    q.count = 2 * pack_size;
    q.volume.activate(q.count);
    q.half_width[0].activate(q.count);
    q.half_width[1].activate(q.count);
    const auto reset = [&]
    {
        for (std::size_t p = 0; p < q.count; ++p)
            q.volume[p] = q.half_width[0][p] = q.half_width[1][p] = 0.2;
    };
    const auto left = [&](double ax, double ay)
    {
        Corner<2> c{{Pack(0.5), Pack(0.5)}, {Pack(0.4), Pack(0.4)}};
        c.a[0][pack_size - 1] = ax;
        c.a[1][pack_size - 1] = ay;
        const bool point = stdx::any_of(frame.left<PointSupport>(q, 0, AllLanes{}, c)),
                   box = stdx::any_of(frame.left<DomainSupport>(q, 0, AllLanes{}, c));
        EXPECT_EQ(point, box);
        return point;
    };
    reset();
    const double nan = std::numeric_limits<double>::quiet_NaN();
    EXPECT_FALSE(left(0, 0));
    EXPECT_FALSE(left(-0.5e-9, 1 - 2e-9));
    for (const double out : {-2e-9, 1.0, nan})
    {
        EXPECT_TRUE(left(out, 0.5)) << out;
        EXPECT_TRUE(left(0.5, out)) << out;
    }
    const Corner<2> inside{{Pack(0.5), Pack(0.5)}, {Pack(0.4), Pack(0.4)}};
    for (const double bad : {0.0, -1.0, nan})
    {
        for (Field<double>* field : {&q.half_width[0], &q.half_width[1]})
        {
            reset();
            (*field)[0] = bad;
            EXPECT_TRUE(stdx::any_of(frame.left<DomainSupport>(q, 0, AllLanes{}, inside))) << bad;
        }
        reset();
        q.volume[0] = bad;
        EXPECT_TRUE(stdx::any_of(frame.left<PointSupport>(q, 0, AllLanes{}, inside))) << bad;
    }
    reset();
    for (const double a : {0.4, 0.6})  // B-splines begin half a cell from the point: the edge of the lattice lies in the middle of a bin
        for (const int first : {-1, 3})
        {
            const Corner<2> c{{Pack(a), Pack(a)}, {Pack(0.0), Pack(0.0)}};
            const Bin<2> left_or_right{{first, 1}, 0, 1}, low_or_high{{1, first}, 0, 1};
            for (const Bin<2>& bin : {left_or_right, low_or_high})
                EXPECT_EQ(stdx::any_of(BinFrame(lattice, bin).left<BSplineShape>(q, 0, AllLanes{}, c)), (a < 0.5) == (first < 0)) << a;
        }
    Corner<2> behind = inside;
    if (pack_size > 1)
    {
        behind.a[0][pack_size - 1] = nan;
        EXPECT_FALSE(stdx::any_of(frame.left<PointSupport>(q, 0, SomeLanes{pack_size - 1}, behind)));
        EXPECT_TRUE(stdx::any_of(frame.left<PointSupport>(q, 0, AllLanes{}, behind)));
    }
}
