#pragma once
/// Mohr-Coulomb in plane strain with the out-of-plane stress, tension positive, principal stresses s1 >= s2 >= s3:
///     F = s1 (1 + sin phi) - s3 (1 - sin phi) - 2 c cos phi <= 0,     s1 <= tensile strength.
/// Cohesion falls from c to residual c over the plastic shear strain, solved together with the return.

#include "core/materials/mohr_coulomb_return.hpp"
#include "core/materials/softening.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <variant>

namespace testbed
{
template <bool varying_strength, bool nonlocal>
struct MohrCoulombField;

/// The law with one strength for all points of the body, and softening by the point's own plastic shear strain.
struct MohrCoulomb : ElasticPart
{
    static constexpr const char* name = "mohr_coulomb";
    static constexpr bool has_strength = true, is_cheap = false;
    using Keys = StrengthKeys;
    using Forms = std::variant<MohrCoulomb, MohrCoulombField<true, false>, MohrCoulombField<false, true>, MohrCoulombField<true, true>>;
    /// @param keys has a strength
    static Forms make(const Keys& keys, const LawInput& input);

    Strength<> strength{0, 0};
    MohrCoulombReturn back;
    Softening softening;

    template <class T>
    struct State
    {
        SymTensor<2, T> stress;
        T stress_zz{}, plastic_shear_strain{};
    };

    void allocate(Points<2>& q) const
    {
        q.szz.activate(q.count);
        q.plastic_shear.activate(q.count);
    }
    double out_of_plane_stress(const Points<2>& q, std::size_t p) const { return q.szz[p]; }

    /// What is lost per volume and unit of plastic shear strain, along the flow of the face that the stress of point p lies on [J/m^3].
    double plastic_work_per_shear(const Points<2>& q, std::size_t p) const
    {
        const double mean = 0.5 * (q.stress[0][p] + q.stress[1][p]),
                     radius = std::hypot(0.5 * (q.stress[0][p] - q.stress[1][p]), q.stress[2][p]);
        const double major = std::max(mean + radius, q.szz[p]), minor = std::min(mean - radius, q.szz[p]), sine = back.sin_psi();
        return 0.5 * (major * (1 + sine) - minor * (1 - sine));
    }

    /// The pure point function: stress after the displacement gradient increment d, with the law's one strength and softening by
    /// the point's own strain.
    void update(State<double>& state, const Gradient<2>& d) const
    {
        elastic(state, d);
        if (!inside(state, strength, state.plastic_shear_strain))
            plastic(state);
    }

    /// The same on the points [p, p + lanes).
    template <class Lanes>
    TESTBED_INLINE void update(Points<2>& q, std::size_t p, const Lanes& lanes, const Gradient<2, Pack>& d) const
    {
        update(q, p, lanes, d, Strength<Pack>{Pack(strength.cohesion), Pack(strength.sin_phi)}, LocalDriver{});
    }

protected:
    /// What drives softening: the plastic shear strain of the point, at the end of the step.
    struct LocalDriver
    {
        TESTBED_INLINE static Pack at_end(Pack own, Pack) { return own; }
        static const Field<double>& field(const Points<2>& q) { return q.plastic_shear; }
    };
    /// A field that stays as it is within a step: the cohesion is known before the return.
    struct NonlocalDriver
    {
        TESTBED_INLINE static Pack at_end(Pack, Pack given) { return given; }
        static const Field<double>& field(const Points<2>& q) { return q.softening_strain; }
    };

    template <class T>
    TESTBED_INLINE void elastic(State<T>& state, const Gradient<2, T>& d) const
    {
        HypoelasticExactRotation::State<T> in_plane{state.stress};
        HypoelasticExactRotation{{moduli}}.update(in_plane, d);
        state.stress = in_plane.stress;
        state.stress_zz += T(moduli.lame()) * d.trace();
    }

    /// Whether the stress is admissible, for a double or for each lane of a pack.
    template <class T>
    TESTBED_INLINE decltype(T{} <= T{}) inside(const State<T>& state, const Strength<T>& strength, const T& driver) const
    {
        using std::sqrt;
        const SymTensor<2, T>& s = state.stress;
        const T mean = T(0.5) * (s.xx + s.yy), half = T(0.5) * (s.xx - s.yy);
        const T radius = sqrt(half * half + s.xy * s.xy);
        const T high = max(mean + radius, state.stress_zz), low = min(mean - radius, state.stress_zz);
        const T F = back.yield_function(high, low, strength.sin_phi, strength.cohesion * softening.share(driver));
        const T rounding = T(1e-13) * (max(high, -high) + max(low, -low));
        return F <= rounding && high <= T(back.tensile_strength());
    }

