#include "core/lattice/gather.hpp"
#include "lpfdm/equations.hpp"
#include "mpm/shapes/bspline.hpp"
#include "tests/random.hpp"

#include <gtest/gtest.h>
#include <map>

using namespace testbed;

namespace
{
const Lattice<2> lattice{{-1.0, 2.0}, 0.5, {6, 4}};

Points<2> random_points(std::size_t n, unsigned seed)
{
    test::Random random(seed);
    Points<2> q;
    q.count = n;
    for (Field<double>* f : {&q.x[0], &q.x[1], &q.stress[0], &q.half_width[0], &q.half_width[1]})
        f->activate(n, 0.05);
    q.id.activate(n);
    for (std::size_t p = 0; p < n; ++p)
    {
        q.x[0][p] = random(-0.9, 1.9);
        q.x[1][p] = random(2.1, 3.9);
        q.stress[0][p] = q.x[0][p] + 100 * q.x[1][p];
        q.half_width[0][p] = random(0.01, 0.4);  // some are wider than a cell
        q.half_width[1][p] = random(0.01, 0.2);
        q.id[p] = static_cast<std::uint32_t>(p);
    }
    return q;
}
}  // namespace

template <class T>
class BinsTest : public testing::Test
{
};
using Supports = testing::Types<PointSupport, DomainSupport, BSplineShape>;
TYPED_TEST_SUITE(BinsTest, Supports);

/// Each point lies in the bin of its support's corner, all fields move together, none is lost, and a second sort changes nothing.
TYPED_TEST(BinsTest, SortsPoints)
{
    Points<2> q = random_points(500, 8);
    Bins<2> bins(lattice);
    std::vector<double> workspace;
    bins.rebuild<TypeParam>(q, workspace);
    std::vector<bool> seen(q.count, false);
    std::size_t next = 0;
    for (const Bin<2>& b : bins.list())
    {
        EXPECT_EQ(b.begin, next);
        EXPECT_GT(b.end, b.begin);
        next = b.end;
        for (std::size_t p = b.begin; p < b.end; ++p)
        {
            const double h = std::is_same_v<TypeParam, BSplineShape> ? 0.25 : 0;
            const double hx = TypeParam::has_box ? std::min(q.half_width[0][p], 0.25) : h;
            const double hy = TypeParam::has_box ? std::min(q.half_width[1][p], 0.25) : h;
            EXPECT_EQ(b.at[0], std::floor((q.x[0][p] - hx + 1) / 0.5));
            EXPECT_EQ(b.at[1], std::floor((q.x[1][p] - hy - 2) / 0.5));
            EXPECT_DOUBLE_EQ(q.stress[0][p], q.x[0][p] + 100 * q.x[1][p]);
            EXPECT_FALSE(seen[q.id[p]]);
            seen[q.id[p]] = true;
        }
    }
    EXPECT_EQ(next, q.count);
    const std::vector<std::uint32_t> before(q.id.data(), q.id.data() + q.count);
    for (std::size_t b = 0; b < bins.list().size(); ++b)
        bins.mark(b);
    bins.rebuild<TypeParam>(q, workspace);
    EXPECT_TRUE(std::equal(before.begin(), before.end(), q.id.data()));
}

/// A sort of the marked bins alone gives the order of a sort of all, by cell.
TYPED_TEST(BinsTest, SortsWhatIsMarked)
{
    Points<2> some = random_points(30, 8), all = random_points(30, 8);  // few, so that bins come and go
    Bins<2> bins(lattice), other(lattice);
    std::vector<double> workspace;
    bins.rebuild<TypeParam>(some, workspace);
    other.rebuild<TypeParam>(all, workspace);
    test::Random random(21);
    for (int round = 0; round < 5; ++round)
    {
        for (std::size_t b = 0; b < bins.list().size(); ++b)
        {
            other.mark(b);
            if (b % 3 != static_cast<std::size_t>(round % 3))
                continue;
            bins.mark(b);
            for (std::size_t p = bins.list()[b].begin; p < bins.list()[b].end; ++p)
            {
                some.x[0][p] = all.x[0][p] = random(-0.9, 1.9);
                some.x[1][p] = all.x[1][p] = random(2.1, 3.9);
            }
        }
        EXPECT_EQ(bins.rebuild<TypeParam>(some, workspace), other.rebuild<TypeParam>(all, workspace));
        ASSERT_EQ(bins.list().size(), other.list().size());
        EXPECT_TRUE(std::is_sorted(bins.list().begin(), bins.list().end(),
                                   [](const Bin<2>& a, const Bin<2>& b) { return lattice.cell(a.at) < lattice.cell(b.at); }));
        for (std::size_t b = 0; b < bins.list().size(); ++b)
            EXPECT_EQ(bins.list()[b].end, other.list()[b].end);
        EXPECT_TRUE(std::equal(some.id.data(), some.id.data() + some.count, all.id.data()));
        EXPECT_TRUE(std::equal(some.x[0].data(), some.x[0].data() + some.count, all.x[0].data()));
    }
}

