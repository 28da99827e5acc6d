/// The one-step map of small bodies: what is known of it must be found.

#include "core/run/spectrum.hpp"
#include "tests/scenes.hpp"
#include "tests/solvers.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <gtest/gtest.h>

#include <map>
#include <numbers>

using namespace testbed;

namespace
{
constexpr double bar_speed = 40;  ///< of the bodies here: M = 1.6e6 Pa, 1000 kg/m^3

/// A free block of cells x cells on a lattice of unit cells with faces at (2 + shift, 2 + shift).
std::string block(int cells, double poissons_ratio = 0.3, const std::string& more = "", double shift = 0, int points_per_cell = 2)
{
    const double nu = poissons_ratio, modulus = 1.6e6 * (1 + nu) * (1 - 2 * nu) / (1 - nu);
    return fmt::format(
        "[grid]\nsize = [12.0, 12.0]\ncell_size = 1.0\n[time]\nend = 1.0\ncfl = 0.4\n[[material]]\nname = \"m\"\n"
        "law = \"hypoelastic_jaumann\"\ndensity = 1000.0\nyoungs_modulus = {:.17g}\npoissons_ratio = {}\n[[body]]\nname = \"b\"\n"
        "material = \"m\"\nshape = \"box\"\nmin = [{}, {}]\nmax = [{}, {}]\npoints_per_cell = {}\n{}\n",
        modulus, nu, 2 + shift, 2 + shift, 2 + cells + shift, 2 + cells + shift, points_per_cell, more);
}

struct Case
{
    Scene scene;
    std::unique_ptr<Solver> solver;
    State state;
    double t = 0, dt;

    Case(const std::string& text, const std::string& method, const std::vector<std::string>& overrides = {}, int steps = 1)
        : scene(test::load(text, method, overrides)),
          solver(test::make(scene)),
          dt(scene.time.dt.value_or(scene.time.cfl / bar_speed))
    {
        for (int n = 0; n < steps; ++n, t += dt)
        {
            solver->prepare(t, dt);
            solver->advance(dt);
        }
        state = state_of(*solver);
    }
    OneStepMap map(int steps = 1) { return one_step_map(*solver, state, make_lattice(scene.grid), {.t = t, .dt = dt, .steps = steps}); }
    OneStepMap map_of_step(double step) { return one_step_map(*solver, state, make_lattice(scene.grid), {.t = t, .dt = step}); }
    double radius(double step) { return spectral_radius(map_of_step(step).matrix); }
};
}  // namespace

/// A shear with its chain, a rotation with growth, a decay: what is known of a matrix is found, turned into another basis.
TEST(Spectrum, KnownMatrix)
{
    Eigen::MatrixXd a = Eigen::MatrixXd::Zero(8, 8);  // the last row and column are forgotten
    a.topLeftCorner(3, 3) << 1, 2, 0, 0, 1, 0, 0, 0, 1;
    const double growth = 1.1, phase = 0.7;
    a.block(3, 3, 2, 2) << growth * std::cos(phase), -growth * std::sin(phase), growth * std::sin(phase), growth * std::cos(phase);
    a(5, 5) = 0.5;
    a(6, 6) = -0.25;
    Eigen::MatrixXd basis = Eigen::MatrixXd::Identity(8, 8);
    for (int i = 0; i < 8; ++i)
        for (int j = 0; j < 8; ++j)
            basis(i, j) += 0.3 * std::sin(1 + i + 3 * j * j);
    const Eigen::MatrixXd turned = basis * a * basis.inverse();
    const Spectrum s = spectrum(turned);
    EXPECT_EQ(s.steady, 2u);
    EXPECT_EQ(s.drifting, 1u);
    EXPECT_EQ(s.forgotten, 1u);
    ASSERT_EQ(s.modes.size(), 3u);
    EXPECT_NEAR(s.modes[0].growth(), growth, 1e-12);
    EXPECT_NEAR(s.modes[0].phase(), phase, 1e-12);
    EXPECT_NEAR(s.modes[0].damping_ratio(), -std::log(growth) / std::hypot(std::log(growth), phase), 1e-12);
    EXPECT_NEAR(std::abs(s.modes[1].eigenvalue - 0.5), 0, 1e-12);
    EXPECT_NEAR(std::abs(s.modes[2].eigenvalue + 0.25), 0, 1e-12);
    for (const Mode& m : s.modes)
        EXPECT_LT((turned.cast<std::complex<double>>() * m.shape - m.eigenvalue * m.shape).norm(), 1e-11);
    EXPECT_NEAR(spectral_radius(turned), growth, 1e-12);
}

