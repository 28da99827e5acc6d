#pragma once
/// Guards over the balance sheets of a run: energy, momentum, and a settlement that nothing makes.

#include "core/run/guards.hpp"

namespace testbed
{
/// Mean over whole periods of a record that swings about it, by the times at which it rises through its average.
/// @param t, y the record, in order of time @returns nothing with less than five periods, or less than eight samples in each and a thousand
/// in all
std::optional<double> mean_of_periods(std::span<const double> t, std::span<const double> y);

/// energy, gravity_work, hourglass, momentum, drift, released: as far as the scene has what they balance.
std::vector<std::unique_ptr<Guard>> balance_guards(const Scene& scene);
}  // namespace testbed