/// Sums taken over from step to step are those of all points anew, whatever points do: rest, go to the next bin, jump, leave bins empty and
/// fill them again. A list of bins that stayed has the same cells.
TYPED_TEST(BinsTest, SumsFollow)
{
    using Sums = CellSums<std::conditional_t<TypeParam::has_box, DomainSupport, PointSupport>>;
    using Support = std::conditional_t<TypeParam::has_box, DomainSupport, PointSupport>;
    test::Random random(31);
    for (const std::size_t n : {1u, 7u, 60u, 600u})
    {
        std::vector<Body> bodies;
        for (unsigned b = 0; b < 2; ++b)
        {
            Points<2> q = random_points(n, 40 + b);
            for (Field<double>* f : {&q.stress[1], &q.stress[2], &q.volume})
                f->activate(n, 2.0 + b);
            q.mass = 1;
            bodies.push_back({"body", std::move(q), Material{}, Bins(lattice)});
        }
        std::vector<double> workspace;
        BinSums<Support, Sums> sums;
        for (int round = 0; round < 60; ++round)
        {
            bool others = false;
            for (Body& body : bodies)
            {
                const auto before = body.bins.list();
                const bool other = body.bins.template rebuild<Support>(body.points, workspace);
                EXPECT_NE(other, std::equal(before.begin(), before.end(), body.bins.list().begin(), body.bins.list().end(),
                                            [](const Bin<2>& a, const Bin<2>& b) { return a.at == b.at; }));
                others |= other;
            }
            others ? sums.update(lattice, bodies) : sums.update_changed(lattice, bodies);
            BinSums<Support, Sums> anew;
            anew.update(lattice, bodies);
            ASSERT_EQ(sums.all(), anew.all()) << n << ' ' << round;
            for (Body& body : bodies)
                for (std::size_t b = 0; b < body.bins.list().size(); ++b)
                    for (std::size_t p = body.bins.list()[b].begin; p < body.bins.list()[b].end; ++p)
                    {
                        const double chance = random(0, 1);
                        if (chance > (round % 3 == 0 ? 0.02 : 0.2))
                            continue;
                        body.bins.mark(b);
                        body.points.x[0][p] =
                            chance < 0.01 ? random(-0.9, 1.9) : std::clamp(body.points.x[0][p] + random(-0.3, 0.3), -0.9, 1.9);
                        body.points.x[1][p] =
                            chance < 0.01 ? random(2.1, 3.9) : std::clamp(body.points.x[1][p] + random(-0.3, 0.3), 2.1, 3.9);
                    }
        }
    }
}

TEST(Bins, RefusePointsOutsideAndNotFinite)
{
    Bins<2> bins(lattice);
    std::vector<double> workspace;
    for (const double x : {-1.01, 2.01, std::nan(""), 1e300, -1e300})
    {
        Points<2> q = random_points(10, 9);
        q.x[0][4] = x;
        EXPECT_THROW(bins.rebuild<PointSupport>(q, workspace), Diverged) << x;
    }
    Points<2> turned = random_points(10, 9);
    turned.volume.activate(10, 1.0);
    turned.volume[4] = -1e-9;  // turned inside out
    EXPECT_THROW(bins.rebuild<PointSupport>(turned, workspace), Diverged);
    Points<2> q = random_points(10, 9);
    q.half_width[1][4] = -0.1;  // an inverted box
    EXPECT_THROW(bins.rebuild<DomainSupport>(q, workspace), Diverged);
    Points<2> in = random_points(10, 9);
    bins.rebuild<PointSupport>(in, workspace);  // as if nothing had been
    Bins<2> fresh(lattice);
    Points<2> same = random_points(10, 9);
    fresh.rebuild<PointSupport>(same, workspace);
    EXPECT_TRUE(std::equal(in.id.data(), in.id.data() + in.count, same.id.data()));
    EXPECT_EQ(bins.list().size(), fresh.list().size());
}

