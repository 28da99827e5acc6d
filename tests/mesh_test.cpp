/// LPFDM on cells of any shape: its polygons, its mesh, its equations, its limits, and the same step as on squares.

#include "lpfdm/lpfdm.hpp"
#include "lpfdm/mesh/equations.hpp"
#include "lpfdm/mesh/limits.hpp"
#include "lpfdm/mesh/make_mesh.hpp"
#include "tests/polygon.hpp"
#include "tests/random.hpp"
#include "tests/scenes.hpp"
#include "tests/solvers.hpp"

#include <gtest/gtest.h>

using namespace testbed;
using test::Random;

namespace
{
const std::string block = test::soil_block({0.5, 0.5}, {2.5, 2.5});

Scene scene_of(const std::vector<std::string>& settings, const std::string& text = block)
{
    return test::load(text, "lpfdm-2000", settings);
}
const std::vector<std::vector<std::string>> meshes{{"lpfdm.cells=triangles"},
                                                   {"lpfdm.cells=quadrilaterals"},
                                                   {"lpfdm.cells=triangles", "lpfdm.shake=0.24"},
                                                   {"lpfdm.cells=quadrilaterals", "lpfdm.shake=0.24", "lpfdm.shake_seed=7"}};

/// A mesh with random stress, mass and nodal velocity everywhere.
MeshGrid random_grid(const std::vector<std::string>& settings, Random& random)
{
    MeshGrid grid(make_mesh(scene_of(settings)).mesh);
    std::vector<std::uint32_t> all;
    for (std::uint32_t n = 0; n < grid.mesh.nodes(); ++n)
    {
        set(grid.nodes.v, n, {random(-1, 1), random(-1, 1)});
        all.push_back(n);
    }
    grid.nodes.set_active(all);
    for (std::size_t c = 0; c < grid.mesh.cells(); ++c)
    {
        grid.mass[c] = random(1, 2);
        for (auto& component : grid.stress)
            component[c] = random(-1, 1);
    }
    return grid;
}

/// A honeycomb of regular hexagons over the block's lattice of 4 x 4 m, as a mesh file.
std::string honeycomb()
{
    const double r = 0.4, w = r * std::sqrt(3.0);
    std::vector<Vec<2>> nodes;
    std::string cells;
    const auto number = [&](const Vec<2>& x)
    {
        for (std::size_t n = 0; n < nodes.size(); ++n)
            if (std::hypot(nodes[n][0] - x[0], nodes[n][1] - x[1]) < 1e-6)
                return n;
        nodes.push_back(x);
        return nodes.size() - 1;
    };
    for (int j = -1; j < 9; ++j)
        for (int i = -1; i < 8; ++i)
        {
            const double x = (i + 0.5 * (j & 1)) * w, y = 1.5 * r * j;
            std::string corners;
            for (int k = 0; k < 6; ++k)
            {
                const double angle = std::numbers::pi * (k / 3.0 + 1 / 6.0);
                corners += fmt::format("{}{}", k ? ", " : "", number({x + r * std::cos(angle), y + r * std::sin(angle)}));
            }
            cells += fmt::format("  [{}],\n", corners);
        }
    std::string text = "nodes = [\n";
    for (const Vec<2>& x : nodes)
        text += fmt::format("  [{:.17g}, {:.17g}],\n", x[0], x[1]);
    return text + "]\ncells = [\n" + cells + "]\n";
}

/// A scene beside a mesh file.
class MeshScene
{
public:
    explicit MeshScene(const std::string& mesh, const std::string& text = block) : file_(text)
    {
        std::ofstream(std::filesystem::path(file_.path()).parent_path() / "mesh.toml") << mesh;
    }
    Scene load(std::vector<std::string> settings = {}) const
    {
        settings.insert(settings.end(), {"lpfdm.cells=file", "lpfdm.mesh=mesh.toml"});
        return load_scene(file_.path(), "lpfdm-2000", settings).scene;
    }

private:
    test::SceneFile file_;
};

void expect_no_mesh(const std::string& mesh, const std::string& message)
{
    const MeshScene scene(mesh);
    try
    {
        make_mesh(scene.load());
        ADD_FAILURE() << "accepted, expected: " << message;
    }
    catch (const SceneError& e)
    {
        EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what();
        EXPECT_NE(std::string(e.what()).find("mesh.toml"), std::string::npos) << e.what();
    }
}

double largest_stress(const Points<2>& q)
{
    double largest = 0;
    for (std::size_t p = 0; p < q.count; ++p)
        largest = std::max({largest, std::abs(q.stress[0][p]), std::abs(q.stress[1][p]), std::abs(q.stress[2][p])});
    return largest;
}
}  // namespace

