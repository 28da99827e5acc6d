#pragma once
/// The initial velocity of the bodies at the nodes of LPFDM.

#include "core/bodies/body.hpp"
#include "lpfdm/grid.hpp"

#include <optional>

namespace testbed
{
/// Nodes start with the bodies' velocity at their own position, weighted by the mass that each body gives them.
/// @param sums of the bins, four numbers for each block, the first of which is the mass
template <int S>
void set_initial_velocity(LpfdmGrid& grid, const Scene& scene, const std::vector<Body>& bodies, const std::vector<double>& sums)
{
    std::vector<double> mass(grid.lattice.nodes(), 0.0);
    std::size_t block = 0;
    for (std::size_t b = 0; b < bodies.size(); ++b)
    {
        std::optional<VectorExpression> velocity;
        if (scene.bodies[b].velocity)
            velocity.emplace(*scene.bodies[b].velocity, scene.expression_constants());
        for (const Bin& bin : bodies[b].bins.list())
            for (int k = 0; k < S * S; ++k, ++block)
                for (int corner = 0; corner < 4; ++corner)
                {
                    const std::size_t n = grid.corner(grid.lattice.node(bin.i + k % S, bin.j + k / S), corner);
                    const Vec2 x = grid.lattice.node_position(n);
                    const double m = 0.25 * sums[block * 4];
                    mass[n] += m;
                    if (!velocity)
                        continue;
                    const Vec2 v = (*velocity)({x[0], x[1], x[0], x[1], 0});
                    grid.nodes.vx[n] += m * v[0];
                    grid.nodes.vy[n] += m * v[1];
                }
    }
    for (const auto n : grid.nodes.active())
        if (mass[n] > 0)
        {
            grid.nodes.vx[n] /= mass[n];
            grid.nodes.vy[n] /= mass[n];
        }
}
}  // namespace testbed
