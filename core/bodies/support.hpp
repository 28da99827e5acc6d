#pragma once
/// The support of a point: which S x S cells or nodes it touches, and with which weights. In each direction the support begins
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
struct Corner
{
    Pack ax, ay, wx, wy;
};

/// 1 over both widths by one division: divisions cost as much as all else.
TESTBED_INLINE inline std::array<Pack, 2> inverse_widths(const Corner& c)
{
    const Pack inverse = Pack(1.0) / (c.wx * c.wy);
    return {inverse * c.wy, inverse * c.wx};
}

/// Weights in both directions.
template <class Support>
struct Weights
{
    std::array<Pack, Support::S> x, y;

    TESTBED_INLINE explicit Weights(const Corner& c) : Weights(c, inverses(c)) {}

private:
    TESTBED_INLINE Weights(const Corner& c, const std::array<Pack, 2>& inverse)
        : x(along(c.ax, c.wx, inverse[0])),
          y(along(c.ay, c.wy, inverse[1]))
    {
    }
    TESTBED_INLINE static std::array<Pack, 2> inverses(const Corner& c)
    {
        if constexpr (Support::has_box)
            return inverse_widths(c);
        else
            return {c.wx, c.wy};  // not used
    }
    TESTBED_INLINE static std::array<Pack, Support::S> along(Pack a, Pack width, Pack inverse)
    {
        if constexpr (Support::has_box)
            return Support::weights_by(a, width, inverse);
        else
            return Support::weights(a, width);
    }
};

/// The middles of a pack of boxes in their bin, and their half widths [cells]; points without a box have none.
struct Box
{
    Pack x, y, hx, hy;
};

/// Maps points to the coordinates of their bin, from its corner or from another place in it.
struct BinFrame
{
    const Lattice& lattice;
    const Bin& bin;
    double scale, x0, y0;  ///< 1/L; bin corner, or that place, in cells from the coordinate origin

    BinFrame(const Lattice& in, const Bin& of, const Vec2& from = {0, 0})
        : lattice(in),
          bin(of),
          scale(lattice.cells_per_length),
          x0(lattice.origin[0] * scale + bin.i + from[0]),
          y0(lattice.origin[1] * scale + bin.j + from[1])
    {
    }

    template <class Support, class Lanes>
    TESTBED_INLINE Box box(const Points& q, std::size_t p, const Lanes& lanes, Pack x, Pack y) const
    {
        const Pack cx = x * Pack(scale) - Pack(x0), cy = y * Pack(scale) - Pack(y0);
        if constexpr (!Support::has_box)
            return {cx, cy, Pack(0.0), Pack(0.0)};
        else
            return {cx, cy, min(lanes.load(&q.half_x[p]) * Pack(scale), Pack(0.5)), min(lanes.load(&q.half_y[p]) * Pack(scale), Pack(0.5))};
    }
    template <class Support, class Lanes>
    TESTBED_INLINE Corner corner(const Points& q, std::size_t p, const Lanes& lanes, Pack x, Pack y) const
    {
        const Box b = box<Support>(q, p, lanes, x, y);
        if constexpr (!Support::has_box)
            return {b.x - Pack(Support::half_width), b.y - Pack(Support::half_width), Pack(0.0), Pack(0.0)};
        else
            return {b.x - b.hx, b.y - b.hy, b.hx + b.hx, b.hy + b.hy};
    }
    template <class Support, class Lanes>
    TESTBED_INLINE Corner corner(const Points& q, std::size_t p, const Lanes& lanes) const
    {
        return corner<Support>(q, p, lanes, lanes.load(&q.x[p]), lanes.load(&q.y[p]));
    }
    /// Which of the points, with their support at c, may no longer belong to the bin: the support begins in another one, the point has
    /// left the lattice or is turned inside out.
    template <class Support, class Lanes>
    TESTBED_INLINE Mask left(const Points& q, std::size_t p, const Lanes& lanes, const Corner& c) const
    {
        Mask in = is_in_bin(c.ax) && is_in_bin(c.ay);
        if constexpr (Support::has_box)
            in = in && lanes.load(&q.half_x[p]) > Pack(0.0) && lanes.load(&q.half_y[p]) > Pack(0.0);
        else
        {
            in = in && lanes.load(&q.volume[p]) > Pack(0.0);
            if constexpr (Support::half_width > 0)  // the edge of the lattice lies in the middle of a bin
                in = in && is_inside(c.ax + Pack(Support::half_width + bin.i), lattice.nx) &&
                     is_inside(c.ay + Pack(Support::half_width + bin.j), lattice.ny);
        }
        return lanes.keep(!in);
    }

private:
    /// A coordinate in cells, of n.
    TESTBED_INLINE static Mask is_inside(Pack v, int n) { return v > Pack(bin_tolerance) && v < Pack(n - bin_tolerance); }
};