    /// The return of one point whose trial stress is not admissible.
    void plastic(State<double>& state) const
    {
        SymTensor<2>& s = state.stress;
        const double mean = 0.5 * (s.xx + s.yy), half = 0.5 * (s.xx - s.yy), radius = std::hypot(half, s.xy);
        const double high = mean + radius, low = mean - radius;
        // sorted: where the in-plane stresses and s_zz stand
        const std::size_t zz = state.stress_zz > high ? 0 : state.stress_zz < low ? 2 : 1;
        const std::size_t first = zz == 0 ? 1 : 0, last = zz == 2 ? 1 : 2;
        MohrCoulombReturn::Principal trial{};
        trial[zz] = state.stress_zz;
        trial[first] = high;
        trial[last] = low;

        const double own = state.plastic_shear_strain;
        MohrCoulombReturn::Principal returned{};
        double increment = 0;
        const auto excess = [&](double share)  // of the assumed cohesion over the one that the return leads to
        {
            returned = trial;
            back(returned, strength.sin_phi, share * strength.cohesion);
            increment = back.plastic_shear(trial, returned);
            return share - softening.share(own + increment);
        };
        softening.solve(excess, own);

        state.plastic_shear_strain = own + increment;
        state.stress_zz = returned[zz];
        const double new_mean = 0.5 * (returned[first] + returned[last]), new_radius = 0.5 * (returned[first] - returned[last]);
        const double ratio = radius > 0 ? new_radius / radius : 0;
        s = {new_mean + ratio * half, new_mean - ratio * half, ratio * s.xy};
    }

    /// Principal stresses of a pack of points, and the way back.
    struct Directions
    {
        Pack half, xy, radius;
        Mask zz_first, zz_last;
        std::array<Pack, 3> stress;  ///< descending

        TESTBED_INLINE explicit Directions(const State<Pack>& state)
            : half(Pack(0.5) * (state.stress.xx - state.stress.yy)),
              xy(state.stress.xy),
              radius(sqrt(half * half + xy * xy))
        {
            const Pack mean = Pack(0.5) * (state.stress.xx + state.stress.yy), zz = state.stress_zz;
            const Pack high = mean + radius, low = mean - radius;
            zz_first = zz > high;
            zz_last = zz < low;
            stress = {max(high, zz), select(zz_first, high, select(zz_last, low, zz)), min(low, zz)};
        }
        /// Sets the stress of some lanes to that with principal stresses n in these directions.
        TESTBED_INLINE void give(State<Pack>& state, const std::array<Pack, 3>& n, Mask lanes) const
        {
            const Pack high = select(zz_first, n[1], n[0]), low = select(zz_last, n[1], n[2]), mean = Pack(0.5) * (high + low);
            const Pack ratio = Pack(0.5) * (high - low) / select(radius > Pack(0.0), radius, Pack(1.0));
            state.stress = {select(lanes, mean + ratio * half, state.stress.xx), select(lanes, mean - ratio * half, state.stress.yy),
                            select(lanes, ratio * xy, state.stress.xy)};
            state.stress_zz = select(lanes, select(zz_first, n[0], select(zz_last, n[2], n[1])), state.stress_zz);
        }
    };

    /// The return of the lanes of `yields` that end on a face with the cohesion that is left after a large strain, or is given. Returns the
    /// lanes of `yields` that end elsewhere; they are left as they are.
    template <class Driver>
    TESTBED_INLINE Mask return_to_face(State<Pack>& state, const Strength<Pack>& point, Driver, Pack given, Mask yields) const
    {
        const Directions trial(state);
        std::array<Pack, 3> n = trial.stress;
        const Pack share = softening.share(Driver::at_end(Pack(std::numeric_limits<double>::max()), given));
        const Pack F = back.yield_function(n[0], n[2], point.sin_phi, share * point.cohesion);
        const Pack multiplier = F / back.face_stiffness(point.sin_phi);
        const Pack strain = state.plastic_shear_strain + Pack(2.0) * multiplier;
        back.flow(n, 0, 2, multiplier);
        const Mask on_face = yields && F > Pack(0.0) && n[0] >= n[1] && n[1] >= n[2] && n[0] <= Pack(back.tensile_strength()) &&
                             softening.share(Driver::at_end(strain, given)) <= share;
        trial.give(state, n, on_face);
        state.plastic_shear_strain = select(on_face, strain, state.plastic_shear_strain);
        return yields && !on_face;
    }

