#include "mpm/mpm.hpp"
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
        const Lattice lattice = make_lattice(scene.grid);
        auto bodies = make_bodies(scene, lattice, {.box = Shape::has_box, .velocity = true});
        Body& body = bodies[1];
        Points& q = body.points;
        random.points(q);
        std::vector<double> workspace;
        body.bins.rebuild<Shape::has_box>(q, workspace);
        Gather gather(lattice.nodes());
        const Bins* bins = &body.bins;
        gather.rebuild<Shape::S>({&bins, 1}, [&](int i, int j) { return lattice.node(i, j); });
        make_room(workspace, gather.blocks() * 2);
        scatter<Shape, Strain, Scatter::force>(lattice, body, 0, workspace);
        std::vector<double> vx(lattice.nodes()), vy(lattice.nodes());
        for (std::size_t n = 0; n < vx.size(); ++n)
        {
            vx[n] = random(-1, 1);
            vy[n] = random(-1, 1);
        }
        double nodal = 0, work = 0, scale = 0;
        gather.sum<2>(workspace, [&](std::size_t n, const std::array<double, 2>& f) { nodal += f[0] * vx[n] + f[1] * vy[n]; });
        for (const Bin& bin : body.bins.list())
        {
            const BinFrame frame(lattice, bin);
            const typename Strain::template InBin<Shape> strain(lattice, q, bin);
            const NodalVelocity<Shape::S> v(lattice, bin, vx, vy);
            for (std::size_t p = bin.begin; p < bin.end; ++p)
            {
                const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, AllLanes{}), frame.scale);
                const Gradient<Pack> d = v.template gradient<Strain>(at, strain, 1.0);
                const double power = q.current_volume(p) * (q.sxx[p] * d.xx[0] + q.syy[p] * d.yy[0] + q.sxy[p] * (d.xy[0] + d.yx[0]));
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

struct MpmCase
{
    const char *method, *scheme;
    double flip;
};
class MpmOracle : public testing::TestWithParam<MpmCase>
{
};

/// Every shape, strain, scheme and blend against the oracle, with points that change cells.
TEST_P(MpmOracle, SameTrajectories)
{
    const MpmCase& c = GetParam();
    // one modulus per body: the oracle of B-bar tells bodies apart by it
    const Scene scene =
        test::load(test::two_bodies() + "[gravity]\nacceleration = [0.4, -1.3]\n", c.method,
                   {std::string("mpm.scheme=") + c.scheme, "mpm.flip=" + std::to_string(c.flip), "material.stiff.youngs_modulus=3e4"});
    const auto solver = make_mpm(scene);
    test::RefMpm reference{{0.5, -1, -1}, test::reference_points(scene), scene.mpm.shape == "cpgimp", c.scheme,
                           c.flip,        scene.mpm.strain == "b_bar"};
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
                                         MpmCase{"mpm-cpgimp", "usl", 0.95}, MpmCase{"mpm-cpgimp", "usf", 1}),
                         [](const auto& info)
                         {
                             std::string name =
                                 std::string(info.param.method) + "_" + info.param.scheme + (info.param.flip < 1 ? "_blend" : "");
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
        const Points& q = solver->bodies()[0].points;
        std::vector<double> out(q.sxx.data(), q.sxx.data() + q.count);
        out.insert(out.end(), q.vx.data(), q.vx.data() + q.count);
        set_threads(1);
        return out;
    };
    for (const char* method : {"mpm-linear", "mpm-linear-bbar", "mpm-cpgimp"})
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
