#include "mpm/shapes/cpgimp.hpp"

#include "mpm/step.hpp"

namespace testbed
{
template std::unique_ptr<Solver> make_mpm_of<GimpShape, PointStrain>(const Scene&);
}  // namespace testbed
