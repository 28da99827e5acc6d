#include "core/materials/material.hpp"
#include "tests/quadrilateral.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>
#include <map>

using namespace testbed;

namespace
{
using Principal = MohrCoulombReturn::Principal;
using State = MohrCoulomb::State<double>;

const ElasticModuli soil(5e7, 0.47);  // Konagai & Johansson (2000), table 1
constexpr double phi = 0.5, c = 9800;
const double none = std::numeric_limits<double>::infinity();

MohrCoulomb law_of(double friction, double cohesion, double dilatancy = 0, const Softening& softening = {}, double tension = none)
{
    return {{soil}, {cohesion, std::sin(friction)}, {soil, std::sin(dilatancy), tension}, softening};
}

/// D : e in principal directions, written out apart from the code under test.
Principal stiffness_times(const Principal& e)
{
    const double E = soil.youngs_modulus(), nu = soil.poissons_ratio(), f = E / ((1 + nu) * (1 - 2 * nu));
    Principal s{};
    for (std::size_t i = 0; i < 3; ++i)
        s[i] = f * ((1 - nu) * e[i] + nu * (e[(i + 1) % 3] + e[(i + 2) % 3]));
    return s;
}

Principal plus(Principal a, double factor, const Principal& b)
{
    for (std::size_t i = 0; i < 3; ++i)
        a[i] += factor * b[i];
    return a;
}

/// Yield function of all three principal stresses, from tau = c - sigma tan(phi).
double most_critical(const State& s, double friction, double cohesion)
{
    const double mean = 0.5 * (s.stress.xx + s.stress.yy), radius = std::hypot(0.5 * (s.stress.xx - s.stress.yy), s.stress.xy);
    const double p[] = {mean + radius, mean - radius, s.stress_zz};
    const double high = *std::max_element(p, p + 3), low = *std::min_element(p, p + 3);
    return (high - low) + (high + low) * std::sin(friction) - 2 * cohesion * std::cos(friction);
}

double energy(const State& s)
{
    return ElasticPart{soil}.energy_density(s.stress, s.stress_zz);
}
}  // namespace

/// From a stress on the surface and a plastic strain by the flow rule follows the trial stress that must return there.
TEST(MohrCoulombReturn, ClosedFormInEveryRegion)
{
    test::Random random(1);
    const double sf = std::sin(phi);
    for (const double psi : {0.0, 0.2, 0.5})
    {
        const double sp = std::sin(psi);
        const MohrCoulombReturn back(soil, sp, none);
        const Principal m13{1 + sp, 0, -(1 - sp)}, m12{1 + sp, -(1 - sp), 0}, m23{0, 1 + sp, -(1 - sp)};
        const auto major_of = [&](double s3) { return (2 * c * std::cos(phi) + s3 * (1 - sf)) / (1 + sf); };
        const auto expect = [&](Principal trial, const Principal& wanted, YieldRegion region)
        {
            EXPECT_EQ(back(trial, sf, c), region);
            for (std::size_t i = 0; i < 3; ++i)
                EXPECT_NEAR(trial[i], wanted[i], 1e-10 * (std::abs(wanted[0]) + std::abs(wanted[2]) + c));
        };
        for (int k = 0; k < 1000; ++k)
        {
            const double s3 = random(-1e5, 0), s1 = major_of(s3), a = random(1e-6, 1e-4), b = random(1e-6, 1e-4);
            const Principal face{s1, random(s3 + 0.3 * (s1 - s3), s1 - 0.3 * (s1 - s3)), s3}, left{s1, s1, s3}, right{s1, s3, s3};
            Principal inside = face;
            inside[0] -= 0.1 * c;
            if (inside[0] > inside[1])
                expect(inside, inside, YieldRegion::elastic);
            expect(plus(face, a, stiffness_times(m13)), face, YieldRegion::face);
            expect(plus(plus(left, a, stiffness_times(m13)), 0.9 * a, stiffness_times(m23)), left, YieldRegion::left_edge);
            expect(plus(plus(right, a, stiffness_times(m13)), 0.9 * a, stiffness_times(m12)), right, YieldRegion::right_edge);
            const double apex = c * std::cos(phi) / sf;
            const double d = random(1, 1e5);
            if (psi > 0)  // pure extension beyond the apex
                expect({apex + d, apex + d, apex + d}, {apex, apex, apex}, YieldRegion::apex);
            expect({apex + d + 1e-6 * b, apex + d, apex + d - 1e-6 * a}, {apex, apex, apex}, YieldRegion::apex);
            // the plastic shear strain is gamma of the flow: 2 a on the face
            Principal trial = plus(face, a, stiffness_times(m13)), returned = trial;
            back(returned, sf, c);
            EXPECT_NEAR(back.plastic_shear(trial, returned), 2 * a, 1e-9 * a);
        }
    }
}

