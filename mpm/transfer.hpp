#pragma once
/// Particle-to-node and node-to-particle kernels of MPM. A bin's nodes are the same for all its points, so their values are
/// loaded once and their sums are kept in registers.

#include "core/bodies/bin_sums.hpp"
#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"
#include "core/lattice/kinematics.hpp"

namespace testbed
{
/// Nodal shape functions as a point sees them, in one direction: weights are the values at the S nodes from the bin's first on, slopes are
/// per cell, both of (a, width) as in core/bodies/support.hpp. Smooth: slopes do not jump at lines of nodes. Beyond: the edge of the
/// lattice.
template <class Shape>
concept NodalShape = requires
{
    Shape::S, Shape::has_box, Shape::is_smooth, Shape::reaches_beyond;
    Shape::weights(0.5, 1.0).size() + Shape::slopes(0.5, 1.0).size();
};

/// Values and gradients of the S x S shape functions at a pack of points; gradients in 1/m.
template <NodalShape Shape>
struct ShapeAt
{
    static constexpr int S = Shape::S;
    std::array<Pack, S> wx, wy, gx, gy;

    TESTBED_INLINE ShapeAt(const Corner& c, double scale)
    {
        if constexpr (Shape::has_box)
        {
            const auto inverse = inverse_widths(c);
            wx = Shape::weights_by(c.ax, c.wx, inverse[0]);
            wy = Shape::weights_by(c.ay, c.wy, inverse[1]);
            gx = Shape::slopes_by(c.ax, c.wx, inverse[0]);
            gy = Shape::slopes_by(c.ay, c.wy, inverse[1]);
        }
        else
        {
            wx = Shape::weights(c.ax, c.wx);
            wy = Shape::weights(c.ay, c.wy);
            gx = Shape::slopes(c.ax, c.wx);
            gy = Shape::slopes(c.ay, c.wy);
        }
        for (int k = 0; k < S; ++k)
        {
            gx[k] *= Pack(scale);
            gy[k] *= Pack(scale);
        }
    }
    Pack value(int i, int j) const { return wx[i] * wy[j]; }
    Pack slope_x(int i, int j) const { return gx[i] * wy[j]; }
    Pack slope_y(int i, int j) const { return wx[i] * gy[j]; }
};

/// Strain at each point ("four-point").
struct PointStrain
{
    static constexpr bool averaged = false;
    template <class Shape>
    struct InBin
    {
        InBin(const Lattice&, const Points&, const Bin&) {}
    };
};

struct NoSum
{
};

/// The centroid of a cell's points by volume.
class Centroid
{
public:
    struct Slopes
    {
        std::array<double, 4> x, y;  ///< 1/m
    };
    TESTBED_INLINE void add(Pack v, Pack ax, Pack ay)
    {
        volume_ += v;
        ax_ += v * ax;
        ay_ += v * ay;
    }
    /// Slopes of the bilinear shape functions there.
    template <class Shape>
    Slopes slopes(double scale) const
    {
        static_assert(Shape::S == 2 && !Shape::is_smooth);
        const double all = sum(volume_);
        const ShapeAt<Shape> at({Pack(sum(ax_) / all), Pack(sum(ay_) / all), Pack(0.0), Pack(0.0)}, scale);
        Slopes s;
        for (int k = 0; k < 4; ++k)
        {
            s.x[static_cast<std::size_t>(k)] = at.slope_x(k % 2, k / 2)[0];
            s.y[static_cast<std::size_t>(k)] = at.slope_y(k % 2, k / 2)[0];
        }
        return s;
    }

private:
    Pack volume_{0.0}, ax_{0.0}, ay_{0.0};
};

/// Volumetric strain averaged over the cell (B-bar): the slopes that make the in-plane dilatation are those at the centroid of
/// the cell's points, which is their volume-weighted mean since they are linear. The deviatoric part stays pointwise.
struct BBarStrain
{
    static constexpr bool averaged = true;
    template <class Shape>
    struct InBin
    {
        std::array<Pack, 4> mean_x, mean_y;

        InBin(const Lattice& lattice, const Points& q, const Bin& bin)
        {
            const BinFrame frame(lattice, bin);
            Centroid centroid;
            for_each_pack(bin.begin, bin.end,
                          [&](std::size_t p, const auto& lanes)
                          {
                              const Corner c = frame.corner<Shape>(q, p, lanes);
                              centroid.add(lanes.keep(volume<Shape>(q, p, lanes)), lanes.keep(c.ax), lanes.keep(c.ay));
                          });
            const auto slopes = centroid.slopes<Shape>(frame.scale);
            for (std::size_t k = 0; k < 4; ++k)
            {
                mean_x[k] = Pack(slopes.x[k]);
                mean_y[k] = Pack(slopes.y[k]);
            }
        }
    };
};

/// What scatter() sums at each node.
enum class Scatter
{
    momentum,           ///< mass, momentum
    force,              ///< internal force
    momentum_and_force  ///< both
};
template <Scatter what>
inline constexpr std::size_t sums_of = what == Scatter::momentum_and_force ? 5
                                       : what == Scatter::momentum         ? 3
                                                                           : 2;

/// What the points of one bin give to its S x S nodes: m_i = sum m N_i, (m v)_i = sum m v N_i, f_i = -sum V (sigma + p I) . grad N_i
/// with the confining pressure p. With B-bar the mean in-plane stress works on the cell's dilatation: dual to NodalVelocity::gradient().
template <class Shape, class Strain, Scatter what>
class NodeSums
{
public:
    static constexpr int S = Shape::S;
    static constexpr std::size_t Q = sums_of<what>, numbers = static_cast<std::size_t>(S * S) * Q;