/// Wachspress' weights are those of linear fields on any convex polygon, and one at their own corner.
TEST(PolygonWeights, AreExactForLinearFields)
{
    Random random(1);
    for (int trial = 0; trial < 200; ++trial)
    {
        const auto x = random.convex_polygon(3 + trial % 6);
        std::vector<double> share, weights;
        double total = 0;
        for (std::size_t k = 0; k < x.size(); ++k)
            total += share.emplace_back(random(0.01, 1));
        Vec<2> place{0, 0}, found{0, 0};
        for (std::size_t k = 0; k < x.size(); ++k)
            for (std::size_t d = 0; d < 2; ++d)
                place[d] += share[k] / total * x[k][d];
        polygon_weights(x, place, weights);
        double sum = 0;
        for (std::size_t k = 0; k < x.size(); ++k)
        {
            EXPECT_GT(weights[k], 0);
            sum += weights[k];
            for (std::size_t d = 0; d < 2; ++d)
                found[d] += weights[k] * x[k][d];
        }
        EXPECT_NEAR(sum, 1, 1e-13);
        EXPECT_NEAR(found[0], place[0], 1e-12);
        EXPECT_NEAR(found[1], place[1], 1e-12);
        polygon_weights(x, x[1], weights);
        for (std::size_t k = 0; k < x.size(); ++k)
            EXPECT_NEAR(weights[k], k == 1 ? 1 : 0, 1e-12);
    }
}

/// On a square they are eq. (6).
TEST(PolygonWeights, AreBilinearOnSquares)
{
    const std::vector<Vec<2>> x{{0, 0}, {2, 0}, {2, 2}, {0, 2}};
    std::vector<double> w;
    polygon_weights(x, {0.6, 1.4}, w);
    EXPECT_NEAR(w[0], 0.7 * 0.3, 1e-14);
    EXPECT_NEAR(w[1], 0.3 * 0.3, 1e-14);
    EXPECT_NEAR(w[2], 0.3 * 0.7, 1e-14);
    EXPECT_NEAR(w[3], 0.7 * 0.7, 1e-14);
}

/// Meshes made of the lattice cover it without gap or overlap, whatever the shaking; every place is found in a cell that holds it.
TEST(Mesh, CoversTheLattice)
{
    Random random(2);
    for (const auto& settings : meshes)
    {
        const Scene scene = scene_of(settings);
        const Mesh mesh = make_mesh(scene).mesh;
        double area = 0;
        for (std::size_t c = 0; c < mesh.cells(); ++c)
        {
            area += mesh.area(c);
            EXPECT_NEAR(mesh.area(c), polygon_area(mesh.places(c)), 1e-14);
        }
        EXPECT_NEAR(area, 16, 1e-12);
        EXPECT_EQ(mesh.cells(), settings[0] == "lpfdm.cells=triangles" ? 128u : 64u);
        for (int k = 0; k < 500; ++k)
        {
            const Vec<2> x{random(0, 4), random(0, 4)};
            const auto c = mesh.find({static_cast<int>(x[0] / 0.5), static_cast<int>(x[1] / 0.5)}, x);
            ASSERT_TRUE(c);
            const auto corners = mesh.places(*c);
            for (std::size_t s = 0; s < corners.size(); ++s)
                EXPECT_GE(twice_area(corners[s], corners[(s + 1) % corners.size()], x), -1e-9);
        }
    }
}

/// Rows of points on a diagonal are shared out evenly: with 2 x 2 or 4 x 4 points both triangles of a square get as many.
TEST(Mesh, SharesOutTheDiagonal)
{
    for (const char* points : {"body.soil.points_per_cell=2", "body.soil.points_per_cell=4"})
    {
        const Scene scene = scene_of({"lpfdm.cells=triangles", points});
        const Mesh mesh = make_mesh(scene).mesh;
        std::vector<int> count(mesh.cells());
        for (const Body& body : make_bodies(scene, make_lattice(scene.grid), {}))
            for (std::size_t p = 0; p < body.points.count; ++p)
            {
                const Vec<2> x = at(body.points.x, p);
                ++count[mesh.find({static_cast<int>(x[0] / 0.5), static_cast<int>(x[1] / 0.5)}, x).value()];
            }
        const int most = *std::max_element(count.begin(), count.end());
        for (const int n : count)
            EXPECT_TRUE(n == 0 || n == most) << n << " of " << most;
    }
}

/// Shaking leaves what holds the soil where it is, moves all else by no more than it says, and follows its seed.
TEST(Mesh, ShakesWhatIsFree)
{
    const std::string held = block + "[[boundary]]\nname = \"floor\"\nwhere = \"y <= 0.5\"\nfix = \"xy\"\n"
                                     "[[wall]]\nname = \"post\"\nmin = [2.5, 0.0]\nmax = [3.0, 2.0]\n";
    const Scene scene = scene_of({"lpfdm.cells=triangles", "lpfdm.shake=0.2"}, held);
    const NumberedMesh made = make_mesh(scene);
    const NumberedMesh other = make_mesh(scene_of({"lpfdm.cells=triangles", "lpfdm.shake=0.2", "lpfdm.shake_seed=2"}, held));
    double most = 0;
    std::size_t moved = 0;
    for (std::size_t n = 0; n < made.mesh.nodes(); ++n)
    {
        const Vec<2> x = made.numbers.node_position(n), now = made.mesh.place(n);
        const double way = std::max(std::abs(now[0] - x[0]), std::abs(now[1] - x[1]));
        most = std::max(most, way);
        const bool is_held = x[1] <= 0.5 || x[0] <= 0 || x[0] >= 4 || x[1] >= 4 || (x[0] >= 2.5 && x[0] <= 3 && x[1] <= 2);
        EXPECT_EQ(way > 0, !is_held) << x[0] << ", " << x[1];
        moved += way > 0 && now != other.mesh.place(n);
        EXPECT_TRUE(is_held || now[0] - x[0] != now[1] - x[1]);
    }
    EXPECT_LE(most, 0.2 * 0.5);
    EXPECT_GT(most, 0.17 * 0.5);
    EXPECT_GT(moved, 20u);
}

