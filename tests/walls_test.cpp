#include "core/bodies/body.hpp"
#include "core/loads/node_ops.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>
#include <numeric>

using namespace testbed;

namespace
{
const std::string specimen = test::soil_block({1, 0}, {3, 3});

std::string cap(const std::string& motion, const std::string& more = "")
{
    const std::string top = motion == "smooth" ? "4.0" : "3.5";
    return "[[wall]]\nname = \"cap\"\nmin = [0.0, 3.0]\nmax = [4.0, " + top + "]\nvelocity = [\"0\", \"-2\"]\nmotion = \"" + motion +
           "\"\n" + more;
}

struct Fixture
{
    Scene scene;
    Lattice<2> lattice;
    NodeOps ops;
    Nodes<2> nodes;

    explicit Fixture(const std::string& text, const std::string& method = "")
        : scene(test::load(specimen + text, method)),
          lattice(make_lattice(scene.grid)),
          ops(scene, lattice),
          nodes(lattice.nodes())
    {
        std::fill(nodes.mass.begin(), nodes.mass.end(), 2.0);
        std::vector<std::uint32_t> all(nodes.mass.size());
        std::iota(all.begin(), all.end(), 0u);
        nodes.set_active(all);
    }
    void step(double t, double dt)
    {
        ops.begin_step({t, dt, dt});
        ops.end_step({0, dt, dt});
    }
    /// Velocity in y that the walls leave of 1 everywhere, at column i.
    std::vector<double> column(int i)
    {
        VectorField<2> v{std::vector<double>(nodes.mass.size(), 1), std::vector<double>(nodes.mass.size(), 1)};
        ops.restrain(lattice, nodes, v);
        std::vector<double> values;
        for (int j = 0; j <= lattice.size[1]; ++j)
            values.push_back(v[1][lattice.node({i, j})]);
        return values;
    }
};
}  // namespace

/// Section 2.2: all nodes of a line move; after one cell of travel the next line does.
TEST(Wall, HandsOffAfterOneCell)
{
    Fixture f(cap("hand_off"));
    f.step(0, 0.1);
    EXPECT_EQ(f.column(3), (std::vector<double>{1, 1, 1, 1, 1, 1, -2, -2, 1}));  // nodes at y = 3 and 3.5
    f.step(0.1, 0.1);
    f.ops.begin_step({0.2, 0.1, 0.1});  // travel 0.4 < L
    EXPECT_EQ(f.column(3), (std::vector<double>{1, 1, 1, 1, 1, 1, -2, -2, 1}));
    f.ops.end_step({0, 0.1, 0.1});
    f.ops.begin_step({0.3, 0.1, 0.1});  // travel 0.6 > L
    EXPECT_EQ(f.column(3), (std::vector<double>{1, 1, 1, 1, 1, -2, -2, 1, 1}));
    EXPECT_DOUBLE_EQ((*f.ops.records()[0].displacement)[1], -2 * 0.3);
}

/// The smooth wall prescribes the velocity interpolated at its face, and passes on the same impulse as it takes.
TEST(Wall, SmoothFaceMovesWithTheWall)
{
    Fixture f(cap("smooth"));
    for (std::size_t n = 0; n < f.nodes.mass.size(); ++n)
        f.nodes.mass[n] = 1 + static_cast<double>(n % 3);
    f.step(0, 0.1);
    f.ops.begin_step({0.1, 0.1, 0.1});  // the faces are at y = 2.8 and 3.8
    const auto v = f.column(3);
    EXPECT_NEAR(0.4 * v[5] + 0.6 * v[6], -2, 1e-12);  // y = 2.5 and 3.0
    EXPECT_NEAR(0.4 * v[7] + 0.6 * v[8], -2, 1e-12);
    EXPECT_EQ(v[4], 1);
}

