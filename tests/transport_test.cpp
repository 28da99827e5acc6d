/// Transport of LPFDM: free faces, the middle of the step, and what both mean for whole bodies. `old` is the form before it: central
/// convection of the whole step at once, positions from the start of the step.

#include "core/bodies/point_sums.hpp"
#include "lpfdm/convection.hpp"
#include "lpfdm/equations.hpp"
#include "lpfdm/lpfdm.hpp"
#include "tests/random.hpp"
#include "tests/scenes.hpp"

#include <cmath>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <numbers>

using namespace testbed;

namespace
{
const std::vector<std::string> old{"lpfdm.convection=central", "lpfdm.frontier=extrapolate"};

std::string material(double youngs_modulus, double poissons_ratio, double density = 1000,
                     const std::string& law = "hypoelastic_exact_rotation")
{
    return fmt::format("[[material]]\nname = \"m\"\nlaw = \"{}\"\ndensity = {}\nyoungs_modulus = {}\npoissons_ratio = {}\n", law, density,
                       youngs_modulus, poissons_ratio);
}
std::string box(const Vec<2>& min, const Vec<2>& max, int points_per_cell, const std::string& velocity = "")
{
    return fmt::format(
        "[[body]]\nname = \"b\"\nmaterial = \"m\"\nshape = \"box\"\nmin = [{}, {}]\nmax = [{}, {}]\npoints_per_cell = {}\n{}", min[0],
        min[1], max[0], max[1], points_per_cell, velocity.empty() ? "" : "velocity = " + velocity + "\n");
}
std::string lattice(double width, double height, double cell_size = 1, const Vec<2>& origin = {0, 0})
{
    return fmt::format("[grid]\norigin = [{}, {}]\nsize = [{}, {}]\ncell_size = {}\n[time]\nend = 1.0\n", origin[0], origin[1], width,
                       height, cell_size);
}
double wave_speed(double youngs_modulus, double nu, double density = 1000)
{
    return std::sqrt(youngs_modulus * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) / density);
}

/// A block of 5 x 5 unit cells with masses and a velocity field of choice.
struct Patch
{
    static constexpr int first = 2, last = 6;  ///< cells
    Scene scene = test::load(lattice(10, 10) + material(1, 0) + box({2, 2}, {7, 7}, 2), "lpfdm");
    LpfdmGrid<2> grid{make_lattice(scene.grid)};
    FreeFaces faces{grid.lattice.nodes()};
    std::vector<double> before;
    std::vector<Body> bodies = make_bodies(scene, grid.lattice, {.box = true});

    /// @param mass of a cell (i, j) with material
    template <class Mass>
    explicit Patch(Mass&& mass)
    {
        std::vector<double> workspace;
        bodies[0].bins.rebuild<DomainSupport>(bodies[0].points, workspace);
        const Bins<2>* bins = &bodies[0].bins;
        grid.rebuild<2>({&bins, 1});
        for (int j = first; j <= last; ++j)
            for (int i = first; i <= last; ++i)
                grid.cells.mass[grid.lattice.cell({i, j})] = mass(i, j);
        nodal_forces(grid);
        before = grid.nodes.mass;
        faces.full_mass = 1;
    }
    template <class Field>
    void set(Field&& field)
    {
        for (const auto n : grid.nodes.active())
            if (grid.nodes.mass[n] > 0)
            {
                const Vec<2> v = field(grid.lattice.node_position(n));
                grid.nodes.v[0][n] = v[0];
                grid.nodes.v[1][n] = v[1];
            }
    }
    Vec<2> velocity(std::uint32_t n) const { return {grid.nodes.v[0][n], grid.nodes.v[1][n]}; }
    std::uint32_t node(int i, int j) const { return static_cast<std::uint32_t>(grid.lattice.node({i, j})); }
    /// Gradients of the cells and nodes over dt, and the faces.
    void find(double dt)
    {
        cell_gradients(grid, dt);
        faces.find(grid);
        faces.keep(
            grid,
            [&](std::size_t c, const auto& lanes, const Vec<2, Pack>&) {
                return CentralConvection::gradient<2>(grid, c, lanes, {Pack(0.0), Pack(0.0)});
            },
            [](const Vec<2, Pack>& v, const Gradient<2, Pack>&) { return v; });
    }
};

