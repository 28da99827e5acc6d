#pragma once
/// Gauss's theorem on a cell (eqs. (1)-(5)) and the nodal forces dual to it (eq. (9)), with nodes
/// [1]..[4] in the numbering of lattice.hpp.

#include "core/base/types.hpp"

namespace testbed
{
/// Strain, rotation and stretch of a step from the displacement gradient G over the configuration at its start: G (I + theta G)^-1, the
/// gradient over the configuration at theta (generalised midpoint rule, Hughes & Winget 1980). theta = 1/2 is second order: an increment of
/// rotation strains nothing, a stretch and its inverse cancel; theta = 0 leaves G, first order.
struct StrainIncrement
{
    double theta = 0.5;

    /// The inverse of the determinant is taken as 1 - e + e^2: what is left out is of third order in the strain of one step, as is what the
    /// midpoint itself leaves out, and a division costs as much as all else.
    template <class T>
    TESTBED_INLINE Gradient<2, T> of(const Gradient<2, T>& g) const
    {
        const T det = g.xx * g.yy - g.xy * g.yx, share(theta), half = share * det;
        const T e = share * (g.trace() + half), inverse = T(1.0) - e * (T(1.0) - e);
        return {(g.xx + half) * inverse, (g.yy + half) * inverse, g.xy * inverse, g.yx * inverse};
    }
    /// Ratio of new to old length, or volume, for an increment of strain, or its trace, by of().
    template <class T>
    TESTBED_INLINE T stretch(const T& d) const
    {
        return T(1.0) + d * (T(1.0) + T(theta) * d);
    }
};

/// Whether corner k = 0..2^dim - 1 of a cell, node [k+1] of lattice.hpp, is on the upper side in direction d.
constexpr bool is_upper(std::size_t k, std::size_t d)
{
    return (k >> d & 1) != 0;
}

/// Eqs. (5a)-(5d) on a square or cubic cell: gradient of a velocity [m/s] or increment [m] with these components at the corners;
/// scale = dt / (2^(dim-1) L) or 1 / (2^(dim-1) L).
template <std::size_t dim, class T, std::size_t corners>
TESTBED_INLINE inline Gradient<dim, T> cell_gradient(const std::array<std::array<T, corners>, dim>& u, T scale)
{
    static_assert(corners == 1 << dim);
    Gradient<dim, T> g;
    unrolled<dim * dim>(
        [&](auto n) TESTBED_INLINE
        {
            constexpr std::size_t i = n / dim, j = n % dim, first = std::size_t{1} << j;
            T difference = u[i][first];
            unrolled<corners>(
                [&](auto k) TESTBED_INLINE
                {
                    if constexpr (is_upper(k, j) && k != first)
                        difference += u[i][k];
                });
            unrolled<corners>(
                [&](auto k) TESTBED_INLINE
                {
                    if constexpr (!is_upper(k, j))
                        difference -= u[i][k];
                });
            component<i, j>(g) = difference * scale;
        });
    return g;
}

/// Eq. (9) on a square or cubic cell: force at corner k from the smeared stress s [Pa]; share = (L/2)^(dim-1), that of a corner in a face.
template <std::size_t k, int dim, class T>
TESTBED_INLINE inline Vec<dim, T> corner_force(const SymTensor<dim, T>& s, double share)
{
    Vec<dim, T> f;
    unrolled<dim>([&](auto i) TESTBED_INLINE
                  { f[i] = total<dim>([&](auto j) TESTBED_INLINE { return component<i, j>(s) * T(is_upper(k, j) ? -share : share); }); });
    return f;
}
}  // namespace testbed
