#pragma once
/// Passes of MPM over the points, bin by bin: their velocity, stress and position from the nodes.

#include "core/bodies/bin_sums.hpp"
#include "core/bodies/cloud.hpp"
#include "core/bodies/stress_runs.hpp"
#include "mpm/grid.hpp"
#include "mpm/xpic.hpp"

namespace testbed
{
/// The new velocity of the points; and the sums of their momentum, if nodes ask for them.
template <class Strain, bool with_remap, class Shape, class Update>
void update_velocity(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, Update& rule)
{
    using Momentum = NodeSums<Shape, Strain, Scatter::momentum>;
    cloud.for_each_bin(
        grid.lattice,
        [&](Body& body, const Bin<2>& bin, std::size_t number, const BinFrame<2>& frame) TESTBED_FLATTEN
        {
            Points<2>& q = body.points;
            const auto update = rule.template in_bin<Shape::S>(grid.lattice, grid.nodes, body, bin);
            with_packs_for(bin.end - bin.begin,
                           [&]<AnyPack P>(const P&) TESTBED_INLINE
                           {
                               for_each_pack<P>(bin.begin, bin.end,
                                                [&](std::size_t p, const auto& lanes) TESTBED_INLINE {
                                                    update.update(q, p, lanes,
                                                                  shape_at<Shape>(frame.template corner<Shape>(q, p, lanes), frame.scale));
                                                });
                           });
            if constexpr (with_remap)
                sum_bin<Shape, Momentum>(grid.lattice, body, bin, &cloud.workspace[number * Momentum::numbers]);
        });
}

/// A nodal field goes to the points and back.
template <class Shape>
void smooth(Cloud<Shape>& cloud, MpmGrid<Shape>& grid, VectorField<2>& field)
{
    using Smoothed = SmoothedSums<Shape>;
    grid.extend(field);
    cloud.for_each_bin(grid.lattice,
                       [&](const Body& body, const Bin<2>& bin, std::size_t number, const BinFrame<2>& frame) TESTBED_FLATTEN
                       {
                           Smoothed sums(grid.lattice, bin, field);
                           for_each_pack(bin.begin, bin.end,
                                         [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                         { sums.add(body.points, lanes, frame.template corner<Shape>(body.points, p, lanes)); });
                           sums.write(&cloud.workspace[number * Smoothed::numbers]);
                       });
    grid.gather.template sum<2>(cloud.workspace, [&](std::size_t i, const Vec<2>& s) { set(field, i, s); });
    grid.fold(field);
    grid.nodes.for_each(
        [&](std::size_t i, const auto& lanes)
        {
            const Pack inverse = inverse_mass(grid.nodes, i, lanes);
            unrolled<2>([&](auto d) { lanes.store(&field[d][i], lanes.load(&field[d][i]) * inverse); });
        });
}

/// Stress alone, with the nodal velocity (USF).
template <class Strain, class Shape>
void update_stress(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, const StrainIncrement& increment, double dt)
{
    cloud.for_each_body(
        [&](Body& body, std::size_t)
        {
            const auto strain = [&](std::size_t b, auto&& keep) TESTBED_INLINE
            {
                const Bin<2>& bin = body.bins.list()[b];
                const BinFrame<2> frame(grid.lattice, bin);
                const typename Strain::template InBin<Shape> strain_in(grid.lattice, body.points, bin);
                const NodalVelocity<Shape::S> v(grid.lattice, bin, grid.nodes.v);
                for_each_pack(bin.begin, bin.end,
                              [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                              {
                                  const ShapeAt<Shape> at(frame.template corner<Shape>(body.points, p, lanes), frame.scale);
                                  keep(p, lanes, increment.of(v.template gradient<Strain>(at, strain_in, dt)));
                              });
            };
            testbed::update_stress(body, strain, [](std::size_t) {});
        });
}

/// Whether a point of a bin has left it.
template <class Shape>
bool any_left(const Points<2>& q, const Bin<2>& bin, const BinFrame<2>& frame)
{
    bool left = false;
    for_each_pack(bin.begin, bin.end,
                  [&](std::size_t p, const auto& lanes)
                  { left |= stdx::any_of(frame.template left<Shape>(q, p, lanes, frame.template corner<Shape>(q, p, lanes))); });
    return left;
}

/// Position with the carrier velocity; volume or box with the nodal velocity. If the stress is not updated first: stress, too, and the
/// sums of the bins for the next step.
/// @param sums of the bins, numbers for each, or null if the stress came first
template <class Strain, bool with_stress, class Shape>
void move_points(Cloud<Shape>& cloud, const MpmGrid<Shape>& grid, const StrainIncrement& increment, const VectorField<2>& carrier_velocity,
                 double dt, double* sums)
{
    using Sums = NodeSums<Shape, Strain, Scatter::momentum_and_force>;
    const auto move = [&](Body& body, const Bin<2>& bin, auto&& keep) TESTBED_INLINE
    {
        Points<2>& q = body.points;
        const BinFrame<2> frame(grid.lattice, bin);
        const typename Strain::template InBin<Shape> strain(grid.lattice, q, bin);
        const NodalVelocity<Shape::S> carrier(grid.lattice, bin, carrier_velocity), v(grid.lattice, bin, grid.nodes.v);
        bool left = false;
        const auto move_pack = [&](std::size_t p, const auto& lanes) TESTBED_INLINE
        {
            using Pack = typename std::decay_t<decltype(lanes)>::Pack;
            const auto at = shape_at<Shape>(frame.template corner<Shape>(q, p, lanes), frame.scale);
            const auto d = increment.of(v.template gradient<Strain>(at, strain, dt));
            keep(p, lanes, d);
            stretch<Shape>(q, p, lanes, increment, d);
            auto x = carrier.at(at);
            unrolled<2>([&](auto i) TESTBED_INLINE { x[i] = lanes.load(&q.x[i][p]) + x[i] * Pack(dt); });
            store(q.x, p, lanes, x);
            if constexpr (!with_stress)  // else the sums of the bin tell
                left |= stdx::any_of(frame.template left<Shape>(q, p, lanes, frame.template corner<Shape>(q, p, lanes, x)));
        };
        with_packs_for(bin.end - bin.begin, [&]<AnyPack P>(const P&) TESTBED_INLINE { for_each_pack<P>(bin.begin, bin.end, move_pack); });
        return left;
    };
    if constexpr (with_stress)
        cloud.for_each_body(
            [&](Body& body, std::size_t first_bin)
            {
                const auto& bins = body.bins.list();
                testbed::update_stress(
                    body, [&](std::size_t b, auto&& keep) TESTBED_INLINE { move(body, bins[b], keep); },
                    [&](std::size_t b) TESTBED_INLINE
                    {
                        if (sum_bin<Shape, Sums>(grid.lattice, body, bins[b], sums + (first_bin + b) * Sums::numbers))
                            body.bins.mark(b);
                    });
            });
    else
        cloud.for_each_bin(grid.lattice,
                           [&](Body& body, const Bin<2>& bin, std::size_t, const BinFrame<2>&) TESTBED_FLATTEN
                           {
                               if (move(body, bin, [](std::size_t, const auto&, const auto&) {}))
                                   body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
                           });
}
}  // namespace testbed
