#pragma once
/// A body's law, one of the closed set. A kernel visits it once per launch.

#include "core/materials/laws.hpp"

#include <variant>

namespace testbed
{
using Material = Laws::Material;

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