TEST(Mesh, RefusesWhatIsNone)
{
    const std::string nodes = "nodes = [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1]]\n";
    expect_no_mesh("cells = [[0, 1, 2]]", "nodes: a list of lists is asked");
    expect_no_mesh(nodes, "cells: a list of lists is asked");
    expect_no_mesh("nodes = [[0, 0], [4, \"a\"]]\ncells = [[0, 1, 2]]", "mesh.toml:1: a node is two numbers");
    expect_no_mesh(nodes + "cells = [[0, 1, 2.5]]", "mesh.toml:2: a cell is a list of numbers of nodes");
    expect_no_mesh(nodes + "cells = [[0, 1, 5]]", "node 5; the last one is 4");
    expect_no_mesh(nodes + "cells = [[0, 2, 1]]", "anticlockwise");
    expect_no_mesh(nodes + "cells = [[0, 1]]", "3 to 64 corners");
    expect_no_mesh(nodes + "cells = [[0, 1, 4, 3]]", "convex");
    expect_no_mesh(nodes + "cells = [[0, 1, 2, 3, 0, 1, 2, 3]]", "convex");
    expect_no_mesh(nodes + "cells = [[0, 1, 2], [0, 1, 4]]", "lie over each other");
    expect_no_mesh("nodes = [", "mesh.toml");
    const std::string two =
        "nodes = [[0, 0], [2, 0], [2, 4], [0, 4], [2, 0], [4, 0], [4, 4], [2, 4], [2, 2], [1, 1], [3, 1], [3, 3], [1, 3]]\n";
    expect_no_mesh(two + "cells = [[0, 1, 2, 3], [4, 5, 6, 7]]", "without a node in common");             // doubled nodes
    expect_no_mesh(two + "cells = [[0, 1, 2, 3], [1, 5, 8], [8, 5, 6, 2]]", "without a node in common");  // a hanging one
    expect_no_mesh(two + "cells = [[0, 1, 2, 3], [1, 5, 6, 2], [9, 10, 11, 12]]", "lie over each other");
    expect_no_mesh("nodes = [[-1e200, -1e200], [1e200, -1e200], [1e200, 1e200]]\ncells = [[0, 1, 2]]\n", "convex");
    const MeshScene fine("nodes = [[0, 0], [4, 0], [4, 4], [0, 4], [1.1, 1.1], [1.3, 1.1], [1.3, 1.3], [1.1, 1.3]]\ncells = [[4, 5, 6, 7], "
                         "[0, 1, 5, 4], [1, 2, 6, "
                         "5], [2, 3, 7, 6], [3, 0, 4, 7]]\n");
    EXPECT_NO_THROW(test::make(fine.load({"body.soil.points_per_cell=4"})));
    EXPECT_THROW(test::make(fine.load({"body.soil.points_per_cell=1"})), SceneError);  // points of 0.25 m^2, one in a cell of 0.04
    const MeshScene without("");
    EXPECT_THROW(make_mesh(load_scene_text(block, "nowhere/scene.toml", "lpfdm-2000", {"lpfdm.cells=file", "lpfdm.mesh=a.toml"}).scene),
                 SceneError);
}

/// Cells far from the lattice hold nothing and harm nothing.
TEST(Mesh, ReachesFarBeyondTheLattice)
{
    const MeshScene scene("nodes = [[-1e12, -3e9], [3e9, -3e9], [3e9, 1e12], [-1e12, 1e12]]\ncells = [[0, 1, 2, 3]]\n");
    EXPECT_EQ(make_mesh(scene.load()).mesh.find({3, 3}, {1.6, 1.6}), 0u);
    const MeshScene far("nodes = [[1e10, 0], [2e10, 0], [2e10, 4], [1e10, 4]]\ncells = [[0, 1, 2, 3]]\n");
    EXPECT_FALSE(make_mesh(far.load()).mesh.find({3, 3}, {1.6, 1.6}));
    EXPECT_THROW(test::make(far.load()), SceneError);
}

/// Supports take the nodes of the mesh that their expression names: of a file where they are, of what is shaken where they were, and no
/// node that no cell has.
TEST(Mesh, SupportsTakeItsNodes)
{
    const std::string held = block + "[[boundary]]\nname = \"low\"\nwhere = \"y < 0.45\"\nfix = \"xy\"\n";
    const auto count = [](const Scene& scene)
    {
        const NodeOps ops = node_ops_of(scene, make_mesh(scene));
        return ops.restraints()[0].components[1].nodes;
    };
    EXPECT_EQ(count(scene_of({"lpfdm.cells=quadrilaterals"}, held)),
              count(scene_of({"lpfdm.cells=quadrilaterals", "lpfdm.shake=0.24"}, held)));
    const std::string mesh = "nodes = [[0, 0.1], [4, 0.1], [4, 4], [0, 4], [1, 0.2]]\ncells = [[0, 1, 2, 3]]\n";
    EXPECT_EQ(count(MeshScene(mesh, held).load()), (std::vector<Index<2>>{{0, 0}, {1, 0}}));
    const std::string only = block + "[[boundary]]\nname = \"low\"\nwhere = \"y > 0.15 && y < 0.45\"\nfix = \"xy\"\n";
    EXPECT_THROW(count(MeshScene(mesh, only).load()), SceneError);
}

