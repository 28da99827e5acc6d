#pragma once
/// One step of LPFDM, a function for each group of equations of Konagai & Johansson (2000).

#include "core/support.hpp"
#include "lpfdm/grid.hpp"

#include <atomic>

namespace testbed
{
/// Eqs. (7), (8): mass and smeared stress (beyond the confining pressure) of each cell. @param workspace room for 4 S^2 numbers per bin
template <class Support>
void cell_averages(LpfdmGrid& grid, const std::vector<Body>& bodies, std::vector<double>& workspace)
{
    std::size_t first_bin = 0;
    for (const Body& body : bodies)
    {
        const Points& q = body.points;
        spread<Support, 4>(grid.lattice, body, first_bin, workspace,
                           [&](std::size_t p, const auto& lanes)
                           {
                               const Pack v = volume<Support>(q, p, lanes), pressure(body.confinement);
                               return std::array<Pack, 4>{Pack(q.mass), v * (lanes.load(&q.sxx[p]) + pressure),
                                                          v * (lanes.load(&q.syy[p]) + pressure), v * lanes.load(&q.sxy[p])};
                           });
        first_bin += body.bins.list().size();
    }
    const double area = grid.lattice.cell_size * grid.lattice.cell_size;
    grid.gather.sum<4>(workspace,
                       [&](std::size_t c, const std::array<double, 4>& s)
                       {
                           grid.cells.mass[c] = s[0];
                           grid.cells.stress[c] = {s[1] / area, s[2] / area, s[3] / area};
                       });
}

/// Eqs. (9), (10): a quarter of the mass of the cells around a node, and their forces. Empty cells add nothing.
inline void nodal_forces(LpfdmGrid& grid)
{
    const double half_side = 0.5 * grid.lattice.cell_size;
    grid.for_each_node(
        [&](std::size_t i, std::size_t first_cell)
        {
            double mass = 0;
            Vec2 force{0, 0};
            for (int k = 0; k < 4; ++k)
            {
                const std::size_t c = grid.around(first_cell, k);
                const Vec2 f = square_force(k, grid.cells.stress[c], half_side);
                mass += grid.cells.mass[c];
                force[0] += f[0];
                force[1] += f[1];
            }
            grid.nodes.mass[i] = 0.25 * mass;
            grid.nodes.fx[i] = force[0];
            grid.nodes.fy[i] = force[1];
        });
}

/// Eqs. (5a)-(5d): gradient of the increment over dt in each cell.
inline void cell_gradients(LpfdmGrid& grid, double dt)
{
    const double scale = dt / (2 * grid.lattice.cell_size);
    grid.for_each_cell(
        [&](std::size_t c)
        {
            double ux[4], uy[4];
            grid.corner_velocities(c, ux, uy);
            grid.cells.gradient[c] = square_gradient(ux, uy, scale);
        });
}

/// Viscous force against the pattern (+1, -1, -1, +1), which no gradient sees and no linear field contains.
/// The pattern decays at four times the rate. @param rate chi c_p / L [1/s] @param amplitude one force per cell of the lattice
inline void resist_hourglass(LpfdmGrid& grid, double rate, std::vector<Vec2>& amplitude)
{
    grid.for_each_cell(
        [&](std::size_t c)
        {
            double ux[4], uy[4];
            grid.corner_velocities(c, ux, uy);
            const double f = -0.25 * rate * grid.cells.mass[c];
            amplitude[c] = {f * (ux[0] - ux[1] - ux[2] + ux[3]), f * (uy[0] - uy[1] - uy[2] + uy[3])};
        });
    grid.for_each_node(
        [&](std::size_t i, std::size_t first_cell)
        {
            for (int k = 0; k < 4; ++k)
                if (const std::size_t c = grid.around(first_cell, k); grid.cells.mass[c] > 0)
                {
                    const double sign = (k == 0 || k == 3) ? 1 : -1;
                    grid.nodes.fx[i] += sign * amplitude[c][0];
                    grid.nodes.fy[i] += sign * amplitude[c][1];
                }
        });
}

/// What is constant in a bin: the gradients of its S x S cells and the increments of its (S+1) x (S+1) nodes.
template <class Support>
struct BinMotion
{
    static constexpr int S = Support::S;
    std::array<Gradient<>, S * S> cell;
    std::array<double, (S + 1) * (S + 1)> ux, uy;

