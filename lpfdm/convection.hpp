#pragma once
/// Convection correction of the nodal velocity, eq. (13): du <= du - (du . grad) du.

#include "lpfdm/cells.hpp"

#include <cmath>

namespace testbed
{
/// As published: the gradient of the cell that holds the departure point x_k - du; no correction where that cell is empty.
struct UpwindConvection
{
    static Gradient<> gradient(const Cells& cells, const Neighbours& near, std::size_t first_cell, double cx, double cy)
    {
        const int k = (cx > 0 ? 1 : 0) + (cy > 0 ? 2 : 0);
        return cells.gradient[near.around(first_cell, k)];
    }
};

/// Mean of the cells around the node, weighted to the midpoint x_k - du/2 of the path. At rest this is the central
/// difference; the shift is the Lax-Wendroff term that keeps it stable forward in time. Empty cells are left out.
struct CentralConvection
{
    static Gradient<> gradient(const Cells& cells, const Neighbours& near, std::size_t first_cell, double cx, double cy)
    {
        Gradient<> mean;
        double total = 0;
        for (int k = 0; k < 4; ++k)
        {
            const std::size_t c = near.around(first_cell, k);
            if (cells.mass[c] == 0)
                continue;
            const double w = 0.25 * ((k & 1) ? 1 + cx : 1 - cx) * ((k & 2) ? 1 + cy : 1 - cy);
            const Gradient<>& g = cells.gradient[c];
            mean = mean + Gradient<>{w * g.xx, w * g.yy, w * g.xy, w * g.yx};
            total += w;
        }
        if (total <= 0)
            return {};
        return {mean.xx / total, mean.yy / total, mean.xy / total, mean.yx / total};
    }
};

/// @param first_cell of the node: the cell of which it is corner [1] @param vx, vy nodal velocity, corrected in place [m/s]
/// @param courant dt / L [s/m]; the gradients in cells are those of the increment over dt
template <class Scheme>
void convect(const Cells& cells, const Neighbours& near, std::size_t first_cell, double courant, double& vx, double& vy)
{
    const auto limited = [](double c) { return std::fmin(1.0, std::fmax(-1.0, c)); };
    const Gradient<> g = Scheme::gradient(cells, near, first_cell, limited(vx * courant), limited(vy * courant));
    const double dx = vx * g.xx + vy * g.xy, dy = vx * g.yx + vy * g.yy;
    vx -= dx;
    vy -= dy;
}
}  // namespace testbed
