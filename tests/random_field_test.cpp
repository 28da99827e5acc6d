#include "core/bodies/body.hpp"
#include "core/bodies/random_field.hpp"
#include "core/scene/geometry.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

TEST(StandardNormal, MomentsAndIndependence)
{
    const int n = 200000;
    double mean = 0, square = 0, fourth = 0, neighbours = 0, streams = 0;
    for (int k = 0; k < n; ++k)
    {
        const auto c = static_cast<std::uint64_t>(k);
        const double z = standard_normal(1, 0, c);
        mean += z / n;
        square += z * z / n;
        fourth += z * z * z * z / n;
        neighbours += z * standard_normal(1, 0, c + 1) / n;
        streams += z * standard_normal(1, 1, c) / n;
    }
    const double sigma = 1 / std::sqrt(n);
    EXPECT_NEAR(mean, 0, 4 * sigma);
    EXPECT_NEAR(square, 1, 4 * sigma * std::sqrt(2.0));
    EXPECT_NEAR(fourth, 3, 4 * sigma * std::sqrt(96.0));
    EXPECT_NEAR(neighbours, 0, 4 * sigma);
    EXPECT_NEAR(streams, 0, 4 * sigma);
    EXPECT_DOUBLE_EQ(standard_normal(1, 0, 5), standard_normal(1, 0, 5));
    EXPECT_NE(standard_normal(1, 0, 5), standard_normal(2, 0, 5));
}

/// Variance 1 and correlation exp(-r^2 / theta^2) over many seeds.
TEST(CorrelatedField, VarianceAndCorrelation)
{
    const double theta = 0.7;
    const int seeds = 40000;
    const std::array<double, 3> distance{0.2, 0.5, 1.0};
    double variance = 0;
    std::array<double, 3> covariance{};
    for (int seed = 0; seed < seeds; ++seed)
    {
        const CorrelatedField field(static_cast<std::uint64_t>(seed), 0, theta);
        const double a = field({0.13, -0.4});
        variance += a * a / seeds;
        for (std::size_t k = 0; k < 3; ++k)
            covariance[k] += a * field({0.13 + 0.6 * distance[k], -0.4 + 0.8 * distance[k]}) / seeds;
    }
    EXPECT_NEAR(variance, 1, 0.028);  // 4 standard errors
    for (std::size_t k = 0; k < 3; ++k)
        EXPECT_NEAR(covariance[k], std::exp(-distance[k] * distance[k] / (theta * theta)), 0.028) << distance[k];
}

namespace
{
const std::string soil = test::soil_block({0, 0}, {4, 3}, test::strength);
const std::string random_table = "[material.random]\nseed = 3\ncohesion_deviation = 0.33\nfriction_deviation = 0.25\n";

std::string with(const std::string& table)
{
    std::string text = soil;
    return text.insert(text.find("[[body]]"), table);
}
}  // namespace

TEST(RandomStrength, MeanDeviationAndTruncation)
{
    const Scene scene = test::load(with(random_table), "", {"body.soil.points_per_cell=16", "material.soil.random.cohesion_deviation=0.8"});
    const auto bodies = make_bodies(scene, make_lattice(scene.grid), {});
    const Points<2>& q = bodies[0].points;
    double c = 0, phi = 0, square = 0, zero = 0, together = 0;
    for (std::size_t p = 0; p < q.count; ++p)
    {
        EXPECT_GE(q.cohesion[p], 0);
        const double angle = std::asin(q.sin_friction[p]);
        c += q.cohesion[p] / static_cast<double>(q.count);
        phi += angle / static_cast<double>(q.count);
        square += (angle - 0.5) * (angle - 0.5) / static_cast<double>(q.count);
        zero += q.cohesion[p] == 0;
        together += (q.cohesion[p] - 9800) * (angle - 0.5) / (0.8 * 9800 * 0.125) / static_cast<double>(q.count);
    }
    EXPECT_NEAR(phi, 0.5, 0.005);
    EXPECT_NEAR(std::sqrt(square), 0.125, 0.003);
    EXPECT_NEAR(together, 0, 4 / std::sqrt(static_cast<double>(q.count)));  // two fields, not one
    EXPECT_NEAR(c / 9800, 1.0328, 0.02);                                    // of max(0, 1 + 0.8 z)
    EXPECT_NEAR(zero / static_cast<double>(q.count), 0.1056, 0.01);         // P(z < -1/0.8)
    EXPECT_NEAR(bodies[0].truncated_share, 0.5 * 0.1056, 0.006);            // of both parameters
}