    BinMotion(const LpfdmGrid& grid, const Bin& bin, double dt)
    {
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
                cell[j * S + i] = grid.cells.gradient[grid.lattice.cell(bin.i + i, bin.j + j)];
        for (int j = 0; j <= S; ++j)
            for (int i = 0; i <= S; ++i)
            {
                const std::size_t n = grid.lattice.node(bin.i + i, bin.j + j);
                ux[j * (S + 1) + i] = grid.nodes.vx[n] * dt;
                uy[j * (S + 1) + i] = grid.nodes.vy[n] * dt;
            }
    }
    Gradient<Pack> gradient(const Corner& c) const
    {
        const auto wx = Support::weights(c.ax, c.wx), wy = Support::weights(c.ay, c.wy);
        Gradient<Pack> d{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                const Pack w = wx[i] * wy[j];
                const Gradient<>& g = cell[j * S + i];
                d = d + Gradient<Pack>{w * Pack(g.xx), w * Pack(g.yy), w * Pack(g.xy), w * Pack(g.yx)};
            }
        return d;
    }
    void displace(const Corner& c, Pack& x, Pack& y) const
    {
        const auto wx = hat(c.ax + Pack(0.5) * c.wx), wy = hat(c.ay + Pack(0.5) * c.wy);
        for (int j = 0; j <= S; ++j)
        {
            Pack rx(0.0), ry(0.0);
            for (int i = 0; i <= S; ++i)
            {
                rx += wx[i] * Pack(ux[j * (S + 1) + i]);
                ry += wx[i] * Pack(uy[j * (S + 1) + i]);
            }
            x += wy[j] * rx;
            y += wy[j] * ry;
        }
    }
    /// Bilinear weights of the nodes 0..S at xi in [0, S).
    static std::array<Pack, S + 1> hat(Pack xi)
    {
        if constexpr (S == 1)
            return {Pack(1.0) - xi, xi};
        else
        {
            const Pack low = max(Pack(1.0) - xi, Pack(0.0)), high = max(xi - Pack(1.0), Pack(0.0));
            return {low, Pack(1.0) - low - high, high};
        }
    }
};

/// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6), for the points of one body.
/// Returns whether a point left its bin.
template <class Support, class Law>
bool move_points(const LpfdmGrid& grid, Body& body, const Law& law, double dt)
{
    Points& q = body.points;
    Bins& sorted = body.bins;
    const auto& bins = sorted.list();
    std::atomic<bool> moved{false};
    parallel_for(bins.size(),
                 [&](std::size_t b)
                 {
                     const BinFrame frame(grid.lattice, bins[b]);
                     const BinMotion<Support> motion(grid, bins[b], dt);
                     bool left = false;
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       Pack x = lanes.load(&q.x[p]), y = lanes.load(&q.y[p]);
                                       const Corner c = frame.corner<Support>(q, p, lanes, x, y);
                                       const Gradient<Pack> d = motion.gradient(c);
                                       motion.displace(c, x, y);
                                       law.update(q, p, lanes, d);
                                       stretch<Support>(q, p, lanes, d);
                                       lanes.store(&q.x[p], x);
                                       lanes.store(&q.y[p], y);
                                       left |= frame.left<Support>(q, p, lanes, x, y);
                                   });
                     if (left)
                     {
                         sorted.mark(b);
                         moved.store(true, std::memory_order_relaxed);
                     }
                 });
    return moved;
}
}  // namespace testbed
