#pragma once
/// Guards that look at whole fields, once, at the end of a run of elastic bodies: what the lattice does not resolve.

#include "core/run/guards.hpp"

namespace testbed
{
/// noise, crossing, mixed_cells: for scenes without a law that may flow; else none.
std::vector<std::unique_ptr<Guard>> field_guards(const Scene& scene);
}  // namespace testbed