/// Tresca: the return keeps the mean stress and has no apex.
TEST(MohrCoulombReturn, Tresca)
{
    test::Random random(2);
    const MohrCoulombReturn back(soil, 0, none);
    for (int k = 0; k < 10000; ++k)
    {
        Principal s{random(-1e6, 1e6), random(-1e6, 1e6), random(-1e6, 1e6)};
        std::sort(s.rbegin(), s.rend());
        const double mean = s[0] + s[1] + s[2];
        const auto region = back(s, 0, c);
        EXPECT_NE(region, YieldRegion::apex);
        EXPECT_NEAR(s[0] + s[1] + s[2], mean, 1e-8 * 1e6);
        EXPECT_LE(s[0] - s[2] - 2 * c, 1e-8 * 1e6);
    }
}

TEST(MohrCoulombReturn, TensionCutOff)
{
    const double limit = 2000;
    const MohrCoulombReturn back(soil, 0, limit);
    const double share = soil.poissons_ratio() / (1 - soil.poissons_ratio());
    Principal one{limit + 1000, 1000, -500};
    EXPECT_EQ(back(one, std::sin(phi), c), YieldRegion::tension);
    EXPECT_NEAR(one[0], limit, 1e-9);
    EXPECT_NEAR(one[1], 1000 - share * 1000, 1e-9);
    EXPECT_NEAR(one[2], -500 - share * 1000, 1e-9);
    Principal two{limit + 1000, limit + 900, -500};  // sigma_3 falls by nu times the sum, as in plane stress
    back(two, std::sin(phi), c);
    EXPECT_NEAR(two[1], limit, 1e-9);
    EXPECT_NEAR(two[2], -500 - soil.poissons_ratio() * 1900, 1e-9);
    Principal three{limit + 1000, limit + 990, limit + 980};
    back(three, std::sin(phi), c);
    for (const double s : three)
        EXPECT_NEAR(s, limit, 1e-9);
}

/// Plane-strain compression without lateral stress: slope E/(1 - nu^2), peak 2 c tan(45 + phi/2), then half of it.
TEST(MohrCoulomb, PlaneStrainCompression)
{
    const double nu = soil.poissons_ratio(), peak = 2 * c * std::tan(std::numbers::pi / 4 + phi / 2);
    EXPECT_NEAR(peak, 33.04e3, 10);  // reference value of the paper's soil
    for (const auto& [softening, end] : {std::pair{Softening{}, 1.0}, {Softening::drop(0.5), 0.5}, {Softening::linear(0.5, 2e-3), 0.5}})
    {
        const MohrCoulomb law = law_of(phi, c, 0, softening);
        State state;
        double highest = 0;
        const double step = 1e-7;
        for (int n = 0; n < 50000; ++n)
        {
            double low = -step, high = 3 * step;  // lateral strain increment that leaves no lateral stress
            State trial;
            for (int k = 0; k < 60; ++k)
            {
                const double lateral = 0.5 * (low + high);
                trial = state;
                law.update(trial, Gradient<2>{lateral, -step, 0, 0});
                (trial.stress.xx > 0 ? high : low) = lateral;
            }
            state = trial;
            if (n == 2000)
            {
                EXPECT_NEAR(-state.stress.yy / ((n + 1) * step), 5e7 / (1 - nu * nu), 64e6 * 1e-6);
            }
            highest = std::max(highest, -state.stress.yy);
        }
        EXPECT_NEAR(highest, peak, 5e-4 * peak);  // one step
        EXPECT_NEAR(-state.stress.yy, end * peak, 1e-4 * peak);
    }
}

