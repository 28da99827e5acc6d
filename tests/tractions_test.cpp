#include "core/loads/tractions.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

using namespace testbed;

namespace
{
/// The block [1, 3] x [1, 3] with a traction on one of its faces.
Scene loaded(const std::string& face, const std::string& traction)
{
    return test::load(test::soil_block({1, 1}, {3, 3}) + "[[traction]]\nname = \"push\"\nbody = \"soil\"\nface = \"" + face +
                          "\"\ntraction = " + traction + "\n",
                      "", {"body.soil.points_per_cell=3"});
}

struct FaceOfBlock
{
    const char* name;
    std::size_t normal;
    double at;
};
const std::array<FaceOfBlock, 4> faces{{{"left", 0, 1}, {"right", 0, 3}, {"bottom", 1, 1}, {"top", 1, 3}}};

/// Sums of the forces at the nodes and of their moments about the origin; `off`: of what acts off the line x_k = at.
struct Sums
{
    double fx = 0, fy = 0, moment_x = 0, moment_y = 0, off = 0;

    Sums(const Lattice<2>& lattice, const Nodes<2>& nodes, std::size_t k, double at)
    {
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            const Vec<2> x = lattice.node_position(n);
            fx += nodes.f[0][n];
            fy += nodes.f[1][n];
            moment_x += x[1] * nodes.f[0][n];
            moment_y += x[0] * nodes.f[1][n];
            off += std::abs(x[k] - at) > 1e-9 ? std::abs(nodes.f[0][n]) + std::abs(nodes.f[1][n]) : 0;
        }
    }
};
}  // namespace

/// The load goes to the nodes of the face, with the right sum and moment.
TEST(Tractions, ActOnEachFace)
{
    for (const FaceOfBlock& face : faces)
        for (const bool box : {false, true})
        {
            SCOPED_TRACE(face.name);
            const Scene scene = loaded(face.name, face.normal == 0 ? "[\"1e4*(1+Y)\", \"-2e3\"]" : "[\"3e3\", \"1e4*(1+X)\"]");
            const Lattice<2> lattice = make_lattice(scene.grid);
            const auto bodies = make_bodies(scene, lattice, {.box = box});
            Nodes<2> nodes(lattice.nodes());
            std::fill(nodes.mass.begin(), nodes.mass.end(), 1.0);
            Tractions(scene).apply(lattice, bodies, nodes, 0);
            const Sums s(lattice, nodes, face.normal, face.at);
            const double linear = 1e4 * (2 + 4), moment = 1e4 * (4 + 26.0 / 3);  // of 1 + s over s in [1, 3]
            EXPECT_NEAR(face.normal == 0 ? s.fx : s.fy, linear, 1e-6);
            EXPECT_NEAR(face.normal == 0 ? s.fy : s.fx, face.normal == 0 ? -2e3 * 2 : 3e3 * 2, 1e-6);
            EXPECT_NEAR(face.normal == 0 ? s.moment_x : s.moment_y, moment, 1e4 * 0.02);  // by the points' mid-point rule
            EXPECT_NEAR(s.off, 0, 1e-6);
        }
}

/// It follows the surface into the next cell, and is carried by the nodes that have mass.
TEST(Tractions, FollowTheSurface)
{
    const Scene scene = loaded("left", "[\"1e4\", \"3e3\"]");
    const Lattice<2> lattice = make_lattice(scene.grid);
    for (const bool box : {false, true})
    {
        auto bodies = make_bodies(scene, lattice, {.box = box});
        Nodes<2> nodes(lattice.nodes());
        std::fill(nodes.mass.begin(), nodes.mass.end(), 1.0);
        const Tractions tractions(scene);
        for (std::size_t p = 0; p < bodies[0].points.count; ++p)
            bodies[0].points.x[0][p] -= 0.1;  // a fifth of a cell outwards
        tractions.apply(lattice, bodies, nodes, 0);
        EXPECT_NEAR(Sums(lattice, nodes, 0, 1).off, 0.2 * (2e4 + 6e3), 1e-6);
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            nodes.mass[n] = lattice.node_position(n)[0] < 0.9 ? 0 : 1;  // the next line of nodes holds nothing yet
            nodes.f[0][n] = nodes.f[1][n] = 0;
        }
        tractions.apply(lattice, bodies, nodes, 0);
        const Sums s(lattice, nodes, 0, 1);
        EXPECT_NEAR(s.fx, 2e4, 1e-6);
        EXPECT_NEAR(s.fy, 6e3, 1e-6);
        EXPECT_NEAR(s.off, 0, 1e-6);
    }
}

/// The surface is half of the point's own box away, in the direction of the face alone, however the box was stretched.
TEST(Tractions, ActOnTheEdgeOfAStretchedBox)
{
    for (const FaceOfBlock& face : faces)
    {
        SCOPED_TRACE(face.name);
        const Scene scene = loaded(face.name, "[\"7\", \"7\"]");
        const Lattice<2> lattice = make_lattice(scene.grid);
        auto bodies = make_bodies(scene, lattice, {.box = true});
        Points<2>& q = bodies[0].points;
        const double h = 1.0 / 6;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            q.half_width[0][p] *= 1.2;
            q.half_width[1][p] *= 0.7;
        }
        Nodes<2> nodes(lattice.nodes());
        std::fill(nodes.mass.begin(), nodes.mass.end(), 1.0);
        Tractions(scene).apply(lattice, bodies, nodes, 0);
        double force = 0, moment = 0;
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            force += nodes.f[0][n];
            moment += lattice.node_position(n)[face.normal] * nodes.f[0][n];
        }
        const double outward = face.at > 2 ? 1 : -1, moved = 0.5 * h * ((face.normal == 0 ? 1.2 : 0.7) - 1);
        EXPECT_NEAR(force, 14, 1e-9);
        EXPECT_NEAR(moment / force, face.at + outward * moved, 1e-9);
    }
}
