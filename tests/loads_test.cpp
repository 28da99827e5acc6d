#include "core/run/guards.hpp"
#include "tests/scenes.hpp"
#include "tests/solvers.hpp"

#include <cmath>
#include <gtest/gtest.h>

using namespace testbed;

namespace
{
using test::all_methods;

using test::make;

/// Sum of the forces at nodes that can move by them.
Vec<2> force_on(const Solver& solver)
{
    const Nodes<2>& nodes = *solver.nodes().second;
    Vec<2> sum{0, 0};
    for (const auto n : nodes.active())
        if (nodes.mass[n] > 0)
            sum = {sum[0] + nodes.f[0][n], sum[1] + nodes.f[1][n]};
    return sum;
}
}  // namespace

/// A force that grows with the way of each point: v = v0 cosh(t).
TEST(BodyForce, IsThatOfThePlaceWhereThePointIs)
{
    for (const std::string& method : all_methods)
    {
        const Scene scene = test::load(test::soil_block({1, 1}, {2, 2}) +
                                           "velocity = [\"1\", \"-0.5\"]\n[body_force]\nacceleration = [\"x - X\", \"y - Y\"]\n",
                                       method, {"time.end=0.4", "time.dt=0.001"});
        const auto solver = make(scene);
        for (int n = 0; n < 400; ++n)
        {
            solver->prepare(0.001 * n, 0.001);
            solver->advance(0.001);
        }
        const PointMotion motion = solver->point_motion();
        EXPECT_NEAR(motion.momentum[0] / motion.mass, std::cosh(0.4), 2e-3) << method;
        EXPECT_NEAR(motion.momentum[1] / motion.mass, -0.5 * std::cosh(0.4), 1e-3) << method;
    }
}

/// Masses that density scaling raised have no more weight than before.
TEST(BodyForce, HasTheWeightOfScaledBodies)
{
    const std::string stiff =
        "[[material]]\nname = \"rock\"\nlaw = \"linear_elastic\"\ndensity = 2000.0\nyoungs_modulus = 1e8\npoissons_ratio = 0.2\n"
        "[[body]]\nname = \"rock\"\nmaterial = \"rock\"\nshape = \"box\"\nmin = [1.0, 2.0]\nmax = [2.0, 3.0]\n";
    for (const std::string load : {"[body_force]\nacceleration = [\"2\", \"-3\"]\n", "[gravity]\nacceleration = [2.0, -3.0]\n"})
        for (const std::string& method : all_methods)
        {
            const auto solver = make(
                test::load(test::soil_block({1, 1}, {2, 2}) + stiff + load, method, {"damping.local=0.5", "time.density_scaling=true"}));
            solver->prepare(0, 1e-4);
            EXPECT_NEAR(force_on(*solver)[0], 2 * 3000, 1e-6) << method << load;
            EXPECT_NEAR(force_on(*solver)[1], -3 * 3000, 1e-6) << method << load;
        }
}

/// A node that does not count hands on the load that it was given.
TEST(Tractions, PassThroughSmallNodes)
{
    const std::string pull = "[[traction]]\nname = \"pull\"\nbody = \"soil\"\nface = \"left\"\ntraction = [\"-100\", \"30\"]\n";
    for (const std::string method : {"mpm-linear", "mpm-bspline", "mpm-cpgimp"})
    {
        const auto solver = make(test::load(test::soil_block({1.45, 1.2}, {2.45, 2.2}) + pull, method, {"mpm.mass_cutoff=0.25"}));
        solver->prepare(0, 1e-4);
        EXPECT_NEAR(force_on(*solver)[0], -100, 1e-9) << method;
        EXPECT_NEAR(force_on(*solver)[1], 30, 1e-9) << method;
    }
}

/// Stress of a point that tension has grown counts over so much of its volume as the scene allows.
TEST(VolumeCap, LimitsTheForceOfAGrownPoint)
{
    const auto force = [](double cap)
    {
        const auto solver = make(test::load(test::soil_block({1, 1}, {2, 2}), "lpfdm-2000",
                                            {"body.soil.points_per_cell=1", "lpfdm.volume_cap=" + std::to_string(cap)}));
        solver->prepare(0, 1e-12);
        auto& q = const_cast<Points<2>&>(solver->bodies()[0].points);
        for (std::size_t p = 0; p < q.count; ++p)
        {
            q.volume[p] = 3 * q.initial_volume;
            q.stress[0][p] = 1000;
        }
        solver->advance(1e-12);
        solver->prepare(1e-12, 1e-12);
        double sum = 0;
        for (const auto n : solver->nodes().second->active())
            sum += std::abs(solver->nodes().second->f[0][n]);
        return sum;
    };
    EXPECT_GT(force(0), 0);
    EXPECT_NEAR(force(2) / force(0), 2.0 / 3, 1e-9);
    EXPECT_NEAR(force(4) / force(0), 1, 1e-9);
}

/// A body that came apart on the way is told, though its parts met again.
TEST(Guards, PartsThatMeetAgain)
{
    const Scene scene = test::load(test::soil_block({1, 1}, {2, 2}), "lpfdm");
    const auto solver = make(scene);
    Guards guards(scene, *solver, 1);
    auto& q = const_cast<Points<2>&>(solver->bodies()[0].points);
    const auto look = [&](double way)
    {
        for (std::size_t p = 0; p < q.count; ++p)
            q.x[0][p] += q.x[0][p] > 1.5 ? way : 0;
        solver->prepare(0, 1e-9);
        solver->advance(1e-9);
        solver->prepare(1e-9, 1e-9);
        GuardSample s;
        s.energy_scale = s.points.smallest = s.points.largest = 1;
        guards.watch(s, *solver);
        solver->advance(1e-9);
    };
    const auto told = [&]
    {
        const auto found = guards.findings(true);
        return std::any_of(found.begin(), found.end(), [](const Finding& f) { return f.code == "separated"; });
    };
    look(0);
    EXPECT_FALSE(told());
    look(1.5);
    EXPECT_TRUE(told());
    look(-1.5);
    EXPECT_TRUE(told());
}
