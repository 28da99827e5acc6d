#pragma once
/// Small value types of plane strain, for a scalar type T that is double or a pack of doubles.

#include <array>
#include <stdexcept>
#include <string>

namespace testbed
{
using Vec2 = std::array<double, 2>;

/// In-plane stress [Pa], tension positive.
template <class T = double>
struct SymTensor
{
    T xx{}, yy{}, xy{};
};

/// Gradient of the displacement increment over one step: xy means d(u_x)/dy, yx means d(u_y)/dx [-].
template <class T = double>
struct Gradient
{
    T xx{}, yy{}, xy{}, yx{};

    T trace() const { return xx + yy; }
    T shear() const { return xy + yx; }                ///< engineering shear, eq. (5e)
    T rotation() const { return T(0.5) * (yx - xy); }  ///< anticlockwise, eq. (5f)
};

template <class T>
Gradient<T> operator+(const Gradient<T>& a, const Gradient<T>& b)
{
    return {a.xx + b.xx, a.yy + b.yy, a.xy + b.xy, a.yx + b.yx};
}
template <class T>
Gradient<T> operator-(const Gradient<T>& a, const Gradient<T>& b)
{
    return {a.xx - b.xx, a.yy - b.yy, a.xy - b.xy, a.yx - b.yx};
}
template <class T, class U>
Gradient<T> operator*(const T& factor, const Gradient<U>& a)
{
    return {factor * T(a.xx), factor * T(a.yy), factor * T(a.xy), factor * T(a.yx)};
}

/// A run that cannot go on: points left the lattice, a value is not finite. The run ends as `diverged`.
struct Diverged : std::runtime_error
{
    using std::runtime_error::runtime_error;
};
}  // namespace testbed
