#include "core/bodies/nonlocal.hpp"
#include "mpm/shapes/bspline.hpp"
#include "mpm/shapes/cpgimp.hpp"
#include "mpm/shapes/linear.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
Scene nonlocal_scene(double l, double m, const std::string& weight)
{
    const std::string softening = "[material.softening]\nkind = \"linear\"\nresidual = 0.5\nstrain = 0.1\n[material.softening.nonlocal]\n"
                                  "internal_length = " +
                                  std::to_string(l) + "\nover_nonlocal = " + std::to_string(m) + "\nweight = \"" + weight + "\"\n";
    return test::load(test::soil_block({0.2, 0.3}, {2.7, 2.8}, test::strength + softening), "",
                      {"grid.size=[3.0, 3.0]", "grid.cell_size=0.1", "body.soil.points_per_cell=2"});
}

template <class Support>
void check_against_double_sum(const std::string& weight, double tolerance)
{
    const Scene scene = nonlocal_scene(0.4, 1.7, weight);
    const Lattice<2> lattice = make_lattice(scene.grid);
    auto bodies = make_bodies(scene, lattice, {.box = Support::has_box});
    std::vector<double> workspace;
    bodies[0].bins.template rebuild<Support>(bodies[0].points, workspace);
    constexpr bool cells = std::is_same_v<Support, PointSupport> || std::is_same_v<Support, DomainSupport>;
    const auto index = [&](const Index<2>& at) { return cells ? lattice.cell(at) : lattice.node(at); };
    Gather gather(cells ? lattice.cells() : lattice.nodes());
    const std::vector<const Bins<2>*> bins{&bodies[0].bins};
    gather.rebuild<Support::S, 2>(bins, index);
    Points<2>& q = bodies[0].points;
    const auto strain = [](double x, double y) { return 0.02 * (1 + std::sin(1.1 * x) * std::cos(0.8 * y)); };
    for (std::size_t p = 0; p < q.count; ++p)
        q.plastic_shear[p] = strain(q.x[0][p], q.x[1][p]);
    NonlocalStrain nonlocal(scene, lattice.cell_size);
    nonlocal.resize(cells ? lattice.cell_stride() : lattice.node_stride(), cells ? lattice.cells() : lattice.nodes());
    nonlocal.apply<Support>(lattice, bodies, gather, index);
    const NonlocalSpec& spec = *scene.materials[0].softening->nonlocal;
    for (std::size_t p = 0; p < q.count; p += 37)
    {
        double sum = 0, total = 0;
        for (std::size_t o = 0; o < q.count; ++o)
        {
            const double w = nonlocal_weight(spec, std::hypot(q.x[0][p] - q.x[0][o], q.x[1][p] - q.x[1][o]));
            sum += w * q.plastic_shear[o];
            total += w;
        }
        EXPECT_NEAR(q.softening_strain[p], -0.7 * q.plastic_shear[p] + 1.7 * sum / total, tolerance);
    }
}
/// The first body of a scene, whose points belong to one cell each.
struct OnCells
{
    const Scene& scene;
    Lattice<2> lattice;
    std::vector<Body> bodies;

    explicit OnCells(const Scene& s) : scene(s), lattice(make_lattice(s.grid)), bodies(make_bodies(s, lattice, {}))
    {
        std::vector<double> workspace;
        bodies[0].bins.rebuild<PointSupport>(bodies[0].points, workspace);
    }
    /// Sets the softening strain.
    void average()
    {
        const auto index = [&](const Index<2>& at) { return lattice.cell(at); };
        Gather gather(lattice.cells());
        const std::vector<const Bins<2>*> bins{&bodies[0].bins};
        gather.rebuild<1, 2>(bins, index);
        NonlocalStrain nonlocal(scene, lattice.cell_size);
        nonlocal.resize(lattice.cell_stride(), lattice.cells());
        nonlocal.apply<PointSupport>(lattice, bodies, gather, index);
    }
};
}  // namespace

/// Against the double sum over points: the way over cells or nodes costs part of a cell's smoothing.
TEST(Nonlocal, EqualsTheSumOverPoints)
{
    for (const std::string weight : {"gauss", "galavi_schweiger"})
    {
        check_against_double_sum<PointSupport>(weight, 8e-4);
        check_against_double_sum<DomainSupport>(weight, 8e-4);
        check_against_double_sum<LinearShape>(weight, 8e-4);
        check_against_double_sum<GimpShape>(weight, 8e-4);
        check_against_double_sum<BSplineShape>(weight, 1.5e-3);
    }
}

/// With points in the middle of their cells: exactly the double sum over cells, in rows that end at edges of the body and of the lattice.
TEST(Nonlocal, IsTheDoubleSumOverCells)
{
    for (const std::string weight : {"gauss", "galavi_schweiger"})
    {
        Scene scene = nonlocal_scene(0.15, 1.7, weight);
        scene.bodies[0].points_per_cell = 1;
        scene.bodies[0].min = Vec<2>{0, 0.3};
        OnCells soil(scene);
        Points<2>& q = soil.bodies[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            q.plastic_shear[p] = 0.01 * (1 + std::sin(50 * q.x[0][p] + 31 * q.x[1][p]));
            q.volume[p] *= 1 + 0.3 * std::sin(17 * q.x[1][p]);
        }
        soil.average();
        const NonlocalSpec& spec = *scene.materials[0].softening->nonlocal;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            double sum = 0, total = 0;
            for (std::size_t o = 0; o < q.count; ++o)
            {
                const double dx = q.x[0][p] - q.x[0][o], dy = q.x[1][p] - q.x[1][o];
                if (std::max(std::abs(dx), std::abs(dy)) > 0.55)  // three internal lengths, in whole cells
                    continue;
                const double w = nonlocal_weight(spec, std::hypot(dx, dy)) * q.volume[o];
                sum += w * q.plastic_shear[o];
                total += w;
            }
            ASSERT_NEAR(q.softening_strain[p], std::max(0.0, -0.7 * q.plastic_shear[p] + 1.7 * sum / total), 1e-14) << weight;
        }
    }
}

TEST(Nonlocal, NeverBelowZeroAndAbsentWhereNotAsked)
{
    const Scene scene = nonlocal_scene(0.4, 1.7, "gauss");
    EXPECT_TRUE(has_nonlocal_softening(scene));
    OnCells soil(scene);
    soil.bodies[0].points.plastic_shear[700] = 0.01;  // one point: its own strain counts -0.7, the mean next to nothing
    soil.average();
    EXPECT_EQ(soil.bodies[0].points.softening_strain[700], 0);
    EXPECT_GT(soil.bodies[0].points.softening_strain[704], 0);
    const Points<2>& q = soil.bodies[0].points;
    for (std::size_t p = 0; p < q.count; ++p)  // the weight reaches three internal lengths
        if (const double r = std::hypot(q.x[0][p] - q.x[0][700], q.x[1][p] - q.x[1][700]); r > 0.3)
            EXPECT_TRUE(r > 1.1 || q.softening_strain[p] > 0) << r;
    EXPECT_EQ(nonlocal_weight({.internal_length = 2, .over_nonlocal = 2, .weight = NonlocalSpec::Weight::gauss}, 2), std::exp(-1.0));
    EXPECT_EQ(nonlocal_weight({.internal_length = 2, .over_nonlocal = 2, .weight = NonlocalSpec::Weight::gauss}, 1), std::exp(-0.25));
    EXPECT_EQ(nonlocal_weight({.internal_length = 2, .over_nonlocal = 2, .weight = NonlocalSpec::Weight::galavi_schweiger}, 1),
              0.5 * std::exp(-0.25));
}
