#include "mpm/edges.hpp"
#include "mpm/mpm.hpp"
#include "mpm/options.hpp"
#include "mpm/shapes/bspline.hpp"
#include "mpm/shapes/cpgimp.hpp"
#include "mpm/shapes/linear.hpp"
#include "mpm/transfer.hpp"
#include "tests/oracle.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
template <class Shape, class Strain>
void check_virtual_work()
{
    for (unsigned seed = 1; seed < 20; ++seed)
    {
        test::Random random(seed);
        const Scene scene = test::load(test::two_bodies());
        const Lattice<2> lattice = make_lattice(scene.grid);
        auto bodies = make_bodies(scene, lattice, {.box = Shape::has_box, .velocity = true});
        Body& body = bodies[1];
        Points<2>& q = body.points;
        random.points(q);
        std::vector<double> workspace;
        body.bins.rebuild<Shape>(q, workspace);
        Gather gather(lattice.nodes());
        const Bins<2>* bins = &body.bins;
        gather.rebuild<Shape::S, 2>({&bins, 1}, [&](const Index<2>& at) { return lattice.node(at); });
        make_room(workspace, gather.blocks() * 2);
        scatter<Shape, Strain, Scatter::force>(lattice, body, 0, workspace);
        VectorField<2> velocity{std::vector<double>(lattice.nodes()), std::vector<double>(lattice.nodes())};
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
            set(velocity, n, {random(-1, 1), random(-1, 1)});
        double nodal = 0, work = 0, scale = 0;
        gather.sum<2>(workspace,
                      [&](std::size_t n, const std::array<double, 2>& f) { nodal += f[0] * velocity[0][n] + f[1] * velocity[1][n]; });
        for (const Bin<2>& bin : body.bins.list())
        {
            const BinFrame frame(lattice, bin);
            const typename Strain::template InBin<Shape> strain(lattice, q, bin);
            const NodalVelocity<Shape::S> v(lattice, bin, velocity);
            for (std::size_t p = bin.begin; p < bin.end; ++p)
            {
                const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, AllLanes{}), frame.scale);
                const Gradient<2, Pack> d = v.template gradient<Strain>(at, strain, 1.0);
                const double power =
                    q.current_volume(p) * (q.stress[0][p] * d.xx[0] + q.stress[1][p] * d.yy[0] + q.stress[2][p] * (d.xy[0] + d.yx[0]));
                work += power;
                scale += std::abs(power);
            }
        }
        EXPECT_NEAR(nodal, -work, 1e-12 * scale) << seed;
    }
}
}  // namespace

TEST(MpmForces, VirtualWorkLinear)
{
    check_virtual_work<LinearShape, PointStrain>();
}
TEST(MpmForces, VirtualWorkBBar)
{
    check_virtual_work<LinearShape, BBarStrain>();
}
TEST(MpmForces, VirtualWorkGimp)
{
    check_virtual_work<GimpShape, PointStrain>();
}

TEST(MpmForces, VirtualWorkBSpline)
{
    check_virtual_work<BSplineShape, PointStrain>();
}

