#include "core/base/simd.hpp"

#include "tests/random.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
/// The folded sums of N packs of random whole numbers, whose sums are exact in any order; nothing behind them is written.
template <std::size_t N>
void check_sums()
{
    test::Random random(N);
    std::array<Pack, N> packs;
    std::array<double, N> expected{};
    for (std::size_t k = 0; k < N; ++k)
        for (std::size_t lane = 0; lane < pack_size; ++lane)
        {
            const double v = std::floor(random(-1e6, 1e6));
            packs[k][lane] = v;
            expected[k] += v;
        }
    std::array<double, N + 2> to;
    to.fill(-7);
    sum(packs, &to[1]);
    EXPECT_EQ(to.front(), -7) << N;
    EXPECT_EQ(to.back(), -7) << N;
    for (std::size_t k = 0; k < N; ++k)
        EXPECT_EQ(to[k + 1], expected[k]) << k << " of " << N;
}
}  // namespace

TEST(Packs, FoldedSums)
{
    [&]<std::size_t... n>(std::index_sequence<n...>)
    {
        (check_sums<n + 1>(), ...);
    }
    (std::make_index_sequence<24>{});
    check_sums<45>();
}

TEST(Packs, Select)
{
    const Pack a([](auto i) { return static_cast<double>(i); });
    const Pack chosen = select(a < Pack(1.0), Pack(5.0), a);
    for (std::size_t lane = 0; lane < pack_size; ++lane)
        EXPECT_EQ(chosen[lane], lane == 0 ? 5.0 : static_cast<double>(lane));
}
