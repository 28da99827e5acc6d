#include "core/bodies/stress_runs.hpp"
#include "core/bodies/support.hpp"
#include "core/materials/material.hpp"
#include "core/materials/material_spec.hpp"
#include "tests/random.hpp"
#include "tests/scenes.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

using namespace testbed;

namespace
{
const ElasticModuli moduli_of_test(2.5e6, 0.3);

template <class Law>
SymTensor<2> simple_shear(double total, int steps)
{
    const Law law{moduli_of_test};
    typename Law::template State<double> state;
    for (int n = 0; n < steps; ++n)
        law.update(state, Gradient<2>{0, 0, total / steps, 0});
    return state.stress;
}
}  // namespace

TEST(Elastic, Moduli)
{
    const ElasticModuli soil(5e7, 0.47);
    EXPECT_NEAR(soil.constrained(), 3.0045e8, 1e4);  // reference value of the paper's soil
    EXPECT_NEAR(soil.shear(), 5e7 / 2.94, 1e-6);
    EXPECT_NEAR(soil.lame() + 2 * soil.shear(), soil.constrained(), 1e-6);
}

TEST(Elastic, UniaxialStrainAndStress)
{
    const LinearElastic law{moduli_of_test};
    LinearElastic::State<double> state;
    law.update(state, Gradient<2>{0, 1e-3, 0, 0});
    const double nu = 0.3, M = moduli_of_test.constrained();
    EXPECT_NEAR(state.stress.yy, M * 1e-3, 1e-9);
    EXPECT_NEAR(state.stress.xx, nu / (1 - nu) * M * 1e-3, 1e-9);
    // plane strain, no lateral stress: slope E / (1 - nu^2)
    state = {};
    law.update(state, Gradient<2>{-nu / (1 - nu) * 1e-3, 1e-3, 0, 0});
    EXPECT_NEAR(state.stress.xx, 0, 1e-9);
    EXPECT_NEAR(state.stress.yy, 2.5e6 / (1 - nu * nu) * 1e-3, 1e-9);
}

/// Energy density is the work of the stress on a straight path.
TEST(Elastic, EnergyDensity)
{
    test::Random random(4);
    const LinearElastic law{moduli_of_test};
    for (int trial = 0; trial < 50; ++trial)
    {
        LinearElastic::State<double> state;
        const Gradient<2> d{random(-1, 1), random(-1, 1), random(-1, 1), random(-1, 1)};
        law.update(state, d);
        const SymTensor<2>& s = state.stress;
        const double work = 0.5 * (s.xx * d.xx + s.yy * d.yy + s.xy * d.shear());
        EXPECT_NEAR(ElasticPart{moduli_of_test}.energy_density(s, 0.3 * (s.xx + s.yy)), work, 1e-9 * work);
    }
}

/// Simple shear of a Jaumann-rate material: G (1 - cos g), G sin g (Dienes 1979). Both forms integrate this rate.
TEST(Jaumann, SimpleShear)
{
    const double G = moduli_of_test.shear();
    for (const double g : {1.0, 6.0})
    {
        const auto jaumann = simple_shear<HypoelasticJaumann>(g, 200000), exact = simple_shear<HypoelasticExactRotation>(g, 20000);
        EXPECT_NEAR(jaumann.xx, G * (1 - std::cos(g)), 2e-4 * G);
        EXPECT_NEAR(jaumann.xy, G * std::sin(g), 2e-4 * G);
        EXPECT_NEAR(jaumann.yy, -jaumann.xx, 1e-9 * G);
        EXPECT_NEAR(exact.xx, G * (1 - std::cos(g)), 2e-4 * G);
        EXPECT_NEAR(exact.xy, G * std::sin(g), 2e-4 * G);
    }
}

TEST(LinearElastic, SimpleShearHasNoNormalStress)
{
    const auto s = simple_shear<LinearElastic>(1, 100);
    EXPECT_DOUBLE_EQ(s.xx, 0);
    EXPECT_NEAR(s.xy, moduli_of_test.shear(), 1e-6);
}

