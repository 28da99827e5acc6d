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
        for (auto* values : {&one_sided_, &xx_, &yy_, &xy_, &yx_, &new_x_, &new_y_})
            values->assign(nodes, 0.0);
    }

    /// Finds the nodes at free faces, from the cells' masses. What is held in the direction across the face, as at a wall, has no
    /// convection from there.
    void find(const LpfdmGrid& grid)
    {
        const Pack two(2.0);
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                const auto mass = [&](int k) { return lanes.load(&grid.cells.mass[grid.around(first_cell, k)]); };
                const Pack m0 = mass(0), m1 = mass(1), m2 = mass(2), m3 = mass(3);
                const Pack right = m0 + m2, left = m1 + m3, up = m0 + m1, down = m2 + m3;
                const Pack vx = lanes.load(&grid.nodes.vx[n]), vy = lanes.load(&grid.nodes.vy[n]), none(0.0);
                const Mask is_face = (two * min(left, right) < max(left, right) && vx != none) ||
                                     (two * min(down, up) < max(down, up) && vy != none) || left + right < Pack(4 * sliver * full_mass);
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
    void keep(const LpfdmGrid& grid, NodeGradient&& gradient, Correct&& correct)
    {
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                const std::array<Pack, 2> v{lanes.load(&grid.nodes.vx[n]), lanes.load(&grid.nodes.vy[n])};
                const Gradient<Pack> g = gradient(first_cell, lanes, v);
                const std::array<Pack, 2> corrected = correct(v, g);
                lanes.store(&xx_[n], g.xx);
                lanes.store(&yy_[n], g.yy);
                lanes.store(&xy_[n], g.xy);
                lanes.store(&yx_[n], g.yx);
                lanes.store(&new_x_[n], corrected[0]);
                lanes.store(&new_y_[n], corrected[1]);
            });
    }
    /// Gives a node another one.
    void set_velocity(std::uint32_t node, const Vec2& v)
    {
        new_x_[node] = v[0];
        new_y_[node] = v[1];
    }
    /// The nodes take the velocity that was kept for them.
    void give_velocity(Nodes& nodes)
    {
        nodes.vx.swap(new_x_);
        nodes.vy.swap(new_y_);
    }
    /// Of a node that goes out of use.
    void forget(std::uint32_t node) { set_velocity(node, {0, 0}); }
    const std::vector<std::uint32_t>& list() const { return faces_; }
    /// Nodes without mass that boxes may reach within the step: their velocity is that of the body, continued.
    const std::vector<std::uint32_t>& ahead() const { return ahead_; }

    /// Gradient at a node of list(): across a face see derivative_at_face(), with none for the next layer of cells where there is none.
    /// @param share of the step, to which the kept gradients belong
    /// @param its share of the node's velocity that did not arrive just now, and counts in its own gradient
    Gradient<> across(const LpfdmGrid& grid, std::uint32_t node, double share, double its) const
    {
        const int i = grid.lattice.node_i(node), j = grid.lattice.node_j(node);
        const Gradient<> own{xx_[node], yy_[node], xy_[node], yx_[node]};
        const Layer right = layer(grid, {i, j}, {i, j - 1}), left = layer(grid, {i - 1, j}, {i - 1, j - 1}),
                    up = layer(grid, {i, j}, {i - 1, j}), down = layer(grid, {i, j - 1}, {i - 1, j - 1});
        const double shear = 0.5 * (own.xy + own.yx);
        Gradient<> g = own;
        if (const double outer = imbalance(left.mass, right.mass); outer > 0)
        {
            const bool to_right = right.mass > left.mass;
            const int next = to_right ? i + 1 : i - 2;
            const Layer inner = layer(grid, {next, j}, {next, j - 1});
            const double weight = std::min(1.0, inner.mass / std::max(left.mass, right.mass));
            const bool leads = to_right ? grid.nodes.vx[node] < 0 : grid.nodes.vx[node] > 0;
            const Vec2 d = derivative_at_face({own.xx, own.yx}, {own.xx, shear},
                                              {share * weight * inner.mean.xx, share * weight * inner.mean.yx}, leads ? its : 0.0);
            g.xx = (1 - outer) * own.xx + outer * d[0];
            g.yx = (1 - outer) * own.yx + outer * d[1];
        }
        if (const double outer = imbalance(down.mass, up.mass); outer > 0)
        {
            const bool to_top = up.mass > down.mass;
            const int next = to_top ? j + 1 : j - 2;
            const Layer inner = layer(grid, {i, next}, {i - 1, next});
            const double weight = std::min(1.0, inner.mass / std::max(down.mass, up.mass));
            const bool leads = to_top ? grid.nodes.vy[node] < 0 : grid.nodes.vy[node] > 0;
            const Vec2 d = derivative_at_face({own.xy, own.yy}, {shear, own.yy},
                                              {share * weight * inner.mean.xy, share * weight * inner.mean.yy}, leads ? its : 0.0);
            g.xy = (1 - outer) * own.xy + outer * d[0];
            g.yy = (1 - outer) * own.yy + outer * d[1];
        }
        return g;
    }

    /// What the neighbours of a node say of its velocity: their mean, and what their gradients add to it on the way to the node.
    struct Around
    {
        Vec2 mean, beyond;
        Vec2 linear() const { return {mean[0] + beyond[0], mean[1] + beyond[1]}; }
    };
    /// Weighted by mass, of neighbours that had mass before, too.
    /// @param mass_before of nodes, in the step before, or null @param scale 1 / the time over which the kept gradients are increments
    Around around(const LpfdmGrid& grid, const std::vector<double>* mass_before, std::uint32_t node, double scale) const
    {
        const int i = grid.lattice.node_i(node), j = grid.lattice.node_j(node);
        const double L = grid.lattice.cell_size;
        double mass = 0;
        Around sum{{0, 0}, {0, 0}};
        for (int dj = -1; dj <= 1; ++dj)
            for (int di = -1; di <= 1; ++di)
            {
                if ((di == 0 && dj == 0) || !grid.lattice.has_node(i + di, j + dj))
                    continue;
                const std::size_t k = grid.lattice.node(i + di, j + dj);
                const double m = mass_before ? std::min(grid.nodes.mass[k], (*mass_before)[k]) : grid.nodes.mass[k];
                if (!(m > 0))
                    continue;
                const double dx = -di * scale * L, dy = -dj * scale * L;
                mass += m;
                sum.mean[0] += m * grid.nodes.vx[k];
                sum.mean[1] += m * grid.nodes.vy[k];
                sum.beyond[0] += m * (xx_[k] * dx + xy_[k] * dy);
                sum.beyond[1] += m * (yx_[k] * dx + yy_[k] * dy);
            }
        for (double* value : {&sum.mean[0], &sum.mean[1], &sum.beyond[0], &sum.beyond[1]})
            *value = mass > 0 ? *value / mass : 0;
        return sum;
    }
    /// Velocity that mass brings to a node where the node's own is v. What arrives comes from between the node and its neighbours: unless
    /// the node had next to no mass, and no velocity to speak of, the extrapolation goes no further from their mean than v does. Else a
    /// curved profile would win energy whenever mass arrives, and a body that oscillates grow.
    /// @param is_new 1 for a node without a velocity of its own
    Vec2 arriving(const LpfdmGrid& grid, const std::vector<double>* mass_before, std::uint32_t node, double scale, const Vec2& v,
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
    std::size_t bytes() const { return 7 * xx_.capacity() * sizeof(double) + (faces_.capacity() + ahead_.capacity()) * sizeof(faces_[0]); }

private:
    /// That of the next layer. At a face that leads this feeds short waves: there the node's own, which is then the upwind one, as far as
    /// it takes from a strain across the face. In smooth motion that strain falls to what the free face leaves of it, and the two
    /// derivatives to one: whether the face comes or goes then makes no difference.
    /// @param strain of the node's own gradient, that part of it in which a rotation has no share @param leads 0 where the face recedes,
    /// else the share of the node's velocity that counts
    static Vec2 derivative_at_face(const Vec2& own, const Vec2& strain, const Vec2& next, double leads)
    {
        const Vec2 apart{own[0] - next[0], own[1] - next[1]};
        const double square = apart[0] * apart[0] + apart[1] * apart[1];
        if (!(square > 0))
            return next;
        const double part = leads * std::clamp(2 * (strain[0] * apart[0] + strain[1] * apart[1]) / square, 0.0, 1.0);
        return {next[0] + part * apart[0], next[1] + part * apart[1]};
    }
    struct Layer
    {
        double mass = 0;
        Gradient<> mean{};
    };
    /// Two cells on one side of a node: their mass, and the mean of their gradients by mass.
    static Layer layer(const LpfdmGrid& grid, NodeIndex a, NodeIndex b)
    {
        Layer sum;
        for (const auto& [i, j] : {a, b})
            if (grid.lattice.has_cell(i, j))
            {
                const std::size_t c = grid.lattice.cell(i, j);
                sum.mass += grid.cells.mass[c];
                sum.mean = sum.mean + grid.cells.mass[c] * grid.cells.gradient(c);
            }
        if (sum.mass > 0)
            sum.mean = (1 / sum.mass) * sum.mean;
        return sum;
    }

    std::vector<double> one_sided_;          ///< 1 at nodes of faces_ and ahead_
    std::vector<double> xx_, yy_, xy_, yx_;  ///< gradient of the increment at nodes
    std::vector<double> new_x_, new_y_;      ///< velocity of nodes after a share of the convection
    std::vector<std::uint32_t> faces_, ahead_;
};
}  // namespace testbed
