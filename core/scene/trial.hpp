#pragma once
/// What a scene's expressions give where a run asks for them: `testbed check` and a run refuse before the first step what would fail later.

#include "core/scene/scene.hpp"

namespace testbed
{
/// Evaluates all expressions of bodies, loads, probes and exact solutions at the initial points, at the start and at the end of the scene.
/// Those of the current position x, y are tried at the start alone: where points will be is not known.
/// @throws SceneError for the first that is not finite there, and for a probe of no point
void try_expressions(const Scene& scene);
}  // namespace testbed
