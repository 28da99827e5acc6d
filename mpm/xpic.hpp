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
    static constexpr int S = Shape::S;
    static constexpr std::size_t Q = 2, numbers = static_cast<std::size_t>(S * S) * Q;

    TESTBED_INLINE SmoothedSums(const Lattice& lattice, const Bin& bin, const std::vector<double>& x, const std::vector<double>& y)
        : scale_(lattice.cells_per_length),
          field_(lattice, bin, x, y)
    {
        set_zero(total_);
    }
    template <class Lanes>
    TESTBED_INLINE void add(const Points& q, const Lanes& lanes, const Corner& c)
    {
        const ShapeAt<Shape> at(c, scale_);
        const auto v = field_.at(at);
        const Pack px = lanes.keep(Pack(q.mass) * v[0]), py = lanes.keep(Pack(q.mass) * v[1]);
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                const Pack N = at.value(i, j);
                total_[static_cast<std::size_t>(j * S + i) * Q] += px * N;
                total_[static_cast<std::size_t>(j * S + i) * Q + 1] += py * N;
            }
    }
    TESTBED_INLINE void write(double* to) const { sum(total_, to); }

private:
    double scale_;
    NodalVelocity<S> field_;
    std::array<Pack, numbers> total_;
};

class Xpic
{
public:
    explicit Xpic(int order) : order_(order) {}

    /// w from the nodal velocity, before supports and walls.
    /// @param smooth (x, y): nodal field -> S+ S of it
    template <class Smooth>
    void filter(const Nodes& nodes, const std::vector<double>& vx, const std::vector<double>& vy, Smooth&& smooth)
    {
        for (auto* field : {&term_x_, &term_y_, &w_x_, &w_y_})
            field->resize(vx.size());
        const double m = order_;
        set_term(nodes, vx, vy);
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                lanes.store(&w_x_[i], Pack(m) * lanes.load(&term_x_[i]));
                lanes.store(&w_y_[i], Pack(m) * lanes.load(&term_y_[i]));
            });
        for (int r = 2; r <= order_; ++r)
        {
            smooth(term_x_, term_y_);
            const Pack scale((m - r + 1) / r), sign(r % 2 ? m : -m);
            nodes.for_each(
                [&](std::size_t i, const auto& lanes)
                {
                    const Pack x = scale * lanes.load(&term_x_[i]), y = scale * lanes.load(&term_y_[i]);
                    lanes.store(&term_x_[i], x);
                    lanes.store(&term_y_[i], y);
                    lanes.store(&w_x_[i], lanes.load(&w_x_[i]) + sign * x);
                    lanes.store(&w_y_[i], lanes.load(&w_y_[i]) + sign * y);
                });
        }
    }
    std::vector<double>& kept_x() { return w_x_; }  ///< w, what the filter keeps [m/s]
    std::vector<double>& kept_y() { return w_y_; }

    /// Room for what the filter takes from the points, in their present order.
    void begin_update(const std::vector<Body>& bodies)
    {
        taken_.resize(bodies.size());
        for (std::size_t b = 0; b < bodies.size(); ++b)
        {
            make_room(taken_[b].x, bodies[b].points.count);
            make_room(taken_[b].y, bodies[b].points.count);
        }
        first_ = bodies.data();
    }

    /// The update of the points as a policy.
    template <int S>
    struct InBin
    {
        NodalVelocity<S> w, increment;
        double *taken_x, *taken_y;  ///< by point

        template <class At, class Lanes>
        TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const At& at) const
        {
            const auto kept = w.at(at), dv = increment.at(at);
            lanes.store(taken_x + p, lanes.load(&q.vx[p]) - kept[0]);
            lanes.store(taken_y + p, lanes.load(&q.vy[p]) - kept[1]);
            lanes.store(&q.vx[p], kept[0] + dv[0]);
            lanes.store(&q.vy[p], kept[1] + dv[1]);
        }
    };
    template <int S>
    TESTBED_INLINE InBin<S> in_bin(const Lattice& lattice, const Nodes& nodes, const Body& body, const Bin& bin)
    {
        Taken& taken = taken_[static_cast<std::size_t>(&body - first_)];
        return {NodalVelocity<S>(lattice, bin, w_x_, w_y_), NodalVelocity<S>(lattice, bin, nodes.fx, nodes.fy), taken.x.data(),
                taken.y.data()};
    }

    /// x_p -= dt/2 (v_p - S w), for the points of a bin, after the nodes have moved them.
    void move(Body& body, const Bin& bin, double dt) const
    {
        const Taken& taken = taken_[static_cast<std::size_t>(&body - first_)];
        Points& q = body.points;
        const Pack half(0.5 * dt);
        for_each_pack(bin.begin, bin.end,
                      [&](std::size_t p, const auto& lanes)
                      {
                          lanes.store(&q.x[p], lanes.load(&q.x[p]) - half * lanes.load(&taken.x[p]));
                          lanes.store(&q.y[p], lanes.load(&q.y[p]) - half * lanes.load(&taken.y[p]));
                      });
    }
    std::size_t bytes() const
    {
        std::size_t n = term_x_.capacity() + term_y_.capacity() + w_x_.capacity() + w_y_.capacity();
        for (const Taken& t : taken_)
            n += t.x.capacity() + t.y.capacity();
        return n * sizeof(double);
    }

private:
    struct Taken
    {
        std::vector<double> x, y;  ///< m/s
    };
    void set_term(const Nodes& nodes, const std::vector<double>& vx, const std::vector<double>& vy)
    {
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                lanes.store(&term_x_[i], lanes.load(&vx[i]));
                lanes.store(&term_y_[i], lanes.load(&vy[i]));
            });
    }

    int order_;
    std::vector<double> term_x_, term_y_, w_x_, w_y_;
    std::vector<Taken> taken_;
    const Body* first_ = nullptr;
};
}  // namespace testbed