/// Simple shear with linear softening: tau = c - (c - c_r) gamma_p / gamma_r, solved within the step, whatever its size.
TEST(MohrCoulomb, LinearSofteningInSimpleShear)
{
    const double residual = 0.3, strain = 0.02, G = soil.shear();
    const MohrCoulomb law = law_of(0, c, 0, Softening::linear(residual, strain));
    for (const int steps : {7, 1000})
    {
        State state;
        const double total = c / G + 0.5 * strain;  // within the softening branch
        for (int n = 0; n < steps; ++n)
            law.update(state, Gradient<2>{0, 0, 0.5 * total / steps, 0.5 * total / steps});
        const double H = (1 - residual) * c / strain, plastic = (G * total - c) / (G - H);
        EXPECT_NEAR(state.plastic_shear_strain, plastic, 1e-10);
        EXPECT_NEAR(state.stress.xy, c - H * plastic, 1e-10 * c);
    }
}

/// A drop marks the point even where plastic flow has no shear: pure tension breaks the bonds, too.
TEST(MohrCoulomb, TensionBreaksTheCohesion)
{
    const MohrCoulomb law = law_of(phi, c, 0, Softening::drop(0.5));
    State state;
    for (int n = 0; n < 100; ++n)
        law.update(state, Gradient<2>{1e-5, 1e-5, 0, 0});
    const double apex = 0.5 * c / std::tan(phi);
    EXPECT_NEAR(state.stress.xx, apex, 1e-9 * apex);
    EXPECT_GT(state.plastic_shear_strain, 0);
}

namespace
{
struct Case
{
    double friction, cohesion, dilatancy, tension;
    Softening softening;
};
const Case cases[] = {{0.5, 9800, 0, none, Softening{}},
                      {0.5, 9800, 0, none, Softening::drop(0.5)},
                      {0.5, 9800, 0.3, 1000, Softening::linear(0.2, 0.5)},
                      {0, 9800, 0, none, Softening::linear(0.5, 0.3)},
                      {0, 0, 0, 0, Softening{}},
                      {0.7, 0, 0.7, none, Softening{}},
                      {1.4, 1, 0, none, Softening::drop(0)}};
}  // namespace

/// A million random steps: admissible to 1e-8 of the stress level, finite, and the work exceeds what is stored.
TEST(MohrCoulomb, RandomPaths)
{
    for (const Case& k : cases)
    {
        test::Random random(7);
        const MohrCoulomb law = law_of(k.friction, k.cohesion, k.dilatancy, k.softening, k.tension);
        State state;
        double work = 0, least = 0;
        int bad = 0;
        for (int n = 0; n < 1000000; ++n)
        {
            const double size = std::pow(10.0, random(-7, -1));
            const Gradient<2> d{random(-size, size), random(-size, size), random(-size, size), random(-size, size)};
            const State before = state;
            // the rotation is frame change, not work: the work is counted with the strain on the rotated stress
            law.update(state, d);
            work += state.stress.xx * d.xx + state.stress.yy * d.yy + state.stress.xy * d.shear();
            const double share = law.softening.share(state.plastic_shear_strain);
            const double level =
                std::abs(state.stress.xx) + std::abs(state.stress.yy) + std::abs(state.stress_zz) + std::abs(state.stress.xy) + k.cohesion;
            bad += !(most_critical(state, k.friction, share * k.cohesion) <= 1e-8 * level);
            bad += !(0.5 * (state.stress.xx + state.stress.yy) + std::hypot(0.5 * (state.stress.xx - state.stress.yy), state.stress.xy) <=
                     k.tension + 1e-8 * level);
            bad += !(state.plastic_shear_strain >= before.plastic_shear_strain) || !std::isfinite(work);
            least = std::min(least, work - energy(state));
        }
        EXPECT_EQ(bad, 0);
        EXPECT_GE(least, -1e-9 * work);  // what is not stored is dissipated: no closed cycle can create energy
        if (k.cohesion > 0)
        {
            EXPECT_GT(state.plastic_shear_strain, 1);
        }
    }
}

/// Within the yield surface the law is the hypoelastic one with exact rotation, sigma_zz included.
TEST(MohrCoulomb, ElasticPartRotates)
{
    test::Random random(11);
    const MohrCoulomb law = law_of(phi, 1e12);
    State state;
    HypoelasticExactRotation::State<double> elastic;
    double zz = 0;
    for (int n = 0; n < 200; ++n)
    {
        const Gradient<2> d{random(-1e-2, 1e-2), random(-1e-2, 1e-2), random(-0.1, 0.1), random(-0.1, 0.1)};
        law.update(state, d);
        HypoelasticExactRotation{soil}.update(elastic, d);
        zz += soil.lame() * d.trace();
        EXPECT_NEAR(state.stress.xx, elastic.stress.xx, 1e-3);
        EXPECT_NEAR(state.stress.xy, elastic.stress.xy, 1e-3);
        EXPECT_NEAR(state.stress_zz, zz, 1e-3);
    }
}

