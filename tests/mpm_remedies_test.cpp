/// XPIC, the null-space filter and nodes with little mass.

#include "mpm/mpm.hpp"
#include "mpm/options.hpp"
#include "tests/oracle.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
struct Motion
{
    double energy = 0, angular_momentum = 0;  ///< of the points, per mass
    Vec<2> momentum{0, 0};
};

/// Of the points' own velocity; the moment arms are those of `at`, by id.
Motion motion(const Solver& solver, const std::vector<Vec<2>>& at)
{
    Motion s;
    for (const Body& body : solver.bodies())
    {
        const Points<2>& q = body.points;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            const Vec<2>& x = at[q.id[p]];
            s.energy += 0.5 * q.mass * (q.v[0][p] * q.v[0][p] + q.v[1][p] * q.v[1][p]);
            s.momentum[0] += q.mass * q.v[0][p];
            s.momentum[1] += q.mass * q.v[1][p];
            s.angular_momentum += q.mass * (x[0] * q.v[1][p] - x[1] * q.v[0][p]);
        }
    }
    return s;
}

std::vector<Vec<2>> positions(const Solver& solver)
{
    std::vector<Vec<2>> x;
    for (const Body& body : solver.bodies())
        for (std::size_t p = 0; p < body.points.count; ++p)
        {
            x.resize(std::max<std::size_t>(x.size(), body.points.id[p] + std::size_t{1}));
            x[body.points.id[p]] = {body.points.x[0][p], body.points.x[1][p]};
        }
    return x;
}

/// A block of 4 x 4 points per cell with the given velocity.
std::string moving_block(const std::string& vx, const std::string& vy, const Vec<2>& min = {1, 1}, const Vec<2>& max = {3, 3})
{
    return test::soil_block(min, max) + "velocity = [\"" + vx + "\", \"" + vy + "\"]\n";
}

/// The motion after some steps over that at the start.
std::pair<Motion, Motion> before_and_after(const std::string& text, const std::string& method, const std::vector<std::string>& settings,
                                           int steps, double dt)
{
    const auto solver = make_mpm(test::load(text, method, settings));
    std::vector<Vec<2>> at = positions(*solver);
    const Motion before = motion(*solver, at);
    for (int n = 0; n < steps; ++n)
    {
        at = positions(*solver);
        solver->prepare(n * dt, dt);
        solver->advance(dt);
    }
    return {before, motion(*solver, at)};
}

double energy_kept(const std::string& text, const std::string& method, const std::vector<std::string>& settings, int steps = 1,
                   double dt = 1e-6)
{
    const auto [before, after] = before_and_after(text, method, settings, steps, dt);
    return after.energy / before.energy;
}

/// What no node of bilinear shapes sees: with 4 x 4 points per cell (L = 0.5 m) the signs +, -, -, + in each direction.
const std::string unseen = moving_block("cos(4*pi*X)", "cos(4*pi*X)*cos(4*pi*Y)");
/// A longitudinal wave as long as twice the block of 4 cells.
const std::string smooth = moving_block("cos(pi*(X-1)/2)", "0");
}  // namespace

TEST(NullSpace, StaysWithFlip)
{
    for (const char* method : {"mpm-linear", "mpm-linear-bbar"})
        EXPECT_NEAR(energy_kept(unseen, method, {}, 50, 1e-3), 1, 1e-9) << method;
}

TEST(NullSpace, GoesWithXpicAndFilter)
{
    for (const char* method : {"mpm-linear", "mpm-linear-bbar"})
    {
        for (const int order : {1, 2, 5})
            EXPECT_LT(energy_kept(unseen, method, {"mpm.transfer=xpic", "mpm.xpic_order=" + std::to_string(order)}), 1e-24) << order;
        EXPECT_LT(energy_kept(unseen, method, {"mpm.null_space_filter=cell"}), 1e-24);
    }
}

