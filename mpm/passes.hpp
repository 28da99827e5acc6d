#pragma once
/// Passes of MPM over the points, bin by bin: their velocity, stress and position from the nodes.

#include "core/bodies/bin_sums.hpp"
#include "core/bodies/cloud.hpp"
#include "mpm/grid.hpp"
#include "mpm/xpic.hpp"

namespace testbed
{
/// The new velocity of the points; and the sums of their momentum, if nodes ask for them.
template <class Strain, bool with_remap, class Shape, class Update>
void update_velocity(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, Update& rule)
{
    using Momentum = NodeSums<Shape, Strain, Scatter::momentum>;
    cloud.for_each_bin(grid.lattice,
                       [&](Body& body, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                       {
                           Points& q = body.points;
                           const auto update = rule.template in_bin<Shape::S>(grid.lattice, grid.nodes, body, bin);
                           for_each_pack(bin.begin, bin.end,
                                         [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                         {
                                             const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                             update.update(q, p, lanes, at);
                                         });
                           if constexpr (with_remap)
                               sum_bin<Shape, Momentum>(grid.lattice, body, bin, &cloud.workspace[number * Momentum::numbers]);
                       });
}

/// A nodal field goes to the points and back.
template <class Shape>
void smooth(Cloud<Shape>& cloud, MpmGrid<Shape>& grid, std::vector<double>& x, std::vector<double>& y)
{
    using Smoothed = SmoothedSums<Shape>;
    grid.extend(x, y);
    cloud.for_each_bin(grid.lattice,
                       [&](const Body& body, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                       {
                           Smoothed sums(grid.lattice, bin, x, y);
                           for_each_pack(bin.begin, bin.end,
                                         [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                         { sums.add(body.points, lanes, frame.template corner<Shape>(body.points, p, lanes)); });
                           sums.write(&cloud.workspace[number * Smoothed::numbers]);
                       });
    grid.gather.template sum<2>(cloud.workspace,
                                [&](std::size_t i, const std::array<double, 2>& s)
                                {
                                    x[i] = s[0];
                                    y[i] = s[1];
                                });
    grid.fold(x);
    grid.fold(y);
    grid.nodes.for_each(
        [&](std::size_t i, const auto& lanes)
        {
            const Pack inverse = inverse_mass(grid.nodes, i, lanes);
            lanes.store(&x[i], lanes.load(&x[i]) * inverse);
            lanes.store(&y[i], lanes.load(&y[i]) * inverse);
        });
}

/// Stress alone, with the nodal velocity (USF).
template <class Strain, class Shape>
void update_stress(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, const StrainIncrement& increment, double dt)
{
    cloud.for_each_bin_with_law(grid.lattice,
                                [&](Body& body, const auto& law, const Bin& bin, std::size_t, const BinFrame& frame)
                                {
                                    Points& q = body.points;
                                    const typename Strain::template InBin<Shape> strain(grid.lattice, q, bin);
                                    const NodalVelocity<Shape::S> v(grid.lattice, bin, grid.nodes.vx, grid.nodes.vy);
                                    for_each_pack(bin.begin, bin.end,
                                                  [&](std::size_t p, const auto& lanes)
                                                  {
                                                      const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                                      law.update(q, p, lanes, increment.of(v.template gradient<Strain>(at, strain, dt)));
                                                  });
                                });
}

/// Position with the carrier velocity; volume or box with the nodal velocity. If the stress is not updated first: stress, too, and the
/// sums of the bins for the next step.
/// @param sums of the bins, numbers for each, or null if the stress came first
template <class Strain, bool with_stress, class Shape>
void move_points(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, const StrainIncrement& increment, const std::vector<double>& carrier_x,
                 const std::vector<double>& carrier_y, double dt, double* sums)
{
    using Sums = NodeSums<Shape, Strain, Scatter::momentum_and_force>;
    cloud.for_each_bin_with_law(grid.lattice,
                                [&](Body& body, const auto& law, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                                {
                                    Points& q = body.points;
                                    const typename Strain::template InBin<Shape> strain(grid.lattice, q, bin);
                                    const NodalVelocity<Shape::S> carrier(grid.lattice, bin, carrier_x, carrier_y),
                                        v(grid.lattice, bin, grid.nodes.vx, grid.nodes.vy);
                                    bool left = false;
                                    for_each_pack(bin.begin, bin.end,
                                                  [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                                  {
                                                      const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                                      const Gradient<Pack> d = increment.of(v.template gradient<Strain>(at, strain, dt));
                                                      if constexpr (with_stress)
                                                          law.update(q, p, lanes, d);
                                                      stretch<Shape>(q, p, lanes, increment, d);
                                                      const auto step = carrier.at(at);
                                                      const Pack x = lanes.load(&q.x[p]) + step[0] * Pack(dt),
                                                                 y = lanes.load(&q.y[p]) + step[1] * Pack(dt);
                                                      lanes.store(&q.x[p], x);
                                                      lanes.store(&q.y[p], y);
                                                      if constexpr (!with_stress)
                                                          left |= stdx::any_of(frame.template left<Shape>(
                                                              q, p, lanes, frame.template corner<Shape>(q, p, lanes, x, y)));
                                                  });
                                    if constexpr (with_stress)
                                        left |= sum_bin<Shape, Sums>(grid.lattice, body, bin, sums + number * Sums::numbers);
                                    if (left)
                                        body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
                                });
}

/// Whether a point of a bin has left it.
template <class Shape>
bool any_left(const Points& q, const Bin& bin, const BinFrame& frame)
{
    bool left = false;
    for_each_pack(bin.begin, bin.end,
                  [&](std::size_t p, const auto& lanes)
                  { left |= stdx::any_of(frame.template left<Shape>(q, p, lanes, frame.template corner<Shape>(q, p, lanes))); });
    return left;
}
}  // namespace testbed
