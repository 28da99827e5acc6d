#pragma once
/// The closed set of laws. A body holds one of them; a kernel visits it once per launch.

#include "core/materials/mohr_coulomb.hpp"

#include <concepts>
#include <variant>

namespace testbed
{
using Material = std::variant<LinearElastic, HypoelasticJaumann, HypoelasticExactRotation, VaryingStiffness<LinearElastic>,
                              VaryingStiffness<HypoelasticJaumann>, VaryingStiffness<HypoelasticExactRotation>, MohrCoulomb,
                              MohrCoulombField<true, false>, MohrCoulombField<false, true>, MohrCoulombField<true, true>>;

/// What a law must offer: a pure point function (which a quadrature point or a triangle can call, too), its batch form, and what only
/// the law knows of itself: energy, wave speed, out-of-plane stress, kinematics.
template <class Law>
concept MaterialLaw = requires(const Law law, typename Law::template State<double> state, Points<2> points, Gradient<2> d,
                               Gradient<2, Pack> packs)
{
    {
        law.moduli
        } -> std::convertible_to<ElasticModuli>;
    {
        Law::kinematics
        } -> std::convertible_to<Kinematics>;
    {
        law.wave_speed(points)
        } -> std::same_as<double>;
    {
        law.energy_density(SymTensor<2>{}, 0.0)
        } -> std::same_as<double>;
    {
        law.out_of_plane_stress(points, std::size_t{})
        } -> std::same_as<double>;
    {
        law.elastic_out_of_plane_stress(SymTensor<2>{})
        } -> std::same_as<double>;
    law.allocate(points);
    law.update(state, d);
    law.update(points, std::size_t{}, AllLanes{}, packs);
};
static_assert(MaterialLaw<LinearElastic> && MaterialLaw<VaryingStiffness<HypoelasticJaumann>> && MaterialLaw<MohrCoulombField<true, true>>);

inline const ElasticModuli& moduli(const Material& material)
{
    return std::visit([](const auto& law) -> const ElasticModuli& { return law.moduli; }, material);
}
inline Kinematics kinematics(const Material& material)
{
    return std::visit([](const auto& law) { return law.kinematics; }, material);
}
/// Of compression in these points, the stiffest of them [m/s].
inline double wave_speed(const Material& material, const Points<2>& q)
{
    return std::visit([&](const auto& law) { return law.wave_speed(q); }, material);
}
/// Of point p [Pa].
inline double out_of_plane_stress(const Material& material, const Points<2>& q, std::size_t p)
{
    return std::visit([&](const auto& law) { return law.out_of_plane_stress(q, p); }, material);
}
/// Energy of the stress of point p on its current volume, that is given back [J/m].
template <MaterialLaw Law>
double strain_energy(const Law& law, const Points<2>& q, std::size_t p)
{
    return q.current_volume(p) * law.energy_density(q.stress_at(p), law.out_of_plane_stress(q, p)) / stiffness_ratio(q, p);
}
inline double strain_energy(const Material& material, const Points<2>& q, std::size_t p)
{
    return std::visit([&](const auto& law) { return strain_energy(law, q, p); }, material);
}
}  // namespace testbed
