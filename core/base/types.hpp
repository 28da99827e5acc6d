#pragma once
/// Small value types in `dim` dimensions, for a scalar type T that is double or a pack of doubles. Their components have the names that
/// laws use; what is the same for all of them goes over their numbers, constants of the compiler, so that each stays in its register.

#include "core/base/simd.hpp"

#include <array>
#include <stdexcept>
#include <string>
#include <tuple>
#include <type_traits>

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

    /// Number of component (i, j).
    static constexpr int number(int i, int j) { return i == j ? i : 2; }
};
template <class T>
struct SymTensor<3, T>
{
    T xx{}, yy{}, zz{}, yz{}, zx{}, xy{};

    static constexpr int number(int i, int j) { return i == j ? i : 6 - i - j; }
};

/// Gradient of the displacement increment over one step: xy means d(u_x)/dy, yx means d(u_y)/dx [-].
template <int dim, class T = double>
struct Gradient;

template <class T>
struct Gradient<2, T>
{
    T xx{}, yy{}, xy{}, yx{};

    /// Number of component (i, j), d(u_i)/d(x_j).
    static constexpr int number(int i, int j) { return i == j ? i : 2 + i; }
    T trace() const { return xx + yy; }
    T shear() const { return xy + yx; }                ///< engineering shear, eq. (5e)
    T rotation() const { return T(0.5) * (yx - xy); }  ///< anticlockwise, eq. (5f)
};
template <class T>
struct Gradient<3, T>
{
    T xx{}, yy{}, zz{}, xy{}, yz{}, zx{}, yx{}, zy{}, xz{};

    static constexpr int number(int i, int j) { return i == j ? i : j == (i + 1) % 3 ? 3 + i : 6 + j; }
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

/// Component k, in the order of their names.
template <int k>
TESTBED_INLINE inline auto& component(auto& t)
{
    return std::get<k>(detail::members(t));
}
template <int i, int j>
TESTBED_INLINE inline auto& component(auto& t)
{
    return component<std::remove_cvref_t<decltype(t)>::number(i, j)>(t);
}

/// The tensor with these components, in the order of their names.
template <class Tensor, class T, std::size_t n>
TESTBED_INLINE inline Tensor tensor_of(const std::array<T, n>& components)
{
    Tensor t;
    unrolled<n>([&](auto k) TESTBED_INLINE { component<k>(t) = components[k]; });
    return t;
}

/// f(component of a, component of b) for each component.
template <int dim, class T, class F>
TESTBED_INLINE inline Gradient<dim, T> by_component(const Gradient<dim, T>& a, const Gradient<dim, T>& b, F&& f)
{
    Gradient<dim, T> c;
    unrolled<dim * dim>([&](auto k) TESTBED_INLINE { component<k>(c) = f(component<k>(a), component<k>(b)); });
    return c;
}
template <int dim, class T>
TESTBED_INLINE inline Gradient<dim, T> operator+(const Gradient<dim, T>& a, const Gradient<dim, T>& b)
{
    return by_component(a, b, [](const T& x, const T& y) TESTBED_INLINE { return x + y; });
}
template <int dim, class T>
TESTBED_INLINE inline Gradient<dim, T> operator-(const Gradient<dim, T>& a, const Gradient<dim, T>& b)
{
    return by_component(a, b, [](const T& x, const T& y) TESTBED_INLINE { return x - y; });
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