/// Tension and shear together: from the corner by both flows.
TEST(MohrCoulombReturn, Corner)
{
    const double limit = 2000, psi = 0.2, sf = std::sin(phi), sp = std::sin(psi);
    const MohrCoulombReturn back(soil, sp, limit);
    const double low = (limit * (1 + sf) - 2 * c * std::cos(phi)) / (1 - sf);
    const Principal at{limit, 0.5 * (limit + low), low}, open{1, 0, 0}, shear{1 + sp, 0, -(1 - sp)};
    test::Random random(12);
    for (int k = 0; k < 100; ++k)
    {
        Principal trial = plus(plus(at, random(1e-6, 1e-5), stiffness_times(open)), random(1e-6, 1e-5), stiffness_times(shear));
        EXPECT_EQ(back(trial, sf, c), YieldRegion::corner);
        for (std::size_t i = 0; i < 3; ++i)
            EXPECT_NEAR(trial[i], at[i], 1e-6);
    }
}

/// A cycle of strain that returns to its start, with the work by the trapezoidal rule in small steps.
TEST(MohrCoulomb, ClosedCyclesDissipate)
{
    test::Random random(8);
    for (int cycle = 0; cycle < 50; ++cycle)
    {
        const MohrCoulomb law = law_of(random(0, 0.7), random(0, 1e4), 0, Softening::linear(0.5, random(1e-3, 1e-2)));
        State state;
        double work = 0, scale = 0;
        const Gradient<2> a{random(-3e-3, 3e-3), random(-3e-3, 3e-3), random(-3e-3, 3e-3), 0};
        const Gradient<2> b{random(-3e-3, 3e-3), random(-3e-3, 3e-3), random(-3e-3, 3e-3), 0};
        const int steps = 2000;
        for (int n = 0; n < steps; ++n)
        {
            const double t = 2 * std::numbers::pi * n / steps, h = 2 * std::numbers::pi / steps;
            const double da = std::sin(t + h) - std::sin(t), db = std::cos(t + h) - std::cos(t);
            Gradient<2> d{a.xx * da + b.xx * db, a.yy * da + b.yy * db, 0, 0};
            d.xy = d.yx = 0.5 * (a.xy * da + b.xy * db);
            const State s = state;
            law.update(state, d);
            const double dw = 0.5 * ((s.stress.xx + state.stress.xx) * d.xx + (s.stress.yy + state.stress.yy) * d.yy +
                                     (s.stress.xy + state.stress.xy) * d.shear());
            work += dw;
            scale += std::abs(dw);
        }
        EXPECT_GE(work - energy(state), -1e-6 * scale);
    }
}