    TESTBED_INLINE NodeSums(const Lattice& lattice, const Bin&) : scale_(lattice.cells_per_length) { set_zero(total_); }

    /// Points [p, p + lanes) of the body, with their support at c.
    template <class Lanes>
    TESTBED_INLINE void add(const Body& body, std::size_t p, const Lanes& lanes, const Corner& c)
    {
        const ShapeAt<Shape> at(c, scale_);
        const Points& q = body.points;
        [[maybe_unused]] Pack m, px, py, txx, tyy, txy;
        if constexpr (what != Scatter::force)
        {
            m = lanes.keep(Pack(q.mass));
            px = m * lanes.load(&q.vx[p]);
            py = m * lanes.load(&q.vy[p]);
        }
        if constexpr (what != Scatter::momentum)
        {
            const Pack v = lanes.keep(volume<Shape>(q, p, lanes));
            const SymTensor<Pack> s = total_stress(body, p, lanes);
            txx = v * s.xx;
            tyy = v * s.yy;
            txy = v * s.xy;
            if constexpr (Strain::averaged)
            {
                const Pack mean = Pack(0.5) * (txx + tyy);
                txx -= mean;
                tyy -= mean;
                mean_ += mean;
                strain_.add(v, lanes.keep(c.ax), lanes.keep(c.ay));
            }
        }
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                Pack* to = &total_[static_cast<std::size_t>(j * S + i) * Q];
                if constexpr (what != Scatter::force)
                {
                    const Pack N = at.value(i, j);
                    to[0] += m * N;
                    to[1] += px * N;
                    to[2] += py * N;
                }
                if constexpr (what != Scatter::momentum)
                {
                    const Pack nx = at.slope_x(i, j), ny = at.slope_y(i, j);
                    to[Q - 2] -= txx * nx + txy * ny;
                    to[Q - 1] -= txy * nx + tyy * ny;
                }
            }
    }
    TESTBED_INLINE void write(const Body&, const Bin&, double* to) const
    {
        sum(total_, to);
        if constexpr (Strain::averaged && what != Scatter::momentum)
        {
            const auto slopes = strain_.template slopes<Shape>(scale_);
            const double mean = sum(mean_);
            for (std::size_t k = 0; k < static_cast<std::size_t>(S * S); ++k)
            {
                to[k * Q + Q - 2] -= mean * slopes.x[k];
                to[k * Q + Q - 1] -= mean * slopes.y[k];
            }
        }
    }

private:
    double scale_;
    std::array<Pack, numbers> total_;
    [[no_unique_address]] std::conditional_t<Strain::averaged, Pack, NoSum> mean_{};
    [[no_unique_address]] std::conditional_t<Strain::averaged, Centroid, NoSum> strain_{};
};

/// The sums of all bins of a body, anew.
template <class Shape, class Strain, Scatter what>
void scatter(const Lattice& lattice, const Body& body, std::size_t first_bin, std::vector<double>& partial)
{
    using Sums = NodeSums<Shape, Strain, what>;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b) { sum_bin<Shape, Sums>(lattice, body, bins[b], &partial[(first_bin + b) * Sums::numbers]); });
}

/// Nodal values of one bin.
template <int S>
struct NodalVelocity
{
    std::array<double, static_cast<std::size_t>(S*S)> x, y;

    TESTBED_INLINE NodalVelocity(const Lattice& lattice, const Bin& bin, const std::vector<double>& vx, const std::vector<double>& vy)
    {
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                const std::size_t n = lattice.node(bin.i + i, bin.j + j);
                x[j * S + i] = vx[n];
                y[j * S + i] = vy[n];
            }
    }
    template <class At>
    TESTBED_INLINE std::array<Pack, 2> at(const At& at) const
    {
        Pack vx(0.0), vy(0.0);
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                const Pack N = at.value(i, j);
                vx += N * Pack(x[j * S + i]);
                vy += N * Pack(y[j * S + i]);
            }
        return {vx, vy};
    }
    /// Gradient of the increment over dt, with the dilatation that `strain` prescribes.
    template <class Strain, class At, class InBin>
    TESTBED_INLINE Gradient<Pack> gradient(const At& at, [[maybe_unused]] const InBin& strain, double dt) const
    {
        Gradient<Pack> d{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
        [[maybe_unused]] Pack dilatation(0.0);
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                const Pack nx = at.slope_x(i, j), ny = at.slope_y(i, j);
                const Pack vx(x[j * S + i]), vy(y[j * S + i]);
                d.xx += nx * vx;
                d.yy += ny * vy;
                d.xy += ny * vx;
                d.yx += nx * vy;
                if constexpr (Strain::averaged)
                    dilatation += strain.mean_x[j * S + i] * vx + strain.mean_y[j * S + i] * vy;
            }
        if constexpr (Strain::averaged)
        {
            const Pack correction = Pack(0.5) * (dilatation - d.trace());
            d.xx += correction;
            d.yy += correction;
        }
        return Pack(dt) * d;
    }
};
}  // namespace testbed