/// What a mesh does not have is refused, by the key that asks for it.
TEST(Mesh, RefusesWhatItDoesNotHave)
{
    const auto problem = [](const std::vector<std::string>& settings, const std::string& message, const std::string& more = "")
    {
        std::vector<std::string> all{"method=lpfdm-2000"};
        all.insert(all.end(), settings.begin(), settings.end());
        test::expect_problem(block + more, all, message);
    };
    problem({"lpfdm.cells=triangles", "lpfdm.support=domain"}, "lpfdm.support");
    problem({"lpfdm.cells=triangles", "lpfdm.convection=central"}, "lpfdm.convection");
    problem({"lpfdm.cells=triangles", "lpfdm.frontier=arrival"}, "lpfdm.frontier");
    problem({"lpfdm.cells=triangles", "lpfdm.hourglass=0.1"}, "lpfdm.hourglass");
    problem({"lpfdm.cells=triangles", "lpfdm.shake=0.3"}, "lpfdm.shake");
    problem({"lpfdm.shake=0.1"}, "lpfdm.shake");
    problem({"lpfdm.cells=file"}, "lpfdm.mesh");
    problem({"lpfdm.mesh=a.toml"}, "lpfdm.mesh");
    problem({"lpfdm.cells=triangles"}, "traction", "[[traction]]\nbody = \"soil\"\nface = \"top\"\ntraction = [0, -1.0]\n");
    const std::string wall = "[[wall]]\nname = \"w\"\nmin = [2.5, 0.0]\nmax = [3.0, 4.0]\n";
    problem({"lpfdm.cells=file", "lpfdm.mesh=a.toml"}, "wall", wall);
    problem({"lpfdm.cells=triangles", "lpfdm.shake=0.1"}, "lpfdm.shake", wall + "velocity = [0.1, 0]\n");
    problem({"lpfdm.cells=triangles", "time.sharp_limit=true"}, "time.sharp_limit");
    problem({"lpfdm.cells=triangles"}, "hand_off", wall + "velocity = [0.1, 0]\nmotion = \"smooth\"\n");
}

/// Eq. (9): the nodal forces do the work of the stress, sum F.u = -A <sigma>:<grad u>, on shaken meshes of triangles, quadrilaterals,
/// hexagons.
TEST(MeshForces, VirtualWork)
{
    Random random(3);
    for (const auto& settings : meshes)
    {
        MeshGrid grid = random_grid(settings, random);
        nodal_forces(grid);
        cell_gradients(grid, 1);
        double power = 0, work = 0, mass = 0;
        for (std::size_t n = 0; n < grid.mesh.nodes(); ++n)
        {
            power += grid.nodes.f[0][n] * grid.nodes.v[0][n] + grid.nodes.f[1][n] * grid.nodes.v[1][n];
            mass += grid.nodes.mass[n];
        }
        for (std::size_t c = 0; c < grid.mesh.cells(); ++c)
        {
            const Gradient<2> g = grid.gradient_at(c);
            work -= grid.stress[0][c] * g.xx + grid.stress[1][c] * g.yy + grid.stress[2][c] * g.shear();
            mass -= grid.mass[c];
        }
        EXPECT_NEAR(power, work, 1e-12 * std::abs(work) + 1e-12);
        EXPECT_NEAR(mass, 0, 1e-10);
    }
}

/// The same cell by cell against Gauss's theorem as it is printed (tests/polygon.hpp).
TEST(MeshForces, AreGauss)
{
    Random random(4);
    MeshGrid grid(make_mesh(MeshScene(honeycomb()).load()).mesh);
    const std::size_t c = 30;
    const auto corners = grid.mesh.corners(c);
    ASSERT_EQ(corners.size(), 6u);
    grid.mass[c] = 6;
    const SymTensor<2> s = random.stress();
    const std::vector<Vec<2>> x(grid.mesh.places(c).begin(), grid.mesh.places(c).end()), v = random.vectors(6);
    for (std::size_t k = 0; k < 6; ++k)
        set(grid.nodes.v, corners[k], v[k]);
    for (std::size_t k = 0; k < 3; ++k)
        grid.stress[k][c] = polygon_area(x) * std::array{s.xx, s.yy, s.xy}[k];
    std::vector<std::uint32_t> active(corners.begin(), corners.end());
    std::sort(active.begin(), active.end());
    grid.nodes.set_active(active);
    nodal_forces(grid);
    cell_gradients(grid, 0.5);
    const auto force = polygon_forces(x, s);
    for (std::size_t k = 0; k < 6; ++k)
    {
        EXPECT_NEAR(grid.nodes.mass[corners[k]], 1, 1e-14);
        for (std::size_t d = 0; d < 2; ++d)
            EXPECT_NEAR(grid.nodes.f[d][corners[k]], force[k][d], 1e-13);
    }
    const Gradient<2> g = grid.gradient_at(c), exact = polygon_gradient(x, v);
    EXPECT_NEAR(g.xx, 0.5 * exact.xx, 1e-13);
    EXPECT_NEAR(g.yy, 0.5 * exact.yy, 1e-13);
    EXPECT_NEAR(g.xy, 0.5 * exact.xy, 1e-13);
    EXPECT_NEAR(g.yx, 0.5 * exact.yx, 1e-13);
}

