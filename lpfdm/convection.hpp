#pragma once
/// Convection correction of the nodal velocity: eq. (13), du <= du - (du . grad) du, as printed or solved.

#include "lpfdm/free_faces.hpp"

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

/// Velocity of a node at a free face after a share of the convection, with what arrives there.
inline Vec2 velocity_at_face(const LpfdmGrid& grid, const FreeFaces& faces, std::uint32_t n, double dt, double share,
                             const std::vector<double>* mass_before)
{
    Vec2 v{grid.nodes.vx[n], grid.nodes.vy[n]};
    const double won = mass_before ? 1 - (*mass_before)[n] / grid.nodes.mass[n] : 0;
    const double sliver = 1 - grid.nodes.mass[n] / (FreeFaces::sliver * faces.full_mass);
    const double part = std::max({0.0, won, sliver});
    if (part > 0)
    {
        const Vec2 arriving = faces.arriving(grid, mass_before, n, 1 / (share * dt), v, part);
        v = {v[0] + part * (arriving[0] - v[0]), v[1] + part * (arriving[1] - v[1])};
    }
    const Gradient<> g = faces.across(grid, n, share, 1 - part);
    const double inverse = 1 / ((1 + g.xx) * (1 + g.yy) - g.xy * g.yx);
    return {((1 + g.yy) * v[0] - g.xy * v[1]) * inverse, ((1 + g.xx) * v[1] - g.yx * v[0]) * inverse};
}

/// A share of the same, with the central difference inside and FreeFaces at the faces. The cells hold the gradients over dt.
/// @param mass_before of nodes, in the step before; null: no mass arrives
inline void convect(LpfdmGrid& grid, FreeFaces& faces, double dt, double share, const std::vector<double>* mass_before)
{
    const Pack courant(share * dt / grid.lattice.cell_size), one(1.0), part(share);
    faces.keep(
        grid,
        [&](std::size_t first_cell, const auto& lanes, const Velocity& v)
        {
            const Pack cx = min(one, max(-one, v[0] * courant)), cy = min(one, max(-one, v[1] * courant));
            return part * CentralConvection::gradient(grid, first_cell, lanes, cx, cy);
        },
        [](const Velocity& v, const Gradient<Pack>& g) { return CentralConvection::correct(v, g); });
    const auto& at_faces = faces.list();
    parallel_for(
        at_faces.size(),
        [&](std::size_t f) { faces.set_velocity(at_faces[f], velocity_at_face(grid, faces, at_faces[f], dt, share, mass_before)); }, 64);
    // these continue what the others have become
    faces.give_velocity(grid.nodes);
    for (const auto n : faces.ahead())
    {
        const auto v = faces.around(grid, nullptr, n, 1 / (share * dt)).linear();
        grid.nodes.vx[n] = v[0];
        grid.nodes.vy[n] = v[1];
    }
}
}  // namespace testbed
