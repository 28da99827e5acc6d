#include "core/lattice/bins.hpp"

#include <fmt/core.h>

namespace testbed
{
void Bins::throw_left_lattice(const Points& points, std::size_t p)
{
    if (points.half_x.active() && !(points.half_x[p] > 0 && points.half_y[p] > 0))
        throw Diverged(fmt::format("the box of point {} has collapsed: half widths ({:.6g}, {:.6g}) m", points.id[p], points.half_x[p],
                                   points.half_y[p]));
    throw Diverged(
        fmt::format("point {} left the lattice or is not finite: position ({:.6g}, {:.6g}) m", points.id[p], points.x[p], points.y[p]));
}
}  // namespace testbed
