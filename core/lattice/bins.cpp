#include "core/lattice/bins.hpp"

#include <fmt/ranges.h>

namespace testbed
{
template <int dim>
void Bins<dim>::throw_left_lattice(const Points<dim>& points, std::size_t p)
{
    const auto list = [&](const auto& vector) { return fmt::format("({:.6g})", fmt::join(at(vector, p), ", ")); };
    if (points.has_box() && !std::all_of(points.half_width.begin(), points.half_width.end(), [&](const auto& half) { return half[p] > 0; }))
        throw Diverged(fmt::format("the box of point {} has collapsed: half widths {} m", points.id[p], list(points.half_width)));
    throw Diverged(fmt::format("point {} left the lattice or is not finite: position {} m", points.id[p], list(points.x)));
}
template void Bins<2>::throw_left_lattice(const Points<2>&, std::size_t);
template void Bins<3>::throw_left_lattice(const Points<3>&, std::size_t);
}  // namespace testbed
