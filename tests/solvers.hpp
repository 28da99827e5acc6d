#pragma once
/// The particle methods, for tests that run on all of them.

#include "lpfdm/lpfdm.hpp"
#include "mpm/mpm.hpp"

#include <string>
#include <vector>

namespace testbed::test
{
inline const std::vector<std::string> all_methods{"lpfdm-2000", "lpfdm", "mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"};

inline std::unique_ptr<Solver> make(const Scene& scene)
{
    return method_of(scene).make(scene);
}
}  // namespace testbed::test
