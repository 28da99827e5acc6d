#include "mpm/shapes/linear.hpp"

#include "mpm/step.hpp"

namespace testbed
{
template std::unique_ptr<Solver> make_mpm_of<LinearShape, PointStrain>(const Scene&);
template std::unique_ptr<Solver> make_mpm_of<LinearShape, BBarStrain>(const Scene&);
}  // namespace testbed
