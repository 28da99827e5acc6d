#include "lpfdm/convection.hpp"
#include "lpfdm/equations.hpp"
#include "lpfdm/lpfdm.hpp"
#include "lpfdm/options.hpp"
#include "tests/oracle.hpp"
#include "tests/random.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

using namespace testbed;

namespace
{
std::string with_gravity()
{
    return test::two_bodies() + "[gravity]\nacceleration = [0.4, -1.3]\n";
}

/// A square of one material on a lattice of 8 x 8 unit cells.
std::string one_square(const std::string& material, const std::string& body)
{
    return "[grid]\nsize = [8.0, 8.0]\ncell_size = 1.0\n[time]\nend = 1.0\n[[material]]\nname = \"m\"\nlaw = \"linear_elastic\"\n" +
           material + "\n[[body]]\nname = \"b\"\nmaterial = \"m\"\nshape = \"box\"\n" + body;
}

/// A grid with random points of random stress, ready for the equations.
template <class Support>
struct RandomState
{
    Scene scene = test::load(test::two_bodies());
    LpfdmGrid<2> grid{make_lattice(scene.grid)};
    std::vector<Body> bodies = make_bodies(scene, grid.lattice, {.box = Support::has_box});
    std::vector<double> workspace;

    explicit RandomState(unsigned seed)
    {
        test::Random random(seed);
        std::vector<const Bins<2>*> bins;
        for (Body& body : bodies)
        {
            Points<2>& q = body.points;
            random.points(q);
            body.bins.rebuild<Support>(q, workspace);
            bins.push_back(&body.bins);
        }
        grid.rebuild<Support::S>(bins);
        LpfdmSums<Support> sums;
        sums.update(grid.lattice, bodies);
        cell_averages(grid, sums.all());
        nodal_forces(grid);
        for (const auto n : grid.nodes.active())
        {
            grid.nodes.v[0][n] = random(-1, 1);
            grid.nodes.v[1][n] = random(-1, 1);
        }
    }
};

template <class Support>
void check_virtual_work()
{
    for (unsigned seed = 1; seed < 20; ++seed)
    {
        RandomState<Support> state(seed);
        LpfdmGrid<2>& grid = state.grid;
        const double dt = 1e-3;
        double nodal = 0, mass = 0;
        for (const auto n : grid.nodes.active())
        {
            nodal += (grid.nodes.f[0][n] * grid.nodes.v[0][n] + grid.nodes.f[1][n] * grid.nodes.v[1][n]) * dt;
            mass += grid.nodes.mass[n];
        }
        cell_gradients(grid, dt);
        MidSteps at_start;
        at_start.resize(grid.lattice.nodes());
        at_start.find(grid, 0, dt);
        double work = 0, total = 0, scale = 0;
        for (Body& body : state.bodies)
        {
            const Points<2>& q = body.points;
            total += q.mass * static_cast<double>(q.count);
            for (const Bin<2>& bin : body.bins.list())
            {
                const BinMotion<Support> motion(grid, bin, at_start);
                const BinFrame<2> frame(grid.lattice, bin, motion.origin());
                for (std::size_t p = bin.begin; p < bin.end; ++p)
                {
                    Vec<2, Pack> x{Pack(0.0), Pack(0.0)};
                    const Gradient<2, Pack> d = motion(frame.box<Support>(q, p, AllLanes{}, load(q.x, p, AllLanes{})), dt, x);
                    const double power =
                        q.current_volume(p) * (q.stress[0][p] * d.xx[0] + q.stress[1][p] * d.yy[0] + q.stress[2][p] * (d.xy[0] + d.yx[0]));
                    work += power;
                    scale += std::abs(power);
                }
            }
        }
        EXPECT_NEAR(nodal, -work, 1e-12 * scale) << seed;
        EXPECT_NEAR(mass, total, 1e-12 * total);
    }
}
}  // namespace

/// The nodal forces do the work of the points' stresses, for random stresses, volumes, boxes and velocities.
TEST(Forces, VirtualWorkPointSupport)
{
    check_virtual_work<PointSupport>();
}
TEST(Forces, VirtualWorkDomainSupport)
{
    check_virtual_work<DomainSupport>();
}