/// Eq. (13) of a linear field is v - dt (v . grad) v at every node, and no correction comes from empty cells.
TEST(MeshConvection, LinearField)
{
    Random random(5);
    for (const auto& settings : meshes)
    {
        MeshGrid grid = random_grid(settings, random);
        const Gradient<2> g{0.3, -0.2, 0.7, -0.5};
        const double dt = 0.01;
        std::vector<Vec<2>> before;
        for (std::size_t n = 0; n < grid.mesh.nodes(); ++n)
        {
            const Vec<2>& x = grid.mesh.place(n);
            before.push_back({1 + g.xx * x[0] + g.xy * x[1], -2 + g.yx * x[0] + g.yy * x[1]});
            set(grid.nodes.v, n, before.back());
        }
        cell_gradients(grid, dt);
        convect(grid, dt);
        int inside = 0;
        for (std::size_t n = 0; n < grid.mesh.nodes(); ++n)
        {
            const Vec<2>&x = grid.mesh.place(n), v = before[n];
            if (x[0] < 0.01 || x[0] > 3.99 || x[1] < 0.01 || x[1] > 3.99)
                continue;
            ++inside;
            EXPECT_NEAR(grid.nodes.v[0][n], v[0] - dt * (v[0] * g.xx + v[1] * g.xy), 1e-13);
            EXPECT_NEAR(grid.nodes.v[1][n], v[1] - dt * (v[0] * g.yx + v[1] * g.yy), 1e-13);
        }
        EXPECT_EQ(inside, 49);
        std::fill(grid.mass.begin(), grid.mass.end(), 0.0);
        const VectorField<2> now = grid.nodes.v;
        convect(grid, dt);
        EXPECT_EQ(grid.nodes.v, now);
    }
}

/// Each node takes the gradient of the cell that its velocity comes from.
TEST(MeshConvection, IsUpwind)
{
    MeshGrid grid(make_mesh(scene_of({"lpfdm.cells=triangles"})).mesh);
    std::vector<std::uint32_t> all;
    for (std::uint32_t n = 0; n < grid.mesh.nodes(); ++n)
        all.push_back(n);
    grid.nodes.set_active(all);
    std::fill(grid.mass.begin(), grid.mass.end(), 1.0);
    const Vec<2> middle{2, 2};
    const auto n = static_cast<std::size_t>(
        std::find_if(all.begin(), all.end(), [&](std::uint32_t k) { return grid.mesh.place(k) == middle; }) - all.begin());
    ASSERT_EQ(grid.mesh.around(n).size(), 6u);
    for (const auto& [c, corner] : grid.mesh.around(n))
    {
        Vec<2> from{0, 0};  // the middle of the cell
        for (const Vec<2>& x : grid.mesh.places(c))
            for (std::size_t d = 0; d < 2; ++d)
                from[d] += x[d] / 3;
        for (std::size_t other = 0; other < grid.mesh.cells(); ++other)
            set(grid.gradient, other, std::array<double, 4>{other == c ? 0.1 : 0.0, 0, 0, 0});
        const double dt = 0.1;
        const Vec<2> v{middle[0] - from[0], middle[1] - from[1]};
        set(grid.nodes.v, n, v);
        convect(grid, dt);
        EXPECT_NEAR(grid.nodes.v[0][n], 0.9 * v[0], 1e-14);
        EXPECT_EQ(grid.nodes.v[1][n], v[1]);
    }
}

/// The limit of a square is the closed form, that of a triangle what its stiffness says: 6 x 6, from Gauss's forces.
TEST(MeshLimits, AreThoseOfTheCell)
{
    const ElasticModuli law{3e6, 0.3};
    const std::vector<Vec<2>> square{{0, 0}, {0.5, 0}, {0.5, 0.5}, {0, 0.5}}, triangle{{0, 0}, {0.6, 0.1}, {0.2, 0.5}};
    EXPECT_NEAR(2 / std::sqrt(cell_frequency_squared(polygon_slopes(square), 0.25, stiffness_root(law))),
                0.5 / std::sqrt(law.constrained()) * std::sqrt(0.7), 1e-12);
    const double area = polygon_area(triangle);
    Eigen::Matrix<double, 6, 6> stiffness;
    for (int a = 0; a < 6; ++a)
    {
        std::vector<Vec<2>> u(3, {0, 0});
        u[static_cast<std::size_t>(a / 2)][static_cast<std::size_t>(a % 2)] = 1;
        const Gradient<2> g = polygon_gradient(triangle, u);
        const SymTensor<2> s{law.constrained() * g.xx + law.lame() * g.yy, law.lame() * g.xx + law.constrained() * g.yy,
                             law.shear() * g.shear()};
        const auto f = polygon_forces(triangle, s);
        for (int b = 0; b < 6; ++b)
            stiffness(b, a) = -f[static_cast<std::size_t>(b / 2)][static_cast<std::size_t>(b % 2)];
    }
    const double largest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(stiffness).eigenvalues().maxCoeff() / (area / 3);
    EXPECT_NEAR(cell_frequency_squared(polygon_slopes(triangle), area, stiffness_root(law)) / largest, 1, 1e-12);
}

