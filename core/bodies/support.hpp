#pragma once
/// The support of a point: which S x S (x S) cells or nodes it touches, and with which weights. In each direction the support begins
/// at `a` = (corner - bin) / L in [0, 1); a point with a box has `width` = box / L <= 1, others have none, but all the same
/// `half_width` [cells] between the corner and the point.

#include "core/base/simd.hpp"
#include "core/bodies/body.hpp"
#include "core/lattice/kinematics.hpp"

namespace testbed
{
/// A point belongs to one cell.
struct PointSupport
{
    static constexpr int S = 1;
    static constexpr bool has_box = false;
    static constexpr double half_width = 0;

    template <class T>
    TESTBED_INLINE static std::array<T, S> weights(T, T)
    {
        return {T(1.0)};
    }
};

/// Share of a point's box in each of the two cells that it may overlap.
struct DomainSupport
{
    static constexpr int S = 2;
    static constexpr bool has_box = true;

    template <class T>
    TESTBED_INLINE static std::array<T, S> weights(T a, T width)
    {
        return weights_by(a, width, T(1.0) / width);
    }
    template <class T>
    TESTBED_INLINE static std::array<T, S> weights_by(T a, T width, T inverse)
    {
        const T high = above(a + width - T(1.0), bin_tolerance) * inverse;
        return {T(1.0) - high, high};
    }
};

/// Where the supports of a pack of points begin in their bin, and how wide they are [cells].
template <int dim, AnyPack Pack = testbed::Pack>
struct Corner
{
    Vec<dim, Pack> a, width;
};

/// 1 over each width by one division: divisions cost as much as all else.
template <int dim, AnyPack Pack>
TESTBED_INLINE inline Vec<dim, Pack> inverse_widths(const Corner<dim, Pack>& c)
{
    Pack all = c.width[0];
    unrolled<dim - 1>([&](auto d) TESTBED_INLINE { all *= c.width[d + 1]; });
    const Pack inverse = Pack(1.0) / all;
    Vec<dim, Pack> one_by_one;
    unrolled<dim>(
        [&](auto d) TESTBED_INLINE
        {
            one_by_one[d] = inverse;
            unrolled<dim>(
                [&](auto other) TESTBED_INLINE
                {
                    if constexpr (other != d)
                        one_by_one[d] *= c.width[other];
                });
        });
    return one_by_one;
}

/// The product of one factor per direction, those of block k of S^dim, row by row.
template <int S, std::size_t k, class T, std::size_t dim>
TESTBED_INLINE inline T block_product(const std::array<std::array<T, S>, dim>& factors)
{
    constexpr auto at = block_index<S, dim>(k);
    T product = factors[0][at[0]];
    unrolled<dim - 1>([&](auto d) TESTBED_INLINE { product *= factors[d + 1][at[d + 1]]; });
    return product;
}

/// Weights in each direction.
template <class Support, int dim, AnyPack Pack = testbed::Pack>
struct Weights
{
    static constexpr int S = Support::S;
    std::array<std::array<Pack, S>, dim> along;

    TESTBED_INLINE explicit Weights(const Corner<dim, Pack>& c)
    {
        if constexpr (Support::has_box)
        {
            const auto inverse = inverse_widths(c);
            unrolled<dim>([&](auto d) TESTBED_INLINE { along[d] = Support::weights_by(c.a[d], c.width[d], inverse[d]); });
        }
        else
            unrolled<dim>([&](auto d) TESTBED_INLINE { along[d] = Support::weights(c.a[d], c.width[d]); });
    }
    /// Of the cell or node with number k in the bin's block.
    template <std::size_t k>
    TESTBED_INLINE Pack of() const
    {
        return block_product<S, k>(along);
    }
};

/// The middles of a pack of boxes in their bin, and their half widths [cells]; points without a box have none.
template <int dim, AnyPack Pack = testbed::Pack>
struct Box
{
    Vec<dim, Pack> x, half;
};

/// Maps points to the coordinates of their bin, from its corner or from another place in it.
template <int dim>
struct BinFrame
{
    const Lattice<dim>& lattice;
    const Bin<dim>& bin;
    double scale;   ///< 1/L
    Vec<dim> from;  ///< bin corner, or that place, in cells from the coordinate origin

    BinFrame(const Lattice<dim>& in, const Bin<dim>& of, const Vec<dim>& place = {}) : lattice(in), bin(of), scale(lattice.cells_per_length)
    {
        for (int d = 0; d < dim; ++d)
            from[d] = lattice.origin[d] * scale + bin.at[d] + place[d];
    }