/// At a face between nodes the reaction balances the forces in the way of virtual work: what is left does not accelerate it.
TEST(Wall, ReactionHoldsTheFace)
{
    Fixture f("[[wall]]\nname = \"floor\"\nmin = [0.0, 0.2]\nmax = [4.0, 0.2]\nmotion = \"smooth\"\nfix = \"y\"\n");
    f.ops.begin_step({0, 0.1, 0.1});
    const std::size_t low = f.lattice.node({3, 0}), high = f.lattice.node({3, 1});
    f.nodes.mass[low] = 3;
    f.nodes.f[1][low] = -5;
    f.nodes.f[1][high] = -7;
    f.nodes.f[0][low] = 4;
    f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
    EXPECT_NEAR(0.6 * f.nodes.f[1][low] / 3 + 0.4 * f.nodes.f[1][high] / 2, 0, 1e-12);
    EXPECT_NEAR(f.ops.records()[0].reaction[1], f.nodes.f[1][low] + f.nodes.f[1][high] + 12, 1e-12);
    EXPECT_GT(f.ops.records()[0].reaction[1], 0);
    EXPECT_EQ(f.nodes.f[0][low], 4);  // a smooth wall does not hold what slides along it
}

/// Reactions are those of the soil's forces: damping has no part in them.
TEST(Wall, ReactionBeforeDamping)
{
    Fixture f("[damping]\nlocal = 0.8\n[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n");
    f.ops.begin_step({0, 0.1, 0.1});
    const auto n = static_cast<std::uint32_t>(f.lattice.node({3, 0})), free = static_cast<std::uint32_t>(f.lattice.node({3, 2}));
    f.nodes.set_active({n, free});
    f.nodes.f[1][n] = -5;
    f.nodes.f[0][n] = 2;
    f.nodes.v[1][n] = f.nodes.v[1][free] = 1;
    f.nodes.f[1][free] = 10;
    f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
    EXPECT_EQ(f.ops.records()[0].reaction, (Vec<2>{-2, 5}));
    EXPECT_EQ(f.nodes.f[1][n], 0);
    EXPECT_DOUBLE_EQ(f.nodes.f[1][free], 2);
    EXPECT_FALSE(f.ops.records()[0].displacement.has_value());
}

/// What damping puts on the nodes of a face must not move the wall.
TEST(Wall, DampingDoesNotMoveTheFace)
{
    Fixture f("[damping]\nlocal = 0.8\n[[wall]]\nname = \"floor\"\nmin = [0.0, 0.2]\nmax = [4.0, 0.2]\nmotion = \"smooth\"\nfix = \"y\"\n");
    f.ops.begin_step({0, 0.1, 0.1});
    const auto low = static_cast<std::uint32_t>(f.lattice.node({3, 0})), high = static_cast<std::uint32_t>(f.lattice.node({3, 1}));
    f.nodes.set_active({low, high});
    f.nodes.mass[low] = 3;
    f.nodes.f[1][low] = -5;
    f.nodes.f[1][high] = -7;
    f.nodes.v[1][low] = 0.4;
    f.nodes.v[1][high] = 0.6;
    f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
    EXPECT_NEAR(0.6 * f.nodes.f[1][low] / 3 + 0.4 * f.nodes.f[1][high] / 2, 0, 1e-12);
    EXPECT_GT(std::abs(f.nodes.f[1][low]), 1e-3);  // the pair may still turn about the face
}

/// A travel of exactly one cell hands off, up and down, whatever the rounding of its sum.
TEST(Wall, HandsOffAtExactlyOneCell)
{
    for (const double direction : {-1.0, 1.0})
    {
        const std::string v = std::to_string(direction);
        Fixture f("[[wall]]\nname = \"w\"\nmin = [0.0, 2.0]\nmax = [4.0, 2.0]\nvelocity = [\"0\", \"" + v + "*(t<0.5)\"]\n");
        for (int n = 0; n < 10; ++n)
        {
            f.step(0.05 * n, 0.05);  // 0.5 m in all: one cell
            EXPECT_EQ(f.column(3)[4], direction);
        }
        f.ops.begin_step({0.5, 0.1, 0.1});
        EXPECT_EQ(f.column(3)[4], 1);
        EXPECT_EQ(f.column(3)[direction > 0 ? 5 : 3], 0);
    }
}