/// Quadrilaterals that are squares are the lattice: a block that turns, flies and vibrates without supports.
TEST(MeshLpfdm, SquaresAreTheLattice)
{
    const std::string moving = block + "velocity = [\"3 - 0.4*Y + 0.3*sin(2*X)\", \"1.3 + 0.4*X + 0.2*cos(3*Y)\"]\n";
    const auto run = [&](const char* cells)
    {
        auto solver = test::make(scene_of({std::string("lpfdm.cells=") + cells}, moving));
        for (int n = 0; n < 120; ++n)
        {
            solver->prepare(n * 2e-3, 2e-3);
            solver->advance(2e-3);
        }
        solver->prepare(0.24, 2e-3);
        return solver;
    };
    const auto fast = run("lattice"), slow = run("quadrilaterals");
    const Points<2>&a = fast->bodies()[0].points, &b = slow->bodies()[0].points;
    std::vector<std::size_t> place(b.count);
    for (std::size_t p = 0; p < b.count; ++p)
        place[b.id[p]] = p;
    EXPECT_GT(largest_stress(a), 1e3);
    for (std::size_t p = 0; p < a.count; ++p)
    {
        const std::size_t other = place[a.id[p]];
        for (std::size_t d = 0; d < 2; ++d)
        {
            ASSERT_NEAR(a.x[d][p], b.x[d][other], 1e-11);
            ASSERT_NEAR(fast->velocity(0, p)[d], slow->velocity(0, other)[d], 1e-9);
        }
        for (std::size_t k = 0; k < 3; ++k)
            ASSERT_NEAR(a.stress[k][p], b.stress[k][other], 1e-9 * 1e6);
        ASSERT_NEAR(a.volume[p], b.volume[other], 1e-12);
    }
    EXPECT_NEAR(fast->sums().kinetic_energy / slow->sums().kinetic_energy, 1, 1e-10);
    EXPECT_NEAR(fast->sums().angular_momentum / slow->sums().angular_momentum, 1, 1e-10);
    EXPECT_EQ(fast->unknowns(), slow->unknowns());
    EXPECT_EQ(fast->active_cells(), slow->active_cells());
    EXPECT_DOUBLE_EQ(fast->step_limits()[0].seconds, slow->step_limits()[0].seconds);
}

namespace
{
/// Positions and stresses of all points by id, after n steps.
std::vector<double> after(const Scene& scene, int n, double dt)
{
    const auto solver = test::make(scene);
    for (int k = 0; k < n; ++k)
    {
        solver->prepare(k * dt, dt);
        solver->advance(dt);
    }
    const Points<2>& q = solver->bodies()[0].points;
    std::vector<double> numbers(5 * q.count);
    for (std::size_t p = 0; p < q.count; ++p)
        for (std::size_t k = 0; k < 5; ++k)
            numbers[5 * q.id[p] + k] = k < 2 ? q.x[k][p] : 1e-6 * q.stress[k - 2][p];
    return numbers;
}
void expect_near(const std::vector<double>& a, const std::vector<double>& b, double tolerance, const std::string& what)
{
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t k = 0; k < a.size(); ++k)
        ASSERT_NEAR(a[k], b[k], tolerance) << what << ", " << k;
}
}  // namespace

/// Walls on squares as a mesh are those on the lattice, in whatever way they move; without convection, which on a side between two cells
/// is the mean of theirs here and that of one there. Triangles follow a wall from line to line.
TEST(MeshLpfdm, Walls)
{
    const auto pressed = [](const std::string& motion)
    {
        return block +
               "[damping]\nlocal = 0.3\n[[boundary]]\nname = \"floor\"\nwhere = \"y <= 0.5\"\nfix = \"xy\"\n[[wall]]\nname = \"cap\"\n"
               "min = [0.0, 2.5]\nmax = [3.0, 3.5]\nvelocity = [0, -0.8]\nmotion = \"" +
               motion + "\"\n";
    };
    for (const char* motion : {"hand_off", "smooth"})
    {
        const auto of = [&](const char* cells) {
            return after(scene_of({std::string("lpfdm.cells=") + cells, "lpfdm.convection=none"}, pressed(motion)), 450, 2e-3);
        };
        expect_near(of("lattice"), of("quadrilaterals"), 1e-9, motion);
    }
    const Scene scene = scene_of({"lpfdm.cells=triangles"}, pressed("hand_off"));
    const std::vector<double> numbers = after(scene, 450, 2e-3);
    double top = 0;
    for (std::size_t k = 1; k < numbers.size(); k += 5)
        top = std::max(top, numbers[k]);
    EXPECT_LT(top, 2.0 + 1e-6);  // the cap stands at 1.78 m: the line of nodes at 2 m has been driven since it passed
    EXPECT_GT(top, 1.5);
}