    /// plastic() for the lanes of `rest`. Not inlined, so that the kernel keeps its registers where no lane comes here.
    template <class Driver>
    [[gnu::noinline]] State<Pack> plastic(State<Pack> state, const Strength<Pack>& point, Driver, Pack given, Mask rest) const
    {
        const Directions trial(state);
        const Pack own = state.plastic_shear_strain;
        std::array<Pack, 3> n = trial.stress;
        const auto excess = [&](Pack share, Mask open)
        {
            const std::array<Pack, 3> returned = back(trial.stress, point.sin_phi, share * point.cohesion);
            const Pack strain = own + back.plastic_shear(trial.stress, returned);
            for (std::size_t k = 0; k < 3; ++k)
                n[k] = select(open, returned[k], n[k]);
            state.plastic_shear_strain = select(open, strain, state.plastic_shear_strain);
            return share - softening.share(Driver::at_end(strain, given));
        };
        softening.solve(excess, Driver::at_end(own, given), rest);
        trial.give(state, n, rest);
        return state;
    }

    template <class Lanes, class Driver>
    TESTBED_INLINE void update(Points<2>& q, std::size_t p, const Lanes& lanes, const Gradient<2, Pack>& d, const Strength<Pack>& point,
                               Driver driver) const
    {
        State<Pack> state{q.stress_at(p, lanes), lanes.load(&q.szz[p]), lanes.load(&q.plastic_shear[p])};
        elastic(state, d);
        const Pack given = lanes.load(&Driver::field(q)[p]);
        if (const Mask yields = lanes.keep(!inside(state, point, given)); stdx::any_of(yields))
        {
            if (const Mask rest = return_to_face(state, point, driver, given, yields); stdx::any_of(rest))
                state = plastic(state, point, driver, given, rest);
            lanes.store(&q.plastic_shear[p], state.plastic_shear_strain);
        }
        q.set_stress(p, lanes, state.stress);
        lanes.store(&q.szz[p], state.stress_zz);
    }
};

/// The same law with a field of strength, or with softening by a nonlocal strain, or both.
template <bool varying_strength, bool nonlocal>
struct MohrCoulombField : MohrCoulomb
{
    using MohrCoulomb::update;

    void allocate(Points<2>& q) const
    {
        MohrCoulomb::allocate(q);
        if constexpr (varying_strength)
        {
            q.cohesion.activate(q.count);
            q.sin_friction.activate(q.count);
        }
        if constexpr (nonlocal)
            q.softening_strain.activate(q.count);
    }

    template <class Lanes>
    TESTBED_INLINE void update(Points<2>& q, std::size_t p, const Lanes& lanes, const Gradient<2, Pack>& d) const
    {
        Strength<Pack> point{Pack(strength.cohesion), Pack(strength.sin_phi)};
        if constexpr (varying_strength)
            point = {lanes.load(&q.cohesion[p]), lanes.load(&q.sin_friction[p])};
        MohrCoulomb::update(q, p, lanes, d, point, std::conditional_t<nonlocal, NonlocalDriver, LocalDriver>{});
    }
};

inline MohrCoulomb::Forms MohrCoulomb::make(const Keys& keys, const LawInput& input)
{
    const double tension = keys.strength->tensile_strength.value_or(std::numeric_limits<double>::infinity());
    const MohrCoulomb law{{input.moduli},
                          input.strength,
                          {input.moduli, std::sin(keys.strength->dilatancy_angle), tension},
                          keys.softening ? Softening::of(*keys.softening, input.cell_size) : Softening{}};
    const bool nonlocal = keys.softening && keys.softening->nonlocal;
    if (input.varying.strength && nonlocal)
        return MohrCoulombField<true, true>{law};
    if (input.varying.strength)
        return MohrCoulombField<true, false>{law};
    if (nonlocal)
        return MohrCoulombField<false, true>{law};
    return law;
}
}  // namespace testbed
