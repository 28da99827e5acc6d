#pragma once
/// The return of a stress to the Mohr-Coulomb surface with a tensile strength: backward Euler in principal stresses (face, two edges, apex)
/// after de Souza Neto, Peric & Owen (2008), ch. 8. Tension positive, s1 >= s2 >= s3.

#include "core/materials/elastic.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace testbed
{
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

/// Elastic constants and flow of a Mohr-Coulomb law, with the return of one stress, or a pack of them, for a given cohesion.
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

    /// The same for packs: each lane goes the way that the numbers in it ask for.
    std::array<Pack, 3> operator()(const std::array<Pack, 3>& trial, Pack sin_phi, Pack cohesion) const
    {
        std::array<Pack, 3> s = on_shear_surface(trial, sin_phi, cohesion);
        if (const Mask torn = !(s[0] <= Pack(tensile_strength_)); stdx::any_of(torn))
        {
            const std::array<Pack, 3> cut = without_tension(trial);
            const Mask outside = yield_function(cut[0], cut[2], sin_phi, cohesion) > Pack(0.0);
            s = select(torn, stdx::any_of(torn && outside) ? select(outside, at_corner(trial, sin_phi, cohesion), cut) : cut, s);
        }
        return s;
    }

    /// Increment of the plastic shear strain from the trial to the returned stress: major minus minor principal plastic strain,
    /// the minor one counted not above zero, so that failure in tension counts, too. In simple shear this is gamma.
    template <class T>
    T plastic_shear(const std::array<T, 3>& trial, const std::array<T, 3>& s) const
    {
        const double E = moduli_.youngs_modulus(), nu = moduli_.poissons_ratio();
        const std::array<T, 3> d{trial[0] - s[0], trial[1] - s[1], trial[2] - s[2]};
        const T sum = d[0] + d[1] + d[2];
        T major(0.0), minor(0.0);
        for (const T& di : d)
        {
            const T strain = (T(1 + nu) * di - T(nu) * sum) / T(E);
            major = max(major, strain);
            minor = min(minor, strain);
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

    static std::array<Pack, 3> select(Mask mask, const std::array<Pack, 3>& a, const std::array<Pack, 3>& b)
    {
        return {testbed::select(mask, a[0], b[0]), testbed::select(mask, a[1], b[1]), testbed::select(mask, a[2], b[2])};
    }

    std::array<Pack, 3> on_shear_surface(const std::array<Pack, 3>& trial, Pack sin_phi, Pack cohesion) const
    {
        const Pack F = yield_function(trial[0], trial[2], sin_phi, cohesion), same = face_stiffness(sin_phi);
        std::array<Pack, 3> face = trial;
        flow(face, 0, 2, F / same);
        const Mask yields = !(F <= Pack(0.0)), beside = yields && !(face[0] >= face[1] && face[1] >= face[2]);
        const std::array<Pack, 3> s = select(yields, face, trial);
        return stdx::any_of(beside) ? select(beside, on_edge(trial, face[1] > face[0], F, same, sin_phi, cohesion), s) : s;
    }

    /// The left edge, or the right one, or the apex. @param F, same of the face between the largest and the smallest stress
    std::array<Pack, 3> on_edge(const std::array<Pack, 3>& trial, Mask left, Pack F, Pack same, Pack sin_phi, Pack cohesion) const
    {
        using testbed::select;
        const Pack one(1.0), none(0.0);
        const Pack F2 = yield_function(select(left, trial[1], trial[0]), select(left, trial[2], trial[1]), sin_phi, cohesion);
        const Pack sides = select(left, (one - sin_phi) * Pack(1 - sin_psi_), (one + sin_phi) * Pack(1 + sin_psi_));
        const Pack other = Pack(4 * (moduli_.lame() * sin_psi_)) * sin_phi + Pack(2 * moduli_.shear()) * sides;
        const Pack inverse = one / (same * same - other * other), second = (same * F2 - other * F) * inverse;
        std::array<Pack, 3> s = trial;
        flow(s, 0, 2, (same * F - other * F2) * inverse);
        const Pack volumetric = Pack(2 * moduli_.lame() * sin_psi_) * second, shear = Pack(2 * moduli_.shear()) * second;
        const Pack down = shear * Pack(1 + sin_psi_), up = shear * Pack(1 - sin_psi_);
        s[0] -= volumetric + select(left, none, down);
        s[1] -= volumetric + select(left, down, -up);
        s[2] -= volumetric - select(left, up, none);
        const Pack mean = Pack(0.5) * (s[1] + select(left, s[0], s[2]));
        s = {select(left, mean, s[0]), mean, select(left, s[2], mean)};
        const Mask beyond = !(s[0] >= s[2]) && sin_phi != none;
        const Pack apex = cohesion * sqrt(one - sin_phi * sin_phi) / sin_phi;
        return {select(beyond, apex, s[0]), select(beyond, apex, s[1]), select(beyond, apex, s[2])};
    }

    std::array<Pack, 3> without_tension(const std::array<Pack, 3>& s) const
    {
        const Pack limit(tensile_strength_), share(moduli_.lame() / moduli_.constrained()), above = s[0] - limit;
        const Pack second = s[1] - share * above, third = s[2] - share * above;
        const Pack of_both = min(limit, s[2] - share / (Pack(1.0) + share) * (above + s[1] - limit));
        const Mask one = second <= limit;
        return {limit, testbed::select(one, second, limit), testbed::select(one, third, of_both)};
    }

    std::array<Pack, 3> at_corner(const std::array<Pack, 3>& s, Pack sin_phi, Pack cohesion) const
    {
        const Pack one(1.0), limit(tensile_strength_);
        const Pack low = (limit * (one + sin_phi) - Pack(2.0) * cohesion * sqrt(one - sin_phi * sin_phi)) / (one - sin_phi);
        const double lame = moduli_.lame(), M = moduli_.constrained(), volumetric = 2 * lame * sin_psi_;
        const double d1 = volumetric + 2 * moduli_.shear() * (1 + sin_psi_), d3 = volumetric - 2 * moduli_.shear() * (1 - sin_psi_);
        const Pack r1 = s[0] - limit, r3 = s[2] - low, inverse(1 / (M * d3 - lame * d1));
        const Pack opening = (r1 * Pack(d3) - r3 * Pack(d1)) * inverse, shear = (Pack(M) * r3 - Pack(lame) * r1) * inverse;
        return {limit, max(low, min(limit, s[1] - Pack(lame) * opening - Pack(volumetric) * shear)), low};
    }

    ElasticModuli moduli_;
    double sin_psi_ = 0, tensile_strength_ = std::numeric_limits<double>::infinity();
};
}  // namespace testbed