/// A point that crosses a corner reaches nodes whose neighbours it leaves in the same step: these count, as on the lattice.
TEST(MeshLpfdm, NodesReachedAsOthersAreLeft)
{
    std::string lone = test::soil_block({0.5, 0.5}, {1.0, 1.0}) + "points_per_cell = 1\nvelocity = [\"1.9 + 0.6*X\", \"1.8 + 0.9*Y\"]\n";
    const auto of = [&](const char* cells) {
        return after(scene_of({std::string("lpfdm.cells=") + cells, "lpfdm.convection=none"}, lone), 300, 2e-3);
    };
    expect_near(of("lattice"), of("quadrilaterals"), 1e-12, "lone point");
}

/// Nodes that two bodies share start with the mean of their velocities by mass, as on the lattice.
TEST(MeshLpfdm, StartsAsTheLattice)
{
    const auto momentum = [](const char* cells)
    {
        const auto solver = test::make(scene_of({std::string("lpfdm.cells=") + cells}, test::two_bodies()));
        solver->prepare(0, 1e-3);
        return solver->sums().momentum;
    };
    for (std::size_t d = 0; d < 2; ++d)
        EXPECT_NEAR(momentum("lattice")[d], momentum("quadrilaterals")[d], 1e-9);
}

/// A block that flies is read into another solver after each of its steps, also where the next one reaches nodes.
TEST(MeshLpfdm, GoesOnFromEachStep)
{
    const Scene scene = scene_of({"lpfdm.cells=triangles"}, block + "velocity = [\"1.7 + 0.2*Y\", \"1.1 - 0.3*X\"]\n");
    const auto solver = test::make(scene), other = test::make(scene);
    for (int n = 0; n < 130; ++n)
    {
        solver->prepare(n * 4e-3, 4e-3);
        solver->advance(4e-3);
        const State state = state_of(*solver);
        restore(*other, state);
        solver->prepare((n + 1) * 4e-3, 4e-3);
        other->prepare((n + 1) * 4e-3, 4e-3);
        ASSERT_EQ(solver->sums().momentum, other->sums().momentum) << n;
        restore(*solver, state);
    }
}

/// The energy ledger of a mesh is kept and written as that of the lattice; the mesh of a restart must be the same one.
TEST(MeshLpfdm, KeepsItsLedgerAndItsMesh)
{
    const auto solver = test::make(scene_of({"lpfdm.cells=triangles", "lpfdm.shake=0.2"}));
    ASSERT_TRUE(solver->work());
    EXPECT_NE(solver->nodes().second, nullptr);
    solver->prepare(0, 1e-3);
    solver->advance(1e-3);
    const State state = state_of(*solver);
    EXPECT_NO_THROW(restore(*test::make(scene_of({"lpfdm.cells=triangles", "lpfdm.shake=0.2"})), state));
    EXPECT_THROW(restore(*test::make(scene_of({"lpfdm.cells=triangles", "lpfdm.shake=0.1"})), state), SceneError);
}

/// Free flight over cells of any shape: momentum to 1e-10, no stress, and points where they should be. Nodes that start from zero, as
/// printed, stop the block.
TEST(MeshLpfdm, FreeFlight)
{
    const std::string flying = block + "velocity = [1.7, 1.1]\n";
    const MeshScene hexagons(honeycomb(), flying);
    std::vector<Scene> scenes{hexagons.load()};
    for (const auto& settings : meshes)
        scenes.push_back(scene_of(settings, flying));
    for (const Scene& scene : scenes)
    {
        const auto solver = test::make(scene);
        const double dt = 2e-3;
        solver->prepare(0, dt);
        const Vec<2> start = solver->sums().momentum;
        for (int n = 0; n < 400; ++n)
        {
            solver->prepare(n * dt, dt);
            solver->advance(dt);
        }
        solver->prepare(400 * dt, dt);
        EXPECT_NEAR(solver->sums().momentum[0] / start[0], 1, 1e-10);
        EXPECT_NEAR(solver->sums().momentum[1] / start[1], 1, 1e-10);
        EXPECT_NEAR(solver->point_motion().momentum[0] / start[0], 1, 1e-10);
        const Points<2>& q = solver->bodies()[0].points;
        EXPECT_LT(largest_stress(q), 1e-6 * 1e6);
        double mean = 0;
        for (std::size_t p = 0; p < q.count; ++p)
            mean += q.x[0][p] / static_cast<double>(q.count);
        EXPECT_NEAR(mean, 1.5 + 1.7 * 0.8, 1e-10);
    }
    const auto literal = test::make(scene_of({"lpfdm.cells=triangles", "lpfdm.frontier=literal"}, flying));
    for (int n = 0; n < 400; ++n)
    {
        literal->prepare(n * 2e-3, 2e-3);
        literal->advance(2e-3);
    }
    EXPECT_LT(literal->point_motion().momentum[0], 0.99 * 4000 * 1.7);
}