/// The wider shapes see a part of it at the faces of the block alone.
TEST(NullSpace, GoesWithXpicOnWiderShapes)
{
    for (const char* method : {"mpm-bspline", "mpm-cpgimp"})
    {
        EXPECT_NEAR(energy_kept(unseen, method, {}, 1), 1, 1e-9) << method;
        EXPECT_LT(energy_kept(unseen, method, {"mpm.transfer=xpic", "mpm.xpic_order=2"}), 0.02) << method;
    }
}

/// What each takes from a smooth wave in one step: less with each order.
TEST(Xpic, KeepsASmoothWave)
{
    for (const char* method : {"mpm-linear", "mpm-bspline", "mpm-cpgimp"})
    {
        double last = 0;
        for (const int order : {1, 2, 3, 5})
        {
            const double kept = energy_kept(smooth, method, {"mpm.transfer=xpic", "mpm.xpic_order=" + std::to_string(order)});
            EXPECT_GT(kept, last) << method << ' ' << order;
            EXPECT_LT(kept, 1);
            last = kept;
        }
        EXPECT_GT(last, 0.99) << method;
    }
    const double kept = energy_kept(smooth, "mpm-linear", {"mpm.null_space_filter=cell"});
    EXPECT_GT(kept, 0.999);
    EXPECT_LT(kept, 1);
}

TEST(Xpic, KeepsLinearMomentum)
{
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"})
        for (const int order : {1, 2, 5})
        {
            const auto [before, after] =
                before_and_after(test::two_bodies(), method, {"mpm.transfer=xpic", "mpm.xpic_order=" + std::to_string(order)}, 40, 0.01);
            EXPECT_NEAR(after.momentum[0], before.momentum[0], 1e-11 * 600) << method << order;
            EXPECT_NEAR(after.momentum[1], before.momentum[1], 1e-11 * 600) << method << order;
        }
}

/// A rotation: FLIP and the filter keep its angular momentum, XPIC loses less with each order.
TEST(Xpic, AngularMomentum)
{
    const std::string turning = moving_block("-(Y-2)", "X-2", {0.8, 0.9}, {2.8, 2.9});
    for (const char* method : {"mpm-linear", "mpm-bspline", "mpm-cpgimp"})
    {
        const auto lost = [&](const std::vector<std::string>& settings)
        {
            const auto [before, after] = before_and_after(turning, method, settings, 1, 1e-6);
            return 1 - after.angular_momentum / before.angular_momentum;
        };
        EXPECT_NEAR(lost({}), 0, 1e-9) << method;
        double last = 1;
        for (const int order : {1, 2, 3, 5, 10})
        {
            const double loss = lost({"mpm.transfer=xpic", "mpm.xpic_order=" + std::to_string(order)});
            EXPECT_LT(loss, last) << method << order;
            EXPECT_GT(loss, 0) << method << order;
            last = loss;
        }
    }
}

/// Whatever the field, nodes see the same before and after the filter.
TEST(NullSpaceFilter, KeepsLinearAndAngularMomentum)
{
    const std::string any = moving_block("sin(5*X+Y)+0.3", "cos(7*Y-3*X)", {0.77, 0.91}, {2.77, 2.41});
    for (const char* method : {"mpm-linear", "mpm-linear-bbar"})
    {
        const auto [before, after] = before_and_after(any, method, {"mpm.null_space_filter=cell"}, 1, 1e-9);
        const double scale = 1e3 * 3;
        EXPECT_NEAR(after.momentum[0], before.momentum[0], 1e-12 * scale);
        EXPECT_NEAR(after.momentum[1], before.momentum[1], 1e-12 * scale);
        EXPECT_NEAR(after.angular_momentum, before.angular_momentum, 1e-11 * scale);
        EXPECT_LT(after.energy, 0.999 * before.energy);  // it did something
    }
}

struct RemedyCase
{
    const char *method, *scheme;
    int order;
    double cutoff;
};
class RemedyOracle : public testing::TestWithParam<RemedyCase>
{
};

