#pragma once
/// Packs of points. A kernel is written once as a function of (offset, lanes) and is called for whole packs and for
/// the rest of a bin, where lanes masks what lies behind its end.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstring>
#include <experimental/simd>
#include <utility>

/// What a kernel consists of is inlined into it whole: one call left makes the compiler spill every vector register around it. Not
/// under the sanitizers, with which that takes minutes to compile.
#ifdef TESTBED_SANITIZE
#define TESTBED_INLINE
#define TESTBED_FLATTEN
#else
#define TESTBED_INLINE __attribute__((always_inline))
#define TESTBED_FLATTEN __attribute__((flatten))
#endif

namespace testbed
{
namespace stdx = std::experimental;
using Pack = stdx::native_simd<double>;
using Mask = Pack::mask_type;
inline constexpr std::size_t pack_size = Pack::size();
/// For the points of a bin that has no more: four of eight lanes work for nothing, and a store with a mask makes the next load wait.
using ShortPack = std::conditional_t<(pack_size > 4), stdx::simd<double, stdx::simd_abi::deduce_t<double, 4>>, Pack>;

template <class P>
concept AnyPack = std::same_as<P, Pack> || std::same_as<P, ShortPack>;

template <AnyPack P>
struct AllLanesOf
{
    using Pack = P;
    using Mask = typename P::mask_type;

    static Pack load(const double* from) { return Pack(from, stdx::element_aligned); }
    static void store(double* to, Pack v) { v.copy_to(to, stdx::element_aligned); }
    static Pack keep(Pack v) { return v; }
    static Mask keep(Mask m) { return m; }
    static bool any(Mask m) { return stdx::any_of(m); }
};
using AllLanes = AllLanesOf<Pack>;

template <AnyPack P>
class SomeLanesOf
{
public:
    using Pack = P;
    using Mask = typename P::mask_type;

