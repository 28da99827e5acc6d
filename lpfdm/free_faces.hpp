#pragma once
/// Transport at free faces: at nodes that have material on one side alone, or beside it no more than a sliver.
///
/// The central difference of the convection needs material on both sides. Where it is missing, the gradient of the cell that is left holds
/// the node's own velocity with the sign that feeds it (a downwind difference, at a face that recedes), and mass that arrives at a node
/// with next to none would take the velocity that this node happens to have. Therefore
/// - the derivative across a face comes from the next layer of cells, which does not hold the node's own velocity: exact for linear fields,
///   and the same whether the face comes or goes, so that an oscillation rectifies nothing. A face that leads would let short waves grow
///   with each cell that it travels: there the node's own gradient damps them;
/// - mass that arrives brings the velocity of the place that it comes from: m v <- m_before v + (m - m_before) v_a, with v_a extrapolated
///   from the neighbours, exact for linear fields.

#include "lpfdm/grid.hpp"

#include <cmath>
#include <optional>

namespace testbed
{
class FreeFaces
{
public:
    /// A node with less than this share of a full node's mass has no velocity of its own: what little stress it sees tells nothing of the
    /// body, and pushes it to any speed.
    static constexpr double sliver = 1e-3;
    double full_mass = 0;  ///< of a node with four full cells of the lightest body [kg/m]

    explicit FreeFaces(std::size_t nodes) { resize(nodes); }
    void resize(std::size_t nodes)
    {
        one_sided_.assign(nodes, 0.0);
        for (auto& values : gradient_)
            values.assign(nodes, 0.0);
        for (auto& values : new_v_)
            values.assign(nodes, 0.0);
    }