/// Full inside; an outermost ring of cells that are full, light or next to empty.
struct Ring
{
    double outer;
    double operator()(int i, int j) const
    {
        return std::min({i - Patch::first, j - Patch::first, Patch::last - i, Patch::last - j}) == 0 ? outer : 1;
    }
};

const Gradient<2> rate{0.3, -0.2, 0.7, 0.4};
Vec<2> linear(const Vec<2>& x)
{
    return {1 + rate.xx * x[0] + rate.xy * x[1], -1 + rate.yx * x[0] + rate.yy * x[1]};
}
}  // namespace

/// A linear field arrives exactly from x - dt v / 2 at every node with mass: inside, at faces, edges and corners, in full cells and
/// slivers, and whatever part of the mass is new. Nodes ahead of the body continue it.
TEST(FreeFaces, LinearFieldArrivesExactly)
{
    test::Random random(7);
    const double dt = 0.02;
    for (const double outer : {1.0, 0.3, 0.01, 1e-5})
        for (const bool mass_arrives : {false, true})
        {
            Patch p{Ring{outer}};
            p.set(linear);
            for (const auto n : p.grid.nodes.active())
                p.before[n] = p.grid.nodes.mass[n] * random(0.2, 1.1);
            p.before[p.node(2, 4)] = p.before[p.node(7, 7)] = 0;  // reached in this step
            cell_gradients(p.grid, dt);
            p.faces.find(p.grid);
            convect(p.grid, p.faces, dt, 0.5, mass_arrives ? &p.before : nullptr);
            int nodes = 0;
            for (const auto n : p.grid.nodes.active())
            {
                const Vec<2> x = p.grid.lattice.node_position(n), v = p.velocity(n);
                if (p.grid.nodes.mass[n] > 0)
                {
                    const Vec<2> arrives = linear({x[0] - 0.5 * dt * v[0], x[1] - 0.5 * dt * v[1]});
                    EXPECT_NEAR(v[0], arrives[0], 1e-13) << outer << " " << x[0] << " " << x[1];
                    EXPECT_NEAR(v[1], arrives[1], 1e-13) << outer << " " << x[0] << " " << x[1];
                    ++nodes;
                }
            }
            EXPECT_EQ(nodes, 36);
        }
}

/// The derivative across a face that recedes is that of the next layer and does not know the velocity of the node at the face; at a corner
/// in both directions.
TEST(FreeFaces, GradientAcrossIsOfTheNextLayer)
{
    Patch p{Ring{1}};
    const auto field = [](const Vec<2>& x) { return Vec<2>{std::sin(x[0] + 2 * x[1]) - 9, std::cos(3 * x[0] - x[1]) - 9}; };
    p.set(field);
    p.find(0.1);
    const auto at = [&](int i, int j) { return p.faces.across(p.grid, p.node(i, j), 1, 1); };
    const Gradient<2> face = at(7, 4), corner = at(7, 7);
    EXPECT_EQ(corner.xx, p.grid.cells.gradient[0][p.grid.lattice.cell({5, 6})]);
    EXPECT_EQ(corner.xy, p.grid.cells.gradient[2][p.grid.lattice.cell({6, 5})]);
    for (const auto n : {p.node(7, 4), p.node(7, 7)})
    {
        p.grid.nodes.v[0][n] += 5;
        p.grid.nodes.v[1][n] -= 3;
    }
    p.find(0.1);
    EXPECT_EQ(at(7, 4).xx, face.xx);
    EXPECT_EQ(at(7, 4).yx, face.yx);
    EXPECT_EQ(at(7, 7).xx, corner.xx);
    EXPECT_EQ(at(7, 7).yy, corner.yy);
    EXPECT_EQ(at(7, 7).xy, corner.xy);
    EXPECT_EQ(at(7, 7).yx, corner.yx);
}

