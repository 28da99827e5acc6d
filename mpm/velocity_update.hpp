#pragma once
/// Velocity updates of the points, stateless policies of the pass that takes nodal values to points. S maps nodal values to points,
/// S+ = 1/m_i sum m_p N_i points to nodes.

#include "mpm/transfer.hpp"

namespace testbed
{
/// FLIP: v_p += S dv.
struct FlipUpdate
{
    template <int S>
    struct InBin
    {
        NodalVelocity<S> increment;

        template <class At, class Lanes>
        TESTBED_INLINE void update(Points<Body::dim>& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            const auto dv = increment.at(at);
            unrolled<Body::dim>([&](auto d) TESTBED_INLINE { lanes.store(&q.v[d][p], lanes.load(&q.v[d][p]) + dv[d]); });
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice<Body::dim>& lattice, const Nodes<Body::dim>& nodes, const Body&,
                                   const Bin<Body::dim>& bin) const
    {
        return {NodalVelocity<S>(lattice, bin, nodes.f)};
    }
};

/// v_p = flip (v_p + S dv) + (1 - flip) S v.
struct BlendUpdate
{
    double flip;

    template <int S>
    struct InBin
    {
        NodalVelocity<S> increment, total;
        double flip, pic;

        template <class At, class Lanes>
        TESTBED_INLINE void update(Points<Body::dim>& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            using Pack = typename At::Pack;
            const auto dv = increment.at(at), v = total.at(at);
            unrolled<Body::dim>([&](auto d) TESTBED_INLINE
                                { lanes.store(&q.v[d][p], Pack(flip) * (lanes.load(&q.v[d][p]) + dv[d]) + Pack(pic) * v[d]); });
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice<Body::dim>& lattice, const Nodes<Body::dim>& nodes, const Body&,
                                   const Bin<Body::dim>& bin) const
    {
        return {NodalVelocity<S>(lattice, bin, nodes.f), NodalVelocity<S>(lattice, bin, nodes.v), flip, 1 - flip};
    }
};
}  // namespace testbed
