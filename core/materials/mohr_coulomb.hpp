#pragma once
/// Mohr-Coulomb in plane strain with the out-of-plane stress, tension positive, principal stresses s1 >= s2 >= s3:
///     F = s1 (1 + sin phi) - s3 (1 - sin phi) - 2 c cos phi <= 0,     s1 <= tensile strength.
/// Backward Euler in principal stresses (face, two edges, apex) after de Souza Neto, Peric & Owen (2008), ch. 8.
/// Cohesion falls from c to residual c over the plastic shear strain, solved together with the return.

#include "core/materials/elastic.hpp"
#include "core/materials/softening.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace testbed
{
/// Strength of one point. T is double or a pack.
template <class T = double>
struct Strength
{
    T cohesion;  ///< before softening [Pa]
    T sin_phi;
};

enum class YieldRegion
{
    elastic,
    face,
    left_edge,   ///< s1 = s2
    right_edge,  ///< s2 = s3
    apex,
    tension,  ///< the tensile strength alone
    corner    ///< tensile strength and Mohr-Coulomb together
};

/// Elastic constants and flow of a Mohr-Coulomb law, with the return of one stress for a given cohesion.
class MohrCoulombReturn
{
public:
    using Principal = std::array<double, 3>;  ///< descending [Pa]

    MohrCoulombReturn() = default;
    /// @param tensile_strength [Pa], infinity for none
    MohrCoulombReturn(const ElasticModuli& moduli, double sin_psi, double tensile_strength)
        : moduli_(moduli),
          sin_psi_(sin_psi),
          tensile_strength_(tensile_strength)
    {
    }
    double tensile_strength() const { return tensile_strength_; }
    double sin_psi() const { return sin_psi_; }

    /// T is double or a pack, in all templates here.
    template <class T>
    TESTBED_INLINE static T yield_function(T s1, T s3, T sin_phi, T cohesion)
    {
        using std::sqrt;
        return s1 * (T(1.0) + sin_phi) - s3 * (T(1.0) - sin_phi) - T(2.0) * cohesion * sqrt(T(1.0) - sin_phi * sin_phi);
    }

    /// Decrease of the yield function on a face per plastic multiplier.
    template <class T>
    TESTBED_INLINE T face_stiffness(T sin_phi) const
    {
        return T(4 * (moduli_.lame() * sin_psi_)) * sin_phi + T(4 * moduli_.shear()) * (T(1.0) + sin_phi * T(sin_psi_));
    }

    /// s -= multiplier D m, with the flow m = (1 + sin psi) on s[high] and -(1 - sin psi) on s[low].
    template <class T>
    TESTBED_INLINE void flow(std::array<T, 3>& s, std::size_t high, std::size_t low, T multiplier) const
    {
        const T volumetric = T(2 * moduli_.lame() * sin_psi_) * multiplier, shear = T(2 * moduli_.shear()) * multiplier;
        for (T& si : s)
            si -= volumetric;
        s[high] -= shear * T(1 + sin_psi_);
        s[low] += shear * T(1 - sin_psi_);
    }

    /// Returns the trial stress s in place.
    YieldRegion operator()(Principal& s, double sin_phi, double cohesion) const
    {
        const Principal trial = s;
        const YieldRegion shear = return_to_shear_surface(s, sin_phi, cohesion);
        if (s[0] <= tensile_strength_)
            return shear;
        s = trial;
        cut_tension(s);
        if (yield_function(s[0], s[2], sin_phi, cohesion) <= 0)
            return YieldRegion::tension;
        s = trial;
        return_to_corner(s, sin_phi, cohesion);
        return YieldRegion::corner;
    }

    /// Increment of the plastic shear strain from the trial to the returned stress: major minus minor principal plastic strain,
    /// the minor one counted not above zero, so that failure in tension counts, too. In simple shear this is gamma.
    double plastic_shear(const Principal& trial, const Principal& s) const
    {
        const double E = moduli_.youngs_modulus(), nu = moduli_.poissons_ratio();
        const Principal d{trial[0] - s[0], trial[1] - s[1], trial[2] - s[2]};
        const double sum = d[0] + d[1] + d[2];
        double major = 0, minor = 0;
        for (const double di : d)
        {
            const double strain = ((1 + nu) * di - nu * sum) / E;
            major = std::max(major, strain);
            minor = std::min(minor, strain);
        }
        return major - minor;
    }

private:
    /// Face, edges and apex of the surface F = 0.
    YieldRegion return_to_shear_surface(Principal& s, double sin_phi, double cohesion) const
    {
        const double F = yield_function(s[0], s[2], sin_phi, cohesion);
        if (F <= 0)
            return YieldRegion::elastic;
        const Principal trial = s;
        const double lame = 4 * moduli_.lame() * sin_phi * sin_psi_, shear = moduli_.shear();
        const double same = face_stiffness(sin_phi);
        flow(s, 0, 2, F / same);
        if (s[0] >= s[1] && s[1] >= s[2])
            return YieldRegion::face;
        const bool left = s[1] > s[0];
        s = trial;
        const double F2 = left ? yield_function(s[1], s[2], sin_phi, cohesion) : yield_function(s[0], s[1], sin_phi, cohesion);
        const double other = lame + 2 * shear * (left ? (1 - sin_phi) * (1 - sin_psi_) : (1 + sin_phi) * (1 + sin_psi_));
        const double determinant = same * same - other * other;
        flow(s, 0, 2, (same * F - other * F2) / determinant);
        left ? flow(s, 1, 2, (same * F2 - other * F) / determinant) : flow(s, 0, 1, (same * F2 - other * F) / determinant);
        const double mean = left ? 0.5 * (s[0] + s[1]) : 0.5 * (s[1] + s[2]);  // equal but for rounding
        (left ? s[0] : s[2]) = s[1] = mean;
        if (s[0] >= s[2] || sin_phi == 0)
            return left ? YieldRegion::left_edge : YieldRegion::right_edge;
        s.fill(cohesion * std::sqrt(1 - sin_phi * sin_phi) / sin_phi);
        return YieldRegion::apex;
    }

    /// Rankine's return: each principal stress above the tensile strength by associated flow; s[0] is above it.
    void cut_tension(Principal& s) const
    {
        const double limit = tensile_strength_;
        const double share = moduli_.lame() / moduli_.constrained();  // lateral over axial stress
        if (const double second = s[1] - share * (s[0] - limit); second <= limit)
            s = {limit, second, s[2] - share * (s[0] - limit)};
        else
            s = {limit, limit, std::min(limit, s[2] - share / (1 + share) * (s[0] + s[1] - 2 * limit))};
    }

    /// s1 at the tensile strength and s3 on the shear surface by the flow of both; s2 follows, between them.
    void return_to_corner(Principal& s, double sin_phi, double cohesion) const
    {
        const double limit = tensile_strength_, cos_phi = std::sqrt(1 - sin_phi * sin_phi);
        const double low = (limit * (1 + sin_phi) - 2 * cohesion * cos_phi) / (1 - sin_phi);
        const double lame = moduli_.lame(), volumetric = 2 * lame * sin_psi_;
        const double d1 = volumetric + 2 * moduli_.shear() * (1 + sin_psi_), d3 = volumetric - 2 * moduli_.shear() * (1 - sin_psi_);
        const double r1 = s[0] - limit, r3 = s[2] - low;
        const double determinant = moduli_.constrained() * d3 - lame * d1;
        const double opening = (r1 * d3 - r3 * d1) / determinant, shear = (moduli_.constrained() * r3 - lame * r1) / determinant;
        s = {limit, std::clamp(s[1] - lame * opening - volumetric * shear, low, limit), low};
    }

    ElasticModuli moduli_;
    double sin_psi_ = 0, tensile_strength_ = std::numeric_limits<double>::infinity();
};

/// The law with one strength for all points of the body, and softening by the point's own plastic shear strain.
struct MohrCoulomb
{
    ElasticModuli moduli;
    Strength<> strength{0, 0};
    MohrCoulombReturn back;
    Softening softening;

    template <class T>
    struct State
    {
        SymTensor<T> stress;
        T stress_zz{}, plastic_shear_strain{};
    };

    void allocate(Points& q) const
    {
        q.szz.activate(q.count);
        q.plastic_shear.activate(q.count);
    }

    /// The pure point function: stress after the displacement gradient increment d, with the law's one strength and softening by
    /// the point's own strain.
    void update(State<double>& state, const Gradient<double>& d) const
    {
        elastic(state, d);
        if (!inside(state, strength, state.plastic_shear_strain))
            plastic(state, strength, LocalDriver{});
    }

    /// The same on the points [p, p + lanes).
    template <class Lanes>
    TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const Gradient<Pack>& d) const
    {
        update(q, p, lanes, d, Strength<Pack>{Pack(strength.cohesion), Pack(strength.sin_phi)}, LocalDriver{});
    }

protected:
    /// What drives softening: the plastic shear strain of the point, at the end of the step.
    struct LocalDriver
    {
        template <class T>
        TESTBED_INLINE static T at_end(T own, T)
        {
            return own;
        }
        static const Field<double>& field(const Points& q) { return q.plastic_shear; }
    };
    /// A field that stays as it is within a step: the cohesion is known before the return.
    struct NonlocalDriver
    {
        template <class T>
        TESTBED_INLINE static T at_end(T, T given)
        {
            return given;
        }
        static const Field<double>& field(const Points& q) { return q.softening_strain; }
    };

    template <class T>
    TESTBED_INLINE void elastic(State<T>& state, const Gradient<T>& d) const
    {
        HypoelasticExactRotation::State<T> in_plane{state.stress};
        HypoelasticExactRotation{moduli}.update(in_plane, d);
        state.stress = in_plane.stress;
        state.stress_zz += T(moduli.lame()) * d.trace();
    }

    /// Whether the stress is admissible, for a double or for each lane of a pack.
    template <class T>
    TESTBED_INLINE decltype(T{} <= T{}) inside(const State<T>& state, const Strength<T>& strength, const T& driver) const
    {
        using std::sqrt;
        const SymTensor<T>& s = state.stress;
        const T mean = T(0.5) * (s.xx + s.yy), half = T(0.5) * (s.xx - s.yy);
        const T radius = sqrt(half * half + s.xy * s.xy);
        const T high = max(mean + radius, state.stress_zz), low = min(mean - radius, state.stress_zz);
        const T F = back.yield_function(high, low, strength.sin_phi, strength.cohesion * softening.share(driver));
        const T rounding = T(1e-13) * (max(high, -high) + max(low, -low));
        return F <= rounding && high <= T(back.tensile_strength());
    }

    /// The return of one point whose trial stress is not admissible.
    template <class Driver>
    void plastic(State<double>& state, const Strength<>& point, Driver, double given = 0) const
    {
        SymTensor<>& s = state.stress;
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
            back(returned, point.sin_phi, share * point.cohesion);
            increment = back.plastic_shear(trial, returned);
            return share - softening.share(Driver::at_end(own + increment, given));
        };
        softening.solve(excess, Driver::at_end(own, given));

        state.plastic_shear_strain = own + increment;
        state.stress_zz = returned[zz];
        const double new_mean = 0.5 * (returned[first] + returned[last]), new_radius = 0.5 * (returned[first] - returned[last]);
        const double ratio = radius > 0 ? new_radius / radius : 0;
        s = {new_mean + ratio * half, new_mean - ratio * half, ratio * s.xy};
    }

    /// The return of the lanes of `yields` that end on a face with the cohesion that is left after a large strain, or is given. Returns the
    /// lanes of `yields` that end elsewhere; they are left as they are.
    template <class Driver>
    TESTBED_INLINE Mask return_to_face(State<Pack>& state, const Strength<Pack>& point, Driver, Pack given, Mask yields) const
    {
        SymTensor<Pack>& s = state.stress;
        const Pack mean = Pack(0.5) * (s.xx + s.yy), half = Pack(0.5) * (s.xx - s.yy), radius = sqrt(half * half + s.xy * s.xy);
        const Pack high = mean + radius, low = mean - radius, zz = state.stress_zz;
        const Mask zz_first = zz > high, zz_last = zz < low;
        std::array<Pack, 3> n{max(high, zz), select(zz_first, high, select(zz_last, low, zz)), min(low, zz)};

        const Pack share = softening.share(Driver::at_end(Pack(std::numeric_limits<double>::max()), given));
        const Pack F = back.yield_function(n[0], n[2], point.sin_phi, share * point.cohesion);
        const Pack multiplier = F / back.face_stiffness(point.sin_phi);
        const Pack strain = state.plastic_shear_strain + Pack(2.0) * multiplier;
        const Pack driver = Driver::at_end(strain, given);
        back.flow(n, 0, 2, multiplier);
        const Mask on_face = yields && F > Pack(0.0) && n[0] >= n[1] && n[1] >= n[2] && n[0] <= Pack(back.tensile_strength()) &&
                             driver == driver && softening.share(driver) <= share;  // not NaN, which share() may lose

        const Pack new_high = select(zz_first, n[1], n[0]), new_low = select(zz_last, n[1], n[2]);
        const Pack new_mean = Pack(0.5) * (new_high + new_low);
        const Pack ratio = Pack(0.5) * (new_high - new_low) / select(radius > Pack(0.0), radius, Pack(1.0));
        s = {select(on_face, new_mean + ratio * half, s.xx), select(on_face, new_mean - ratio * half, s.yy),
             select(on_face, ratio * s.xy, s.xy)};
        state.stress_zz = select(on_face, select(zz_first, n[0], select(zz_last, n[2], n[1])), zz);
        state.plastic_shear_strain = select(on_face, strain, state.plastic_shear_strain);
        return yields && !on_face;
    }

    /// plastic() for each lane of `rest`. Not inlined, so that the kernel keeps its registers where no lane comes here.
    template <class Driver>
    [[gnu::noinline]] State<Pack> plastic_lanes(State<Pack> state, const Strength<Pack>& point, Driver driver, Pack given, Mask rest) const
    {
        for (std::size_t k = 0; k < pack_size; ++k)
            if (rest[k])
            {
                State<double> one{
                    {state.stress.xx[k], state.stress.yy[k], state.stress.xy[k]}, state.stress_zz[k], state.plastic_shear_strain[k]};
                plastic(one, Strength<>{point.cohesion[k], point.sin_phi[k]}, driver, given[k]);
                state.stress.xx[k] = one.stress.xx;
                state.stress.yy[k] = one.stress.yy;
                state.stress.xy[k] = one.stress.xy;
                state.stress_zz[k] = one.stress_zz;
                state.plastic_shear_strain[k] = one.plastic_shear_strain;
            }
        return state;
    }

    template <class Lanes, class Driver>
    TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const Gradient<Pack>& d, const Strength<Pack>& point,
                               Driver driver) const
    {
        State<Pack> state{
            {lanes.load(&q.sxx[p]), lanes.load(&q.syy[p]), lanes.load(&q.sxy[p])}, lanes.load(&q.szz[p]), lanes.load(&q.plastic_shear[p])};
        elastic(state, d);
        const Pack given = lanes.load(&Driver::field(q)[p]);
        if (const Mask yields = lanes.keep(!inside(state, point, given)); stdx::any_of(yields))
        {
            if (const Mask rest = return_to_face(state, point, driver, given, yields); stdx::any_of(rest))
                state = plastic_lanes(state, point, driver, given, rest);
            lanes.store(&q.plastic_shear[p], state.plastic_shear_strain);
        }
        lanes.store(&q.sxx[p], state.stress.xx);
        lanes.store(&q.syy[p], state.stress.yy);
        lanes.store(&q.sxy[p], state.stress.xy);
        lanes.store(&q.szz[p], state.stress_zz);
    }
};

/// The same law with a field of strength, or with softening by a nonlocal strain, or both.
template <bool varying_strength, bool nonlocal>
struct MohrCoulombField : MohrCoulomb
{
    using MohrCoulomb::update;

    void allocate(Points& q) const
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
    TESTBED_INLINE void update(Points& q, std::size_t p, const Lanes& lanes, const Gradient<Pack>& d) const
    {
        Strength<Pack> point{Pack(strength.cohesion), Pack(strength.sin_phi)};
        if constexpr (varying_strength)
            point = {lanes.load(&q.cohesion[p]), lanes.load(&q.sin_friction[p])};
        MohrCoulomb::update(q, p, lanes, d, point, std::conditional_t<nonlocal, NonlocalDriver, LocalDriver>{});
    }
};
}  // namespace testbed