/// Soil that does not reach the face is left alone.
TEST(Wall, AGapPassesNothingOn)
{
    Fixture f(cap("smooth"));
    for (int j = 6; j <= f.lattice.size[1]; ++j)
        for (int i = 0; i <= f.lattice.size[0]; ++i)
            f.nodes.mass[f.lattice.node({i, j})] = 0;
    f.step(0, 0.1);
    f.ops.begin_step({0.1, 0.1, 0.1});  // the lower face is at y = 2.8, between a node with mass and one without
    EXPECT_EQ(f.column(3)[5], 1);
}

/// Where the mass of soil sits in the middle of its points, the nodes behind a wall that leaves it have none until a point follows. The
/// soil within a spacing of points of the face is still pulled, by the node that has mass; with boxes their mass tells.
TEST(Wall, PullsSoilWhoseMassDoesNotReachTheNextNode)
{
    for (const auto& [method, travel, follows] : {std::tuple{"lpfdm-2000", 0.1, true},
                                                  {"lpfdm-2000", 0.2, false},
                                                  {"mpm-linear", 0.1, true},
                                                  {"mpm-linear-bbar", 0.1, true},
                                                  {"lpfdm", 0.1, false},
                                                  {"mpm-cpgimp", 0.1, false}})
    {
        const double speed = travel / 0.05;
        Fixture f("[[wall]]\nname = \"cap\"\nmin = [0.0, 2.0]\nmax = [4.0, 2.0]\nvelocity = [\"0\", \"" + std::to_string(speed) +
                      "*(t < 0.2)\"]\nmotion = \"smooth\"\nfix = \"y\"\n",
                  method);
        for (int j = 5; j <= f.lattice.size[1]; ++j)
            for (int i = 0; i <= f.lattice.size[0]; ++i)
                f.nodes.mass[f.lattice.node({i, j})] = 0;
        f.step(0, 0.05);
        f.ops.begin_step(
            {0.05, 0.05, 0.05});  // the face is at y = 2 + travel; points are 0.125 m apart, and the highest nodes with mass at y = 2
        EXPECT_EQ(f.column(3)[4], follows ? speed : 1.0) << method << " " << travel;
        const std::size_t n = f.lattice.node({3, 4});
        f.nodes.f[1][n] = -5;
        f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
        EXPECT_EQ(f.nodes.f[1][n], follows ? 0.0 : -5.0) << method << " " << travel;
        EXPECT_EQ(f.ops.records()[0].reaction[1], follows ? 5.0 : 0.0) << method << " " << travel;
    }
}

/// A node of a boundary and of a wall follows the wall, and its reaction is the wall's.
TEST(Wall, OwnsWhatItDrives)
{
    Fixture f("[[boundary]]\nname = \"top\"\nwhere = \"y >= 3\"\nfix = \"y\"\n" + cap("hand_off"));
    f.ops.begin_step({0, 0.1, 0.1});
    const auto n = static_cast<std::uint32_t>(f.lattice.node({3, 6}));
    f.nodes.set_active({n});
    for (int n_steps = 0; n_steps < 2; ++n_steps)  // reactions are those of the step
    {
        f.nodes.f[1][n] = 5;
        f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
        EXPECT_EQ(f.ops.records()[0].reaction[1], 0);
        EXPECT_EQ(f.ops.records()[1].reaction[1], -5);
    }
    EXPECT_EQ(f.column(3)[6], -2);
}

/// The same for a node within a smooth wall, whose faces lie elsewhere.
TEST(Wall, LaterOnesDriveTheNodesWithin)
{
    const std::string block = "[[wall]]\nname = \"block\"\nmin = [0.0, 2.3]\nmax = [4.0, 3.8]\nmotion = \"smooth\"\nfix = \"y\"\n";
    const std::string plate = "[[wall]]\nname = \"plate\"\nmin = [0.0, 3.0]\nmax = [4.0, 3.0]\nfix = \"y\"\n";
    Fixture f(block + plate);
    f.ops.begin_step({0, 0.1, 0.1});
    f.nodes.f[1][f.lattice.node({3, 6})] = 5;
    f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
    EXPECT_EQ(f.ops.records()[0].reaction[1], 0);
    EXPECT_EQ(f.ops.records()[1].reaction[1], -5);
}

