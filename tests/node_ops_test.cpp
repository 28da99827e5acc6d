#include "core/bodies/body.hpp"
#include "core/loads/node_ops.hpp"
#include "core/run/solver.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
Nodes<2> two_nodes()
{
    Nodes<2> nodes(3);
    nodes.set_active({0, 2});
    nodes.mass = {2, 5, 4};
    nodes.v[0] = {1, 7, -1};
    nodes.f[0] = {10, 11, 12};
    return nodes;
}

/// Of a mass of 2.
Nodes<2> one_node(double velocity, double force)
{
    Nodes<2> nodes(1);
    nodes.set_active({0});
    nodes.mass = {2};
    nodes.v[0] = {velocity};
    nodes.f[0] = {force};
    return nodes;
}
}  // namespace

TEST(Gravity, RampsSmoothly)
{
    const Gravity gravity{{0, -9.81}, 2.0};
    EXPECT_DOUBLE_EQ(gravity.factor(0), 0);
    EXPECT_NEAR(gravity.factor(1), 0.5, 1e-12);
    EXPECT_DOUBLE_EQ(gravity.factor(2), 1);
    EXPECT_DOUBLE_EQ((Gravity{{0, -9.81}, 0}.factor(0)), 1);  // at once
    Nodes<2> nodes = two_nodes();
    gravity.apply(nodes, nodes.mass, 5);
    EXPECT_DOUBLE_EQ(nodes.f[1][0], -2 * 9.81);
    EXPECT_DOUBLE_EQ(nodes.f[1][1], 0);  // not in use
}

/// Loading to failure: in proportion to time.
TEST(Gravity, RampsLinearlyWhereTheSceneSaysSo)
{
    GravitySpec spec{.acceleration = {0, -9.81}, .ramp = 2.0};
    EXPECT_NEAR(make_gravity(spec).factor(0.5), 0.5 * (1 - std::sqrt(0.5)), 1e-12);
    spec.profile = GravitySpec::Profile::linear;
    for (const double t : {0.0, 0.3, 0.5, 1.7})
        EXPECT_DOUBLE_EQ(make_gravity(spec).factor(t), t / 2);
    EXPECT_DOUBLE_EQ(make_gravity(spec).factor(3), 1);
}

/// Each component by its own acceleration.
TEST(Gravity, PullsBothWays)
{
    Nodes<2> nodes = two_nodes();
    (Gravity{{2, -3}, 0}).apply(nodes, nodes.mass, 1);
    EXPECT_DOUBLE_EQ(nodes.f[0][2], 12 + 4 * 2);
    EXPECT_DOUBLE_EQ(nodes.f[1][2], -4 * 3);
}

/// Eq. (15): opposes the motion, whatever the sign of the force; nothing at rest.
TEST(LocalDamping, AlwaysOpposesTheMotion)
{
    const LocalDamping damping{0.8};
    EXPECT_DOUBLE_EQ(damping.damped(Pack(10.0), Pack(1.0))[0], 2);
    EXPECT_DOUBLE_EQ(damping.damped(Pack(-10.0), Pack(1.0))[0], -18);
    EXPECT_DOUBLE_EQ(damping.damped(Pack(10.0), Pack(-1.0))[0], 18);
    EXPECT_DOUBLE_EQ(damping.damped(Pack(10.0), Pack(0.0))[0], 10);
}

/// What was taken is known from what is left.
TEST(LocalDamping, KnowsWhatItTook)
{
    const LocalDamping damping{0.8};
    for (const double force : {10.0, -3.0})
        for (const double velocity : {2.0, -2.0, 0.0})
        {
            const Pack left = damping.damped(Pack(force), Pack(velocity));
            EXPECT_NEAR(damping.taken(left, Pack(velocity))[0], force - left[0], 1e-12) << force << " " << velocity;
        }
}

