#pragma once
/// Isotropic elasticity in plane strain: the stress rate D : d with the rotation of the stress left out (`linear_elastic`), to
/// first order (`hypoelastic_jaumann`) or exact (`hypoelastic_exact_rotation`). The out-of-plane stress needs no storage:
/// sigma_zz = nu (sigma_xx + sigma_yy) for all three.

#include "core/base/types.hpp"
#include "core/lattice/points.hpp"
#include "core/materials/kinematics.hpp"
#include "core/materials/law_input.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

namespace testbed
{
/// Largest ratio of eps : D : eps over |grad u|^2, by which no cell is stiffer: 2 (lambda + mu) of in-plane dilatation, or 2 mu of shear
/// where Poisson's ratio is negative [Pa].
inline double gradient_stiffness(const ElasticModuli& m)
{
    return 2 * m.shear() + 2 * std::max(m.lame(), 0.0);
}
/// Young's modulus of point p over that of its body's material.
inline double stiffness_ratio(const Points<2>& q, std::size_t p)
{
    return q.stiffness.active() ? q.stiffness[p] : 1.0;
}

/// What a law with an isotropic elastic part owns beside its stress update.
struct ElasticPart
{
    static constexpr Kinematics kinematics = Kinematics::hypoelastic;
    ElasticModuli moduli;

    /// Of compression, at the stiffest point [m/s].
    double wave_speed(const Points<2>& q) const { return std::sqrt(moduli.constrained() * q.initial_volume / q.mass); }

    /// That is given back, per current volume, of a stress with out-of-plane component szz at a point with the stiffness of the law
    /// [J/m^3].
    double energy_density(const SymTensor<2>& s, double szz) const
    {
        const double normal = s.xx * s.xx + s.yy * s.yy + szz * szz;
        const double mixed = s.xx * s.yy + (s.xx + s.yy) * szz;
        return (normal - 2 * moduli.poissons_ratio() * mixed) / (2 * moduli.youngs_modulus()) + s.xy * s.xy / (2 * moduli.shear());
    }
    /// Of a stress in the plane that is all elastic [Pa].
    double elastic_out_of_plane_stress(const SymTensor<2>& s) const { return moduli.poissons_ratio() * (s.xx + s.yy); }
};

struct NoRotation
{
    static constexpr const char* law = "linear_elastic";
    template <class T>
    TESTBED_INLINE static void rotate(SymTensor<2, T>&, T)
    {
    }
};

/// Increment of the Jaumann rate, W s - s W with the spin increment `angle` (anticlockwise).
struct JaumannRotation
{
    static constexpr const char* law = "hypoelastic_jaumann";
    template <class T>
    TESTBED_INLINE static void rotate(SymTensor<2, T>& s, T angle)
    {
        const T dxx = T(-2.0) * angle * s.xy, dxy = angle * (s.xx - s.yy);
        s.xx += dxx;
        s.yy -= dxx;
        s.xy += dxy;
    }
};

/// R s R^T with R orthogonal to rounding and its angle right to angle^7.
struct ExactRotation
{
    static constexpr const char* law = "hypoelastic_exact_rotation";
    template <class T>
    TESTBED_INLINE static void rotate(SymTensor<2, T>& s, T angle)
    {
        const T square = angle * angle;
        const T t = angle * (T(0.5) + square * (T(1.0 / 24) + square * T(1.0 / 240)));  // tan(angle / 2)
        const T norm = T(1.0) / (T(1.0) + t * t);
        const T c = (T(1.0) - t * t) * norm, d = T(2.0) * t * norm;
        const T mean = T(0.5) * (s.xx + s.yy), half = T(0.5) * (s.xx - s.yy);
        const T c2 = c * c - d * d, d2 = T(2.0) * c * d;
        const T rotated = half * c2 - s.xy * d2;
        s.xy = half * d2 + s.xy * c2;
        s.xx = mean + rotated;
        s.yy = mean - rotated;
    }
};

template <class Law>
struct VaryingStiffness;

template <class Rotation>
struct Hypoelastic : ElasticPart
{
    static constexpr const char* name = Rotation::law;
    static constexpr bool has_strength = false, is_cheap = true;
    using Keys = NoKeys;
    using Forms = std::variant<Hypoelastic, VaryingStiffness<Hypoelastic>>;
    static Forms make(const Keys&, const LawInput& input);

    template <class T>
    struct State
    {
        SymTensor<2, T> stress;
    };

    /// The fields of a point beyond its stress in the plane: none.
    void allocate(Points<2>&) const {}
    double out_of_plane_stress(const Points<2>& q, std::size_t p) const { return elastic_out_of_plane_stress(q.stress_at(p)); }

    /// The pure point function: stress after the displacement gradient increment d.
    template <class T>
    TESTBED_INLINE void update(State<T>& state, const Gradient<2, T>& d) const
    {
        update(state, d, T(1.0));
    }

    template <class T>
    TESTBED_INLINE void update(State<T>& state, const Gradient<2, T>& d, T stiffness) const
    {
        SymTensor<2, T>& s = state.stress;
        Rotation::rotate(s, d.rotation());
        const T lame = stiffness * T(moduli.lame()), shear = stiffness * T(moduli.shear());
        s.xx += lame * d.trace() + T(2.0) * shear * d.xx;
        s.yy += lame * d.trace() + T(2.0) * shear * d.yy;
        s.xy += shear * d.shear();
    }

    /// The same on the points [p, p + lanes).
    template <class Lanes>
    TESTBED_INLINE void update(Points<2>& q, std::size_t p, const Lanes& lanes, const Gradient<2, typename Lanes::Pack>& d) const
    {
        auto state = load(q, p, lanes);
        update(state, d);
        store(q, p, lanes, state);
    }

protected:
    template <class Lanes>
    static State<typename Lanes::Pack> load(const Points<2>& q, std::size_t p, const Lanes& lanes)
    {
        return {q.stress_at(p, lanes)};
    }
    template <class Lanes>
    static void store(Points<2>& q, std::size_t p, const Lanes& lanes, const State<typename Lanes::Pack>& state)
    {
        q.set_stress(p, lanes, state.stress);
    }
};

/// The same law with a Young's modulus that varies from point to point.
template <class Law>
struct VaryingStiffness : Law
{
    static constexpr bool is_cheap = false;
    using Law::update;

    void allocate(Points<2>& q) const { q.stiffness.activate(q.count); }

    template <class Lanes>
    TESTBED_INLINE void update(Points<2>& q, std::size_t p, const Lanes& lanes, const Gradient<2, Pack>& d) const
    {
        auto state = Law::load(q, p, lanes);
        Law::update(state, d, lanes.load(&q.stiffness[p]));
        Law::store(q, p, lanes, state);
    }
};

template <class Rotation>
typename Hypoelastic<Rotation>::Forms Hypoelastic<Rotation>::make(const Keys&, const LawInput& input)
{
    const Hypoelastic law{{input.moduli}};
    if (input.varying.stiffness)
        return VaryingStiffness<Hypoelastic>{law};
    return law;
}

using LinearElastic = Hypoelastic<NoRotation>;
using HypoelasticJaumann = Hypoelastic<JaumannRotation>;
using HypoelasticExactRotation = Hypoelastic<ExactRotation>;
}  // namespace testbed