/// The batch form equals the point function, in all four variants, whole packs and rests, lanes that yield beside such that do not, and
/// with the out-of-plane stress in the middle, above and below.
TEST(MohrCoulomb, BatchEqualsPointFunction)
{
    const auto check = [](const auto& law, bool varying, bool nonlocal)
    {
        test::Random random(9);
        Points<2> q;
        const std::size_t n = 19;  // whole packs and a rest, whatever the width
        q.count = n;
        for (Field<double>* f : {&q.stress[0], &q.stress[1], &q.stress[2]})
            f->activate(n);
        law.allocate(q);
        std::vector<State> state(n);
        std::vector<MohrCoulomb> own(n, law);
        int yielded = 0, elastic = 0, zz_first = 0, zz_last = 0;
        for (std::size_t p = 0; p < n; ++p)
        {
            if (varying)
            {
                q.cohesion[p] = random(5e3, 2e4);
                q.sin_friction[p] = std::sin(random(0.2, 0.6));
                own[p].strength = {q.cohesion[p], q.sin_friction[p]};
            }
            if (nonlocal)
            {
                q.softening_strain[p] = random(0, 2e-3);
                const double share = law.softening.share(q.softening_strain[p]);
                own[p].strength.cohesion *= share;
                own[p].softening = Softening{};
            }
        }
        std::vector<double> xx(n), yy(n), xy(n), yx(n);
        for (int step = 0; step < 60; ++step)
        {
            for (std::size_t p = 0; p < n; ++p)
            {
                const bool biaxial = step % 2 == 0;  // both normal strains of one sign take the stress out of the plane to the end
                const double shear = biaxial ? 1e-4 : 4e-4;
                xx[p] = random(-1e-3, 1e-3);
                yy[p] = biaxial ? random(0.3, 0.7) * xx[p] : random(-4e-4, 4e-4);
                xy[p] = random(-shear, shear);
                yx[p] = random(-shear, shear);
            }
            for_each_pack(0, n,
                          [&](std::size_t p, const auto& lanes)
                          {
                              const auto at = [&](const std::vector<double>& v) { return lanes.load(&v[p]); };
                              law.update(q, p, lanes, Gradient<2, Pack>{at(xx), at(yy), at(xy), at(yx)});
                          });
            for (std::size_t p = 0; p < n; ++p)
            {
                const double before = state[p].plastic_shear_strain;
                own[p].update(state[p], {xx[p], yy[p], xy[p], yx[p]});
                const double level = 1e-9 * c;
                EXPECT_NEAR(q.stress[0][p], state[p].stress.xx, level);
                EXPECT_NEAR(q.stress[1][p], state[p].stress.yy, level);
                EXPECT_NEAR(q.stress[2][p], state[p].stress.xy, level);
                EXPECT_NEAR(q.szz[p], state[p].stress_zz, level);
                EXPECT_NEAR(q.plastic_shear[p], state[p].plastic_shear_strain, 1e-13);
                if (state[p].plastic_shear_strain > before)
                    ++yielded;
                else
                    ++elastic;
                const SymTensor<2>& s = state[p].stress;
                const double mean = 0.5 * (s.xx + s.yy), radius = std::hypot(0.5 * (s.xx - s.yy), s.xy);
                zz_first += state[p].plastic_shear_strain > before && state[p].stress_zz > mean + radius * 1.01;
                zz_last += state[p].plastic_shear_strain > before && state[p].stress_zz < mean - radius * 1.01;
            }
        }
        EXPECT_GT(elastic, 50);
        if (law.moduli.poissons_ratio() < 0.2)  // at 0.47 the pressure keeps such points elastic
        {
            EXPECT_GT(zz_first, 10);
            EXPECT_GT(zz_last, 10);
        }
    };
    const ElasticModuli dry(5e7, 0.1);
    const MohrCoulomb dry_soil{dry, {c, std::sin(phi)}, {dry, std::sin(0.1), none}, Softening::drop(0.5)};
    for (const MohrCoulomb& law : {dry_soil, law_of(phi, c, 0.1, Softening::linear(0.5, 2e-3), 5000),
                                   law_of(phi, c, 0.2, Softening::drop(0.5)), law_of(phi, c), law_of(0, c)})
    {
        check(law, false, false);
        check(MohrCoulombField<true, false>{law}, true, false);
        check(MohrCoulombField<false, true>{law}, false, true);
        check(MohrCoulombField<true, true>{law}, true, true);
    }
}