/// A rigid turn rotates the stress: the exact form to rounding in 100 steps, the Jaumann form to first order.
TEST(Rotation, RigidTurn)
{
    const SymTensor<2> start{3, -1, 0.5};
    const double angle = 2 * std::numbers::pi / 3, step = angle / 100;
    const double c = std::cos(angle), s = std::sin(angle);
    const SymTensor<2> turned{c * c * start.xx + s * s * start.yy - 2 * c * s * start.xy,
                              s * s * start.xx + c * c * start.yy + 2 * c * s * start.xy,
                              c * s * (start.xx - start.yy) + (c * c - s * s) * start.xy};
    HypoelasticExactRotation::State<double> exact{start};
    HypoelasticJaumann::State<double> first{start};
    for (int n = 0; n < 100; ++n)
    {
        HypoelasticExactRotation{moduli_of_test}.update(exact, Gradient<2>{0, 0, -step, step});
        HypoelasticJaumann{moduli_of_test}.update(first, Gradient<2>{0, 0, -step, step});
    }
    EXPECT_NEAR(exact.stress.xx, turned.xx, 1e-12);
    EXPECT_NEAR(exact.stress.yy, turned.yy, 1e-12);
    EXPECT_NEAR(exact.stress.xy, turned.xy, 1e-12);
    EXPECT_NEAR(first.stress.xx, turned.xx, 0.2);
    const auto invariant = [](const SymTensor<2>& t) { return std::hypot(0.5 * (t.xx - t.yy), t.xy); };
    EXPECT_GT(invariant(first.stress) / invariant(start), 1.02);  // what first order costs
    EXPECT_NEAR(invariant(exact.stress), invariant(start), 1e-12);
}

/// The batch form equals the point function, for every law, with and without a varying modulus.
TEST(Batch, EqualsPointFunction)
{
    test::Random random(5);
    const auto check = [&](auto law, bool varies)
    {
        Points<2> q;
        const std::size_t n = pack_size + 3;
        q.count = n;
        for (Field<double>* f : {&q.stress[0], &q.stress[1], &q.stress[2], &q.stiffness})
            f->activate(n);
        std::vector<SymTensor<2>> start(n);
        for (std::size_t p = 0; p < n; ++p)
        {
            start[p] = random.stress(1e3);
            q.stress[0][p] = start[p].xx;
            q.stress[1][p] = start[p].yy;
            q.stress[2][p] = start[p].xy;
            q.stiffness[p] = random(0.1, 1);
        }
        const Gradient<2> d{1e-3, -2e-3, 3e-3, -4e-3};
        for_each_pack(0, n,
                      [&](std::size_t p, const auto& lanes) {
                          law.update(q, p, lanes, Gradient<2, Pack>{Pack(d.xx), Pack(d.yy), Pack(d.xy), Pack(d.yx)});
                      });
        for (std::size_t p = 0; p < n; ++p)
        {
            typename decltype(law)::template State<double> state{start[p]};
            law.update(state, d, varies ? q.stiffness[p] : 1.0);
            EXPECT_NEAR(q.stress[0][p], state.stress.xx, 1e-9);
            EXPECT_NEAR(q.stress[1][p], state.stress.yy, 1e-9);
            EXPECT_NEAR(q.stress[2][p], state.stress.xy, 1e-9);
        }
    };
    check(LinearElastic{moduli_of_test}, false);
    check(HypoelasticJaumann{moduli_of_test}, false);
    check(HypoelasticExactRotation{moduli_of_test}, false);
    check(VaryingStiffness<LinearElastic>{{moduli_of_test}}, true);
    check(VaryingStiffness<HypoelasticExactRotation>{{moduli_of_test}}, true);
}

