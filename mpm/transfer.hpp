#pragma once
/// Particle-to-node and node-to-particle kernels of MPM. A bin's nodes are the same for all its points, so their values are
/// loaded once and their sums are kept in registers.

#include "core/bodies/bin_sums.hpp"
#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"
#include "core/lattice/kinematics.hpp"
#include "core/lattice/nodes.hpp"

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

/// Values and gradients of the S^dim shape functions at a pack of points; gradients in 1/m.
template <NodalShape Shape, int dim = Body::dim, AnyPack P = Pack>
struct ShapeAt
{
    using Pack = P;
    static constexpr int S = Shape::S;
    std::array<std::array<Pack, S>, dim> weights, slopes;

    TESTBED_INLINE ShapeAt(const Corner<dim, Pack>& c, double scale)
    {
        if constexpr (Shape::has_box)
        {
            const auto inverse = inverse_widths(c);
            unrolled<dim>(
                [&](auto d) TESTBED_INLINE
                {
                    weights[d] = Shape::weights_by(c.a[d], c.width[d], inverse[d]);
                    slopes[d] = Shape::slopes_by(c.a[d], c.width[d], inverse[d]);
                });
        }
        else
            unrolled<dim>(
                [&](auto d) TESTBED_INLINE
                {
                    weights[d] = Shape::weights(c.a[d], c.width[d]);
                    slopes[d] = Shape::slopes(c.a[d], c.width[d]);
                });
        unrolled<dim>([&](auto d) TESTBED_INLINE { unrolled<S>([&](auto k) TESTBED_INLINE { slopes[d][k] *= Pack(scale); }); });
    }
    /// Of node k of the bin's S^dim.
    template <std::size_t k>
    TESTBED_INLINE Pack value() const
    {
        return block_product<S, k>(weights);
    }
    template <std::size_t k>
    TESTBED_INLINE Vec<dim, Pack> gradient() const
    {
        constexpr auto at = block_index<S, dim>(k);
        Vec<dim, Pack> g;
        unrolled<dim>(
            [&](auto d) TESTBED_INLINE
            {
                const auto factor = [&](auto e) TESTBED_INLINE { return e == d ? slopes[e][at[e]] : weights[e][at[e]]; };
                g[d] = factor(std::integral_constant<std::size_t, 0>{});
                unrolled<dim - 1>([&](auto e) TESTBED_INLINE { g[d] *= factor(std::integral_constant<std::size_t, e + 1>{}); });
            });
        return g;
    }
};

template <NodalShape Shape, int dim, AnyPack Pack>
TESTBED_INLINE inline auto shape_at(const Corner<dim, Pack>& c, double scale)
{
    return ShapeAt<Shape, dim, Pack>(c, scale);
}

/// Strain at each point ("four-point").
struct PointStrain
{
    static constexpr bool averaged = false;
    template <class Shape>
    struct InBin
    {
        InBin(const Lattice<Body::dim>&, const Points<Body::dim>&, const Bin<Body::dim>&) {}
    };
};

struct NoSum
{
};

/// The centroid of a cell's points by volume.
template <int dim = Body::dim, AnyPack Pack = testbed::Pack>
class Centroid
{
public:
    static constexpr std::size_t nodes = 1 << dim;

    TESTBED_INLINE Centroid() { set_zero(moment_); }
    TESTBED_INLINE void add(Pack v, const Vec<dim, Pack>& a)
    {
        volume_ += v;
        unrolled<dim>([&](auto d) TESTBED_INLINE { moment_[d] += v * a[d]; });
    }
    /// Gradients of the linear shape functions there [1/m].
    template <class Shape>
    std::array<Vec<dim>, nodes> gradients(double scale) const
    {
        static_assert(Shape::S == 2 && !Shape::is_smooth);
        const double all = sum(volume_);
        Corner<dim, Pack> c;
        for (std::size_t d = 0; d < dim; ++d)
        {
            c.a[d] = Pack(sum(moment_[d]) / all);
            c.width[d] = Pack(0.0);
        }
        const auto at = shape_at<Shape>(c, scale);
        std::array<Vec<dim>, nodes> g;
        unrolled<nodes>([&](auto k) { unrolled<dim>([&](auto d) { g[k][d] = at.template gradient<k>()[d][0]; }); });
        return g;
    }

private:
    Pack volume_{0.0};
    Vec<dim, Pack> moment_;
};