/// XPIC and the mass cut-off against the oracle, with points that change cells.
TEST_P(RemedyOracle, SameTrajectories)
{
    const RemedyCase& c = GetParam();
    std::vector<std::string> settings{std::string("mpm.scheme=") + c.scheme, "material.stiff.youngs_modulus=3e4",
                                      fmt::format("mpm.mass_cutoff={}", c.cutoff)};
    if (c.order > 0)
        settings.insert(settings.end(), {"mpm.transfer=xpic", "mpm.xpic_order=" + std::to_string(c.order)});
    const Scene scene = test::load(test::two_bodies() + "[gravity]\nacceleration = [0.4, -1.3]\n", c.method, settings);
    const auto solver = make_mpm(scene);
    test::RefMpm reference{{0.5, -1, -1},
                           test::reference_points(scene),
                           name_of(scene.options<MpmSpec>().shape),
                           c.scheme,
                           1,
                           scene.options<MpmSpec>().strain == MpmSpec::Strain::b_bar,
                           true};
    reference.xpic = c.order;
    reference.least = c.cutoff * 1000 * 0.25;  // of the lighter body
    for (int n = 0; n < 40; ++n)
    {
        solver->prepare(n * 0.01, 0.01);
        solver->advance(0.01);
        reference.step(0.01, {0.4, -1.3});
        ASSERT_NO_FATAL_FAILURE(test::expect_same(*solver, reference.points, 1e-9)) << "step " << n;
    }
}

INSTANTIATE_TEST_SUITE_P(Variants, RemedyOracle,
                         testing::Values(RemedyCase{"mpm-linear", "musl", 1, 1e-7}, RemedyCase{"mpm-linear", "musl", 2, 1e-7},
                                         RemedyCase{"mpm-linear", "usl", 5, 1e-7}, RemedyCase{"mpm-linear-bbar", "usf", 3, 1e-7},
                                         RemedyCase{"mpm-bspline", "musl", 2, 1e-7}, RemedyCase{"mpm-bspline", "usf", 4, 1e-7},
                                         RemedyCase{"mpm-cpgimp", "musl", 3, 1e-7}, RemedyCase{"mpm-linear", "musl", 0, 0.05},
                                         RemedyCase{"mpm-linear-bbar", "musl", 0, 0.05}, RemedyCase{"mpm-bspline", "usl", 0, 0.05},
                                         RemedyCase{"mpm-cpgimp", "usf", 0, 0.05}, RemedyCase{"mpm-linear", "musl", 2, 0.05}),
                         [](const auto& info)
                         {
                             std::string name = fmt::format("{}_{}_xpic{}{}", info.param.method, info.param.scheme, info.param.order,
                                                            info.param.cutoff > 0.01 ? "_cutoff" : "");
                             std::replace(name.begin(), name.end(), '-', '_');
                             return name;
                         });