/// Packs go every way that the point function goes, face, edges, apex, tension, corner, with and without softening: random steps of all
/// sizes from states that random steps led to, right to rounding of the trial stress.
TEST(MohrCoulomb, PacksGoEveryWay)
{
    std::map<YieldRegion, int> ways;
    for (const Case& k : cases)
    {
        test::Random random(17);
        const MohrCoulomb law = law_of(k.friction, k.cohesion, k.dilatancy, k.softening, k.tension);
        Points<2> q;
        q.count = pack_size;
        for (auto& component : q.stress)
            component.activate(q.count);
        law.allocate(q);
        std::vector<State> state(pack_size);
        std::vector<Gradient<2>> d(pack_size);
        int softened = 0;
        for (int n = 0; n < 20000; ++n)
        {
            Gradient<2, Pack> packed;
            for (std::size_t p = 0; p < pack_size; ++p)
            {
                if (n % 50 == 0)
                    state[p] = State{};  // bonds are whole again
                const double size = std::pow(10.0, random(-6, -2));
                d[p] = {random(-size, size), random(-size, size), random(-size, size), random(-size, size)};
                unrolled<4>([&](auto c) { component<c>(packed)[p] = component<c>(d[p]); });
                unrolled<3>([&](auto c) { q.stress[c][p] = component<c>(state[p].stress); });
                q.szz[p] = state[p].stress_zz;
                q.plastic_shear[p] = state[p].plastic_shear_strain;
            }
            law.update(q, 0, AllLanes{}, packed);
            for (std::size_t p = 0; p < pack_size; ++p)
            {
                const State before = state[p];
                law.update(state[p], d[p]);
                const double size = std::abs(before.stress.xx) + std::abs(before.stress.yy) + std::abs(before.stress_zz) +
                                    20 * soil.constrained() * (std::abs(d[p].xx) + std::abs(d[p].yy) + std::abs(d[p].shear())) + k.cohesion;
                const double slack = 1e-12 * size / (1 - std::sin(k.friction));
                unrolled<3>([&](auto c) { ASSERT_NEAR(q.stress[c][p], component<c>(state[p].stress), slack) << n << ' ' << p; });
                ASSERT_NEAR(q.szz[p], state[p].stress_zz, slack) << n << ' ' << p;
                ASSERT_NEAR(q.plastic_shear[p], state[p].plastic_shear_strain, slack / soil.shear()) << n << ' ' << p;
                softened += law.softening.share(state[p].plastic_shear_strain) < law.softening.share(before.plastic_shear_strain);
                HypoelasticExactRotation::State<double> elastic{before.stress};
                HypoelasticExactRotation{soil}.update(elastic, d[p]);
                const double mean = 0.5 * (elastic.stress.xx + elastic.stress.yy),
                             radius = std::hypot(0.5 * (elastic.stress.xx - elastic.stress.yy), elastic.stress.xy);
                Principal trial{mean + radius, mean - radius, before.stress_zz + soil.lame() * d[p].trace()};
                std::sort(trial.begin(), trial.end(), std::greater<>());
                ++ways[law.back(trial, law.strength.sin_phi, law.softening.share(state[p].plastic_shear_strain) * k.cohesion)];
            }
        }
        EXPECT_EQ(softened > 100, law.softening.share(1e9) < 1);
    }
    for (const YieldRegion way : {YieldRegion::elastic, YieldRegion::face, YieldRegion::left_edge, YieldRegion::right_edge,
                                  YieldRegion::apex, YieldRegion::tension, YieldRegion::corner})
        EXPECT_GT(ways[way], 300) << static_cast<int>(way);
}

/// A strain that is not a number shows in the stress of its point, and in no other.
TEST(MohrCoulomb, BatchKeepsNaN)
{
    const MohrCoulombField<false, true> law{law_of(phi, c, 0, Softening::linear(0.5, 2e-3))};
    Points<2> q;
    q.count = pack_size;
    for (Field<double>* f : {&q.stress[0], &q.stress[1], &q.stress[2]})
        f->activate(q.count);
    law.allocate(q);
    q.softening_strain[0] = std::numeric_limits<double>::quiet_NaN();
    law.update(q, 0, AllLanes{}, Gradient<2, Pack>{Pack(0.0), Pack(0.0), Pack(1e-3), Pack(1e-3)});
    for (std::size_t p = 0; p < q.count; ++p)
    {
        EXPECT_EQ(std::isfinite(q.stress[2][p]), p > 0) << p;
        EXPECT_EQ(q.plastic_shear[p] > 0, p > 0) << p;
    }
}

/// The point function serves other hosts than points: a quadrilateral of FLAC bears 2 c cos(phi) / (1 - sin(phi)), and up to that what
/// elasticity asks for in plane strain, E / (1 - nu^2) times the strain.
TEST(MohrCoulomb, PointFunctionServesTriangles)
{
    const MohrCoulomb law = law_of(phi, c);
    const auto triangles = test::triangles();
    const double strength = 2 * c * std::cos(phi) / (1 - std::sin(phi));
    const double modulus = soil.youngs_modulus() / (1 - soil.poissons_ratio() * soil.poissons_ratio());
    EXPECT_NEAR(test::pressure_on_top(law, triangles, 0.5 * strength / modulus, 20), 0.5 * strength, 1e-3 * strength);
    EXPECT_NEAR(test::pressure_on_top(law, triangles, 3 * strength / modulus, 120), strength, 1e-3 * strength);
}
