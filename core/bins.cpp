#include "core/bins.hpp"

#include <fmt/core.h>

namespace testbed
{
void Bins::throw_left_lattice(const Points& points, std::size_t p)
{
    throw Diverged(fmt::format("point {} left the lattice or is not finite: position ({:.6g}, {:.6g}) m, from ({:.6g}, {:.6g}) m",
                               points.id[p], points.x[p], points.y[p], points.X[p], points.Y[p]));
}
}  // namespace testbed