/// Volume of a pack of points [m^2].
template <class Support, class Lanes>
TESTBED_INLINE inline Pack volume(const Points& q, std::size_t p, const Lanes& lanes)
{
    if constexpr (Support::has_box)
        return Pack(4.0) * lanes.load(&q.half_x[p]) * lanes.load(&q.half_y[p]);
    else
        return lanes.load(&q.volume[p]);
}

/// Volume, or box, of a pack of points after the strain increment d.
template <class Support, class Lanes>
TESTBED_INLINE inline void stretch(Points& q, std::size_t p, const Lanes& lanes, const StrainIncrement& increment, const Gradient<Pack>& d)
{
    if constexpr (Support::has_box)
    {
        lanes.store(&q.half_x[p], lanes.load(&q.half_x[p]) * increment.stretch(d.xx));
        lanes.store(&q.half_y[p], lanes.load(&q.half_y[p]) * increment.stretch(d.yy));
    }
    else
        lanes.store(&q.volume[p], lanes.load(&q.volume[p]) * increment.stretch(d.trace()));
}

/// Adds Q quantities of the points of each bin, weighted, to the bin's S x S blocks.
/// @param quantities (p, lanes) -> array of Q packs @param partial S*S*Q numbers for each bin from `first_bin` on
template <class Support, std::size_t Q, class Quantities>
void spread(const Lattice& lattice, const Body& body, std::size_t first_bin, std::vector<double>& partial, Quantities&& quantities)
{
    constexpr int S = Support::S;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     std::array<Pack, S * S * Q> total;
                     set_zero(total);
                     const BinFrame frame(lattice, bins[b]);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Corner c = frame.corner<Support>(body.points, p, lanes);
                                       const auto wx = Support::weights(c.ax, c.wx), wy = Support::weights(c.ay, c.wy);
                                       const std::array<Pack, Q> value = quantities(p, lanes);
                                       for (int j = 0; j < S; ++j)
                                           for (int i = 0; i < S; ++i)
                                           {
                                               const Pack w = lanes.keep(wx[i] * wy[j]);
                                               for (std::size_t k = 0; k < Q; ++k)
                                                   total[(j * S + i) * Q + k] += w * value[k];
                                           }
                                   });
                     sum(total, &partial[(first_bin + b) * S * S * Q]);
                 });
}

/// The transpose: each point takes the weighted values of its S x S cells or nodes.
/// @param index (i, j) -> number of the cell or node @param take (p, lanes, value)
template <class Support, class Index, class Take>
void interpolate(const Lattice& lattice, const Body& body, const std::vector<double>& values, Index&& index, Take&& take)
{
    constexpr int S = Support::S;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     std::array<double, static_cast<std::size_t>(S * S)> value;
                     for (int j = 0; j < S; ++j)
                         for (int i = 0; i < S; ++i)
                             value[static_cast<std::size_t>(j * S + i)] = values[index(bins[b].i + i, bins[b].j + j)];
                     const BinFrame frame(lattice, bins[b]);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Corner c = frame.corner<Support>(body.points, p, lanes);
                                       const auto wx = Support::weights(c.ax, c.wx), wy = Support::weights(c.ay, c.wy);
                                       Pack sum(0.0);
                                       for (int j = 0; j < S; ++j)
                                           for (int i = 0; i < S; ++i)
                                               sum += wx[i] * wy[j] * Pack(value[static_cast<std::size_t>(j * S + i)]);
                                       take(p, lanes, sum);
                                   });
                 });
}
}  // namespace testbed