/// At a face that leads it is the node's own where that takes from a strain across the face, on any side of a body; none of it where that
/// would feed it, or where the node's velocity arrived just now; a part where both gradients are opposite. A rotation on top changes
/// nothing.
TEST(FreeFaces, LeadingFaceTakesFromShortWaves)
{
    struct Side
    {
        Vec<2> out;
        int i, j;
    };
    for (const Side& side : {Side{{1, 0}, 7, 4}, Side{{-1, 0}, 2, 4}, Side{{0, 1}, 4, 7}, Side{{0, -1}, 4, 2}})
        for (const Vec<2>& direction : {side.out, Vec<2>{side.out[1], side.out[0]}})  // of the wave's velocity: along or across
        {
            const bool x = side.out[0] != 0, along = direction == side.out;
            // velocity with these differences from the node to the next one inside, and on to the one after
            const auto derivative = [&](double at_face, double inside, double its, double speed, double spin)
            {
                Patch p{Ring{1}};
                p.set(
                    [&](const Vec<2>& at)
                    {
                        const double depth = std::abs(side.out[0] * (side.i - at[0]) + side.out[1] * (side.j - at[1]));
                        const double v = depth < 0.5 ? at_face + inside : depth < 1.5 ? inside : 0;
                        return Vec<2>{side.out[0] * speed + v * direction[0] - spin * (at[1] - side.j),
                                      side.out[1] * speed + v * direction[1] + spin * (at[0] - side.i)};
                    });
                p.find(0.1);
                const Gradient<2> g = p.faces.across(p.grid, p.node(side.i, side.j), 1, its);
                const double sign = direction[0] + direction[1];
                const double found = along ? (x ? g.xx : g.yy) : (x ? g.yx - 0.1 * spin : g.xy + 0.1 * spin);
                EXPECT_NEAR(along ? (x ? g.yx - 0.1 * spin : g.xy + 0.1 * spin) : (x ? g.xx : g.yy), 0, 1e-12);
                return found / (0.1 * sign * (side.out[0] + side.out[1]));
            };
            for (const double spin : {0.0, 40.0, -40.0})
            {
                const auto expect = [&](double at_face, double inside, double its, double speed, double value)
                { EXPECT_NEAR(derivative(at_face, inside, its, speed, spin), value, 1e-9) << at_face << " " << inside << " " << spin; };
                expect(3, 1, 1, 50, 3);                 // steeper than inside: its own
                expect(4, -2, 1, 50, along ? 4 : 2);    // opposite: its own, of shear that is half of it, less
                expect(3, 1, 0.25, 50, 1.5);            // of a velocity that arrived to three quarters
                expect(3, 1, 1, -50, 1);                // the face recedes
                expect(1, 3, 1, 50, 3);                 // less steep: would feed
                expect(1, -5, 1, 50, along ? -3 : -4);  // opposite: a third of the way, half of that for shear
                expect(0, 1, 1, 50, 1);
            }
        }
}

/// Mass that arrives at a node with a velocity of its own is never further from the mean of the neighbours than the node; at one
/// without, it continues their field linearly.
TEST(FreeFaces, ArrivalGoesNoFurtherThanTheNode)
{
    test::Random random(9);
    Patch p{Ring{1}};
    p.set([&](const Vec<2>&) { return Vec<2>{random(-1, 1), random(-1, 1)}; });
    p.find(0.1);
    int shorter = 0;
    for (const auto n : p.faces.list())
    {
        const auto near = p.faces.around(p.grid, &p.before, n, 10);
        const Vec<2> v = p.velocity(n), with = p.faces.arriving(p.grid, &p.before, n, 10, v, 0),
                     without = p.faces.arriving(p.grid, &p.before, n, 10, v, 1);
        const double own = std::hypot(v[0] - near.mean[0], v[1] - near.mean[1]),
                     far = std::hypot(with[0] - near.mean[0], with[1] - near.mean[1]);
        EXPECT_LE(far, own * (1 + 1e-12));
        shorter += std::hypot(near.beyond[0], near.beyond[1]) > own;
        EXPECT_NEAR(without[0], near.linear()[0], 1e-14);
        EXPECT_NEAR(without[1], near.linear()[1], 1e-14);
    }
    EXPECT_GT(shorter, 0);
}

/// A node with next to no mass takes the velocity that its neighbours continue, whatever force has driven it to; and nodes without
/// mass beside it, too.
TEST(FreeFaces, SliversFollow)
{
    const double dt = 0.02, light = 1e-9;
    Patch p([&](int i, int) { return i == Patch::last ? light : 1.0; });
    p.set(linear);
    const auto n = p.node(7, 4);  // beside a sliver, and nothing
    p.grid.nodes.v[0][n] = 40;
    cell_gradients(p.grid, dt);
    p.faces.find(p.grid);
    convect(p.grid, p.faces, dt, 0.5, nullptr);
    const Vec<2> x = p.grid.lattice.node_position(n), v = p.velocity(n), arrives = linear({x[0] - 0.5 * dt * v[0], x[1] - 0.5 * dt * v[1]});
    const double excess = 40 - linear(x)[0];
    EXPECT_NEAR(v[0], arrives[0], 1e-4 * excess);
    EXPECT_NEAR(v[1], arrives[1], 1e-4 * excess);
}