/// A node on a spring under its weight: where the kinetic energy begins to fall it is put at rest in the middle of the kick, so that half
/// of the kick moves it; the work of the forces is that of the half steps before and after, and what was lost is all that moved.
TEST(KineticDamping, StopsANodeBehindItsPeak)
{
    const std::string text = test::soil_block({0, 0}, {1, 1}) + "[damping]\nkinetic = true\n";
    const Scene scene = test::load(text, "lpfdm");
    NodeOps ops(scene, make_lattice(scene.grid));
    Nodes<2> nodes(2);
    nodes.set_active({0});
    nodes.mass = {2, 5};
    nodes.v[0] = {0, 0};
    const double stiffness = 30, weight = 12, dt = 0.1;
    double x = 0, way = 0, v_before = 0;
    int steps = 0;
    for (bool stopped = false; !stopped; ++steps, x += dt * nodes.v[0][0])
    {
        nodes.f[0] = {weight - stiffness * x, 0};
        v_before = nodes.v[0][0];
        const double kicked = v_before + dt * nodes.f[0][0] / 2;
        stopped = ops.kick(nodes, dt).has_value();
        EXPECT_EQ(stopped, kicked * kicked < v_before * v_before) << steps;
        EXPECT_DOUBLE_EQ(nodes.v[0][0], stopped ? 0.5 * dt * nodes.f[0][0] / 2 : kicked);
        way += 0.5 * dt * nodes.f[0][0] * (v_before + nodes.v[0][0]);
    }
    EXPECT_GT(steps, 3);
    const double energy = nodes.v[0][0] * nodes.v[0][0];  // half of a mass of 2
    const NodalWork& work = ops.work_done();
    EXPECT_NEAR(work.kick, energy, 1e-12);  // it started from rest
    EXPECT_NEAR(work.kick + work.damping, way, 1e-12);
    EXPECT_GT(work.damping, 0.9 * v_before * v_before);
}

/// What local damping takes in the half of the kick that a stop leaves out goes by the velocity that it was made with, here of the other
/// sign.
TEST(KineticDamping, TakesBackWhatLocalDampingTook)
{
    const Scene scene = test::load(test::soil_block({0, 0}, {1, 1}) + "[damping]\nkinetic = true\nlocal = 0.3\n", "lpfdm");
    NodeOps ops(scene, make_lattice(scene.grid));
    const double dt = 0.1, force = -30, taken = LocalDamping{0.3}.taken(Pack(force), Pack(1.0))[0];
    Nodes<2> nodes = one_node(1, force);
    const double after = 0.5 * dt * force / 2, way = 0.5 * dt * (1 + after);
    ASSERT_TRUE(ops.kick(nodes, dt));
    EXPECT_DOUBLE_EQ(nodes.v[0][0], after);
    const NodalWork& work = ops.work_done();
    EXPECT_NEAR(work.kick, after * after - 1, 1e-12);
    EXPECT_NEAR(work.kick + work.damping, (force + taken) * way, 1e-12);
}

/// With MUSL the points take what kicks give to the nodes: no kick takes energy, and yet it falls.
TEST(KineticDamping, StopsWhereEnergyFallsBetweenKicks)
{
    const Scene scene = test::load(test::soil_block({0, 0}, {1, 1}) + "[damping]\nkinetic = true\n", "lpfdm");
    NodeOps ops(scene, make_lattice(scene.grid));
    Nodes<2> nodes = one_node(0, 10);
    const auto stops = [&] { return ops.kick(nodes, 0.1).has_value(); };
    EXPECT_FALSE(stops());
    EXPECT_FALSE(stops());
    nodes.v[0][0] *= 0.4;  // at 1 before; the first kick had found it at 0, the second at 0.5
    EXPECT_TRUE(stops());
    EXPECT_DOUBLE_EQ(nodes.v[0][0], 0.25);
    EXPECT_FALSE(stops());  // from rest
}

TEST(KineticDamping, IsForWhatComesToRest)
{
    const std::string scene = test::soil_block({0, 0}, {1, 1}) + "[damping]\nkinetic = true\n";
    test::expect_problem(scene, {"body.soil.velocity=[\"1\", \"0\"]"}, "an initial velocity");
    test::expect_problem(scene + "[[wall]]\nname = \"lid\"\nmin = [0.0, 1.0]\nmax = [1.0, 1.5]\nvelocity = [\"0\", \"-1\"]\nfix = \"y\"\n",
                         {}, "a moving wall");
    test::expect_problem(scene, {"method=mpm-linear", "mpm.transfer=xpic"}, "xpic");
}

TEST(Accelerate, ByForceOverMass)
{
    Nodes<2> nodes = two_nodes();
    nodes.mass[2] = 0;
    accelerate(nodes, nodes.mass, 0.1);
    EXPECT_DOUBLE_EQ(nodes.v[0][0], 1.5);
    EXPECT_DOUBLE_EQ(nodes.v[0][1], 7);
    EXPECT_DOUBLE_EQ(nodes.v[0][2], -1);  // no mass, no acceleration
}