/// Body forces, weight with density scaling, confinement and the cap on volumes reach the nodes: against the lattice, after three steps.
TEST(MeshLpfdm, LoadsAreThoseOfTheLattice)
{
    std::string text = block + "[gravity]\nacceleration = [1.0, -9.8]\n[body_force]\nacceleration = [\"X\", \"Y*Y\"]\n"
                               "[confinement]\npressure = 100.0\n";
    text.replace(text.find("end = 1.0"), 9, "end = 1.0\ndensity_scaling = true");
    text += "[damping]\nlocal = 0.3\n[[material]]\nname = \"stiff\"\ndensity = 1000.0\nyoungs_modulus = 9e6\npoissons_ratio = 0.2\n"
            "law = \"linear_elastic\"\n[[body]]\nname = \"stone\"\nmaterial = \"stiff\"\nshape = \"box\"\nmin = [1.0, 1.0]\nmax = [1.5, "
            "1.5]\ninside = \"soil\"\n";
    const auto run = [&](const char* cells)
    {
        auto solver = test::make(scene_of({std::string("lpfdm.cells=") + cells, "lpfdm.volume_cap=1.0"}, text));
        for (int n = 0; n < 3; ++n)
        {
            solver->prepare(n * 1e-3, 1e-3);
            solver->advance(1e-3);
        }
        solver->prepare(3e-3, 1e-3);
        return solver;
    };
    const auto fast = run("lattice"), slow = run("quadrilaterals");
    for (std::size_t d = 0; d < 2; ++d)
        EXPECT_NEAR(slow->sums().momentum[d] / fast->sums().momentum[d], 1, 1e-10);
    EXPECT_NEAR(slow->sums().unbalanced / fast->sums().unbalanced, 1, 1e-9);
    EXPECT_NEAR(slow->work()->gravity / fast->work()->gravity, 1, 1e-9);
    EXPECT_NEAR(slow->work()->loads / fast->work()->loads, 1, 1e-9);
    EXPECT_NEAR(slow->work()->damping / fast->work()->damping, 1, 1e-9);
}

/// A cap on volumes holds in the solver, too: a stretched block pulls less with it.
TEST(MeshLpfdm, CapsVolumes)
{
    const std::string pulled = block + "velocity = [\"2*(X-1.5)\", \"0\"]\ninitial_stress = [\"1e4\", \"0\", \"0\", \"0\"]\n";
    const auto of = [&](const char* cells, const char* cap)
    {
        return after(
            scene_of({std::string("lpfdm.cells=") + cells, "lpfdm.convection=none", std::string("lpfdm.volume_cap=") + cap}, pulled), 60,
            2e-3);
    };
    const auto capped = of("quadrilaterals", "1.0");
    expect_near(capped, of("lattice", "1.0"), 1e-9, "capped");
    EXPECT_NE(capped, of("quadrilaterals", "0"));
}

/// A volume counts up to the cap only; a point that leaves the mesh ends the run with its place.
TEST(MeshLpfdm, CapAndEdge)
{
    Scene scene = scene_of({"lpfdm.cells=triangles", "lpfdm.volume_cap=1.0"});
    MeshGrid grid(make_mesh(scene).mesh);
    std::vector<Body> bodies = make_bodies(scene, make_lattice(scene.grid), {});
    bodies[0].counted_volume = bodies[0].points.initial_volume;
    for (std::size_t p = 0; p < bodies[0].points.count; ++p)
    {
        bodies[0].points.volume[p] *= 3;
        bodies[0].points.stress[0][p] = 7;
    }
    cell_averages(grid, bodies, {std::vector<std::uint32_t>(bodies[0].points.count, 5)});
    EXPECT_NEAR(grid.stress[0][5], 7 * 4, 1e-12);
    EXPECT_NEAR(grid.mass[5], 4000, 1e-9);
    const std::string patch = "nodes = [[0, 0], [3, 0], [3, 4], [0, 4]]\ncells = [[0, 1, 2, 3]]\n";
    const auto solver = test::make(MeshScene(patch, block + "velocity = [2.0, 0.0]\n").load());
    try
    {
        for (int n = 0; n < 1000; ++n)
        {
            solver->prepare(n * 2e-3, 2e-3);
            solver->advance(2e-3);
        }
        ADD_FAILURE() << "stayed on the mesh";
    }
    catch (const Diverged& e)
    {
        EXPECT_NE(std::string(e.what()).find("left the mesh: position (3"), std::string::npos) << e.what();
    }
}

TEST(MeshLpfdm, SameBitsForAnyThreads)
{
    const auto run = [](int threads)
    {
        set_threads(threads);
        const auto solver = make_lpfdm(test::load(test::two_bodies(0.05, 6), "lpfdm-2000", {"lpfdm.cells=triangles", "lpfdm.shake=0.2"}));
        for (int n = 0; n < 25; ++n)
        {
            solver->prepare(0, 2e-3);
            solver->advance(2e-3);
        }
        set_threads(1);
        return state_of(*solver).numbers;
    };
    const std::vector<double> one = run(1), two = run(2);
    for (std::size_t k = 0; k < one.size(); ++k)
        ASSERT_EQ(one[k], two[k]) << k << " of " << one.size();
}