/// What half of the convection takes from a wave inside a body, with Courant number c of that half, is the Lax-Wendroff term:
/// 4 c^2 (1 - c^2) sin^4(theta/2) of the square of its amplitude.
TEST(FreeFaces, HalfTakesOfTheFourthOrder)
{
    for (const double c : {0.05, 0.2, 0.4})
        for (const double theta : {0.3, 1.0})
        {
            const double V = 3, amplitude = 1e-7, dt = 2 * c / V;
            Patch p{Ring{1}};
            p.set([&](const Vec<2>& x) { return Vec<2>{V + amplitude * std::sin(theta * x[0]), 0.0}; });
            cell_gradients(p.grid, dt);
            p.faces.find(p.grid);
            convect(p.grid, p.faces, dt, 0.5, nullptr);
            const double a = (p.velocity(p.node(4, 4))[0] - V) / amplitude, b = (p.velocity(p.node(5, 4))[0] - V) / amplitude;
            const double kept = (a * a + b * b - 2 * a * b * std::cos(theta)) / std::pow(std::sin(theta), 2);
            EXPECT_NEAR(1 - kept, 4 * c * c * (1 - c * c) * std::pow(std::sin(theta / 2), 4), 1e-6) << c << " " << theta;
        }
}

/// A node that stands still across a face is none of it.
TEST(FreeFaces, NoneAtRest)
{
    Patch p{Ring{1}};
    p.set([](const Vec<2>&) { return Vec<2>{0, 0}; });
    p.find(0.1);
    EXPECT_TRUE(p.faces.list().empty());
    p.set([](const Vec<2>&) { return Vec<2>{1, 0}; });
    p.find(0.1);
    EXPECT_EQ(p.faces.list().size(), 12);  // both faces across x
}

namespace
{
/// Where a small box at x goes in a linear field v = V + G (x - centre), in one step.
Vec<2> moved(double theta, const Vec<2>& at, double dt)
{
    Patch p{Ring{1}};
    for (const auto n : p.grid.nodes.active())
    {
        const Vec<2> v = linear(p.grid.lattice.node_position(n));
        p.grid.nodes.v[0][n] = v[0];
        p.grid.nodes.v[1][n] = v[1];
    }
    cell_gradients(p.grid, dt);
    const Bin<2>* bin = nullptr;
    for (const Bin<2>& b : p.bodies[0].bins.list())
        if (b.at[0] == 4 && b.at[1] == 4)
            bin = &b;
    if (!bin)
        throw std::logic_error("no such bin");
    MidSteps mid_steps;
    mid_steps.resize(p.grid.lattice.nodes());
    mid_steps.find(p.grid, theta, dt);
    const BinMotion<DomainSupport> motion(p.grid, *bin, mid_steps);
    Vec<2, Pack> x{Pack(at[0]), Pack(at[1])};
    const Vec<2> from = motion.origin();
    motion(Box<2>{{Pack(at[0] - bin->at[0] - from[0]), Pack(at[1] - bin->at[1] - from[1])}, {Pack(0.25), Pack(0.25)}}, dt, x);
    return {x[0][0], x[1][0]};
}
/// x + (e^(G t) - 1) G^-1 v(x), by its series.
Vec<2> carried(const Vec<2>& x, double dt)
{
    Vec<2> term = linear(x), sum{x[0], x[1]};
    double factor = 1;
    for (int k = 1; k < 20; ++k)
    {
        factor *= dt / k;
        sum = {sum[0] + factor * term[0], sum[1] + factor * term[1]};
        term = {rate.xx * term[0] + rate.xy * term[1], rate.yx * term[0] + rate.yy * term[1]};
    }
    return sum;
}
}  // namespace

/// In a linear field a step from its middle is of second order, from its start of first.
TEST(MidStep, CarriedByALinearField)
{
    for (const Vec<2>& at : {Vec<2>{4.75, 4.75}, Vec<2>{5.1, 4.8}, Vec<2>{5.0, 5.3}})
    {
        const auto error = [&](double theta, double dt)
        {
            const Vec<2> a = moved(theta, at, dt), b = carried(at, dt);
            return std::hypot(a[0] - b[0], a[1] - b[1]);
        };
        EXPECT_NEAR(error(0.5, 0.04) / error(0.5, 0.02), 8, 0.6);
        EXPECT_LT(error(0.5, 0.02), 1e-5);
        EXPECT_NEAR(error(0.0, 0.04) / error(0.0, 0.02), 4, 0.2);
    }
}

