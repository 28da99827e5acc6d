#pragma once
/// The only place that knows OpenMP. Every loop gives the same bits for any number of threads: iterations are
/// independent, and sums are made in fixed chunks that are added in order.

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

/// For a small kernel of plain numbers: inlined into the loops of one and of more threads it would be compiled twice, and products and sums
/// might be joined in the one and not in the other.
#define TESTBED_NOINLINE __attribute__((noinline))

namespace testbed
{
namespace detail
{
inline int team = 1;
}
/// One thread unless asked for more: studies run many small cases side by side.
inline void set_threads(int n)
{
    detail::team = n;
}
inline int threads()
{
    return detail::team;
}

/// f(i) for i in [0, n); iterations must not write to the same place and must not throw.
/// @param worth_a_team fewer iterations than this are left to one thread
template <class F>
void parallel_for(std::size_t n, F&& f, std::size_t worth_a_team = 256)
{
    if (detail::team == 1 || n < worth_a_team)
    {
        for (std::size_t i = 0; i < n; ++i)
            f(i);
        return;
    }
#pragma omp parallel for schedule(static) num_threads(detail::team)
    for (std::size_t i = 0; i < n; ++i)
        f(i);
}

/// Sum of f(i), an array of K numbers, for i in [0, n), independent of the number of threads, which take `chunk` at a time.
template <std::size_t K, class F>
std::array<double, K> ordered_sum(std::size_t n, F&& f, std::size_t chunk = 4096)
{
    const std::size_t chunks = (n + chunk - 1) / chunk;
    std::vector<std::array<double, K>> partial(chunks);
#pragma omp parallel for schedule(static) num_threads(detail::team) if (chunks > 1)
    for (std::size_t c = 0; c < chunks; ++c)
    {
        std::array<double, K> s{};
        for (std::size_t i = c * chunk; i < std::min(n, (c + 1) * chunk); ++i)
        {
            const std::array<double, K> v = f(i);
            for (std::size_t k = 0; k < K; ++k)
                s[k] += v[k];
        }
        partial[c] = s;
    }
    std::array<double, K> total{};
    for (const auto& s : partial)
        for (std::size_t k = 0; k < K; ++k)
            total[k] += s[k];
    return total;
}

/// Largest f(i) for i in [0, n), 0 for none; a maximum does not depend on the order.
template <class F>
double parallel_max(std::size_t n, F&& f)
{
    double m = 0;
#pragma omp parallel for schedule(static) reduction(max : m) num_threads(detail::team) if (n > 4096)
    for (std::size_t i = 0; i < n; ++i)
        m = std::max(m, f(i));
    return m;
}
}  // namespace testbed