/// Uniform stress on a full patch, whatever the phase of the points: the domain gives no force inside, points do not unless they
/// fill the cells evenly.
TEST(Forces, PatchOfShiftedPoints)
{
    const auto inner_force = [](const std::string& method, double shift, double stretch = 1.0)
    {
        const auto corner = [&](double at) { return fmt::format("[{}, {}]", at + shift, at + 0.7 * shift); };
        const Scene scene = test::load(one_square("density = 1.0\nyoungs_modulus = 1.0\npoissons_ratio = 0.0",
                                                  "min = " + corner(1) + "\nmax = " + corner(6) + "\npoints_per_cell = 3\n"),
                                       method);
        const auto measure = [&]<class Support>(Support)
        {
            LpfdmGrid grid(make_lattice(scene.grid));
            auto bodies = make_bodies(scene, grid.lattice, {.box = Support::has_box});
            std::vector<double> workspace;
            Points<2>& q = bodies[0].points;
            for (std::size_t p = 0; p < q.count; ++p)
            {
                q.stress[0][p] = q.stress[1][p] = q.stress[2][p] = 1;
                q.x[0][p] = 3.5 + stretch * (q.x[0][p] - 3.5);
                q.x[1][p] = 3.5 + stretch * (q.x[1][p] - 3.5);
                if (Support::has_box)
                {
                    q.half_width[0][p] *= stretch;
                    q.half_width[1][p] *= stretch;
                }
            }
            bodies[0].bins.template rebuild<Support>(q, workspace);
            const Bins<2>* bins = &bodies[0].bins;
            grid.template rebuild<Support::S>({&bins, 1});
            LpfdmSums<Support> sums;
            sums.update(grid.lattice, bodies);
            cell_averages(grid, sums.all());
            nodal_forces(grid);
            double largest = 0;
            for (int j = 3; j <= 5; ++j)
                for (int i = 3; i <= 5; ++i)
                    largest = std::max({largest, std::abs(grid.nodes.f[0][grid.lattice.node({i, j})]),
                                        std::abs(grid.nodes.f[1][grid.lattice.node({i, j})])});
            return largest;
        };
        return scene.options<LpfdmSpec>().support == LpfdmSpec::Support::point ? measure(PointSupport{}) : measure(DomainSupport{});
    };
    EXPECT_LT(inner_force("lpfdm", 0.0), 1e-12);
    EXPECT_LT(inner_force("lpfdm", 0.13), 1e-12);
    EXPECT_LT(inner_force("lpfdm-2000", 0.13), 1e-12);  // still three points per cell and row
    EXPECT_LT(inner_force("lpfdm", 0.13, 1.07), 1e-12);
    EXPECT_GT(inner_force("lpfdm-2000", 0.13, 1.07), 0.1);  // some cells hold two, others three
}

/// Every variant against the oracle, with points that change cells and nodes that are reached and left.
struct LpfdmCase
{
    const char *name, *method;
    std::vector<std::string> overrides;
    bool domain, central;
};
class LpfdmOracle : public testing::TestWithParam<LpfdmCase>
{
};

TEST_P(LpfdmOracle, SameTrajectories)
{
    const LpfdmCase& c = GetParam();
    const Scene scene = test::load(with_gravity(), c.method, c.overrides);
    const auto solver = make_lpfdm(scene);
    test::RefLpfdm reference{{0.5, -1, -1},
                             test::reference_points(scene),
                             c.domain,
                             c.central,
                             scene.options<LpfdmSpec>().convection == LpfdmSpec::Convection::two_sided,
                             scene.options<LpfdmSpec>().frontier == LpfdmSpec::Frontier::arrival};
    // hourglass: the scene's coefficient times the fastest wave over L
    double wave_speed = 0;
    for (const Body& body : solver->bodies())
        wave_speed = std::max(wave_speed, std::sqrt(moduli(body.material).constrained() * body.points.initial_volume / body.points.mass));
    reference.hourglass_rate = scene.options<LpfdmSpec>().hourglass * wave_speed / 0.5;
    const std::size_t first_body = solver->bodies()[0].points.count;
    const auto velocity = [&](std::size_t p, Vec<2> x)
    {
        const VectorExpression v(*scene.bodies[p < first_body ? 0 : 1].velocity, {});
        return v({x[0], x[1], x[0], x[1], 0});
    };
    for (int n = 0; n < 60; ++n)
    {
        const double dt = n % 7 == 3 ? 0.005 : 0.01;
        solver->prepare(n * 0.01, dt);
        solver->advance(dt);
        reference.step(dt, {0.4, -1.3}, velocity);
        ASSERT_NO_FATAL_FAILURE(test::expect_same(*solver, reference.points, 1e-10)) << "step " << n;
    }
}

INSTANTIATE_TEST_SUITE_P(
    Variants, LpfdmOracle,
    testing::Values(LpfdmCase{"published", "lpfdm-2000", {}, false, false},
                    LpfdmCase{"point_central", "lpfdm-2000", {"lpfdm.convection=central"}, false, true},
                    LpfdmCase{"domain_central", "lpfdm", {"lpfdm.convection=central", "lpfdm.frontier=extrapolate"}, true, true},
                    LpfdmCase{"domain_two_sided", "lpfdm", {}, true, true},
                    LpfdmCase{"two_sided_extrapolate", "lpfdm", {"lpfdm.frontier=extrapolate"}, true, true},
                    LpfdmCase{"point_two_sided", "lpfdm-2000", {"lpfdm.convection=two_sided", "lpfdm.frontier=arrival"}, false, true},
                    LpfdmCase{"domain_upwind", "lpfdm", {"lpfdm.convection=upwind"}, true, false},
                    LpfdmCase{"point_hourglass", "lpfdm-2000", {"lpfdm.hourglass=0.3"}, false, false},
                    LpfdmCase{"strong_hourglass", "lpfdm", {"lpfdm.hourglass=0.3"}, true, true}),
    [](const auto& info) { return std::string(info.param.name); });