namespace
{
struct Course
{
    double gain = 0;           ///< largest kinetic + elastic - work of gravity over that at the start [J/m]
    double work = 0;           ///< largest work of gravity [J/m]
    double strain_energy = 0;  ///< largest [J/m]
    bool held = true;          ///< no point with less than a third or more than three times its volume
    std::unique_ptr<Solver> solver;
    Scene scene;
};

/// Runs for a time with a step of cfl times that of an isolated cell; watch(solver, t) at each state.
template <class Watch>
Course run(const std::string& text, const std::vector<std::string>& overrides, double end, double dt, Watch&& watch)
{
    Course c;
    c.scene = test::load(text, "lpfdm", overrides);
    c.solver = make_lpfdm(c.scene);
    const Vec<2> g = c.scene.gravity ? c.scene.gravity->acceleration : Vec<2>{0, 0};
    double start = 0, fallen = 0;
    const int steps = static_cast<int>(std::ceil(end / dt));
    try
    {
        for (int n = 0; n <= steps; ++n)
        {
            c.solver->prepare(n * dt, dt);
            double height = 0;
            for (const Body& body : c.solver->bodies())
                for (std::size_t p = 0; p < body.points.count; ++p)
                {
                    height -= body.points.mass * (g[0] * body.points.x[0][p] + g[1] * body.points.x[1][p]);
                    const double ratio = body.points.current_volume(p) / body.points.initial_volume;
                    c.held = c.held && ratio > 1.0 / 3 && ratio < 3;
                }
            const double elastic = strain_energy(c.solver->bodies()), total = c.solver->sums().kinetic_energy + elastic + height;
            if (n == 0)
            {
                start = total;
                fallen = height;
            }
            c.gain = std::max(c.gain, total - start);
            c.work = std::max(c.work, fallen - height);
            c.strain_energy = std::max(c.strain_energy, elastic);
            watch(*c.solver, n * dt);
            if (!c.held)
                break;
            c.solver->advance(dt);
        }
    }
    catch (const std::exception&)
    {
        c.held = false;
    }
    return c;
}
Course run(const std::string& text, const std::vector<std::string>& overrides, double end, double dt)
{
    return run(text, overrides, end, dt, [](const Solver&, double) {});
}

struct Drop
{
    int points_per_cell;
    Vec<2> offset;
    double nu = 0.3, modulus = 1e6, end = 1.5;
};
std::vector<std::string> without_hourglass(std::vector<std::string> overrides)
{
    overrides.push_back("lpfdm.hourglass=0");
    return overrides;
}
Course drop(const std::vector<std::string>& overrides, const Drop& d)
{
    const double dt = 0.5 * std::sqrt(1 - d.nu) / wave_speed(d.modulus, d.nu);
    const std::string scene = lattice(12, 14) + "[gravity]\nacceleration = [0.0, -9.81]\n" + material(d.modulus, d.nu) +
                              box({3 + d.offset[0], 1 + d.offset[1]}, {9 + d.offset[0], 7 + d.offset[1]}, d.points_per_cell) +
                              "[[boundary]]\nname = \"floor\"\nwhere = \"y <= 0\"\nfix = \"y\"\n";
    return run(scene, overrides, d.end, dt);
}
}  // namespace

/// An elastic block of 6 x 6 cells that falls on a smooth floor and leaps wins no more than 2 % of the work of gravity, wherever its
/// faces lie; without hourglass control, too, where it won most of it, or tore, before.
TEST(Transport, DroppedBlockWinsNoEnergy)
{
    for (const int points_per_cell : {2, 3, 4})
        for (const Vec<2>& offset : {Vec<2>{0, 0}, Vec<2>{0.3, 0.3}, Vec<2>{0.5, 0.01}})
        {
            const Course c = drop({}, {points_per_cell, offset});
            EXPECT_TRUE(c.held) << points_per_cell << " " << offset[0];
            EXPECT_LT(c.gain, 0.02 * c.work) << points_per_cell << " " << offset[0];
        }
    for (const Drop& d : {Drop{4, {0, 0}, 0.3, 6e6, 3}, Drop{3, {0, 0.3}, 0.47, 6e6, 3}})
    {
        const Course now = drop(without_hourglass({}), d), before = drop(without_hourglass(old), d);
        EXPECT_TRUE(now.held && now.gain < 0.02 * now.work) << d.points_per_cell << " " << now.gain / now.work;
        EXPECT_FALSE(before.held && before.gain < 0.02 * before.work) << d.points_per_cell << " " << before.gain / before.work;
    }
}