/// The published scheme has the two hourglass patterns that the paper denies, and a third pattern without strain: hourglasses whose size
/// grows linearly, vx = -x h, vy = y h, so that cells spin to and fro. Nothing else but the motions of a rigid body.
TEST(Modes, NullModesOfThePublishedScheme)
{
    for (const int cells : {2, 3})
    {
        Case c(block(cells), "lpfdm-2000");
        const NullModes null = null_modes(c.map());
        EXPECT_EQ(null.hourglass, 2u);
        EXPECT_EQ(null.deforming, 3u);
        EXPECT_EQ(null.rigid, 3u);
        EXPECT_EQ(null.unseen, 0u);
        ASSERT_EQ(null.shapes.cols(), 3);
    }
    Case one(block(1), "lpfdm-2000");  // four nodes have eight velocities, three strains
    EXPECT_EQ(null_modes(one.map()).deforming, 2u);
    Case off(block(3, 0.3, "", 0.3), "lpfdm-2000");
    EXPECT_EQ(null_modes(off.map()).hourglass, 2u);
}

/// Supports take them away as they take motions of a rigid body.
TEST(Modes, SupportsTakeNullModes)
{
    Case c(block(3, 0.3, "[[boundary]]\nname = \"floor\"\nwhere = \"y <= 2\"\nfix = \"xy\""), "lpfdm-2000");
    const NullModes null = null_modes(c.map());
    EXPECT_EQ(null.rigid, 0u);
    EXPECT_EQ(null.deforming, 0u);
}

/// Hourglass control leaves the patterns 1 - 4 chi c_p dt / L of themselves in each step, and no null mode.
TEST(Modes, HourglassControlDampsAtThePredictedRate)
{
    for (const double chi : {0.02, 0.05})
    {
        Case c(block(3), "lpfdm", {fmt::format("lpfdm.hourglass={}", chi)});
        const OneStepMap map = c.map();
        const NullModes null = null_modes(map);
        EXPECT_EQ(null.hourglass, 0u);
        EXPECT_EQ(null.deforming, 0u);
        EXPECT_EQ(null.rigid, 3u);
        const double kept = 1 - 4 * chi * bar_speed * c.dt;
        int found = 0;
        for (const Mode& m : spectrum(map.matrix).modes)
            found += std::abs(m.eigenvalue - kept) < 1e-8;
        EXPECT_GE(found, 2) << chi;
    }
    Case c(block(3), "lpfdm", {"lpfdm.hourglass=0"});
    EXPECT_EQ(null_modes(c.map()).hourglass, 2u);
}

/// FLIP keeps what no node feels: as many patterns of the points' velocity as there are points beyond the rank of the shape functions.
TEST(Modes, NullSpaceOfFlip)
{
    const auto unseen = [](const std::string& method, const std::vector<std::string>& overrides, double& kept)
    {
        const bool is_spline = method == "mpm-bspline";  // two points per cell would do for all but one of its nodes
        Case c(block(3, 0.3, "", 0.2, is_spline ? 3 : 2), method, overrides);
        const NullModes null = null_modes(c.map());
        kept = null.unseen_kept;
        // shape functions at the points, straight from the definition
        const Points<2>& q = c.solver->bodies()[0].points;
        Eigen::MatrixXd N = Eigen::MatrixXd::Zero(13 * 13, static_cast<Eigen::Index>(q.count));
        for (std::size_t p = 0; p < q.count; ++p)
            for (int j = 0; j < 13; ++j)
                for (int i = 0; i < 13; ++i)
                {
                    const auto hat = [](double r) { return std::max(0.0, 1 - std::abs(r)); };
                    const auto spline = [](double r)
                    {
                        r = std::abs(r);
                        return r < 0.5 ? 0.75 - r * r : r < 1.5 ? 0.5 * (1.5 - r) * (1.5 - r) : 0;
                    };
                    N(13 * j + i, static_cast<Eigen::Index>(p)) =
                        is_spline ? spline(q.x[0][p] - i) * spline(q.x[1][p] - j) : hat(q.x[0][p] - i) * hat(q.x[1][p] - j);
                }
        Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(N);
        qr.setThreshold(1e-9);
        EXPECT_EQ(null.unseen, 2 * (q.count - static_cast<std::size_t>(qr.rank()))) << method;
        EXPECT_GE(spectrum(c.map().matrix).steady, overrides.empty() ? null.unseen : 0) << method;
        return null.unseen;
    };
    double kept = 0;
    EXPECT_EQ(unseen("mpm-linear", {}, kept), 2u * (36 - 16));
    EXPECT_NEAR(kept, 1, 1e-8);
    unseen("mpm-linear", {"mpm.scheme=usl"}, kept);
    EXPECT_NEAR(kept, 1, 1e-8);
    unseen("mpm-linear", {"mpm.flip=0.9"}, kept);
    EXPECT_NEAR(kept, 0.9, 1e-8);
    unseen("mpm-bspline", {}, kept);
    EXPECT_NEAR(kept, 1, 1e-8);
}