/// A smooth wall finds driven what earlier restraints drive, and a later one has the last word at a node of its face, whose force
/// is then its reaction. Faces between y = 2.5 and 3, share 0.4 below; the second wall holds y = 3.
TEST(Wall, LaterOnesDriveTheNodesOfAFace)
{
    const auto wall = [](const char* name, const char* y, const char* velocity, const char* motion)
    {
        return std::string("[[wall]]\nname = \"") + name + "\"\nmin = [0.0, " + y + "]\nmax = [4.0, " + y + "]\nvelocity = [\"0\", \"" +
               velocity + "\"]\nmotion = \"" + motion + "\"\nfix = \"y\"\n";
    };
    const std::string smooth = wall("smooth", "2.8", "-2", "smooth"), plate = wall("plate", "3.0", "0.5", "hand_off");
    for (const bool smooth_first : {true, false})
    {
        Fixture f(smooth_first ? smooth + plate : plate + smooth);
        f.ops.begin_step({0, 0.1, 0.1});
        const auto v = f.column(3);
        if (smooth_first)
        {
            EXPECT_EQ(v[6], 0.5);                                   // the plate has the last word
            EXPECT_NEAR(v[5], 1 - 0.4 * 3 / (0.16 + 0.36), 1e-12);  // the face was brought from 1 to -2 before
        }
        else
            EXPECT_NEAR(0.4 * v[5] + 0.6 * v[6], -2, 1e-12);
        const std::size_t low = f.lattice.node({3, 5}), high = f.lattice.node({3, 6});
        f.nodes.f[1][low] = -5;
        f.nodes.f[1][high] = -7;
        f.ops.apply_forces(f.lattice, f.nodes, {0, 0.1, 0.1});
        const std::size_t first = smooth_first ? 0 : 1;
        EXPECT_NEAR(f.ops.records()[1 - first].reaction[1], 7, 1e-12);           // all of the node's force
        EXPECT_NEAR(f.ops.records()[first].reaction[1], 0.4 * 5 / 0.52, 1e-12);  // what then accelerates the face
    }
}

/// The velocity is that of the middle of the step: a uniform acceleration is followed exactly.
TEST(Wall, AcceleratesExactly)
{
    Fixture f("[[wall]]\nname = \"w\"\nmin = [0.0, 3.0]\nmax = [4.0, 3.5]\nvelocity = [\"0\", \"-0.8*t\"]\n");
    for (int n = 0; n < 10; ++n)
        f.step(0.1 * n, 0.1);
    EXPECT_NEAR((*f.ops.records()[0].displacement)[1], -0.4, 1e-12);
}

TEST(Wall, DoorOpensWhenToldTo)
{
    Fixture f("[[wall]]\nname = \"floor\"\nmin = [0.0, 0.0]\nmax = [4.0, 0.0]\ndoor = [1.0, 2.5]\ndoor_opens = 0.5\n");
    const auto row = [&]
    {
        VectorField<2> v{std::vector<double>(f.nodes.mass.size(), 1), std::vector<double>(f.nodes.mass.size(), 1)};
        std::vector<double> values;
        f.ops.restrain(f.lattice, f.nodes, v);
        for (int i = 0; i <= f.lattice.size[0]; ++i)
            values.push_back(v[1][f.lattice.node({i, 0})]);
        return values;
    };
    f.ops.begin_step({0.4, 0.1, 0.1});
    EXPECT_EQ(row(), std::vector<double>(9, 0.0));
    f.ops.begin_step({0.5, 0.1, 0.1});
    EXPECT_EQ(row(), (std::vector<double>{0, 0, 0, 1, 1, 0, 0, 0, 0}));  // its ends hold
}

/// Its opening goes with a wall that moves along itself.
TEST(Wall, TakesItsDoorAlong)
{
    Fixture f(
        "[[wall]]\nname = \"gate\"\nmin = [2.0, 0.5]\nmax = [2.0, 3.0]\ndoor = [1.0, 2.0]\nvelocity = [\"0\", \"t < 0.12 ? 5 : 0\"]\n");
    const auto held = [&]
    {
        VectorField<2> v{std::vector<double>(f.nodes.mass.size(), 1), std::vector<double>(f.nodes.mass.size(), 1)};
        f.ops.restrain(f.lattice, f.nodes, v);
        std::string row;
        for (int j = 0; j <= f.lattice.size[1]; ++j)
            row += v[0][f.lattice.node({4, j})] == 0 ? '#' : '.';
        return row;
    };
    f.ops.begin_step({0, 0.1, 0.1});
    EXPECT_EQ(held(), ".##.###..");
    f.ops.end_step({0, 0.1, 0.1});
    f.ops.begin_step({0.1, 0.1, 0.1});  // a cell farther
    EXPECT_EQ(held(), "..##.###.");
}