/// At the edges of the lattice: mass and its first moment are kept, a linear velocity has its gradient, forces are dual to it, and
/// within half a cell of an edge the shapes are the bilinear ones.
TEST(MpmShape, BSplineAtTheEdges)
{
    const Scene scene = test::load(test::soil_block({0, 0}, {4, 4}));
    const Lattice<2> lattice = make_lattice(scene.grid);
    test::Random random(31);
    auto bodies = make_bodies(scene, lattice, {.velocity = true});
    Points<2>& q = bodies[0].points;
    for (std::size_t p = 0; p < q.count; ++p)
    {
        q.x[0][p] = random(0, 4);
        q.x[1][p] = random(0, 4);
        q.stress[0][p] = random(-1, 1);
        q.stress[1][p] = random(-1, 1);
        q.stress[2][p] = random(-1, 1);
    }
    q.x[0][0] = 0;  // on an edge
    q.x[1][0] = 1;
    const double xa = q.x[0][5] = 0.1, ya = q.x[1][5] = 3.9;
    std::vector<double> workspace;
    bodies[0].bins.rebuild<BSplineShape>(q, workspace);
    Gather gather(lattice.nodes());
    const Bins<2>* bins = &bodies[0].bins;
    gather.rebuild<3, 2>({&bins, 1}, [&](const Index<2>& at) { return lattice.node(at); });
    LatticeEdges edges;
    edges.rebuild(lattice, gather.active());

    const auto sums_of_masses = [&](const std::vector<double>& mass)
    {
        std::array<double, 4> s{};  // beyond the edges, in all, first moments
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            const int i = lattice.node_index(n)[0], j = lattice.node_index(n)[1];
            if (i < 0 || j < 0 || i > lattice.size[0] || j > lattice.size[1])
                s[0] += std::abs(mass[n]);
            EXPECT_GE(mass[n], 0) << i << ' ' << j;
            s[1] += mass[n];
            s[2] += mass[n] * lattice.node_position(n)[0];
            s[3] += mass[n] * lattice.node_position(n)[1];
        }
        return s;
    };
    make_room(workspace, gather.blocks() * 5);
    scatter<BSplineShape, PointStrain, Scatter::momentum_and_force>(lattice, bodies[0], 0, workspace);
    std::vector<double> mass(lattice.nodes()), fx(lattice.nodes()), fy(lattice.nodes()), vx(lattice.nodes()), vy(lattice.nodes());
    gather.sum<5>(workspace,
                  [&](std::size_t n, const std::array<double, 5>& s)
                  {
                      mass[n] = s[0];
                      fx[n] = s[3];
                      fy[n] = s[4];
                  });
    edges.fold_mass(mass);
    edges.fold(fx);
    edges.fold(fy);
    const auto s = sums_of_masses(mass);
    double total = 0, mx = 0, my = 0;
    for (std::size_t p = 0; p < q.count; ++p)
    {
        total += q.mass;
        mx += q.mass * q.x[0][p];
        my += q.mass * q.x[1][p];
    }
    EXPECT_EQ(s[0], 0);
    EXPECT_NEAR(s[1], total, 1e-12 * total);
    EXPECT_NEAR(s[2], mx, 1e-12 * mx);
    EXPECT_NEAR(s[3], my, 1e-12 * my);

    // forces are dual to the gradient of any velocity; that of a linear one is exact
    for (const bool linear : {true, false})
    {
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            const Vec<2> x = lattice.node_position(n);
            vx[n] = linear ? 1 + 2 * x[0] - 3 * x[1] : random(-1, 1);
            vy[n] = linear ? -2 + 0.5 * x[0] + x[1] : random(-1, 1);
        }
        VectorField<2> u{vx, vy};
        for (std::size_t n = 0; n < lattice.nodes(); ++n)  // must not matter
            if (lattice.node_index(n)[0] < 0 || lattice.node_index(n)[1] < 0 || lattice.node_index(n)[0] > lattice.size[0] ||
                lattice.node_index(n)[1] > lattice.size[1])
                set(u, n, {1e3, 1e3});
        for (auto& component : u)
            edges.extend(component);
        double work = 0, nodal = 0;
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
            nodal += fx[n] * vx[n] + fy[n] * vy[n];
        for (const Bin<2>& bin : bodies[0].bins.list())
        {
            const BinFrame frame(lattice, bin);
            const NodalVelocity<3> v(lattice, bin, u);
            for (std::size_t p = bin.begin; p < bin.end; ++p)
            {
                const ShapeAt<BSplineShape> at(frame.corner<BSplineShape>(q, p, AllLanes{}), frame.scale);
                const Gradient<2, Pack> d = v.gradient<PointStrain>(at, PointStrain::InBin<BSplineShape>(lattice, q, bin), 1.0);
                work += q.volume[p] * (q.stress[0][p] * d.xx[0] + q.stress[1][p] * d.yy[0] + q.stress[2][p] * (d.xy[0] + d.yx[0]));
                if (linear)
                {
                    EXPECT_NEAR(d.xx[0], 2, 1e-11);
                    EXPECT_NEAR(d.xy[0], -3, 1e-11);
                    EXPECT_NEAR(d.yx[0], 0.5, 1e-11);
                    EXPECT_NEAR(v.at(at)[0][0], 1 + 2 * q.x[0][p] - 3 * q.x[1][p], 1e-11);
                }
            }
        }
        EXPECT_NEAR(nodal, -work, 1e-10);
    }

    // one point in a corner
    Points<2> one = q;
    std::size_t k = 0;
    while (one.x[0][k] != xa || one.x[1][k] != ya)
        ++k;
    const auto weight = [&](int i, int j)
    {
        std::vector<double> m(lattice.nodes());
        const BinFrame frame(lattice, Bin<2>{{-1, 7}, 0, 1});
        const Corner<2> c = frame.corner<BSplineShape>(one, k, AllLanes{});
        const auto wx = BSplineShape::weights(c.a[0], c.width[0]), wy = BSplineShape::weights(c.a[1], c.width[1]);
        for (int b = 0; b < 3; ++b)
            for (int a = 0; a < 3; ++a)
                m[lattice.node({-1 + a, 7 + b})] = wx[a][0] * wy[b][0];
        edges.fold(m);
        return m[lattice.node({i, j})];
    };
    EXPECT_NEAR(weight(0, 8), 0.8 * 0.8, 1e-14);
    EXPECT_NEAR(weight(1, 8), 0.2 * 0.8, 1e-14);
    EXPECT_NEAR(weight(0, 7), 0.8 * 0.2, 1e-14);
    EXPECT_NEAR(weight(1, 7), 0.2 * 0.2, 1e-14);
}

