#pragma once
/// Guards over the motion of elastic bodies: a settlement that nothing makes, and stress let go.

#include "core/run/guards.hpp"

namespace testbed
{
/// Mean over whole periods of a record that swings about it, by the times at which it rises through its average.
/// @param t, y the record, in order of time @returns nothing with less than five periods, or less than eight samples in each and a thousand
/// in all
std::optional<double> mean_of_periods(std::span<const double> t, std::span<const double> y);

/// drift, released.
std::vector<std::unique_ptr<Guard>> motion_guards(const Scene& scene);
}  // namespace testbed