/// The work of a kick is the change of the kinetic energy; mass times way and what damping took go with the velocity in its middle.
TEST(Accelerate, KnowsItsWork)
{
    Nodes<2> nodes = two_nodes();
    nodes.f[1] = {4, 0, -6};
    nodes.v[1] = {-3, 0, 2};
    const auto kinetic = [&]
    {
        double sum = 0;
        for (const std::size_t n : {0, 2})
            sum += 0.5 * nodes.mass[n] * (nodes.v[0][n] * nodes.v[0][n] + nodes.v[1][n] * nodes.v[1][n]);
        return sum;
    };
    const LocalDamping damping{0.5};
    const Nodes<2> before = nodes;
    const double energy = kinetic();
    const Kick kick = accelerate(nodes, nodes.mass, 0.1, damping);
    EXPECT_NEAR(kick.work, kinetic() - energy, 1e-12);
    Vec<2> transport{0, 0};
    double damped = 0;
    for (const std::size_t n : {0, 2})
    {
        const double x = 0.5 * (before.v[0][n] + nodes.v[0][n]), y = 0.5 * (before.v[1][n] + nodes.v[1][n]);
        transport = {transport[0] + 0.1 * nodes.mass[n] * x, transport[1] + 0.1 * nodes.mass[n] * y};
        damped += 0.1 * (damping.taken(Pack(before.f[0][n]), Pack(before.v[0][n]))[0] * x +
                         damping.taken(Pack(before.f[1][n]), Pack(before.v[1][n]))[0] * y);
    }
    EXPECT_NEAR(kick.transport[0], transport[0], 1e-12);
    EXPECT_NEAR(kick.transport[1], transport[1], 1e-12);
    EXPECT_NEAR(kick.damping, damped, 1e-12);
}

TEST(NodalSums, EnergyAndMomenta)
{
    Nodes<2> nodes = two_nodes();
    const Lattice<2> lattice{{0, 0}, 1.0, {1, 1}};
    const MotionSums s = nodal_sums(lattice, nodes, 0.2, 5.0);
    // v at the time of the force: 1 + 10/2*0.2 = 2, -1 + 12/4*0.2 = -0.4; half a step later: 3, 0.2
    EXPECT_NEAR(s.kinetic_energy, 0.5 * 2 * (1 * 3) + 0.5 * 4 * (-1 * 0.2), 1e-12);
    EXPECT_NEAR(s.kinetic_before, 0.5 * 2 * 1 + 0.5 * 4 * 1, 1e-12);
    EXPECT_NEAR(s.momentum[0], 4 - 1.6, 1e-12);
    EXPECT_NEAR(s.unbalanced, std::hypot(10, 12) / 5, 1e-12);
    // nodes 0 and 2 of the padded lattice stand at y = -1: L = -y m v_x
    EXPECT_NEAR(s.angular_momentum, 2.4, 1e-12);
}

TEST(NodeOps, FixitiesOfAScene)
{
    const Scene scene = test::load(test::two_bodies() + R"(
[gravity]
acceleration = [0.0, -9.81]
[damping]
local = 0.5
[[boundary]]
name = "base"
where = "y <= -1"
fix = "xy"
[[boundary]]
name = "left"
where = "x <= -1"
fix = "x"
)");
    const Lattice<2> lattice = make_lattice(scene.grid);
    NodeOps ops(scene, lattice);
    EXPECT_EQ(ops.restraints().size(), 2u);
    VectorField<2> v{std::vector<double>(lattice.nodes(), 1), std::vector<double>(lattice.nodes(), 1)};
    Nodes<2> nodes(lattice.nodes());
    std::vector<std::uint32_t> all(lattice.nodes() - 1);  // but the last one
    std::iota(all.begin(), all.end(), 0u);
    nodes.set_active(all);
    ops.restrain(lattice, nodes, v);
    EXPECT_EQ(v[1][lattice.node({3, 0})], 0);
    EXPECT_EQ(v[0][lattice.node({0, 3})], 0);
    EXPECT_EQ(v[1][lattice.node({0, 3})], 1);
    EXPECT_EQ(v[0][lattice.node({3, 3})], 1);
    for (const auto& [i, j] : {std::pair{-1, 3}, {0, -1}, {0, lattice.size[1] + 1}})  // the ring around the lattice, too
        EXPECT_EQ(v[0][lattice.node({i, j})], 0) << i << ' ' << j;
    nodes.set_active({});
    std::fill(v[1].begin(), v[1].end(), 1.0);
    ops.restrain(lattice, nodes, v);
    EXPECT_EQ(v[1][lattice.node({3, 0})], 1);  // a node that is not in use costs nothing
}

TEST(NodeOps, WhatASceneDoesNotHaveIsAbsent)
{
    const Scene scene = test::load(test::two_bodies());
    const NodeOps ops(scene, make_lattice(scene.grid));
    EXPECT_FALSE(ops.restrains());
}

TEST(NodeOps, ABoundaryWithoutNodesIsAnError)
{
    const Scene scene = test::load(test::two_bodies() + "[[boundary]]\nname = \"far\"\nwhere = \"y > 100\"\nfix = \"x\"\n");
    EXPECT_THROW(NodeOps(scene, make_lattice(scene.grid)), SceneError);
}