struct MpmCase
{
    const char *method, *scheme;
    double flip;
    const char* increment = "midpoint";
};
class MpmOracle : public testing::TestWithParam<MpmCase>
{
};

/// Every shape, strain, scheme and blend against the oracle, with points that change cells.
TEST_P(MpmOracle, SameTrajectories)
{
    const MpmCase& c = GetParam();
    // one modulus per body: the oracle of B-bar tells bodies apart by it
    const Scene scene = test::load(test::two_bodies() + "[gravity]\nacceleration = [0.4, -1.3]\n", c.method,
                                   {std::string("mpm.scheme=") + c.scheme, "mpm.flip=" + std::to_string(c.flip),
                                    std::string("mpm.increment=") + c.increment, "material.stiff.youngs_modulus=3e4"});
    const auto solver = make_mpm(scene);
    test::RefMpm reference{{0.5, -1, -1},
                           test::reference_points(scene),
                           name_of(scene.options<MpmSpec>().shape),
                           c.scheme,
                           c.flip,
                           scene.options<MpmSpec>().strain == MpmSpec::Strain::b_bar,
                           scene.options<MpmSpec>().increment == MpmSpec::Increment::midpoint};
    reference.least = scene.options<MpmSpec>().mass_cutoff * 1000 * 0.25;  // of the lighter body
    for (int n = 0; n < 40; ++n)
    {
        solver->prepare(n * 0.01, 0.01);
        solver->advance(0.01);
        reference.step(0.01, {0.4, -1.3});
        ASSERT_NO_FATAL_FAILURE(test::expect_same(*solver, reference.points, 1e-9)) << "step " << n;
    }
}

INSTANTIATE_TEST_SUITE_P(Variants, MpmOracle,
                         testing::Values(MpmCase{"mpm-linear", "usl", 1}, MpmCase{"mpm-linear", "musl", 1}, MpmCase{"mpm-linear", "usf", 1},
                                         MpmCase{"mpm-linear", "musl", 0.9}, MpmCase{"mpm-linear-bbar", "musl", 1},
                                         MpmCase{"mpm-linear-bbar", "usl", 1}, MpmCase{"mpm-cpgimp", "musl", 1},
                                         MpmCase{"mpm-cpgimp", "usl", 0.95}, MpmCase{"mpm-cpgimp", "usf", 1},
                                         MpmCase{"mpm-bspline", "musl", 1}, MpmCase{"mpm-bspline", "usl", 0.95},
                                         MpmCase{"mpm-bspline", "usf", 1}, MpmCase{"mpm-cpgimp", "musl", 1, "forward"},
                                         MpmCase{"mpm-linear-bbar", "usf", 1, "forward"}),
                         [](const auto& info)
                         {
                             std::string name = std::string(info.param.method) + "_" + info.param.scheme +
                                                (info.param.flip < 1 ? "_blend" : "") +
                                                (std::string(info.param.increment) == "forward" ? "_forward" : "");
                             std::replace(name.begin(), name.end(), '-', '_');
                             return name;
                         });

TEST(Mpm, SameBitsForAnyThreads)
{
    const auto run = [](const std::string& method, int threads)
    {
        set_threads(threads);
        const auto solver = make_mpm(test::load(test::two_bodies(0.1, 4), method));
        for (int n = 0; n < 100; ++n)
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
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"})
        EXPECT_EQ(run(method, 1), run(method, 2)) << method;
}

/// PIC dissipates, FLIP does not: the energy of a free body after many steps.
TEST(Mpm, PicDissipates)
{
    const auto energy = [](double flip)
    {
        const auto solver = make_mpm(test::load(test::two_bodies(), "mpm-cpgimp", {"mpm.flip=" + std::to_string(flip)}));
        solver->prepare(0, 0.005);
        const double start = solver->sums().kinetic_energy;
        for (int n = 0; n < 20; ++n)
        {
            solver->advance(0.005);
            solver->prepare(0, 0.005);
        }
        return solver->sums().kinetic_energy / start;
    };
    EXPECT_GT(energy(1), energy(0) * 1.1);
}