namespace
{
/// Largest elastic energy of the last third of the way over that of the first third.
/// @param step [L / c], of 0 half of the limit of an isolated cell
double growth(const std::vector<std::string>& overrides, double nu, int points_per_cell, double waves = 1, double speed = 0.25,
              int way = 10, double x = 1.3, double step = 0)
{
    const double E = 1e6, c = wave_speed(E, nu), v = speed * c, dt = (step > 0 ? step : 0.5 * std::sqrt(1 - nu)) / c;
    const std::string tiny =
        fmt::format("[\"{0} + {1}*sin(pi*{2}*(X-{3})/6+1)*cos(pi*(Y-2.3)/6)\", \"{1}*cos(pi*{2}*(X-{3})/6)\"]", v, 1e-6 * c, waves, x);
    double early = 0, late = 0;
    run(lattice(way + 10, 11) + material(E, nu) + box({x, 2.3}, {x + 6, 8.3}, points_per_cell, tiny), overrides, way / v, dt,
        [&](const Solver& solver, double t)
        {
            double& of = t < way / v / 3 ? early : late;
            if (t < way / v / 3 || t > 2 * way / v / 3)
                of = std::max(of, strain_energy(solver.bodies()));
        });
    return std::sqrt(late / early);
}
}  // namespace

/// Uniform motion is none: a tiny oscillation of a block that crosses ten cells at a quarter of the wave speed grows by less than 1.2;
/// without hourglass control it grew by half and more.
TEST(Transport, MovingFrame)
{
    for (const int points_per_cell : {2, 4})
        for (const double nu : {0.0, 0.3})
            EXPECT_LT(growth({}, nu, points_per_cell), 1.2) << points_per_cell << " " << nu;
    EXPECT_LT(growth(without_hourglass({}), 0, 4), 1.2);
    EXPECT_GT(growth(without_hourglass(old), 0, 4), 1.2);
}

/// Nor do short waves at the leading face, down to two cells long, at half of the wave speed; they grew three- to sixfold, and grow
/// in the form before that, too.
TEST(Transport, ShortWavesInAMovingFrame)
{
    for (const int points_per_cell : {2, 4})
        for (const double waves : {3, 5, 6})
        {
            EXPECT_LT(growth({}, 0, points_per_cell, waves, 0.5, 25, 1), 1.2) << points_per_cell << " " << waves;
            EXPECT_GT(growth(old, 0, points_per_cell, waves, 0.5, 25, 1), 1.2) << points_per_cell << " " << waves;
        }
}

/// With nu = 0 the isolated cell has the limit of the whole lattice. Waves near it grow in a body that moves, not at the limit stated for
/// motion.
TEST(Transport, LimitInMotion)
{
    for (const double waves : {1, 3, 6})
        for (const double speed : {0.35, 0.5})
            EXPECT_LT(growth({}, 0, 4, waves, speed, 25, 1.5, 0.65), 1.2) << waves << " " << speed;
    EXPECT_GT(growth({}, 0, 4, 6, 0.5, 25, 1.5, 0.8), 10);
}

namespace
{
Course ring(const std::vector<std::string>& overrides, double speed)
{
    std::string corners;
    const double pi = std::numbers::pi, E = 1e3, nu = 0.3;
    const int n = 96;
    for (int k = 0; k <= 2 * n + 1; ++k)
    {
        const double a = 2 * pi * (k <= n ? k : 2 * n + 1 - k) / n, r = k <= n ? 1.25 : 0.75;
        corners += fmt::format("{}[{:.12g}, {:.12g}]", k ? ", " : "", r * std::cos(a), r * std::sin(a));
    }
    const double c = wave_speed(E, nu, 1), period = 2 * pi / std::sqrt(E / (1 - nu * nu)), dt = 0.4 * 0.125 * std::sqrt(1 - nu) / c;
    const std::string body =
        "[[body]]\nname = \"b\"\nmaterial = \"m\"\nshape = \"polygon\"\nvertices = [" + corners +
        fmt::format("]\npoints_per_cell = 3\nvelocity = [\"{0}*X/sqrt(X^2+Y^2)\", \"{0}*Y/sqrt(X^2+Y^2)\"]\n", speed * c);
    return run(lattice(4, 4, 0.125, {-2, -2}) + material(E, nu, 1) + body, overrides, 2 * period, dt);
}
}  // namespace