    explicit SomeLanesOf(std::size_t count) : mask_(Pack([](auto i) { return static_cast<double>(i); }) < Pack(static_cast<double>(count)))
    {
    }
    /// Lanes behind the end hold 1, which no kernel stumbles over.
    Pack load(const double* from) const
    {
        Pack v(1.0);
        stdx::where(mask_, v).copy_from(from, stdx::element_aligned);
        return v;
    }
    void store(double* to, Pack v) const { stdx::where(mask_, v).copy_to(to, stdx::element_aligned); }
    Pack keep(Pack v) const
    {
        stdx::where(!mask_, v) = Pack(0.0);
        return v;
    }
    Mask keep(Mask m) const { return m && mask_; }
    bool any(Mask m) const { return stdx::any_of(m && mask_); }

private:
    Mask mask_;
};
using SomeLanes = SomeLanesOf<Pack>;

/// f(k) for k = 0..N-1, each a constant: an array of packs whose places are constants from the start lives in registers; of one that a
/// loop runs over the compiler keeps a copy in memory, which costs more than the sums.
template <std::size_t N, class F>
TESTBED_INLINE inline void unrolled(F&& f)
{
    [&]<std::size_t... k>(std::index_sequence<k...>) TESTBED_INLINE
    {
        (f(std::integral_constant<std::size_t, k>{}), ...);
    }
    (std::make_index_sequence<N>{});
}

/// f(0) + f(1) + ... + f(N-1).
template <std::size_t N, class F>
TESTBED_INLINE inline auto total(F&& f)
{
    auto sum = f(std::integral_constant<std::size_t, 0>{});
    unrolled<N - 1>([&](auto k) TESTBED_INLINE { sum += f(std::integral_constant<std::size_t, k + 1>{}); });
    return sum;
}

/// Sets packs to zero one by one: a value-initialised array of them becomes a string instruction.
template <AnyPack P, std::size_t N>
TESTBED_INLINE inline void set_zero(std::array<P, N>& packs)
{
    unrolled<N>([&](auto k) TESTBED_INLINE { packs[k] = P(0.0); });
}

/// Calls kernel(offset, lanes) for the points [begin, end).
template <AnyPack P = Pack, class Kernel>
TESTBED_INLINE inline void for_each_pack(std::size_t begin, std::size_t end, Kernel&& kernel)
{
    std::size_t p = begin;
    for (; p + P::size() <= end; p += P::size())
        kernel(p, AllLanesOf<P>{});
    if (p < end)
        kernel(p, SomeLanesOf<P>(end - p));
}

/// f(P{}) with the packs that so many points fill.
template <class F>
TESTBED_INLINE inline auto with_packs_for(std::size_t points, F&& f)
{
    if constexpr (!std::same_as<ShortPack, Pack>)
        if (points <= ShortPack::size())
            return f(ShortPack(0.0));
    return f(Pack(0.0));
}

template <AnyPack P>
TESTBED_INLINE inline double sum(const P& v)
{
    return stdx::reduce(v);
}

namespace detail
{
template <AnyPack P>
struct VectorOf
{
    using type [[gnu::vector_size(sizeof(P))]] = double;
};
template <AnyPack P>
using Vector = typename VectorOf<P>::type;

/// Neighbours added, with `zip` single lanes, (x0 + x1, y0 + y1, x2 + x3, ...), else pairs of lanes, first those of x, then those of y.
template <AnyPack P, bool zip, std::size_t... k>
TESTBED_INLINE inline Vector<P> fold(Vector<P> x, Vector<P> y, std::index_sequence<k...>)
{
    constexpr std::size_t W = P::size();
    if constexpr (zip)
        return __builtin_shufflevector(x, y, (k % 2 == 0 ? k : W + k - 1)...) +
               __builtin_shufflevector(x, y, (k % 2 == 0 ? k + 1 : W + k)...);
    else
        return __builtin_shufflevector(x, y, (k / 2 * 4 + k % 2)...) + __builtin_shufflevector(x, y, (k / 2 * 4 + 2 + k % 2)...);
}

/// The sums of packs [first, first + count) by the lanes that they come to; count is a power of two, packs from N on are zero.
template <std::size_t first, std::size_t count, AnyPack P, std::size_t N>
TESTBED_INLINE inline Vector<P> folded_sums(const std::array<P, N>& packs)
{
    if constexpr (first >= N)
        return Vector<P>{};
    else if constexpr (count == 1)
        return std::bit_cast<Vector<P>>(packs[first]);
    else
        return fold<P, count == 2>(folded_sums<first, count / 2>(packs), folded_sums<first + count / 2, count / 2>(packs),
                                   std::make_index_sequence<P::size()>{});
}
}  // namespace detail

/// The sums of N packs, to[0..N). Folded together: a fraction of the instructions of N sums.
template <std::size_t first = 0, AnyPack P, std::size_t N>
TESTBED_INLINE inline void sum(const std::array<P, N>& packs, double* to)
{
    constexpr std::size_t W = P::size();
    const detail::Vector<P> sums = detail::folded_sums<first, W>(packs);
    std::memcpy(to + first, &sums, std::min(W, N - first) * sizeof(double));
    if constexpr (first + W < N)
        sum<first + W>(packs, to);
}
/// The larger one; with NaN either.
template <class T, class Abi>
requires AnyPack<stdx::simd<T, Abi>> TESTBED_INLINE inline stdx::simd<T, Abi> max(const stdx::simd<T, Abi>& a, const stdx::simd<T, Abi>& b)
{
    return stdx::max(a, b);
}
/// The smaller one; with NaN either.
template <class T, class Abi>
requires AnyPack<stdx::simd<T, Abi>> TESTBED_INLINE inline stdx::simd<T, Abi> min(const stdx::simd<T, Abi>& a, const stdx::simd<T, Abi>& b)
{
    return stdx::min(a, b);
}
TESTBED_INLINE inline double max(double a, double b)
{
    return a > b ? a : b;
}
TESTBED_INLINE inline double min(double a, double b)
{
    return a < b ? a : b;
}

template <AnyPack P>
TESTBED_INLINE inline P select(const typename P::mask_type& mask, const P& a, P b)
{
    stdx::where(mask, b) = a;
    return b;
}

TESTBED_INLINE inline double select(bool mask, double a, double b)
{
    return mask ? a : b;
}

/// v where it is larger than the threshold, else zero.
template <AnyPack P>
TESTBED_INLINE inline P above(P v, double threshold)
{
    stdx::where(v <= P(threshold), v) = P(0.0);
    return v;
}
TESTBED_INLINE inline double above(double v, double threshold)
{
    return v > threshold ? v : 0.0;
}
}  // namespace testbed
