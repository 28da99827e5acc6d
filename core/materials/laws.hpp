#pragma once
/// The laws, a row each.

#include "core/materials/law_list.hpp"
#include "core/materials/mohr_coulomb.hpp"

namespace testbed
{
using Laws = LawList<LinearElastic, HypoelasticJaumann, HypoelasticExactRotation, MohrCoulomb>;

constexpr auto names(Law)
{
    return Laws::names();
}
}  // namespace testbed
