/// What is written for any dimension, in three: values, lattice, bins, gather, kernels of cells and of points.

#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"
#include "lpfdm/equations.hpp"
#include "mpm/shapes/bspline.hpp"
#include "mpm/shapes/cpgimp.hpp"
#include "mpm/shapes/linear.hpp"
#include "mpm/transfer.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>
#include <map>

using namespace testbed;
using test::Random;

namespace
{
const Lattice<3> lattice{{-1.0, 2.0, 0.5}, 0.5, {6, 4, 5}};

Gradient<3> random_gradient(Random& random)
{
    Gradient<3> g;
    unrolled<9>([&](auto k) { component<k>(g) = random(-1, 1); });
    return g;
}
double entry(const Gradient<3>& g, std::size_t i, std::size_t j)
{
    double value = 0;
    unrolled<3>([&](auto a) { unrolled<3>([&](auto b) { value = a == i && b == j ? component<a, b>(g) : value; }); });
    return value;
}
/// Linear field through the origin.
Vec<3> times(const Gradient<3>& g, const Vec<3>& x)
{
    Vec<3> u{};
    for (std::size_t i = 0; i < 3; ++i)
        for (std::size_t j = 0; j < 3; ++j)
            u[i] += entry(g, i, j) * x[j];
    return u;
}

Points<3> random_points(std::size_t n, unsigned seed)
{
    Random random(seed);
    Points<3> q;
    q.count = n;
    for (std::size_t d = 0; d < 3; ++d)
    {
        q.x[d].activate(n);
        q.half_width[d].activate(n);
    }
    q.stress[0].activate(n);
    q.id.activate(n);
    for (std::size_t p = 0; p < n; ++p)
    {
        set(q.x, p, {random(-0.9, 1.9), random(2.1, 3.9), random(0.6, 2.9)});
        set(q.half_width, p, {random(0.01, 0.4), random(0.01, 0.2), random(0.01, 0.3)});
        q.stress[0][p] = q.x[0][p] + 100 * q.x[1][p] + 1e4 * q.x[2][p];
        q.id[p] = static_cast<std::uint32_t>(p);
    }
    return q;
}
}  // namespace

TEST(Values, ComponentsByNumberAreThoseByName)
{
    Gradient<3> g{1, 2, 3, 4, 5, 6, 7, 8, 9};
    EXPECT_EQ((&component<0, 0>(g)), &g.xx);
    EXPECT_EQ((&component<0, 1>(g)), &g.xy);
    EXPECT_EQ((&component<0, 2>(g)), &g.xz);
    EXPECT_EQ((&component<1, 0>(g)), &g.yx);
    EXPECT_EQ((&component<1, 2>(g)), &g.yz);
    EXPECT_EQ((&component<2, 0>(g)), &g.zx);
    EXPECT_EQ((&component<2, 1>(g)), &g.zy);
    EXPECT_EQ((&component<2, 2>(g)), &g.zz);
    EXPECT_EQ(g.trace(), 6);
    SymTensor<3> s{1, 2, 3, 4, 5, 6};
    EXPECT_EQ((&component<1, 2>(s)), &s.yz);
    EXPECT_EQ((&component<2, 1>(s)), &s.yz);
    EXPECT_EQ((&component<2, 0>(s)), &s.zx);
    EXPECT_EQ((&component<1, 0>(s)), &s.xy);
    EXPECT_EQ((&component<2, 2>(s)), &s.zz);
    Gradient<2> f{1, 2, 3, 4};
    EXPECT_EQ((&component<0, 1>(f)), &f.xy);
    EXPECT_EQ((&component<1, 0>(f)), &f.yx);
    const Gradient<3> twice = g + g - 2.0 * g;
    unrolled<9>([&](auto k) { EXPECT_EQ(component<k>(twice), 0) << k; });
}