    /// Finds the nodes at free faces, from the cells' masses. What is held in the direction across the face, as at a wall, has no
    /// convection from there.
    void find(const LpfdmGrid<2>& grid)
    {
        const Pack two(2.0);
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                const auto mass = [&](std::size_t k) { return lanes.load(&grid.cells.mass[grid.around(first_cell, k)]); };
                const std::array<Pack, 4> m{mass(0), mass(1), mass(2), mass(3)};
                Mask is_face = m[0] + m[2] + (m[1] + m[3]) < Pack(4 * sliver * full_mass);
                unrolled<2>(
                    [&](auto d)
                    {
                        const Pack upper = m[0] + m[2 - d], lower = m[1 + d] + m[3];  // cell k is that of which the node is corner k
                        is_face = is_face || (two * min(lower, upper) < max(lower, upper) && lanes.load(&grid.nodes.v[d][n]) != Pack(0.0));
                    });
                lanes.store(&one_sided_[n], select(is_face, Pack(1.0), Pack(0.0)));
            });
        faces_.clear();
        ahead_.clear();
        for (const Run& run : grid.nodes.runs())
            for_each_pack(
                run.begin, run.begin + run.count,
                [&](std::size_t first, const auto& lanes)
                {
                    if (const auto is_face = lanes.keep(lanes.load(&one_sided_[first]) > Pack(0.0)); stdx::any_of(is_face))
                        for (std::size_t k = 0; k < pack_size; ++k)
                            if (is_face[k])
                                (grid.nodes.mass[first + k] > 0 ? faces_ : ahead_).push_back(static_cast<std::uint32_t>(first + k));
                });
    }

    /// Keeps the gradient at each node, and the velocity that convection makes of the node's own with it.
    /// @param gradient (first cell, node, lanes, velocity) -> gradient of the increment at nodes @param correct (velocity, gradient) ->
    /// velocity
    template <class NodeGradient, class Correct>
    void keep(const LpfdmGrid<2>& grid, NodeGradient&& gradient, Correct&& correct)
    {
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                const Vec<2, Pack> v = load(grid.nodes.v, n, lanes);
                const Gradient<2, Pack> g = gradient(first_cell, lanes, v);
                unrolled<4>([&](auto k) { lanes.store(&gradient_[k][n], component<k>(g)); });
                store(new_v_, n, lanes, correct(v, g));
            });
    }
    /// Gives a node another one.
    void set_velocity(std::uint32_t node, const Vec<2>& v) { set(new_v_, node, v); }
    /// The nodes take the velocity that was kept for them.
    void give_velocity(Nodes<2>& nodes) { nodes.v.swap(new_v_); }
    /// Of a node that goes out of use.
    void forget(std::uint32_t node) { set_velocity(node, {0, 0}); }
    const std::vector<std::uint32_t>& list() const { return faces_; }
    /// Nodes without mass that boxes may reach within the step: their velocity is that of the body, continued.
    const std::vector<std::uint32_t>& ahead() const { return ahead_; }

    /// Gradient at a node of list(): across a face see derivative_at_face(), with none for the next layer of cells where there is none.
    /// @param share of the step, to which the kept gradients belong
    /// @param its share of the node's velocity that did not arrive just now, and counts in its own gradient
    Gradient<2> across(const LpfdmGrid<2>& grid, std::uint32_t node, double share, double its) const
    {
        const Index<2> at = grid.lattice.node_index(node);
        const Gradient<2> own = gradient_at(node);
        const double shear = 0.5 * (own.xy + own.yx);
        Gradient<2> g = own;
        unrolled<2>(
            [&](auto d)
            {
                const Layer upper = layer(grid, at, d, 0), lower = layer(grid, at, d, -1);
                const double outer = imbalance(lower.mass, upper.mass);
                if (!(outer > 0))
                    return;
                const bool to_upper = upper.mass > lower.mass;
                const Layer inner = layer(grid, at, d, to_upper ? 1 : -2);
                const double weight = std::min(1.0, inner.mass / std::max(lower.mass, upper.mass));
                const bool leads = to_upper ? grid.nodes.v[d][node] < 0 : grid.nodes.v[d][node] > 0;
                Vec<2> strain{shear, shear};
                strain[d] = component<d, d>(own);
                const Vec<2> own_d{component<0, d>(own), component<1, d>(own)};
                const Vec<2> next{share * weight * component<0, d>(inner.mean), share * weight * component<1, d>(inner.mean)};
                const Vec<2> along = derivative_at_face(own_d, strain, next, leads ? its : 0.0);
                unrolled<2>([&](auto i) { component<i, d>(g) = (1 - outer) * component<i, d>(own) + outer * along[i]; });
            });
        return g;
    }

    /// What the neighbours of a node say of its velocity: their mean, and what their gradients add to it on the way to the node.
    struct Around
    {
        Vec<2> mean, beyond;
        Vec<2> linear() const { return {mean[0] + beyond[0], mean[1] + beyond[1]}; }
    };
    /// Weighted by mass, of neighbours that had mass before, too.
    /// @param mass_before of nodes, in the step before, or null @param scale 1 / the time over which the kept gradients are increments
    Around around(const LpfdmGrid<2>& grid, const std::vector<double>* mass_before, std::uint32_t node, double scale) const
    {
        const Index<2> at = grid.lattice.node_index(node);
        double mass = 0;
        Around sum{{0, 0}, {0, 0}};
        for_each_index(all<2>(-1), all<2>(2),
                       [&](const Index<2>& away)
                       {
                           if (away == all<2>(0) || !grid.lattice.has_node(at + away))
                               return;
                           const std::size_t k = grid.lattice.node(at + away);
                           const double m = mass_before ? std::min(grid.nodes.mass[k], (*mass_before)[k]) : grid.nodes.mass[k];
                           if (!(m > 0))
                               return;
                           const Gradient<2> g = gradient_at(k);
                           const double dx = -away[0] * scale * grid.lattice.cell_size, dy = -away[1] * scale * grid.lattice.cell_size;
                           mass += m;
                           sum.mean[0] += m * grid.nodes.v[0][k];
                           sum.mean[1] += m * grid.nodes.v[1][k];
                           sum.beyond[0] += m * (g.xx * dx + g.xy * dy);
                           sum.beyond[1] += m * (g.yx * dx + g.yy * dy);
                       });
        for (double* value : {&sum.mean[0], &sum.mean[1], &sum.beyond[0], &sum.beyond[1]})
            *value = mass > 0 ? *value / mass : 0;
        return sum;
    }
    /// Velocity that mass brings to a node where the node's own is v. What arrives comes from between the node and its neighbours: unless
    /// the node had next to no mass, and no velocity to speak of, the extrapolation goes no further from their mean than v does. Else a
    /// curved profile would win energy whenever mass arrives, and a body that oscillates grow.
    /// @param is_new 1 for a node without a velocity of its own
    Vec<2> arriving(const LpfdmGrid<2>& grid, const std::vector<double>* mass_before, std::uint32_t node, double scale, const Vec<2>& v,
                    double is_new) const
    {
        const Around near = around(grid, mass_before, node, scale);
        const double own = std::hypot(v[0] - near.mean[0], v[1] - near.mean[1]), beyond = std::hypot(near.beyond[0], near.beyond[1]);
        const double limit = beyond > own ? own / beyond : 1;
        const double factor = limit + (1 - limit) * is_new;
        return {near.mean[0] + factor * near.beyond[0], near.mean[1] + factor * near.beyond[1]};
    }

    /// 0 where the smaller mass is half of the larger one or more, 1 where it is zero.
    static double imbalance(double a, double b)
    {
        const double larger = std::max(a, b);
        return larger > 0 ? std::max(0.0, 1 - 2 * std::min(a, b) / larger) : 0;
    }
    std::size_t bytes() const
    {
        return 7 * one_sided_.capacity() * sizeof(double) + (faces_.capacity() + ahead_.capacity()) * sizeof(faces_[0]);
    }