/// Sums over blocks, against adding each block to a map.
TEST(Gather, AddsTheBlocksOfEachNode)
{
    Points<2> a = random_points(200, 10), b = random_points(50, 11);
    Bins<2> bins_a(lattice), bins_b(lattice);
    std::vector<double> workspace;
    bins_a.rebuild<DomainSupport>(a, workspace);
    bins_b.rebuild<DomainSupport>(b, workspace);
    Gather gather(lattice.nodes());
    const std::vector<const Bins<2>*> all{&bins_a, &bins_b};
    const auto node = [](const Index<2>& at) { return lattice.node(at); };
    for (int twice = 0; twice < 2; ++twice)
        gather.rebuild<3, 2>(all, node);
    std::vector<double> partial(gather.blocks() * 2);
    std::map<std::size_t, double> expected;
    std::size_t block = 0;
    for (const Bins<2>* bins : all)
        for (const Bin<2>& bin : bins->list())
            for (int k = 0; k < 9; ++k, ++block)
            {
                partial[2 * block] = static_cast<double>(block);
                partial[2 * block + 1] = 1;
                expected[node({bin.at[0] + k % 3, bin.at[1] + k / 3})] += static_cast<double>(block);
            }
    ASSERT_EQ(block, gather.blocks());
    EXPECT_EQ(gather.active().size(), expected.size());
    EXPECT_TRUE(std::is_sorted(gather.active().begin(), gather.active().end()));
    gather.sum<2>(partial, [&](std::size_t n, const std::array<double, 2>& s) { EXPECT_DOUBLE_EQ(s[0], expected[n]); });
}

TEST(Lattice, IndicesInvert)
{
    for (int j = -1; j <= lattice.size[1] + 1; ++j)
        for (int i = -1; i <= lattice.size[0] + 1; ++i)
        {
            EXPECT_EQ(lattice.node_index(lattice.node({i, j})), (Index<2>{i, j}));
            EXPECT_LT(lattice.node({i, j}), lattice.nodes());
            EXPECT_EQ(lattice.cell_index(lattice.cell({i, j})), (Index<2>{i, j}));
            EXPECT_LT(lattice.cell({i, j}), lattice.cells());
        }
    EXPECT_DOUBLE_EQ(lattice.node_position(lattice.node({2, 3}))[1], 3.5);
}

/// Numbers of a part of the lattice: with its rings each node has one of its own, and values keep their nodes on the way to other numbers.
TEST(Lattice, NumbersAPart)
{
    Lattice<2> part{{0, 0}, 1.0, {100, 80}}, other = part;
    part.numbered = {{10, 20}, {14, 22}};
    other.numbered = {{12, 17}, {30, 21}};
    EXPECT_EQ(part.nodes(), 7u * 5u);
    EXPECT_EQ(part.cells(), 8u * 6u);
    std::vector<double> values(part.nodes());
    for (int j = 19; j <= 23; ++j)
        for (int i = 9; i <= 15; ++i)
        {
            ASSERT_TRUE(part.has_node({i, j}));
            const std::size_t n = part.node({i, j});
            EXPECT_EQ(part.node_index(n), (Index<2>{i, j}));
            EXPECT_EQ(part.node_position(n), (Vec<2>{1.0 * i, 1.0 * j}));
            EXPECT_EQ(part.cell_index(part.cell({i, j})), (Index<2>{i, j}));
            values[n] = 100 * i + j;
        }
    for (const auto& [i, j] : {std::pair{8, 20}, {16, 20}, {12, 18}, {12, 24}})
        EXPECT_FALSE(part.has_node({i, j}));
    renumber(values, part, other);
    ASSERT_EQ(values.size(), other.nodes());
    for (int j = 16; j <= 22; ++j)
        for (int i = 11; i <= 31; ++i)
            EXPECT_EQ(values[other.node({i, j})], part.has_node({i, j}) ? 100 * i + j : 0);
    Nodes<2> nodes(part.nodes());
    nodes.set_active({static_cast<std::uint32_t>(part.node({10, 20})), static_cast<std::uint32_t>(part.node({13, 21}))});
    nodes.mass[part.node({13, 21})] = 5;
    const std::size_t version = nodes.version();
    nodes.renumber(part, other);
    EXPECT_GT(nodes.version(), version);
    EXPECT_EQ(nodes.active(), (std::vector<std::uint32_t>{static_cast<std::uint32_t>(other.node({13, 21}))}));
    EXPECT_EQ(nodes.mass[other.node({13, 21})], 5);
    Lattice<2> apart = part;
    apart.numbered = {{90, 70}, {92, 72}};
    std::vector<double> none(part.nodes(), 1.0);
    renumber(none, part, apart);
    EXPECT_EQ(none, std::vector<double>(apart.nodes(), 0.0));
}