TEST(Lattice3, IndicesInvertAndPartsAreNumbered)
{
    for (const Lattice<3>& all : {lattice, with_numbers_for(without_numbers(lattice), CellBox<3>{{1, 1, 2}, {3, 2, 4}})})
        for_each_index(all.numbered.low + testbed::all<3>(-1), all.numbered.high + testbed::all<3>(2),
                       [&](const Index<3>& at)
                       {
                           ASSERT_TRUE(all.has_node(at) && all.has_cell(at));
                           EXPECT_LT(all.node(at), all.nodes());
                           EXPECT_LT(all.cell(at), all.cells());
                           EXPECT_EQ(all.node_index(all.node(at)), at);
                           EXPECT_EQ(all.cell_index(all.cell(at)), at);
                           EXPECT_DOUBLE_EQ(all.node_position(all.node(at))[2], 0.5 + 0.5 * at[2]);
                       });
    Lattice<3> part{{0, 0, 0}, 1.0, {100, 80, 60}}, other = part;
    part.numbered = {{10, 20, 30}, {14, 22, 33}};
    other.numbered = {{12, 17, 31}, {30, 21, 40}};
    EXPECT_EQ(part.nodes(), 7u * 5u * 6u);
    EXPECT_EQ(part.cells(), 8u * 6u * 7u);
    EXPECT_EQ(part.node({11, 20, 30}) + part.node_stride(2), part.node({11, 20, 31}));
    EXPECT_EQ(part.cell({11, 20, 30}) + part.cell_stride(), part.cell({11, 21, 30}));
    const auto mark = [](const Index<3>& at) { return at[0] + 100 * at[1] + 1e4 * at[2]; };
    Nodes<3> nodes(part.nodes());
    std::size_t last = 0;
    for_each_index(part.numbered.low + all<3>(-1), part.numbered.high + all<3>(2),
                   [&](const Index<3>& at)
                   {
                       EXPECT_EQ(part.node(at), last++);  // row by row
                       set(nodes.v, part.node(at), {mark(at), 2.0, -mark(at)});
                   });
    nodes.set_active({static_cast<std::uint32_t>(part.node({10, 20, 30})), static_cast<std::uint32_t>(part.node({13, 21, 32}))});
    nodes.renumber(part, other);
    EXPECT_EQ(nodes.active(), (std::vector<std::uint32_t>{static_cast<std::uint32_t>(other.node({13, 21, 32}))}));
    for_each_index(other.numbered.low + all<3>(-1), other.numbered.high + all<3>(2),
                   [&](const Index<3>& at) { EXPECT_EQ(nodes.v[2][other.node(at)], part.has_node(at) ? -mark(at) : 0); });
}

template <class T>
class Bins3 : public testing::Test
{
};
using Supports = testing::Types<PointSupport, DomainSupport, BSplineShape>;
TYPED_TEST_SUITE(Bins3, Supports);

/// Each point lies in the bin of its support's corner, bins stand in the order of cells, all fields move together, and a sort of what is
/// marked gives what a sort of all gives.
TYPED_TEST(Bins3, SortPoints)
{
    Points<3> q = random_points(300, 8), anew = random_points(300, 8);
    Bins<3> bins(lattice), other(lattice);
    std::vector<double> workspace;
    bins.rebuild<TypeParam>(q, workspace);
    other.rebuild<TypeParam>(anew, workspace);
    Random random(4);
    for (int round = 0; round < 4; ++round)
    {
        std::size_t next = 0;
        for (const Bin<3>& b : bins.list())
        {
            EXPECT_EQ(b.begin, next);
            next = b.end;
            for (std::size_t p = b.begin; p < b.end; ++p)
            {
                for (std::size_t d = 0; d < 3; ++d)
                {
                    const double half = TypeParam::has_box ? std::min(q.half_width[d][p], 0.25) : TypeParam::S == 3 ? 0.25 : 0;
                    EXPECT_EQ(b.at[d], std::floor((q.x[d][p] - half - lattice.origin[d]) / 0.5 + 1e-9));
                }
                EXPECT_DOUBLE_EQ(q.stress[0][p], q.x[0][p] + 100 * q.x[1][p] + 1e4 * q.x[2][p]);
            }
        }
        EXPECT_EQ(next, q.count);
        EXPECT_TRUE(std::is_sorted(bins.list().begin(), bins.list().end(), [](const auto& a, const auto& b) { return a.at < b.at; }));
        for (std::size_t b = 0; b < bins.list().size(); ++b)
        {
            other.mark(b);
            if (b % 4 != static_cast<std::size_t>(round))
                continue;
            bins.mark(b);
            for (std::size_t p = bins.list()[b].begin; p < bins.list()[b].end; ++p)
                for (Points<3>* both : {&q, &anew})
                {
                    both->x[2][p] = std::clamp(q.x[2][p] + 0.3 * (both == &q ? random(-1, 1) : 0), 0.6, 2.9);
                    both->stress[0][p] = q.x[0][p] + 100 * q.x[1][p] + 1e4 * q.x[2][p];
                }
        }
        EXPECT_EQ(bins.rebuild<TypeParam>(q, workspace), other.rebuild<TypeParam>(anew, workspace));
        EXPECT_TRUE(std::equal(q.id.data(), q.id.data() + q.count, anew.id.data()));
    }
    q.x[2][5] = 3.1;
    for (std::size_t b = 0; b < bins.list().size(); ++b)
        bins.mark(b);
    EXPECT_THROW(bins.rebuild<TypeParam>(q, workspace), Diverged);
}