TEST(RandomStrength, CorrelatedFieldIsTheSameForEveryCellSize)
{
    const std::string text = with(random_table + "field = \"correlated\"\ncorrelation_length = 0.8\n");
    const auto at = [&](const std::vector<std::string>& set, const Vec<2>& place)
    {
        const Scene scene = test::load(text, "", set);
        const auto bodies = make_bodies(scene, make_lattice(scene.grid), {});
        const Points<2>& q = bodies[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
            if (std::hypot(q.x[0][p] - place[0], q.x[1][p] - place[1]) < 1e-9)
                return q.cohesion[p];
        ADD_FAILURE() << "no point there";
        return 0.0;
    };
    const Vec<2> place{1.75, 1.25};
    EXPECT_DOUBLE_EQ(at({"body.soil.points_per_cell=1"}, place),
                     at({"grid.cell_size=0.25", "body.soil.points_per_cell=5", "grid.origin=[-0.125, -0.125]", "grid.size=[5.0, 5.0]",
                         "body.soil.min=[0.125,0.125]", "body.soil.max=[3.125,2.125]"},
                        place));
}

TEST(Strength, ExpressionsAndTheirLimits)
{
    const auto bodies_of = [](const std::vector<std::string>& set)
    {
        const Scene scene = test::load(soil, "", set);
        return make_bodies(scene, make_lattice(scene.grid), {});
    };
    EXPECT_FALSE(bodies_of({})[0].points.cohesion.active());  // one strength needs no field
    const auto bodies = bodies_of({"material.soil.strength.cohesion='1000 + 500*Y'"});
    const Points<2>& q = bodies[0].points;
    EXPECT_DOUBLE_EQ(q.cohesion[10], 1000 + 500 * q.x[1][10]);
    EXPECT_THROW(bodies_of({"material.soil.strength.cohesion='1000 - 500*Y'"}), SceneError);
    EXPECT_THROW(bodies_of({"material.soil.strength.friction_angle='0.5 + Y'"}), SceneError);
}

TEST(Strength, ProblemsOfAScene)
{
    const std::string text = with(random_table + "[material.softening]\nkind = \"linear\"\nresidual = 0.5\nstrain = 0.1\n");
    const auto expect = [&](const std::vector<std::string>& set, const std::string& message) { test::expect_problem(text, set, message); };
    expect({"material.soil.strength.friction_angle=28.6"}, "radians");
    expect({"material.soil.strength.cohesion=-1"}, "must not be negative");
    expect({"material.soil.strength.dilatancy_angle=0.6"}, "below the dilatancy angle");
    expect({"material.soil.softening.residual=1.2"}, "share in [0, 1]");
    expect({"material.soil.softening.residual=-0.1"}, "share in [0, 1]");
    expect({"material.soil.softening.kind=drop"}, "only for kind");
    expect({"material.soil.softening.nonlocal={internal_length=0.1}", "material.soil.softening.band_thickness=0.1"}, "exclude each other");
    expect({"material.soil.softening.nonlocal={internal_length=-0.1}"}, "must be positive");
    expect({"material.soil.random.field=correlated"}, "needs it");
    expect({"material.soil.random.cohesion_deviation=-0.1"}, "relative deviation");
    expect({"material.soil.law=linear_elastic"}, "not used by law");
    expect({"material.soil.youngs_modulus='1e6*(1+X)'"}, "plain number");
}

/// An inclusion takes the host's points in its shape: mass and pattern are kept.
TEST(Inclusion, TakesPointsOfItsHost)
{
    const std::string grain =
        "[[body]]\nname = \"grain\"\nmaterial = \"soil\"\nshape = \"disk\"\ninside = \"soil\"\ncenter = [2.0, 1.5]\nradius = 0.7\n";
    const Scene whole = test::load(soil), scene = test::load(soil + grain);
    const auto all = fill(whole, whole.bodies[0]);
    auto host = fill(scene, scene.bodies[0]);
    const auto inclusion = fill(scene, scene.bodies[1]);
    EXPECT_EQ(host.size() + inclusion.size(), all.size());
    EXPECT_NEAR(static_cast<double>(inclusion.size()) * 0.125 * 0.125, 3.14159 * 0.49, 0.05);
    host.insert(host.end(), inclusion.begin(), inclusion.end());
    std::sort(host.begin(), host.end());
    auto sorted = all;
    std::sort(sorted.begin(), sorted.end());
    EXPECT_EQ(host, sorted);
    EXPECT_THROW(test::load(soil + grain, "", {"body.grain.center=[0.5, 1.5]"}), SceneError);
    EXPECT_THROW(test::load(soil + grain, "", {"body.grain.inside=sand"}), SceneError);
    std::string second = grain;
    second.replace(second.find("grain"), 5, "other");
    EXPECT_THROW(test::load(soil + grain + second), SceneError);
}

TEST(Inclusion, LeavesTheRandomSoilAroundItAsItIs)
{
    const std::string grain =
        "[[body]]\nname = \"grain\"\nmaterial = \"soil\"\nshape = \"disk\"\ninside = \"soil\"\ncenter = [2.0, 1.5]\nradius = 0.7\n";
    const Scene whole = test::load(with(random_table)), scene = test::load(with(random_table) + grain);
    const auto all = make_bodies(whole, make_lattice(whole.grid), {}), part = make_bodies(scene, make_lattice(scene.grid), {});
    const Points<2>&a = all[0].points, &b = part[0].points;
    std::size_t p = 0;
    for (std::size_t n = 0; n < b.count; ++n)
    {
        while (a.x[0][p] != b.x[0][n] || a.x[1][p] != b.x[1][n])
            ++p;
        EXPECT_EQ(a.cohesion[p], b.cohesion[n]);
    }
}

TEST(InitialStress, IsThatOfTheScene)
{
    const Scene scene = test::load(soil + "initial_stress = [\"0.5*1e4*(Y-3)\", \"1e4*(Y-3)\", \"0.4*1e4*(Y-3)\", \"7\"]\n");
    const auto bodies = make_bodies(scene, make_lattice(scene.grid), {});
    const Points<2>& q = bodies[0].points;
    EXPECT_DOUBLE_EQ(q.stress[0][9], 0.5e4 * (q.x[1][9] - 3));
    EXPECT_DOUBLE_EQ(q.stress[1][9], 1e4 * (q.x[1][9] - 3));
    EXPECT_DOUBLE_EQ(q.szz[9], 0.4e4 * (q.x[1][9] - 3));
    EXPECT_DOUBLE_EQ(q.stress[2][9], 7);
}