/// A single cell: stable up to a step, unstable beyond. LPFDM has sqrt(1 - nu) L / c_p, for its only strains are those of the whole cell.
TEST(Modes, CriticalStepOfACell)
{
    for (const double nu : {0.0, 0.3})
    {
        Case c(block(1, nu), "lpfdm-2000");
        const double limit = std::sqrt(1 - nu) / bar_speed;
        EXPECT_LE(c.radius(0.999 * limit), 1 + 1e-8) << nu;
        EXPECT_GT(c.radius(1.001 * limit), 1.05) << nu;
        const auto found = critical_step([&](double dt) { return c.radius(dt); }, c.dt, 1e-6);
        ASSERT_TRUE(found);
        EXPECT_NEAR(*found / limit, 1, 2e-4) << nu;
    }
    for (const char* method : {"mpm-linear", "mpm-cpgimp", "mpm-bspline"})
    {
        Case c(block(1), method);
        const auto found = critical_step([&](double dt) { return c.radius(dt); }, c.dt, 1e-6);
        ASSERT_TRUE(found);
        EXPECT_LE(c.radius(0.999 * *found), 1 + 1e-6) << method;
        EXPECT_GT(c.radius(1.001 * *found), 1 + 1e-6) << method;
    }
}

/// The leap-frog swings too fast: sin(theta / 2) = omega dt / 2, omega = 2 c_p / (L sqrt(1 - nu)) for the dilatation of a single cell.
TEST(Modes, PhaseOfTheLeapFrog)
{
    Case c(block(1), "lpfdm-2000");
    const double omega = 2 * bar_speed / std::sqrt(0.7), expected = 2 * std::asin(0.5 * omega * c.dt);
    bool found = false;
    for (const Mode& m : spectrum(c.map().matrix).modes)
    {
        if (m.growth() < 1e-9)  // what a step forgets: the mass before
            continue;
        EXPECT_NEAR(m.growth(), 1, 1e-8);
        found |= std::abs(m.phase() - expected) < 1e-7;
    }
    EXPECT_TRUE(found);
}

/// Central convection takes the gradient behind a trailing face for that before it: what swings there grows. Without convection it does
/// not; at rest neither.
TEST(Modes, CentralConvectionIsUnstableAtATrailingFace)
{
    const auto largest = [](double speed, const std::string& convection)
    {
        Case c(block(3, 0.3, fmt::format("velocity = [\"{}\", 0]", speed)), "lpfdm",
               {"lpfdm.convection=" + convection, "lpfdm.frontier=extrapolate", "lpfdm.hourglass=0"}, 5);
        const OneStepMap map = c.map();
        const Spectrum s = spectrum(map.matrix);
        // where it is: whether the nodes of the trailing face have most of its velocity
        std::map<int, double> columns;
        for (const auto n : map.all(Unknown::Kind::velocity))
        {
            columns[map.unknowns[static_cast<std::size_t>(n)].node[0]] += std::norm(s.modes.front().shape[n]);
        }
        const auto most =
            std::max_element(columns.begin(), columns.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
        return std::pair(s.radius, most->first);
    };
    const auto [radius, column] = largest(0.1 * bar_speed, "central");
    EXPECT_GT(radius, 1.005);
    EXPECT_EQ(column, 2);
    EXPECT_LT(largest(0.1 * bar_speed, "none").first, 1 + 1e-7);
    EXPECT_LT(largest(0, "central").first, 1 + 1e-7);
}

/// The map over the steps in which a body moves by a cell: a body that only flies comes back to where it was in its own cells.
TEST(Modes, MapOverACell)
{
    // mass that arrives brings its velocity by a rule that is not linear about rigid motion: left out here
    Case c(block(2, 0.3, "velocity = [\"4\", 0]", 0.113), "lpfdm",
           {"time.dt=0.0125", "lpfdm.convection=central", "lpfdm.frontier=extrapolate"});
    const OneStepMap map = c.map(20);
    // a velocity that all nodes share is all that they have after it, and it has moved all points by 20 steps
    Eigen::VectorXd push = Eigen::VectorXd::Zero(map.matrix.cols());
    for (const auto n : map.all(Unknown::Kind::velocity))
        push[n] = map.unknowns[static_cast<std::size_t>(n)].component == 1;
    const Eigen::VectorXd end = map.matrix * push;
    for (const auto n : map.all(Unknown::Kind::velocity))
        EXPECT_NEAR(end[n], push[n], 1e-7);
    for (const auto n : map.all(Unknown::Kind::position))
        EXPECT_NEAR(end[n], map.unknowns[static_cast<std::size_t>(n)].component * 20 * 0.0125 * bar_speed, 1e-6);
    for (const auto n : map.all(Unknown::Kind::stress))
        EXPECT_NEAR(end[n], 0, 1e-7);
}

/// Local damping takes from a force by the sign of the velocity: two disturbances are not the sum of both, and the map says so.
TEST(Modes, WhatDoesNotAddUpIsSeen)
{
    Case c(block(2), "lpfdm-2000");
    EXPECT_LT(c.map().excess, 1e-4);
    Case damped(block(2, 0.3, "[damping]\nlocal = 0.5"), "lpfdm-2000");
    EXPECT_GT(damped.map().excess, 0.01);
}