/// Volumetric strain averaged over the cell (B-bar): the slopes that make the in-plane dilatation are those at the centroid of
/// the cell's points, which is their volume-weighted mean since they are linear. The deviatoric part stays pointwise.
struct BBarStrain
{
    static constexpr bool averaged = true;
    template <class Shape>
    struct InBin
    {
        static constexpr int dim = Body::dim;
        std::array<Vec<dim>, Centroid<dim>::nodes> mean;

        InBin(const Lattice<dim>& lattice, const Points<dim>& q, const Bin<dim>& bin)
        {
            const BinFrame<dim> frame(lattice, bin);
            mean = with_packs_for(bin.end - bin.begin,
                                  [&]<AnyPack P>(const P&)
                                  {
                                      Centroid<dim, P> centroid;
                                      for_each_pack<P>(bin.begin, bin.end,
                                                       [&](std::size_t p, const auto& lanes)
                                                       {
                                                           auto c = frame.template corner<Shape>(q, p, lanes);
                                                           for (P& a : c.a)
                                                               a = lanes.keep(a);
                                                           centroid.add(lanes.keep(volume<Shape>(q, p, lanes)), c.a);
                                                       });
                                      return centroid.template gradients<Shape>(frame.scale);
                                  });
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
inline constexpr std::size_t sums_of = (what == Scatter::force ? 0 : 1 + Body::dim) + (what == Scatter::momentum ? 0 : Body::dim);

/// What the points of one bin give to its S^dim nodes: m_i = sum m N_i, (m v)_i = sum m v N_i, f_i = -sum V (sigma + p I) . grad N_i
/// with the confining pressure p. With B-bar the mean in-plane stress works on the cell's dilatation: dual to NodalVelocity::gradient().
template <class Shape, class Strain, Scatter what, AnyPack Pack = testbed::Pack>
class NodeSums
{
public:
    template <AnyPack Other>
    using In = NodeSums<Shape, Strain, what, Other>;
    static constexpr int S = Shape::S, dim = Body::dim;
    static constexpr std::size_t blocks = block_size<S, dim>, Q = sums_of<what>, numbers = blocks * Q;

    TESTBED_INLINE NodeSums(const Lattice<dim>& lattice, const Bin<dim>&) : scale_(lattice.cells_per_length) { set_zero(total_); }

    /// Points [p, p + lanes) of the body, with their support at c.
    template <class Lanes>
    TESTBED_INLINE void add(const Body& body, std::size_t p, const Lanes& lanes, const Corner<dim, Pack>& c)
    {
        const ShapeAt<Shape, dim, Pack> at(c, scale_);
        const Points<dim>& q = body.points;
        [[maybe_unused]] Pack mass;
        [[maybe_unused]] Vec<dim, Pack> momentum;
        [[maybe_unused]] SymTensor<dim, Pack> t;
        if constexpr (what != Scatter::force)
        {
            mass = lanes.keep(Pack(q.mass));
            unrolled<dim>([&](auto d) TESTBED_INLINE { momentum[d] = mass * lanes.load(&q.v[d][p]); });
        }
        if constexpr (what != Scatter::momentum)
        {
            const Pack v = lanes.keep(volume<Shape>(q, p, lanes));
            const SymTensor<dim, Pack> s = total_stress(body, p, lanes);
            unrolled<symmetric_components<dim>>([&](auto k) TESTBED_INLINE { component<k>(t) = v * component<k>(s); });
            if constexpr (Strain::averaged)
            {
                const Pack mean = Pack(1.0 / dim) * total<dim>([&](auto d) TESTBED_INLINE { return component<d, d>(t); });
                unrolled<dim>([&](auto d) TESTBED_INLINE { component<d, d>(t) -= mean; });
                mean_ += mean;
                Vec<dim, Pack> place;
                unrolled<dim>([&](auto d) TESTBED_INLINE { place[d] = lanes.keep(c.a[d]); });
                strain_.add(v, place);
            }
        }
        unrolled<blocks>(
            [&](auto k) TESTBED_INLINE
            {
                Pack* to = &total_[k * Q];
                if constexpr (what != Scatter::force)
                {
                    const Pack N = at.template value<k>();
                    to[0] += mass * N;
                    unrolled<dim>([&](auto d) TESTBED_INLINE { to[1 + d] += momentum[d] * N; });
                }
                if constexpr (what != Scatter::momentum)
                {
                    const Vec<dim, Pack> g = at.template gradient<k>();
                    unrolled<dim>([&](auto i) TESTBED_INLINE
                                  { to[Q - dim + i] -= total<dim>([&](auto j) TESTBED_INLINE { return component<i, j>(t) * g[j]; }); });
                }
            });
    }
    TESTBED_INLINE void write(const Body&, const Bin<dim>&, double* to) const
    {
        sum(total_, to);
        if constexpr (Strain::averaged && what != Scatter::momentum)
        {
            const auto gradients = strain_.template gradients<Shape>(scale_);
            const double mean = sum(mean_);
            for (std::size_t k = 0; k < blocks; ++k)
                for (std::size_t d = 0; d < dim; ++d)
                    to[k * Q + Q - dim + d] -= mean * gradients[k][d];
        }
    }

private:
    double scale_;
    std::array<Pack, numbers> total_;
    [[no_unique_address]] std::conditional_t<Strain::averaged, Pack, NoSum> mean_{};
    [[no_unique_address]] std::conditional_t<Strain::averaged, Centroid<dim, Pack>, NoSum> strain_{};
};

/// The sums of all bins of a body, anew.
template <class Shape, class Strain, Scatter what>
void scatter(const Lattice<Body::dim>& lattice, const Body& body, std::size_t first_bin, std::vector<double>& partial)
{
    using Sums = NodeSums<Shape, Strain, what>;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b) { sum_bin<Shape, Sums>(lattice, body, bins[b], &partial[(first_bin + b) * Sums::numbers]); });
}

/// Nodal values of one bin.
template <int S, int dim = Body::dim>
struct NodalVelocity
{
    static constexpr std::size_t blocks = block_size<S, dim>;
    std::array<std::array<double, blocks>, dim> v;

