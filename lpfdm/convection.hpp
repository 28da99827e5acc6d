#pragma once
/// Convection correction of the nodal velocity: eq. (13), du <= du - (du . grad) du, as printed or solved.

#include "lpfdm/grid.hpp"

#include <cmath>

namespace testbed
{
/// As published: the gradient of the cell that holds the departure point x_k - du; no correction where that cell is empty.
struct UpwindConvection
{
    /// Eq. (13) as printed.
    static Vec2 correct(const Vec2& v, const Gradient<>& g) { return {v[0] - v[0] * g.xx - v[1] * g.xy, v[1] - v[0] * g.yx - v[1] * g.yy}; }

    static Gradient<> gradient(const LpfdmGrid& grid, std::size_t first_cell, double cx, double cy)
    {
        const int k = (cx > 0 ? 1 : 0) + (cy > 0 ? 2 : 0);
        const std::size_t c = grid.around(first_cell, k);
        return grid.cells.mass[c] > 0 ? grid.cells.gradient[c] : Gradient<>{};
    }
};

/// Mean of the cells around the node by their mass, weighted to the midpoint x_k - du/2 of the path. At rest this is the
/// central difference; the shift is the Lax-Wendroff term that keeps it stable forward in time. Without the mass a sliver of a
/// cell, such as a box makes that reaches over a wall by rounding, would count as much as a full one.
struct CentralConvection
{
    /// The node takes the velocity of what arrives from x - dt v', which for a linear field is (I + G) v' = v. Eq. (13) is its
    /// first order; what it drops adds up to a gain of angular momentum and energy in rotation.
    static Vec2 correct(const Vec2& v, const Gradient<>& g)
    {
        const double determinant = (1 + g.xx) * (1 + g.yy) - g.xy * g.yx;
        return {((1 + g.yy) * v[0] - g.xy * v[1]) / determinant, ((1 + g.xx) * v[1] - g.yx * v[0]) / determinant};
    }

    static Gradient<> gradient(const LpfdmGrid& grid, std::size_t first_cell, double cx, double cy)
    {
        Gradient<> mean;
        double total = 0;
        for (int k = 0; k < 4; ++k)
        {
            const std::size_t c = grid.around(first_cell, k);
            const double w = grid.cells.mass[c] * ((k & 1) ? 1 + cx : 1 - cx) * ((k & 2) ? 1 + cy : 1 - cy);
            const Gradient<>& g = grid.cells.gradient[c];
            mean = mean + Gradient<>{w * g.xx, w * g.yy, w * g.xy, w * g.yx};
            total += w;
        }
        if (total <= 0)
            return {};
        return {mean.xx / total, mean.yy / total, mean.xy / total, mean.yx / total};
    }
};

/// Corrects the nodal velocity for the step dt that brought the lattice back; the cells hold the gradients of that step.
template <class Scheme>
void convect(LpfdmGrid& grid, double dt)
{
    const double courant = dt / grid.lattice.cell_size;
    const auto limited = [&](double v) { return std::fmin(1.0, std::fmax(-1.0, v * courant)); };
    grid.for_each_node(
        [&](std::size_t i, std::size_t first_cell)
        {
            double &vx = grid.nodes.vx[i], &vy = grid.nodes.vy[i];
            const Gradient<> g = Scheme::gradient(grid, first_cell, limited(vx), limited(vy));
            const Vec2 v = Scheme::correct({vx, vy}, g);
            vx = v[0];
            vy = v[1];
        });
}
}  // namespace testbed
