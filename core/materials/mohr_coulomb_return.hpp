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
}  // namespace testbed