/// Boxes reach into cells, and so to nodes, before a new bin is needed: a disk of few points flies without stress all the same.
TEST(Frontier, MovesWithoutANewBin)
{
    std::string text = one_square("density = 1000.0\nyoungs_modulus = 1e6\npoissons_ratio = 0.3",
                                  "center = [2.37, 2.21]\nradius = 1.2\npoints_per_cell = 2\nvelocity = [\"3\", \"2\"]\n");
    text.replace(text.find("\"box\""), 5, "\"disk\"");
    const auto solver = make_lpfdm(test::load(text, "lpfdm"));
    for (int n = 0; n < 100; ++n)
    {
        solver->prepare(n * 0.01, 0.01);
        solver->advance(0.01);
    }
    const Points<2>& q = solver->bodies()[0].points;
    for (std::size_t p = 0; p < q.count; ++p)
        EXPECT_LT(std::abs(q.stress[0][p]) + std::abs(q.stress[1][p]) + std::abs(q.stress[2][p]), 1e-3) << p;
}

/// Claim of the paper that hourglass deformation does not occur: the pattern (+1, -1, -1, +1) keeps its amplitude without control
/// and decays with it; a linear field is left alone.
TEST(Hourglass, CheckerboardNeedsControl)
{
    const std::string patch = one_square("density = 1000.0\nyoungs_modulus = 1e6\npoissons_ratio = 0.3",
                                         "min = [1.0, 1.0]\nmax = [7.0, 7.0]\npoints_per_cell = 2\n"
                                         "velocity = [\"1e-4*sqrt(1.2e3)*cos(pi*X)*cos(pi*Y)\", 0]\n");
    const auto kept = [&](const std::string& method)
    {
        const auto solver = make_lpfdm(test::load(patch, method));
        solver->prepare(0, 1e-3);
        const double start = solver->sums().kinetic_energy;
        for (int n = 0; n < 1500; ++n)
        {
            solver->advance(5e-3);
            solver->prepare(0, 5e-3);
        }
        return std::sqrt(solver->sums().kinetic_energy / start);
    };
    EXPECT_GT(kept("lpfdm-2000"), 0.99);
    EXPECT_LT(kept("lpfdm"), 1e-3);
}

/// Convection of a linear velocity field is exact away from the surface: what arrives is what was at the departure point.
TEST(Convection, LinearField)
{
    RandomState<PointSupport> state(3);
    LpfdmGrid<2>& grid = state.grid;
    const Gradient<2> g{0.3, -0.2, 0.7, 0.4};
    const double dt = 0.02;
    const auto field = [&](const Vec<2>& x) { return Vec<2>{1 + g.xx * x[0] + g.xy * x[1], -1 + g.yx * x[0] + g.yy * x[1]}; };
    const auto check = [&](auto scheme)
    {
        for (const auto n : grid.nodes.active())
        {
            const Vec<2> v = field(grid.lattice.node_position(n));
            grid.nodes.v[0][n] = v[0];
            grid.nodes.v[1][n] = v[1];
        }
        cell_gradients(grid, dt);
        convect<decltype(scheme)>(grid, dt);
        int inside = 0;
        for (const auto n : grid.nodes.active())
        {
            bool surrounded = true;
            for (int k = 0; k < 4; ++k)
                surrounded = surrounded && grid.cells.mass[grid.around(grid.first_cell(n), k)] > 0;
            if (!surrounded)
                continue;
            const Vec<2> v = field(grid.lattice.node_position(n));
            // central: the node takes the velocity at x - dt v'; upwind: eq. (13), at x - dt v
            const bool solved = std::is_same_v<decltype(scheme), CentralConvection>;
            const Vec<2> w = solved ? Vec<2>{grid.nodes.v[0][n], grid.nodes.v[1][n]} : v;
            const Vec<2> x = grid.lattice.node_position(n);
            const Vec<2> arrives = field({x[0] - dt * w[0], x[1] - dt * w[1]});
            EXPECT_NEAR(grid.nodes.v[0][n], arrives[0], 1e-13);
            EXPECT_NEAR(grid.nodes.v[1][n], arrives[1], 1e-13);
            ++inside;
        }
        EXPECT_GT(inside, 1);
    };
    check(UpwindConvection{});
    check(CentralConvection{});
}

TEST(Lpfdm, SameBitsForAnyThreads)
{
    const auto run = [](const std::string& method, int threads)
    {
        set_threads(threads);
        const auto solver = make_lpfdm(test::load(test::two_bodies(0.1, 4), method));
        for (int n = 0; n < 100; ++n)
        {
            solver->prepare(0, 5e-3);
            solver->advance(5e-3);
        }
        solver->prepare(0, 5e-3);
        const Points<2>& q = solver->bodies()[0].points;
        std::vector<double> out(q.stress[0].data(), q.stress[0].data() + q.count);
        out.insert(out.end(), q.x[0].data(), q.x[0].data() + q.count);
        out.push_back(solver->sums().kinetic_energy);
        set_threads(1);
        return out;
    };
    for (const char* method : {"lpfdm-2000", "lpfdm"})
        EXPECT_EQ(run(method, 1), run(method, 2)) << method;
}
