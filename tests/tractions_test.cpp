#include "core/tractions.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
const std::string block = R"toml(
[grid]
size = [4.0, 4.0]
cell_size = 0.5
[time]
end = 1.0
[[material]]
name = "soil"
law = "linear_elastic"
density = 1000.0
youngs_modulus = 1e6
poissons_ratio = 0.2
[[body]]
name = "soil"
material = "soil"
shape = "box"
min = [1.0, 0.0]
max = [3.0, 2.0]
points_per_cell = 3
[[traction]]
name = "push"
body = "soil"
face = "left"
traction = ["1e4*(1+Y)", "-2e3"]
)toml";
}  // namespace

/// The load goes to the nodes of the face, with the right sum and moment, and follows the surface into the next cell.
TEST(Tractions, ActAtTheSurface)
{
    const Scene scene = test::load(block);
    const Lattice lattice = make_lattice(scene.grid);
    for (const bool box : {false, true})
    {
        auto bodies = make_bodies(scene, lattice, {.box = box});
        Nodes nodes(lattice.nodes());
        std::fill(nodes.mass.begin(), nodes.mass.end(), 1.0);
        const Tractions tractions(scene);
        const auto sums = [&]
        {
            std::array<double, 4> s{};  // F_x, F_y, moment, F_x off the face x = 1
            for (std::size_t n = 0; n < lattice.nodes(); ++n)
            {
                const Vec2 x = lattice.node_position(n);
                s[0] += nodes.fx[n];
                s[1] += nodes.fy[n];
                s[2] += x[1] * nodes.fx[n];
                s[3] += std::abs(x[0] - 1) > 1e-9 ? std::abs(nodes.fx[n]) : 0;
            }
            return s;
        };
        tractions.apply(lattice, bodies, nodes, 0);
        const auto s = sums();
        EXPECT_NEAR(s[0], 1e4 * (2 + 2), 1e-6);
        EXPECT_NEAR(s[1], -2e3 * 2, 1e-6);
        EXPECT_NEAR(s[2], 1e4 * (2 + 8.0 / 3), 1e4 * 0.02);  // by the points' mid-point rule
        EXPECT_NEAR(s[3], 0, 1e-6);
        for (std::size_t p = 0; p < bodies[0].points.count; ++p)
            bodies[0].points.x[p] -= 0.1;  // a fifth of a cell outwards
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
            nodes.fx[n] = nodes.fy[n] = 0;
        tractions.apply(lattice, bodies, nodes, 0);
        EXPECT_NEAR(sums()[3], 0.2 * 4e4, 1e-6);
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            nodes.mass[n] = lattice.node_position(n)[0] < 0.9 ? 0 : 1;  // the next line of nodes holds nothing yet
            nodes.fx[n] = nodes.fy[n] = 0;
        }
        tractions.apply(lattice, bodies, nodes, 0);
        EXPECT_NEAR(sums()[0], 4e4, 1e-6);
        EXPECT_NEAR(sums()[3], 0, 1e-6);
    }
}