/// Sums over blocks, against adding each block to a map.
TEST(Gather3, AddsTheBlocksOfEachNode)
{
    Points<3> q = random_points(200, 10);
    Bins<3> bins(lattice);
    std::vector<double> workspace;
    bins.rebuild<DomainSupport>(q, workspace);
    const Bins<3>* list = &bins;
    Gather gather(lattice.nodes());
    gather.rebuild<3, 3>({&list, 1}, [](const Index<3>& at) { return lattice.node(at); });
    std::vector<double> partial(gather.blocks());
    std::map<std::size_t, double> expected;
    std::size_t block = 0;
    for (const Bin<3>& bin : bins.list())
        for (int k = 0; k < 3; ++k)
            for (int j = 0; j < 3; ++j)
                for (int i = 0; i < 3; ++i, ++block)
                {
                    partial[block] = static_cast<double>(block);
                    expected[lattice.node({bin.at[0] + i, bin.at[1] + j, bin.at[2] + k})] += static_cast<double>(block);
                }
    ASSERT_EQ(block, gather.blocks());
    EXPECT_EQ(gather.active().size(), expected.size());
    gather.sum<1>(partial, [&](std::size_t n, const std::array<double, 1>& s) { EXPECT_DOUBLE_EQ(s[0], expected[n]); });
}

/// Gauss's theorem on a cube: exact for linear fields; nodal forces do the work of the stress for any displacement, and add up to none.
TEST(Cube, GradientAndForces)
{
    Random random(3);
    const double L = 0.7;
    for (int trial = 0; trial < 50; ++trial)
    {
        const Gradient<3> g = random_gradient(random);
        std::array<std::array<double, 8>, 3> linear, any;
        for (std::size_t k = 0; k < 8; ++k)
        {
            const Vec<3> u = times(g, {is_upper(k, 0) * L, is_upper(k, 1) * L, is_upper(k, 2) * L});
            for (std::size_t d = 0; d < 3; ++d)
            {
                linear[d][k] = 0.3 + u[d];
                any[d][k] = random(-1, 1);
            }
        }
        const Gradient<3> found = cell_gradient(linear, 1 / (4 * L)), mean = cell_gradient(any, 1 / (4 * L));
        SymTensor<3> s;
        unrolled<6>([&](auto k) { component<k>(s) = random(-1, 1); });
        double work = 0, inside = 0;
        Vec<3> sum{};
        unrolled<8>(
            [&](auto k)
            {
                const Vec<3> f = corner_force<k>(s, L * L / 4);
                for (std::size_t d = 0; d < 3; ++d)
                {
                    work += f[d] * any[d][k];
                    sum[d] += f[d];
                }
            });
        unrolled<3>([&](auto i) { unrolled<3>([&](auto j) { inside += component<i, j>(s) * component<i, j>(mean); }); });
        EXPECT_NEAR(work, -L * L * L * inside, 1e-13);
        unrolled<9>([&](auto k) { EXPECT_NEAR(component<k>(found), component<k>(g), 1e-13); });
        for (const double f : sum)
            EXPECT_NEAR(f, 0, 1e-14);
    }
}

/// LPFDM's cells and nodes: mass of the cells around a node, forces of a uniform stress only at the surface of the body.
TEST(Cube, NodesOfLpfdm)
{
    LpfdmGrid<3> grid{lattice};
    Points<3> q = random_points(2000, 5);
    Bins<3> bins(lattice);
    std::vector<double> workspace;
    bins.rebuild<PointSupport>(q, workspace);
    const Bins<3>* list = &bins;
    grid.rebuild<1>({&list, 1});
    std::vector<double> sums;
    for (std::size_t b = 0; b < bins.list().size(); ++b)
        sums.insert(sums.end(), {8.0, 1.0, 2.0, 3.0, -0.5, 0.25, 0.75});  // a mass of 8, and stresses times volume
    cell_averages(grid, sums);
    nodal_forces(grid);
    for (const auto n : grid.nodes.active())
    {
        int cells = 0;
        for (std::size_t k = 0; k < 8; ++k)
            cells += grid.cells.mass[grid.around(grid.first_cell(n), k)] > 0;
        EXPECT_DOUBLE_EQ(grid.nodes.mass[n], cells);
        for (const auto& f : grid.nodes.f)
            EXPECT_TRUE(cells < 8 || std::abs(f[n]) < 1e-13);
        set(grid.nodes.v, n, times({0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9}, grid.lattice.node_position(n)));
    }
    cell_gradients(grid, 2.0);
    for (const auto c : grid.gather.active())
    {
        EXPECT_NEAR(grid.cells.gradient_at(c).zx, 1.2, 1e-13);
        EXPECT_NEAR(grid.cells.gradient_at(c).xz, 1.8, 1e-13);
        EXPECT_DOUBLE_EQ(grid.cells.stress[3][c], -0.5 / 0.125);
    }
}