/// A wall that ends at the edge of the lattice holds the ring of nodes around it, too, of which B-splines know.
TEST(Wall, TakesTheRingAroundTheLattice)
{
    Fixture f("[[wall]]\nname = \"left\"\nmin = [0.0, 0.0]\nmax = [0.0, 4.0]\n");
    f.ops.begin_step({0, 0.1, 0.1});
    VectorField<2> v{std::vector<double>(f.nodes.mass.size(), 1), std::vector<double>(f.nodes.mass.size(), 1)};
    f.ops.restrain(f.lattice, f.nodes, v);
    for (int j = -1; j <= f.lattice.size[1] + 1; ++j)
        for (int i = -1; i <= 1; ++i)
            EXPECT_EQ(v[0][f.lattice.node({i, j})], i < 1 ? 0 : 1) << i << " " << j;
}

/// A wall that is smooth in one direction is not stopped by what holds that direction.
TEST(Wall, SlidesAlongWhatHoldsTheOtherComponent)
{
    Fixture f("[[boundary]]\nname = \"base\"\nwhere = \"y <= 0.5\"\nfix = \"y\"\n[[wall]]\nname = \"plate\"\nmin = [0.0, 1.0]\n"
              "max = [4.0, 1.0]\nfix = \"x\"\nvelocity = [\"0\", \"t < 0.15 ? -5 : 0\"]\n");
    f.step(0, 0.05);
    f.step(0.05, 0.05);
    EXPECT_NO_THROW(f.step(0.1, 0.05));  // on the line of nodes that the base holds in y
}

TEST(Wall, StopsTheRunWhereItCannotGo)
{
    const std::string base = "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n";
    Fixture f(cap("hand_off") + base);
    for (int n = 0; n < 14; ++n)
        f.step(0.1 * n, 0.1);
    try
    {
        f.step(1.5, 0.3);
        f.step(1.8, 0.3);
        FAIL() << "the cap went through the base";
    }
    catch (const Diverged& e)
    {
        EXPECT_NE(std::string(e.what()).find("'cap' was pushed through the soil and has reached 'base'"), std::string::npos) << e.what();
    }
}

TEST(Wall, ProblemsOfAScene)
{
    const auto expect = [](const std::string& text, const std::string& message) { test::expect_problem(specimen + text, {}, message); };
    const std::string wall = "[[wall]]\nname = \"w\"\n";
    expect(wall + "min = [0.0, 3.0]\nmax = [4.0, 4.5]\n", "outside the lattice");
    expect(wall + "min = [0.0, 3.0]\nmax = [4.0, 3.5]\nmotion = \"smooth\"\n", "share no node");
    expect(wall + "min = [0.0, 3.0]\nmax = [4.0, 3.5]\nvelocity = [\"0\", \"2\"]\n", "leaves the lattice at t = 0.25");
    expect(wall + "min = [0.0, 3.1]\nmax = [4.0, 3.5]\n", "lies between lines of nodes");
    expect(wall + "min = [1.0, 0.0]\nmax = [3.0, 0.0]\ndoor = [0.5, 2.0]\n", "wider than its wall");
    expect(wall + "min = [1.0, 0.0]\nmax = [3.0, 0.0]\ndoor = [1.0, 1.5]\n", "no free node");
    expect(wall + "min = [1.0, 0.0]\nmax = [1.0, 0.0]\n", "must lie above");
    expect("[[boundary]]\nname = \"w\"\nwhere = \"y<=0\"\nfix = \"x\"\n" + wall + "min = [1.0, 0.0]\nmax = [3.0, 0.0]\n",
           "name of a boundary, too");
}