/// A ring that expands swings for two periods and wins no energy at 0.1 c; at 0.3 c it holds, where it tore before, and wins what the law
/// makes.
TEST(Transport, ExpandingRing)
{
    const Course slow = ring({}, 0.1), fast = ring({}, 0.3);
    EXPECT_TRUE(slow.held);
    EXPECT_LT(slow.gain, 0.02 * slow.strain_energy);
    EXPECT_TRUE(fast.held);
    EXPECT_LT(fast.gain, 0.06 * fast.strain_energy);
    EXPECT_FALSE(ring(old, 0.3).held);
}

namespace
{
/// Mean deflection of the top of a column that swings under its weight, by 1 % at its base, in the first and the last ten of 60 periods,
/// over the static one.
std::pair<double, double> ratchet(const std::vector<std::string>& overrides)
{
    const double H = 10, period = 4 * H, g = 0.01 / H;
    const int periods = 60;
    std::array<double, 2> sum{0, 0}, count{0, 0};
    double top = 0;
    run(lattice(1, 12) + fmt::format("[gravity]\nacceleration = [0.0, {}]\n", -g) + material(1, 0, 1, "linear_elastic") +
            box({0, 0}, {1, 10}, 2) +
            "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n[[boundary]]\nname = \"sides\"\nwhere = \"x <= 0 || x >= "
            "1\"\nfix = \"x\"\n",
        overrides, periods * period, 0.5,
        [&](const Solver& solver, double t)
        {
            const Points<2>& q = solver.bodies()[0].points;
            double y = 0;
            for (std::size_t p = 0; p < q.count; ++p)
                y = std::max(y, q.x[1][p]);
            if (t == 0)
                top = y;
            const int part = t < 10 * period ? 0 : t > (periods - 10) * period ? 1 : 2;
            if (part < 2)
            {
                sum[part] += top - y;
                count[part] += 1;
            }
        });
    const double still = 0.5 * 0.01 * H;
    return {sum[0] / count[0] / still, sum[1] / count[1] / still};
}
}  // namespace

/// A column that swings does not settle: what an oscillation moves points against their boxes is of second order.
TEST(Transport, ColumnDoesNotRatchet)
{
    const auto [first, last] = ratchet({});
    EXPECT_NEAR(last, first, 0.002);
    const auto before = ratchet(old);
    EXPECT_GT(before.second - before.first, 0.02);
}

namespace
{
/// How far the points of a body that starts as its own mirror image about x = 6 are from that at the end.
double asymmetry(const std::vector<std::string>& overrides, double step)
{
    const double E = 1e6, nu = 0.3, c = wave_speed(E, nu);
    const std::string velocity = fmt::format("[\"{0}*(X-6)*(2+Y)/6\", \"{0}*cos(X-6)\"]", 0.02 * c);
    const Course r = run(lattice(12, 14) + material(E, nu) + box({3.5, 4.1}, {8.5, 9.1}, 3, velocity), overrides, 30 / c, step / c);
    const Points<2>& q = r.solver->bodies()[0].points;
    double most = 0;
    for (std::size_t p = 0; p < q.count; ++p)
    {
        double nearest = 1;
        for (std::size_t m = 0; m < q.count; ++m)
            nearest = std::min(nearest, std::hypot(q.x[0][p] + q.x[0][m] - 12, q.x[1][p] - q.x[1][m]));
        most = std::max(most, nearest);
    }
    return r.held ? most : 1;
}
}  // namespace

/// Known failure: the middle of the step is found about the middle node of a box's 2 x 2 cells, which for a box within one cell is the
/// same corner on both sides of a body. A mirror image is off by 1e-3 L after 30 L/c, in proportion to the time step; to rounding without.
TEST(Transport, MirrorImageIsOffInProportionToTheStep)
{
    EXPECT_LT(asymmetry(old, 0.4), 1e-12);
    const double coarse = asymmetry({}, 0.4), fine = asymmetry({}, 0.2);
    EXPECT_LT(coarse, 2e-3);
    EXPECT_NEAR(coarse / fine, 2, 0.2);
}
