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

/// What a law must offer: a pure point function (FEM quadrature calls it, too) and its batch form.
template <class Law>
concept MaterialLaw = requires(const Law law, typename Law::template State<double> state, Points points, Gradient<double> d,
                               Gradient<Pack> packs)
{
    {
        law.moduli
        } -> std::convertible_to<ElasticModuli>;
    law.allocate(points);
    law.update(state, d);
    law.update(points, std::size_t{}, AllLanes{}, packs);
};
static_assert(MaterialLaw<LinearElastic> && MaterialLaw<VaryingStiffness<HypoelasticJaumann>> && MaterialLaw<MohrCoulombField<true, true>>);

inline const ElasticModuli& moduli(const Material& material)
{
    return std::visit([](const auto& law) -> const ElasticModuli& { return law.moduli; }, material);
}
}  // namespace testbed
