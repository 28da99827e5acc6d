#pragma once
/// Convection correction of the nodal velocity: eq. (13), du <= du - (du . grad) du, as printed or solved.

#include "lpfdm/free_faces.hpp"

namespace testbed
{
/// v' of (I + G) v' = v.
template <class T>
TESTBED_INLINE inline Vec<2, T> departure(const Vec<2, T>& v, const Gradient<2, T>& g)
{
    const T one(1.0), inverse = one / ((one + g.xx) * (one + g.yy) - g.xy * g.yx);
    return {((one + g.yy) * v[0] - g.xy * v[1]) * inverse, ((one + g.xx) * v[1] - g.yx * v[0]) * inverse};
}

/// As published: the gradient of the cell that holds the departure point x_k - du; no correction where that cell is empty.
struct UpwindConvection
{
    /// Eq. (13) as printed.
    template <int dim>
    TESTBED_INLINE static auto correct(const auto& v, const Gradient<dim, Pack>& g)
    {
        Vec<dim, Pack> corrected = v;
        unrolled<dim>([&](auto i) TESTBED_INLINE
                      { unrolled<dim>([&](auto j) TESTBED_INLINE { corrected[i] -= v[j] * component<i, j>(g); }); });
        return corrected;
    }

    template <int dim, class Lanes>
    TESTBED_INLINE static Gradient<dim, Pack> gradient(const LpfdmGrid<dim>& grid, std::size_t first_cell, const Lanes& lanes,
                                                       const Vec<dim, Pack>& courant)
    {
        Gradient<dim, Pack> g;
        unrolled<LpfdmGrid<dim>::corners>(
            [&](auto k) TESTBED_INLINE
            {
                const std::size_t c = grid.around(first_cell, k);
                auto here = lanes.load(&grid.cells.mass[c]) > Pack(0.0);
                unrolled<dim>(
                    [&](auto d) TESTBED_INLINE
                    {
                        const auto upper = courant[d] > Pack(0.0);
                        here = here && (is_upper(k, d) ? upper : !upper);
                    });
                const Gradient<dim, Pack> at = grid.cells.gradient_at(c, lanes);
                unrolled<dim * dim>([&](auto n) TESTBED_INLINE { stdx::where(here, component<n>(g)) = component<n>(at); });
            });
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
    TESTBED_INLINE static Vec<2, Pack> correct(const Vec<2, Pack>& v, const Gradient<2, Pack>& g) { return departure(v, g); }

    template <int dim, class Lanes>
    TESTBED_INLINE static Gradient<dim, Pack> gradient(const LpfdmGrid<dim>& grid, std::size_t first_cell, const Lanes& lanes,
                                                       const Vec<dim, Pack>& courant)
    {
        const Pack one(1.0);
        Gradient<dim, Pack> mean;
        Pack total(0.0);
        unrolled<LpfdmGrid<dim>::corners>(
            [&](auto k) TESTBED_INLINE
            {
                const std::size_t c = grid.around(first_cell, k);
                Pack w = lanes.load(&grid.cells.mass[c]);
                unrolled<dim>([&](auto d) TESTBED_INLINE { w *= is_upper(k, d) ? one + courant[d] : one - courant[d]; });
                mean += w * grid.cells.gradient_at(c, lanes);
                total += w;
            });
        Pack inverse = one / total;
        stdx::where(!(total > Pack(0.0)), inverse) = Pack(0.0);
        return inverse * mean;
    }
};

/// How far the velocity carries in dt, at most a cell [cells].
template <std::size_t dim>
TESTBED_INLINE inline std::array<Pack, dim> courant_numbers(const std::array<Pack, dim>& v, double dt_over_L)
{
    const Pack one(1.0);
    std::array<Pack, dim> c;
    unrolled<dim>([&](auto d) TESTBED_INLINE { c[d] = min(one, max(-one, v[d] * Pack(dt_over_L))); });
    return c;
}

/// Corrects the nodal velocity for the step dt that brought the lattice back; the cells hold the gradients of that step.
template <class Scheme, int dim>
void convect(LpfdmGrid<dim>& grid, double dt)
{
    const double scale = dt / grid.lattice.cell_size;
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            const Vec<dim, Pack> v = load(grid.nodes.v, n, lanes);
            const Gradient<dim, Pack> g = Scheme::template gradient<dim>(grid, first_cell, lanes, courant_numbers(v, scale));
            store(grid.nodes.v, n, lanes, Scheme::correct(v, g));
        });
}

/// Velocity of a node at a free face after a share of the convection, with what arrives there.
inline Vec<2> velocity_at_face(const LpfdmGrid<2>& grid, const FreeFaces& faces, std::uint32_t n, double dt, double share,
                               const std::vector<double>* mass_before)
{
    Vec<2> v = at(grid.nodes.v, n);
    const double won = mass_before ? 1 - (*mass_before)[n] / grid.nodes.mass[n] : 0;
    const double sliver = 1 - grid.nodes.mass[n] / (FreeFaces::sliver * faces.full_mass);
    const double part = std::max({0.0, won, sliver});
    if (part > 0)
    {
        const Vec<2> arriving = faces.arriving(grid, mass_before, n, 1 / (share * dt), v, part);
        for (std::size_t d = 0; d < 2; ++d)
            v[d] += part * (arriving[d] - v[d]);
    }
    return departure(v, faces.across(grid, n, share, 1 - part));
}

/// A share of the same, with the central difference inside and FreeFaces at the faces. The cells hold the gradients over dt.
/// @param mass_before of nodes, in the step before; null: no mass arrives
inline void convect(LpfdmGrid<2>& grid, FreeFaces& faces, double dt, double share, const std::vector<double>* mass_before)
{
    const double scale = share * dt / grid.lattice.cell_size;
    faces.keep(
        grid,
        [&](std::size_t first_cell, const auto& lanes, const Vec<2, Pack>& v)
        { return Pack(share) * CentralConvection::gradient<2>(grid, first_cell, lanes, courant_numbers(v, scale)); },
        [](const Vec<2, Pack>& v, const Gradient<2, Pack>& g) { return CentralConvection::correct(v, g); });
    const auto& at_faces = faces.list();
    parallel_for(
        at_faces.size(),
        [&](std::size_t f) { faces.set_velocity(at_faces[f], velocity_at_face(grid, faces, at_faces[f], dt, share, mass_before)); }, 64);
    // these continue what the others have become
    faces.give_velocity(grid.nodes);
    for (const auto n : faces.ahead())
        set(grid.nodes.v, n, faces.around(grid, nullptr, n, 1 / (share * dt)).linear());
}
}  // namespace testbed
