#pragma once
/// The FEM reference as scenes and lists know it, without deal.II.

#include "core/scene/method.hpp"

namespace testbed
{
/// Its row; its solver is a program of its own, testbed-fem.
Method fem_method();
}  // namespace testbed