    TESTBED_INLINE NodalVelocity(const Lattice<dim>& lattice, const Bin<dim>& bin, const VectorField<dim>& nodal)
    {
        for (std::size_t k = 0; k < blocks; ++k)
        {
            const std::size_t n = lattice.node(bin.at + block_index<S, dim>(static_cast<int>(k)));
            for (std::size_t d = 0; d < dim; ++d)
                v[d][k] = nodal[d][n];
        }
    }
    template <class At>
    TESTBED_INLINE Vec<dim, typename At::Pack> at(const At& at) const
    {
        using Pack = typename At::Pack;
        Vec<dim, Pack> u;
        set_zero(u);
        unrolled<blocks>(
            [&](auto k) TESTBED_INLINE
            {
                const Pack N = at.template value<k>();
                unrolled<dim>([&](auto d) TESTBED_INLINE { u[d] += N * Pack(v[d][k]); });
            });
        return u;
    }
    /// Gradient of the increment over dt, with the dilatation that `strain` prescribes.
    template <class Strain, class At, class InBin>
    TESTBED_INLINE Gradient<dim, typename At::Pack> gradient(const At& at, [[maybe_unused]] const InBin& strain, double dt) const
    {
        using Pack = typename At::Pack;
        Gradient<dim, Pack> g;
        [[maybe_unused]] Pack dilatation(0.0);
        unrolled<blocks>(
            [&](auto k) TESTBED_INLINE
            {
                const Vec<dim, Pack> slope = at.template gradient<k>();
                unrolled<dim>([&](auto i) TESTBED_INLINE
                              { unrolled<dim>([&](auto j) TESTBED_INLINE { component<i, j>(g) += slope[j] * Pack(v[i][k]); }); });
                if constexpr (Strain::averaged)
                    dilatation += total<dim>([&](auto d) TESTBED_INLINE { return Pack(strain.mean[k][d]) * Pack(v[d][k]); });
            });
        if constexpr (Strain::averaged)
        {
            const Pack correction = Pack(1.0 / dim) * (dilatation - g.trace());
            unrolled<dim>([&](auto d) TESTBED_INLINE { component<d, d>(g) += correction; });
        }
        return Pack(dt) * g;
    }
};
}  // namespace testbed