private:
    /// That of the next layer. At a face that leads this feeds short waves: there the node's own, which is then the upwind one, as far as
    /// it takes from a strain across the face. In smooth motion that strain falls to what the free face leaves of it, and the two
    /// derivatives to one: whether the face comes or goes then makes no difference.
    /// @param strain of the node's own gradient, that part of it in which a rotation has no share @param leads 0 where the face recedes,
    /// else the share of the node's velocity that counts
    static Vec<2> derivative_at_face(const Vec<2>& own, const Vec<2>& strain, const Vec<2>& next, double leads)
    {
        const Vec<2> apart{own[0] - next[0], own[1] - next[1]};
        const double square = apart[0] * apart[0] + apart[1] * apart[1];
        if (!(square > 0))
            return next;
        const double part = leads * std::clamp(2 * (strain[0] * apart[0] + strain[1] * apart[1]) / square, 0.0, 1.0);
        return {next[0] + part * apart[0], next[1] + part * apart[1]};
    }
    struct Layer
    {
        double mass = 0;
        Gradient<2> mean{};
    };
    /// The two cells beside a node that are `away` from it in direction d, 0 or more on the upper side: their mass, and the mean of their
    /// gradients by mass.
    static Layer layer(const LpfdmGrid<2>& grid, const Index<2>& node, std::size_t d, int away)
    {
        Layer sum;
        Index<2> at = node;
        at[d] += away;
        for (int k = 0; k < 2; ++k, --at[1 - d])
            if (grid.lattice.has_cell(at))
            {
                const std::size_t c = grid.lattice.cell(at);
                sum.mass += grid.cells.mass[c];
                sum.mean += grid.cells.mass[c] * grid.cells.gradient_at(c);
            }
        if (sum.mass > 0)
            sum.mean = (1 / sum.mass) * sum.mean;
        return sum;
    }
    Gradient<2> gradient_at(std::size_t node) const { return tensor_of<Gradient<2>>(testbed::at(gradient_, node)); }

    std::vector<double> one_sided_;  ///< 1 at nodes of faces_ and ahead_
    VectorField<4> gradient_;        ///< of the increment at nodes
    VectorField<2> new_v_;           ///< velocity of nodes after a share of the convection
    std::vector<std::uint32_t> faces_, ahead_;
};
}  // namespace testbed
