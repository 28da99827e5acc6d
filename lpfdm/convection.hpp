#pragma once
/// Convection correction of the nodal velocity: eq. (13), du <= du - (du . grad) du, as printed or solved.

#include "lpfdm/grid.hpp"

namespace testbed
{
using Velocity = std::array<Pack, 2>;

/// As published: the gradient of the cell that holds the departure point x_k - du; no correction where that cell is empty.
struct UpwindConvection
{
    /// Eq. (13) as printed.
    TESTBED_INLINE static Velocity correct(const Velocity& v, const Gradient<Pack>& g)
    {
        return {v[0] - v[0] * g.xx - v[1] * g.xy, v[1] - v[0] * g.yx - v[1] * g.yy};
    }

    template <class Lanes>
    TESTBED_INLINE static Gradient<Pack> gradient(const LpfdmGrid& grid, std::size_t first_cell, const Lanes& lanes, Pack cx, Pack cy)
    {
        const auto right = cx > Pack(0.0), up = cy > Pack(0.0);
        Gradient<Pack> g{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
        for (int k = 0; k < 4; ++k)
        {
            const std::size_t c = grid.around(first_cell, k);
            const auto here = ((k & 1) ? right : !right) && ((k & 2) ? up : !up) && lanes.load(&grid.cells.mass[c]) > Pack(0.0);
            const Gradient<Pack> at = grid.cells.gradient(c, lanes);
            stdx::where(here, g.xx) = at.xx;
            stdx::where(here, g.yy) = at.yy;
            stdx::where(here, g.xy) = at.xy;
            stdx::where(here, g.yx) = at.yx;
        }
        return g;
    }
};

/// Mean of the cells around the node by their mass, weighted to the midpoint x_k - du/2 of the path. At rest this is the
/// central difference; the shift is the Lax-Wendroff term that keeps it stable forward in time. Without the mass a sliver of a
/// cell, such as a box makes that reaches over a wall by rounding, would count as much as a full one.
struct CentralConvection
{
    /// The node takes the velocity of what arrives from x - dt v', which for a linear field is (I + G) v' = v. Eq. (13) is its
    /// first order; what it drops adds up to a gain of angular momentum and energy in rotation.
    TESTBED_INLINE static Velocity correct(const Velocity& v, const Gradient<Pack>& g)
    {
        const Pack one(1.0), inverse = one / ((one + g.xx) * (one + g.yy) - g.xy * g.yx);
        return {((one + g.yy) * v[0] - g.xy * v[1]) * inverse, ((one + g.xx) * v[1] - g.yx * v[0]) * inverse};
    }

    template <class Lanes>
    TESTBED_INLINE static Gradient<Pack> gradient(const LpfdmGrid& grid, std::size_t first_cell, const Lanes& lanes, Pack cx, Pack cy)
    {
        const Pack one(1.0);
        Gradient<Pack> mean{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
        Pack total(0.0);
        for (int k = 0; k < 4; ++k)
        {
            const std::size_t c = grid.around(first_cell, k);
            const Pack w = lanes.load(&grid.cells.mass[c]) * ((k & 1) ? one + cx : one - cx) * ((k & 2) ? one + cy : one - cy);
            const Gradient<Pack> g = grid.cells.gradient(c, lanes);
            mean = mean + Gradient<Pack>{w * g.xx, w * g.yy, w * g.xy, w * g.yx};
            total += w;
        }
        Pack inverse = one / total;
        stdx::where(!(total > Pack(0.0)), inverse) = Pack(0.0);
        return {mean.xx * inverse, mean.yy * inverse, mean.xy * inverse, mean.yx * inverse};
    }
};

/// Corrects the nodal velocity for the step dt that brought the lattice back; the cells hold the gradients of that step.
template <class Scheme>
void convect(LpfdmGrid& grid, double dt)
{
    const Pack courant(dt / grid.lattice.cell_size), one(1.0);
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            const Velocity v{lanes.load(&grid.nodes.vx[n]), lanes.load(&grid.nodes.vy[n])};
            const Pack cx = min(one, max(-one, v[0] * courant)), cy = min(one, max(-one, v[1] * courant));
            const Velocity corrected = Scheme::correct(v, Scheme::gradient(grid, first_cell, lanes, cx, cy));
            lanes.store(&grid.nodes.vx[n], corrected[0]);
            lanes.store(&grid.nodes.vy[n], corrected[1]);
        });
}
}  // namespace testbed
