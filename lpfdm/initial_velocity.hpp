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
void set_initial_velocity(LpfdmGrid<2>& grid, const Scene& scene, const std::vector<Body>& bodies, const std::vector<double>& sums)
{
    std::vector<double> mass(grid.lattice.nodes(), 0.0);
    std::size_t block = 0;
    for (std::size_t b = 0; b < bodies.size(); ++b)
    {
        std::optional<VectorExpression> velocity;
        if (scene.bodies[b].velocity)
            velocity.emplace(*scene.bodies[b].velocity, scene.expression_constants());
        for (const Bin<2>& bin : bodies[b].bins.list())
            for (int k = 0; k < block_size<S, 2>; ++k, ++block)
                for (std::size_t corner = 0; corner < 4; ++corner)
                {
                    const std::size_t n = grid.corner(grid.lattice.node(bin.at + block_index<S, 2>(k)), corner);
                    const Vec<2> x = grid.lattice.node_position(n);
                    const double m = 0.25 * sums[block * (1 + symmetric_components<2>)];
                    mass[n] += m;
                    if (!velocity)
                        continue;
                    const Vec<2> v = (*velocity)({x[0], x[1], x[0], x[1], 0});
                    for (std::size_t d = 0; d < 2; ++d)
                        grid.nodes.v[d][n] += m * v[d];
                }
    }
    for (const auto n : grid.nodes.active())
        if (mass[n] > 0)
            for (auto& component : grid.nodes.v)
                component[n] /= mass[n];
}
}  // namespace testbed
