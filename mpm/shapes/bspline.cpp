#include "mpm/shapes/bspline.hpp"

#include "mpm/step.hpp"

namespace testbed
{
template std::unique_ptr<Solver> make_mpm_of<BSplineShape, PointStrain>(const Scene&);
}  // namespace testbed