/// What a scene says of strength and softening comes to the law as it was meant.
TEST(MakeMaterial, StrengthAndSofteningOfAScene)
{
    MaterialSpec spec;
    spec.law = Laws::place_of<MohrCoulomb>();
    spec.density = 1;
    spec.strength = StrengthSpec{.cohesion = "10", .friction_angle = "0.6", .dilatancy_angle = 0.3, .tensile_strength = 4.0};
    spec.softening = SofteningSpec{.kind = SofteningSpec::Kind::linear, .residual = 0.4, .strain = 0.2, .band_thickness = 0.1};
    const auto law = std::get<MohrCoulomb>(Laws::make(spec.law, spec, {{1e6, 0.3}, {10, std::sin(0.6)}, 0.5, {}}));
    EXPECT_DOUBLE_EQ(law.back.sin_psi(), std::sin(0.3));
    EXPECT_EQ(law.back.tensile_strength(), 4);
    // cells five times as wide as the band: the displacement of the band is spread over them
    EXPECT_NEAR(law.softening.share(0.02), 0.7, 1e-12);
    EXPECT_NEAR(law.softening.share(0.04), 0.4, 1e-12);
    EXPECT_NEAR(law.softening.share(0.08), 0.4, 1e-12);
}

/// The law goes over the points of several bins, or of one larger than a run, in whole packs: each gets its own increment, once, and a bin
/// is finished after that.
TEST(StressRuns, GiveEachPointItsOwnIncrement)
{
    for (const int points_per_cell : {1, 2, 3, 12})
        for (const std::string& strength : {std::string(), test::strength})
        {
            const Scene scene =
                test::load(test::soil_block({0, 0}, {4, 2.5}, strength) + fmt::format("points_per_cell = {}\n", points_per_cell));
            std::vector<Body> bodies = make_bodies(scene, make_lattice(scene.grid), {});
            Body& body = bodies[0];
            std::vector<double> workspace;
            body.bins.rebuild<PointSupport>(body.points, workspace);
            Points<2>& q = body.points;
            std::vector<Gradient<2>> d(q.count);
            test::Random random(5);
            for (auto& g : d)
                g = {random(-0.02, 0.02), random(-0.02, 0.02), random(-0.02, 0.02), random(-0.02, 0.02)};
            std::vector<int> finished(body.bins.list().size());
            update_stress(
                body,
                [&](std::size_t b, auto&& keep)
                {
                    for_each_pack(body.bins.list()[b].begin, body.bins.list()[b].end,
                                  [&](std::size_t p, const auto& lanes)
                                  {
                                      std::array<std::array<double, pack_size>, 4> own{};
                                      for (std::size_t k = 0; k < pack_size && p + k < q.count; ++k)
                                          own[0][k] = d[p + k].xx, own[1][k] = d[p + k].yy, own[2][k] = d[p + k].xy,
                                          own[3][k] = d[p + k].yx;
                                      const auto pack = [&](std::size_t i) { return lanes.load(own[i].data()); };
                                      keep(p, lanes, Gradient<2, Pack>{pack(0), pack(1), pack(2), pack(3)});
                                  });
                },
                [&](std::size_t b)
                {
                    ++finished[b];
                    EXPECT_NE(q.stress[0][body.bins.list()[b].begin], 0);
                });
            EXPECT_EQ(finished, std::vector<int>(finished.size(), 1));
            std::visit(
                [&](const auto& own)
                {
                    for (std::size_t p = 0; p < q.count; ++p)
                    {
                        typename std::decay_t<decltype(own)>::template State<double> state{};
                        own.update(state, d[p]);
                        EXPECT_NEAR(q.stress[0][p], state.stress.xx, 1e-8) << strength << points_per_cell;
                        EXPECT_NEAR(q.stress[1][p], state.stress.yy, 1e-8);
                        EXPECT_NEAR(q.stress[2][p], state.stress.xy, 1e-8);
                    }
                },
                body.material);
        }
}
