#include "core/bodies/body.hpp"
#include "core/scene/geometry.hpp"
#include "core/scene/method_limits.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

TEST(Fill, BoxStartsAtItsOwnCorner)
{
    BodySpec box;
    box.shape = BodySpec::Shape::box;
    box.points_per_cell = 2;
    box.min = Vec<2>{0.3, 0.1};
    box.max = Vec<2>{1.3, 0.6};
    Scene scene;
    scene.grid = {{0, 0}, {2, 2}, 0.5};
    const auto points = fill(scene, box);
    ASSERT_EQ(points.size(), 8u);
    EXPECT_DOUBLE_EQ(points[0][0], 0.425);
    EXPECT_DOUBLE_EQ(points[0][1], 0.225);
    EXPECT_DOUBLE_EQ(points[1][0], 0.675);
}

TEST(Fill, DiskAndPolygonAreas)
{
    Scene scene;
    scene.grid = {{-2, -2}, {4, 4}, 0.1};
    BodySpec disk;
    disk.shape = BodySpec::Shape::disk;
    disk.center = Vec<2>{0.2, -0.1};
    disk.radius = 1.3;
    const double share = 0.025 * 0.025;
    EXPECT_NEAR(static_cast<double>(fill(scene, disk).size()) * share, 3.14159 * 1.69, 0.01);
    BodySpec triangle;
    triangle.shape = BodySpec::Shape::polygon;
    triangle.vertices = {{-1, -1}, {1, -1}, {-1, 1}};
    EXPECT_NEAR(static_cast<double>(fill(scene, triangle).size()) * share, 2.0, 0.05);
}

TEST(Bodies, CarryOnlyTheFieldsThatAreNeeded)
{
    const Scene scene = test::load(test::two_bodies());
    const auto bodies = make_bodies(scene, make_lattice(scene.grid), {.initial_position = false});
    EXPECT_FALSE(bodies[0].points.X[0].active() || bodies[0].points.half_width[0].active() || bodies[0].points.v[0].active() ||
                 bodies[0].points.stiffness.active());
    EXPECT_TRUE(bodies[1].points.stiffness.active());  // its modulus is an expression
    const auto more = make_bodies(scene, make_lattice(scene.grid), {.box = true, .velocity = true});
    EXPECT_TRUE(more[0].points.X[0].active() && more[0].points.half_width[0].active() && more[0].points.v[0].active());
    EXPECT_FALSE(more[0].points.volume.active());  // follows from the box
    EXPECT_DOUBLE_EQ(more[0].points.current_volume(0), more[0].points.initial_volume);
}

TEST(Bodies, ValuesAtPoints)
{
    const Scene scene = test::load(test::two_bodies());
    const auto bodies = make_bodies(scene, make_lattice(scene.grid), {.velocity = true});
    const Points<2>& q = bodies[1].points;
    const double largest = moduli(bodies[1].material).youngs_modulus();
    for (std::size_t p = 0; p < q.count; ++p)
    {
        EXPECT_NEAR(largest * q.stiffness[p], 3e4 * (1 + q.X[0][p] * q.X[0][p]), 1e-6);
        EXPECT_DOUBLE_EQ(q.v[0][p], -0.3 * q.X[1][p]);
        EXPECT_DOUBLE_EQ(q.v[1][p], 0.4 * q.X[0][p]);
        EXPECT_EQ(q.id[p], bodies[0].points.count + p);
    }
    EXPECT_DOUBLE_EQ(q.mass, 1500 * 0.25 / 9);
}

TEST(Bodies, RefuseAModulusThatIsNotPositive)
{
    const Scene scene = test::load(test::two_bodies(), "", {"material.stiff.youngs_modulus=1e4*(X-1)"});
    EXPECT_THROW(make_bodies(scene, make_lattice(scene.grid), {}), SceneError);
}

/// L / c_p sqrt(1 - nu) / sqrt(1 + alpha), the least of all materials.
TEST(CriticalTimeStep, IsolatedCellAndDamping)
{
    const Scene scene = test::load(test::two_bodies(), "", {"material.stiff.youngs_modulus=1e4", "damping.local=0.8"});
    const double M = ElasticModuli(1e4, 0.3).constrained();
    EXPECT_NEAR(critical_time_step(scene), 0.5 / std::sqrt(M / 1000) * std::sqrt(0.7 / 1.8), 1e-12);
    Scene with_another = scene;
    with_another.materials.push_back(scene.materials[0]);
    with_another.materials.back().name = "unused";
    with_another.materials.back().youngs_modulus = "1e30";
    EXPECT_DOUBLE_EQ(critical_time_step(with_another), critical_time_step(scene));
}
