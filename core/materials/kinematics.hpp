#pragma once
/// The strain that a law adds up, and with that the exact solutions that it can be held against.

#include "core/base/choice.hpp"

namespace testbed
{
enum class Kinematics
{
    small_strain,
    hypoelastic
};
constexpr auto names(Kinematics)
{
    return choice_names<Kinematics>({{Kinematics::small_strain, "small_strain"}, {Kinematics::hypoelastic, "hypoelastic"}});
}
}  // namespace testbed
