#pragma once
/// Small value types in `dim` dimensions, for a scalar type T that is double or a pack of doubles. Their components have the names that
/// laws use; what is the same for all of them goes over their numbers, constants of the compiler, so that each stays in its register.

#include "core/base/simd.hpp"

#include <array>
#include <stdexcept>
#include <string>
#include <tuple>

namespace testbed
{
template <int dim, class T = double>
using Vec = std::array<T, dim>;

template <int n>
constexpr double power(double v)
{
    double product = 1;
    for (int k = 0; k < n; ++k)
        product *= v;
    return product;
}

/// Stress [Pa], tension positive; in plane strain that in the plane.
template <int dim, class T = double>
struct SymTensor;

template <class T>
struct SymTensor<2, T>
{
    T xx{}, yy{}, xy{};
};
template <class T>
struct SymTensor<3, T>
{
    T xx{}, yy{}, zz{}, yz{}, zx{}, xy{};
};

/// Gradient of the displacement increment over one step: xy means d(u_x)/dy, yx means d(u_y)/dx [-].
template <int dim, class T = double>
struct Gradient;

template <class T>
struct Gradient<2, T>
{
    T xx{}, yy{}, xy{}, yx{};

    T trace() const { return xx + yy; }
    T shear() const { return xy + yx; }                ///< engineering shear, eq. (5e)
    T rotation() const { return T(0.5) * (yx - xy); }  ///< anticlockwise, eq. (5f)
};
template <class T>
struct Gradient<3, T>
{
    T xx{}, yy{}, zz{}, xy{}, yz{}, zx{}, yx{}, zy{}, xz{};

    T trace() const { return xx + yy + zz; }
};

namespace detail
{
TESTBED_INLINE inline auto members(auto& t)
{
    if constexpr (requires { t.xz; })
        return std::tie(t.xx, t.yy, t.zz, t.xy, t.yz, t.zx, t.yx, t.zy, t.xz);
    else if constexpr (requires { t.zz; })
        return std::tie(t.xx, t.yy, t.zz, t.yz, t.zx, t.xy);
    else if constexpr (requires { t.yx; })
        return std::tie(t.xx, t.yy, t.xy, t.yx);
    else
        return std::tie(t.xx, t.yy, t.xy);
}
}  // namespace detail

/// How many components a SymTensor has.
template <int dim>
inline constexpr int symmetric_components = dim*(dim + 1) / 2;

/// Number of component (i, j) of a SymTensor: the diagonal comes first, then the planes across x, y, z.
template <int dim>
constexpr int symmetric_component(int i, int j)
{
    return i == j ? i : dim == 2 ? 2 : 6 - i - j;
}
/// Number of component (i, j) of a Gradient, d(u_i)/d(x_j): the diagonal, then j after i, then the others.
template <int dim>
constexpr int gradient_component(int i, int j)
{
    return i == j ? i : dim == 2 ? 2 + i : j == (i + 1) % 3 ? 3 + i : 6 + j;
}

/// Component k, in the order of their names.
template <int k>
TESTBED_INLINE inline auto& component(auto& t)
{
    return std::get<k>(detail::members(t));
}
template <int i, int j, int dim, class T>
TESTBED_INLINE inline T& component(SymTensor<dim, T>& s)
{
    return component<symmetric_component<dim>(i, j)>(s);
}
template <int i, int j, int dim, class T>
TESTBED_INLINE inline const T& component(const SymTensor<dim, T>& s)
{
    return component<symmetric_component<dim>(i, j)>(s);
}
template <int i, int j, int dim, class T>
TESTBED_INLINE inline T& component(Gradient<dim, T>& g)
{
    return component<gradient_component<dim>(i, j)>(g);
}
template <int i, int j, int dim, class T>
TESTBED_INLINE inline const T& component(const Gradient<dim, T>& g)
{
    return component<gradient_component<dim>(i, j)>(g);
}

/// Component by component, as set_zero().
template <int dim>
TESTBED_INLINE inline Gradient<dim, Pack> zero_gradient()
{
    Gradient<dim, Pack> g;
    unrolled<dim * dim>([&](auto k) TESTBED_INLINE { component<k>(g) = Pack(0.0); });
    return g;
}

template <int dim, class T>
TESTBED_INLINE inline Gradient<dim, T> operator+(const Gradient<dim, T>& a, const Gradient<dim, T>& b)
{
    Gradient<dim, T> c;
    unrolled<dim * dim>([&](auto k) TESTBED_INLINE { component<k>(c) = component<k>(a) + component<k>(b); });
    return c;
}
template <int dim, class T>
TESTBED_INLINE inline Gradient<dim, T> operator-(const Gradient<dim, T>& a, const Gradient<dim, T>& b)
{
    Gradient<dim, T> c;
    unrolled<dim * dim>([&](auto k) TESTBED_INLINE { component<k>(c) = component<k>(a) - component<k>(b); });
    return c;
}
template <int dim, class T>
TESTBED_INLINE inline Gradient<dim, T>& operator+=(Gradient<dim, T>& a, const Gradient<dim, T>& b)
{
    return a = a + b;
}
template <int dim, class T, class U>
TESTBED_INLINE inline Gradient<dim, T> operator*(const T& factor, const Gradient<dim, U>& a)
{
    Gradient<dim, T> c;
    unrolled<dim * dim>([&](auto k) TESTBED_INLINE { component<k>(c) = factor * T(component<k>(a)); });
    return c;
}

/// A run that cannot go on: points left the lattice, a value is not finite. The run ends as `diverged`.
struct Diverged : std::runtime_error
{
    using std::runtime_error::runtime_error;
};
}  // namespace testbed
