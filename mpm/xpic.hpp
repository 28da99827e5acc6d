#pragma once
/// XPIC(m), Hammerquist & Nairn (2017): the velocity of the points is filtered in each step,
///     v_p <- S w + S dv,   S w = (1 - (1 - S S+)^m) v_p,   w = m v - m v*,   v* = sum_{r=2..m} (-1)^r v_r,
///     v_r = (m - r + 1)/r S+ S v_{r-1},   v_1 = v = S+ v_p,
/// and with what the filter takes away, A* dt = v_p - S w, their position x_p += dt S v - dt/2 A* dt, where the paper's mean of the nodal
/// velocities before and after the step is here that of the half step between. m = 1 is PIC; what no node sees, S+ v_p = 0, goes at once
/// for every m; of what S S+ returns by the share a there stays 1 - (1 - a)^m. Linear momentum is kept exactly; angular momentum but for
/// what the filter takes from rotation, less and less as m grows.

#include "mpm/transfer.hpp"

namespace testbed
{
/// Smoothing of a nodal field by the points: momentum of the points that move with it.
template <class Shape>
class SmoothedSums
{
public:
    static constexpr int S = Shape::S, dim = Body::dim;
    static constexpr std::size_t blocks = block_size<S, dim>, Q = dim, numbers = blocks * Q;

    TESTBED_INLINE SmoothedSums(const Lattice<dim>& lattice, const Bin<dim>& bin, const VectorField<dim>& field)
        : scale_(lattice.cells_per_length),
          field_(lattice, bin, field)
    {
        set_zero(total_);
    }
    template <class Lanes>
    TESTBED_INLINE void add(const Points<dim>& q, const Lanes& lanes, const Corner<dim>& c)
    {
        const ShapeAt<Shape, dim> at(c, scale_);
        Vec<dim, Pack> momentum = field_.at(at);
        for (Pack& component : momentum)
            component = lanes.keep(Pack(q.mass) * component);
        unrolled<blocks>(
            [&](auto k) TESTBED_INLINE
            {
                const Pack N = at.template value<k>();
                unrolled<dim>([&](auto d) TESTBED_INLINE { total_[k * Q + d] += momentum[d] * N; });
            });
    }
    TESTBED_INLINE void write(double* to) const { sum(total_, to); }

private:
    double scale_;
    NodalVelocity<S, dim> field_;
    std::array<Pack, numbers> total_;
};

class Xpic
{
public:
    static constexpr int dim = Body::dim;

    explicit Xpic(int order) : order_(order) {}

    /// w from the nodal velocity, before supports and walls.
    /// @param smooth nodal field -> S+ S of it, in place
    template <class Smooth>
    void filter(const Nodes<dim>& nodes, const VectorField<dim>& v, Smooth&& smooth)
    {
        for (auto* field : {&term_, &w_})
            for (auto& component : *field)
                component.resize(v[0].size());
        const double m = order_;
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                const Vec<dim, Pack> first = load(v, i, lanes);
                store(term_, i, lanes, first);
                unrolled<dim>([&](auto d) { lanes.store(&w_[d][i], Pack(m) * first[d]); });
            });
        for (int r = 2; r <= order_; ++r)
        {
            smooth(term_);
            const Pack scale((m - r + 1) / r), sign(r % 2 ? m : -m);
            nodes.for_each(
                [&](std::size_t i, const auto& lanes)
                {
                    unrolled<dim>(
                        [&](auto d)
                        {
                            const Pack term = scale * lanes.load(&term_[d][i]);
                            lanes.store(&term_[d][i], term);
                            lanes.store(&w_[d][i], lanes.load(&w_[d][i]) + sign * term);
                        });
                });
        }
    }
    VectorField<dim>& kept() { return w_; }  ///< w, what the filter keeps [m/s]

    /// Room for what the filter takes from the points, in their present order.
    void begin_update(const std::vector<Body>& bodies)
    {
        taken_.resize(bodies.size());
        for (std::size_t b = 0; b < bodies.size(); ++b)
            for (auto& component : taken_[b])
                make_room(component, bodies[b].points.count);
        first_ = bodies.data();
    }

    /// The update of the points as a policy.
    template <int S>
    struct InBin
    {
        NodalVelocity<S> w, increment;
        Vec<dim, double*> taken;  ///< by point

        template <class At, class Lanes>
        TESTBED_INLINE void update(Points<dim>& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            const auto kept = w.at(at), dv = increment.at(at);
            unrolled<dim>(
                [&](auto d) TESTBED_INLINE
                {
                    lanes.store(taken[d] + p, lanes.load(&q.v[d][p]) - kept[d]);
                    lanes.store(&q.v[d][p], kept[d] + dv[d]);
                });
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice<dim>& lattice, const Nodes<dim>& nodes, const Body& body, const Bin<dim>& bin)
    {
        Vec<dim, double*> taken;
        for (std::size_t d = 0; d < dim; ++d)
            taken[d] = taken_[static_cast<std::size_t>(&body - first_)][d].data();
        return {NodalVelocity<S>(lattice, bin, w_), NodalVelocity<S>(lattice, bin, nodes.f), taken};
    }

    /// x_p -= dt/2 (v_p - S w), for the points of a bin, after the nodes have moved them.
    void move(Body& body, const Bin<dim>& bin, double dt) const
    {
        const VectorField<dim>& taken = taken_[static_cast<std::size_t>(&body - first_)];
        Points<dim>& q = body.points;
        const Pack half(0.5 * dt);
        for_each_pack(bin.begin, bin.end,
                      [&](std::size_t p, const auto& lanes) {
                          unrolled<dim>([&](auto d) { lanes.store(&q.x[d][p], lanes.load(&q.x[d][p]) - half * lanes.load(&taken[d][p])); });
                      });
    }
    std::size_t bytes() const
    {
        std::size_t n = dim * (term_[0].capacity() + w_[0].capacity());
        for (const auto& taken : taken_)
            n += dim * taken[0].capacity();
        return n * sizeof(double);
    }

private:
    int order_;
    VectorField<dim> term_, w_;
    std::vector<VectorField<dim>> taken_;  ///< of the points, body by body [m/s]
    const Body* first_ = nullptr;
};
}  // namespace testbed