namespace
{
/// Largest stress over Young's modulus while a block falls whose points stand on lines of nodes.
double stress_in_free_fall(const std::string& method, const std::vector<std::string>& settings)
{
    std::string text = test::soil_block({1.125, 1.125}, {2.125, 2.125}) + "[gravity]\nacceleration = [0.0, -9.81]\n";
    text.replace(text.find("\"soil\"\nshape"), 6, "\"soil\"\npoints_per_cell = 2\n");
    const auto solver = make_mpm(test::load(text, method, settings));
    double largest = 0;
    for (int n = 0; n < 100; ++n)
    {
        solver->prepare(n * 1e-3, 1e-3);
        solver->advance(1e-3);
        const Points<2>& q = solver->bodies()[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
            largest = std::max({largest, std::abs(q.stress[0][p]), std::abs(q.stress[1][p]), std::abs(q.stress[2][p])});
    }
    return largest / 1e6;
}
}  // namespace

/// A point on a line of nodes gives no mass to the nodes behind it, or by rounding some whose sum has any sign: they must not stand still,
/// nor run.
TEST(SmallNodes, PointsOnLinesOfNodesFallWithoutStress)
{
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"})
    {
        EXPECT_LT(stress_in_free_fall(method, {}), 1e-10) << method;
    }
    EXPECT_GT(stress_in_free_fall("mpm-linear", {"mpm.mass_cutoff=0"}), 1e-7);
}

/// The bin of a point reaches 1e-9 cells beyond its line of nodes, so that the masses of a node may cancel to a rest that bears no force.
TEST(SmallNodes, DiskInFreeFlightHasNoStress)
{
    const std::string disk = R"toml(
[grid]
size = [10.0, 10.0]
cell_size = 1.0
[time]
end = 1.0
dt = 0.01
[[material]]
name = "soil"
law = "linear_elastic"
density = 1000.0
youngs_modulus = 1e6
poissons_ratio = 0.3
[[body]]
name = "disk"
material = "soil"
shape = "disk"
center = [2.37, 2.21]
radius = 1.2
points_per_cell = 2
velocity = ["3", "2"]
)toml";
    const auto stress = [&](const std::string& method, const std::vector<std::string>& settings)
    {
        const auto solver = make_mpm(test::load(disk, method, settings));
        for (int n = 0; n < 100; ++n)
        {
            solver->prepare(n * 0.01, 0.01);
            solver->advance(0.01);
        }
        double largest = 0;
        const Points<2>& q = solver->bodies()[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
            largest = std::max({largest, std::abs(q.stress[0][p]), std::abs(q.stress[1][p]), std::abs(q.stress[2][p])});
        return largest / 1e6;
    };
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"})
        EXPECT_LT(stress(method, {}), 1e-14) << method;
    EXPECT_GT(stress("mpm-linear", {"mpm.mass_cutoff=0"}), 1e-3);
}

TEST(SmallNodes, KeepLinearMomentum)
{
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"})
    {
        const auto [before, after] = before_and_after(test::two_bodies(), method, {"mpm.mass_cutoff=0.05"}, 40, 0.01);
        EXPECT_NEAR(after.momentum[0], before.momentum[0], 1e-11 * 600) << method;
        EXPECT_NEAR(after.momentum[1], before.momentum[1], 1e-11 * 600) << method;
    }
}

TEST(Remedies, SameBitsForAnyThreads)
{
    const auto run = [](const std::string& method, const std::vector<std::string>& settings, int threads)
    {
        set_threads(threads);
        const auto solver = make_mpm(test::load(test::two_bodies(0.2, 3), method, settings));
        for (int n = 0; n < 20; ++n)
        {
            solver->prepare(0, 5e-3);
            solver->advance(5e-3);
        }
        const Points<2>& q = solver->bodies()[0].points;
        std::vector<double> out(q.stress[0].data(), q.stress[0].data() + q.count);
        out.insert(out.end(), q.v[0].data(), q.v[0].data() + q.count);
        set_threads(1);
        return out;
    };
    using Settings = std::vector<std::string>;
    for (const char* method : {"mpm-linear", "mpm-bspline", "mpm-cpgimp"})
        for (const Settings& settings : {Settings{"mpm.transfer=xpic", "mpm.xpic_order=3"}, Settings{"mpm.mass_cutoff=0.05"}})
            EXPECT_EQ(run(method, settings, 1), run(method, settings, 2)) << method << ' ' << settings[0];
    const Settings filter{"mpm.null_space_filter=cell"};
    EXPECT_EQ(run("mpm-linear", filter, 1), run("mpm-linear", filter, 2));
}

TEST(Remedies, SceneProblems)
{
    const std::string scene = test::soil_block({1, 1}, {2, 2}) + "";
    for (const auto& [settings, message] : std::vector<std::pair<std::vector<std::string>, std::string>>{
             {{"mpm.xpic_order=0"}, "mpm.xpic_order"},
             {{"mpm.transfer=xpic", "mpm.flip=0.9"}, "mpm.flip"},
             {{"mpm.shape=bspline", "mpm.null_space_filter=cell"}, "mpm.null_space_filter"},
             {{"mpm.mass_cutoff=0.5"}, "mpm.mass_cutoff"},
             {{"mpm.mass_cutoff=-1.0"}, "mpm.mass_cutoff"}})
        test::expect_problem(scene, settings, message);
}
