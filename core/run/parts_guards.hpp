#pragma once
/// Guards over what hangs together: bodies that come apart, or off each other.

#include "core/run/guards.hpp"

namespace testbed
{
/// Parts of a body between which no force passes: they share no node. @param reach bins (columns or lines) at which two still share one
std::size_t connected_parts(const std::vector<Bin<2>>& bins, int reach);
/// Whether two bodies share a node.
bool in_contact(const std::vector<Bin<2>>& a, const std::vector<Bin<2>>& b, int reach);
/// separated, contact_lost.
std::vector<std::unique_ptr<Guard>> parts_guards(const Scene& scene);
}  // namespace testbed