    template <class Support, class Lanes>
    TESTBED_INLINE auto box(const Points<dim>& q, std::size_t p, const Lanes& lanes, const Vec<dim, typename Lanes::Pack>& x) const
    {
        using Pack = typename Lanes::Pack;
        Box<dim, Pack> b;
        unrolled<dim>(
            [&](auto d) TESTBED_INLINE
            {
                b.x[d] = x[d] * Pack(scale) - Pack(from[d]);
                if constexpr (Support::has_box)
                    b.half[d] = min(lanes.load(&q.half_width[d][p]) * Pack(scale), Pack(0.5));
                else
                    b.half[d] = Pack(0.0);
            });
        return b;
    }
    template <class Support, class Lanes>
    TESTBED_INLINE auto corner(const Points<dim>& q, std::size_t p, const Lanes& lanes, const Vec<dim, typename Lanes::Pack>& x) const
    {
        using Pack = typename Lanes::Pack;
        const Box<dim, Pack> b = box<Support>(q, p, lanes, x);
        Corner<dim, Pack> c;
        unrolled<dim>(
            [&](auto d) TESTBED_INLINE
            {
                if constexpr (Support::has_box)
                    c.a[d] = b.x[d] - b.half[d];
                else
                    c.a[d] = b.x[d] - Pack(Support::half_width);
                c.width[d] = b.half[d] + b.half[d];
            });
        return c;
    }
    template <class Support, class Lanes>
    TESTBED_INLINE auto corner(const Points<dim>& q, std::size_t p, const Lanes& lanes) const
    {
        return corner<Support>(q, p, lanes, load(q.x, p, lanes));
    }
    /// Which of the points, with their support at c, may no longer belong to the bin: the support begins in another one, the point has
    /// left the lattice or is turned inside out.
    template <class Support, class Lanes>
    TESTBED_INLINE auto left(const Points<dim>& q, std::size_t p, const Lanes& lanes, const Corner<dim, typename Lanes::Pack>& c) const
    {
        using Pack = typename Lanes::Pack;
        typename Lanes::Mask in(true);
        if constexpr (!Support::has_box)
            in = lanes.load(&q.volume[p]) > Pack(0.0);
        unrolled<dim>(
            [&](auto d) TESTBED_INLINE
            {
                in = in && is_in_bin(c.a[d]);
                if constexpr (Support::has_box)
                    in = in && lanes.load(&q.half_width[d][p]) > Pack(0.0);
                else if constexpr (Support::half_width > 0)  // the edge of the lattice lies in the middle of a bin
                    in = in && is_inside(c.a[d] + Pack(Support::half_width + bin.at[d]), lattice.size[d]);
            });
        return lanes.keep(!in);
    }

private:
    /// A coordinate in cells, of n.
    template <AnyPack Pack>
    TESTBED_INLINE static auto is_inside(const Pack& v, int n)
    {
        return v > Pack(bin_tolerance) && v < Pack(n - bin_tolerance);
    }
};

/// Volume of a pack of points [m^2, in three dimensions m^3].
template <class Support, int dim, class Lanes>
TESTBED_INLINE inline typename Lanes::Pack volume(const Points<dim>& q, std::size_t p, const Lanes& lanes)
{
    using Pack = typename Lanes::Pack;
    if constexpr (Support::has_box)
    {
        Pack v(1 << dim);
        unrolled<dim>([&](auto d) TESTBED_INLINE { v *= lanes.load(&q.half_width[d][p]); });
        return v;
    }
    else
        return lanes.load(&q.volume[p]);
}

/// Volume, or box, of a pack of points after the strain increment g.
template <class Support, int dim, class Lanes>
TESTBED_INLINE inline void stretch(Points<dim>& q, std::size_t p, const Lanes& lanes, const StrainIncrement& increment,
                                   const Gradient<dim, typename Lanes::Pack>& g)
{
    if constexpr (Support::has_box)
        unrolled<dim>([&](auto d) TESTBED_INLINE
                      { lanes.store(&q.half_width[d][p], lanes.load(&q.half_width[d][p]) * increment.stretch(component<d, d>(g))); });
    else
        lanes.store(&q.volume[p], lanes.load(&q.volume[p]) * increment.stretch(g.trace()));
}

/// Adds Q quantities of the points of each bin, weighted, to the bin's S^dim blocks.
/// @param quantities (p, lanes) -> array of Q packs @param partial S^dim Q numbers for each bin from `first_bin` on
template <class Support, std::size_t Q, int dim, class Quantities>
void spread(const Lattice<dim>& lattice, const Body& body, std::size_t first_bin, std::vector<double>& partial, Quantities&& quantities)
{
    constexpr std::size_t blocks = block_size<Support::S, dim>;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     std::array<Pack, blocks * Q> total;
                     set_zero(total);
                     const BinFrame frame(lattice, bins[b]);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Weights<Support, dim> weights(frame.template corner<Support>(body.points, p, lanes));
                                       const std::array<Pack, Q> value = quantities(p, lanes);
                                       unrolled<blocks>(
                                           [&](auto k)
                                           {
                                               const Pack w = lanes.keep(weights.template of<k>());
                                               unrolled<Q>([&](auto n) { total[k * Q + n] += w * value[n]; });
                                           });
                                   });
                     sum(total, &partial[(first_bin + b) * blocks * Q]);
                 });
}

/// The transpose: each point takes the weighted values of its S^dim cells or nodes.
/// @param number Index<dim> -> number of the cell or node @param take (p, lanes, value)
template <class Support, int dim, class Number, class Take>
void interpolate(const Lattice<dim>& lattice, const Body& body, const std::vector<double>& values, Number&& number, Take&& take)
{
    constexpr std::size_t blocks = block_size<Support::S, dim>;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     std::array<double, blocks> value;
                     for (std::size_t k = 0; k < blocks; ++k)
                         value[k] = values[number(bins[b].at + block_index<Support::S, dim>(static_cast<int>(k)))];
                     const BinFrame frame(lattice, bins[b]);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Weights<Support, dim> weights(frame.template corner<Support>(body.points, p, lanes));
                                       Pack sum(0.0);
                                       unrolled<blocks>([&](auto k) { sum += weights.template of<k>() * Pack(value[k]); });
                                       take(p, lanes, sum);
                                   });
                 });
}
}  // namespace testbed
