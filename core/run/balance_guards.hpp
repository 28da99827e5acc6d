#pragma once
/// Guards over the balance sheets of a run: energy and momentum.

#include "core/run/guards.hpp"

namespace testbed
{
/// energy, loss, gravity_work, hourglass, momentum, and those of motion_guards.hpp: as far as the scene has what they balance.
std::vector<std::unique_ptr<Guard>> balance_guards(const Scene& scene);
}  // namespace testbed
