#include "core/materials/make_material.hpp"

namespace testbed
{
namespace
{
template <class Law>
Material elastic(const ElasticModuli& moduli, bool varies)
{
    if (varies)
        return VaryingStiffness<Law>{{{{moduli}}}};
    return Law{{moduli}};
}

Softening make_softening(const SofteningSpec& spec, double cell_size)
{
    if (spec.kind == SofteningSpec::Kind::drop)
        return Softening::drop(spec.residual);
    const double scaling = spec.band_thickness ? cell_size / *spec.band_thickness : 1;
    return Softening::linear(spec.residual, *spec.strain / scaling);
}

Material mohr_coulomb(const MaterialSpec& spec, const ElasticModuli& moduli, const Strength<>& strength, double cell_size, bool varies)
{
    const double tension = spec.strength->tensile_strength.value_or(std::numeric_limits<double>::infinity());
    const MohrCoulomb law{{moduli},
                          strength,
                          {moduli, std::sin(spec.strength->dilatancy_angle), tension},
                          spec.softening ? make_softening(*spec.softening, cell_size) : Softening{}};
    const bool nonlocal = spec.softening && spec.softening->nonlocal;
    if (varies && nonlocal)
        return MohrCoulombField<true, true>{law};
    if (varies)
        return MohrCoulombField<true, false>{law};
    if (nonlocal)
        return MohrCoulombField<false, true>{law};
    return law;
}
}  // namespace

Material make_material(const MaterialSpec& spec, const ElasticModuli& moduli, const Strength<>& strength, double cell_size, Varying varying)
{
    switch (spec.law)
    {
    case MaterialSpec::Law::linear_elastic: return elastic<LinearElastic>(moduli, varying.stiffness);
    case MaterialSpec::Law::hypoelastic_jaumann: return elastic<HypoelasticJaumann>(moduli, varying.stiffness);
    case MaterialSpec::Law::hypoelastic_exact_rotation: return elastic<HypoelasticExactRotation>(moduli, varying.stiffness);
    case MaterialSpec::Law::mohr_coulomb: return mohr_coulomb(spec, moduli, strength, cell_size, varying.strength);
    }
    throw std::logic_error("not a law");
}
}  // namespace testbed