/// All that bins touch has a number, at the edges of the lattice the rings, too; the numbers stay while they do.
TEST(Lattice, NumbersFollowTheBins)
{
    const Lattice<2> all{{0, 0}, 1.0, {200, 150}};
    Points<2> q = random_points(1, 3);
    const auto around = [&](const Lattice<2>& now, double x, double y)
    {
        Bins<2> bins(all);
        std::vector<double> workspace;
        q.x[0][0] = x;
        q.x[1][0] = y;
        bins.rebuild<BSplineShape>(q, workspace);
        const Bins<2>* list = &bins;
        const Lattice<2> lattice = with_numbers_for<3, 2>(now, {&list, 1});
        const Bin<2>& b = bins.list()[0];
        EXPECT_TRUE(lattice.has_node(b.at) && lattice.has_node({b.at[0] + 2, b.at[1] + 2})) << x << ' ' << y;
        return lattice.numbered;
    };
    Lattice<2> now = without_numbers(all);
    EXPECT_EQ(around(now, 0.2, 0.2), (CellBox<2>{{0, 0}, {18, 18}}));  // bins from -1 on
    now.numbered = around(now, 100.7, 70.7);
    EXPECT_EQ(now.numbered, (CellBox<2>{{100 - 16, 70 - 16}, {103 + 16, 73 + 16}}));
    EXPECT_EQ(around(now, 110.7, 60.7), now.numbered);
    for (const auto& [x, y] : {Vec<2>{83.7, 70.7}, {117.7, 70.7}, {100.7, 53.7}, {100.7, 87.7}})
        EXPECT_EQ(around(now, x, y), now.numbered) << x << ' ' << y;  // in its ring
    EXPECT_EQ(around(now, 82.7, 70.7), (CellBox<2>{{66, 54}, {101, 89}}));
    EXPECT_EQ(around(now, 118.7, 70.7), (CellBox<2>{{102, 54}, {137, 89}}));
    EXPECT_EQ(around(now, 100.7, 52.7), (CellBox<2>{{84, 36}, {119, 71}}));
    EXPECT_EQ(around(now, 100.7, 88.7), (CellBox<2>{{84, 72}, {119, 107}}));
    EXPECT_EQ(around(now, 0.2, 149.9), (CellBox<2>{{0, 133}, {18, 150}}));
    EXPECT_EQ(around(all, 199.9, 149.9), all.numbered);
}

TEST(OrderedSum, SameBitsForAnyThreads)
{
    test::Random random(12);
    std::vector<double> v(100000);
    for (double& x : v)
        x = random(-1, 1);
    const auto total = [&] { return ordered_sum<1>(v.size(), [&](std::size_t i) { return std::array<double, 1>{v[i]}; })[0]; };
    set_threads(1);
    const double one = total();
    set_threads(3);
    EXPECT_EQ(total(), one);
    set_threads(1);
    EXPECT_NEAR(one, std::accumulate(v.begin(), v.end(), 0.0), 1e-9);
}
