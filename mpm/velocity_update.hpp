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
        TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            const auto dv = increment.at(at);
            lanes.store(&q.vx[p], lanes.load(&q.vx[p]) + dv[0]);
            lanes.store(&q.vy[p], lanes.load(&q.vy[p]) + dv[1]);
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice& lattice, const Nodes& nodes, const Body&, const Bin& bin) const
    {
        return {NodalVelocity<S>(lattice, bin, nodes.fx, nodes.fy)};
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
        Pack flip, pic;

        template <class At, class Lanes>
        TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            const auto dv = increment.at(at), v = total.at(at);
            lanes.store(&q.vx[p], flip * (lanes.load(&q.vx[p]) + dv[0]) + pic * v[0]);
            lanes.store(&q.vy[p], flip * (lanes.load(&q.vy[p]) + dv[1]) + pic * v[1]);
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice& lattice, const Nodes& nodes, const Body&, const Bin& bin) const
    {
        return {NodalVelocity<S>(lattice, bin, nodes.fx, nodes.fy), NodalVelocity<S>(lattice, bin, nodes.vx, nodes.vy), Pack(flip),
                Pack(1 - flip)};
    }
};
}  // namespace testbed