template <class T>
class Shape3 : public testing::Test
{
};
using Shapes = testing::Types<LinearShape, GimpShape, BSplineShape>;
TYPED_TEST_SUITE(Shape3, Shapes);

/// Shape functions add up to one and carry a linear field and its gradient exactly.
TYPED_TEST(Shape3, CarriesLinearFields)
{
    constexpr int S = TypeParam::S;
    Random random(6);
    Points<3> q = random_points(pack_size, 12);
    const Gradient<3> rate = random_gradient(random);
    VectorField<3> v;
    for (auto& component : v)
        component.resize(lattice.nodes());
    for (std::size_t n = 0; n < lattice.nodes(); ++n)
        set(v, n, times(rate, lattice.node_position(n)));
    for (int trial = 0; trial < 20; ++trial)
    {
        const Bin<3> bin{{2, 1, 2}, 0, pack_size};
        const BinFrame<3> frame(lattice, bin);
        for (std::size_t p = 0; p < pack_size; ++p)
            for (std::size_t d = 0; d < 3; ++d)
            {
                q.half_width[d][p] = random(0.01, 0.25);
                double half = 0;
                if constexpr (TypeParam::has_box)
                    half = q.half_width[d][p];
                else
                    half = TypeParam::half_width * 0.5;
                q.x[d][p] = lattice.origin[d] + 0.5 * (bin.at[d] + random(0, 0.999)) + half;
            }
        const Corner<3> c = frame.template corner<TypeParam>(q, 0, AllLanes{});
        const ShapeAt<TypeParam, 3> at(c, frame.scale);
        Pack unity(0.0);
        unrolled<block_size<S, 3>>([&](auto k) { unity += at.template value<k>(); });
        const NodalVelocity<S, 3> nodal(lattice, bin, v);
        const Vec<3, Pack> found = nodal.at(at);
        const Gradient<3, Pack> g = nodal.template gradient<PointStrain>(at, 0, 1.0);
        for (std::size_t p = 0; p < pack_size; ++p)
        {
            EXPECT_NEAR(unity[p], 1, 1e-13);
            const Vec<3> exact = times(rate, testbed::at(q.x, p));
            for (std::size_t d = 0; d < 3; ++d)
                EXPECT_NEAR(found[d][p], exact[d], 1e-12);
            unrolled<9>([&](auto k) { EXPECT_NEAR(component<k>(g)[p], component<k>(rate), 1e-12) << k; });
        }
    }
}

/// Shares of a box in eight cells are those of its volume.
TEST(DomainSupport3, SharesOfVolume)
{
    Corner<3> c;
    const Vec<3> a{0.8, 0.1, 0.7}, w{0.5, 0.4, 0.6};
    for (std::size_t d = 0; d < 3; ++d)
    {
        c.a[d] = Pack(a[d]);
        c.width[d] = Pack(w[d]);
    }
    const Weights<DomainSupport, 3> weights(c);
    unrolled<8>(
        [&](auto k)
        {
            double share = 1;
            for (std::size_t d = 0; d < 3; ++d)
            {
                const double beyond = std::max(a[d] + w[d] - 1, 0.0) / w[d];
                share *= is_upper(k, d) ? beyond : 1 - beyond;
            }
            EXPECT_NEAR(weights.template of<k>()[0], share, 1e-14) << k;
        });
    Points<3> q = random_points(pack_size, 3);
    EXPECT_DOUBLE_EQ(volume<DomainSupport>(q, 0, AllLanes{})[0], q.current_volume(0));
    EXPECT_DOUBLE_EQ(q.current_volume(0), 8 * q.half_width[0][0] * q.half_width[1][0] * q.half_width[2][0]);
    stretch<DomainSupport>(q, 0, AllLanes{}, StrainIncrement{0},
                           Gradient<3, Pack>{Pack(0.0), Pack(0.0), Pack(0.5), {}, {}, {}, {}, {}, {}});
    EXPECT_DOUBLE_EQ(q.half_width[2][0], 1.5 * random_points(pack_size, 3).half_width[2][0]);
}
