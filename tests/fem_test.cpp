#include "core/run/guards.hpp"
#include "core/run/run.hpp"
#include "fem_reference/fem.hpp"
#include "tests/quadrilateral.hpp"

#include <cmath>
#include <deal.II/base/quadrature_lib.h>
#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/grid/grid_generator.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>

namespace testbed
{
namespace
{
constexpr double E = 5e7, nu = 0.3, rho = 1700, g = 9.81, H = 4;
const double lame = E * nu / ((1 + nu) * (1 - 2 * nu)), shear = E / (2 * (1 + nu)), M = lame + 2 * shear;

const char* const soil = R"(
[[material]]
name = "soil"
law = "linear_elastic"
density = 1700.0
youngs_modulus = 5e7
poissons_ratio = 0.3
)";
const char* const gravity = "[gravity]\nacceleration = [0.0, -9.81]\n";
const char* const supports = R"(
[[boundary]]
name = "base"
where = "y <= 0"
fix = "xy"
[[boundary]]
name = "sides"
where = "x <= 0 || x >= 2"
fix = "x"
)";

std::string box(const std::string& name, double x0, double y0, double x1, double y1, const std::string& more = "",
                const std::string& material = "soil")
{
    return fmt::format("[[body]]\nname = \"{}\"\nmaterial = \"{}\"\nshape = \"box\"\n"
                       "min = [{:.17g}, {:.17g}]\nmax = [{:.17g}, {:.17g}]\n{}\n",
                       name, material, x0, y0, x1, y1, more);
}

/// A scene on a lattice of 6 x 6 m with L = 1 m, over 1 s.
Scene scene_of(const std::string& tables, std::vector<std::string> settings = {}, const std::string& method = "fem-q2")
{
    const std::string case_name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    const auto path = std::filesystem::temp_directory_path() / fmt::format("fem_test_{}.toml", case_name);
    std::ofstream(path) << "[grid]\nsize = [6.0, 6.0]\ncell_size = 1.0\n[time]\nend = 1.0\n" << tables;
    Scene scene = load_scene(path.string(), method, settings).scene;
    std::filesystem::remove(path);
    return scene;
}
Scene column(std::vector<std::string> settings = {}, const std::string& method = "fem-q2", const std::string& body_settings = "")
{
    return scene_of(soil + box("column", 0, 0, 2, H, body_settings) + gravity + supports, std::move(settings), method);
}

std::unique_ptr<FemSolver> solver_of(const Scene& scene)
{
    std::unique_ptr<Solver> solver = make_fem(scene, [](const std::string&) {});
    return std::unique_ptr<FemSolver>(dynamic_cast<FemSolver*>(solver.release()));
}
/// To the end of the scene in n steps of dt.
void run(FemSolver& solver, double dt, int n)
{
    for (int step = 0; step <= n; ++step)
    {
        solver.prepare(step * dt, dt);
        if (step < n)
            solver.advance(dt);
    }
    solver.update_points();
}
std::unique_ptr<FemSolver> solved(const Scene& scene)
{
    std::unique_ptr<FemSolver> solver = solver_of(scene);
    EXPECT_TRUE(solver->is_static());
    run(*solver, scene.time.end, 1);
    return solver;
}

struct Exact
{
    Vec<2> displacement;
    SymTensor<2> stress;
};
/// Relative L2 errors of displacement and stress over all points.
template <class F>
Vec<2> errors(const FemSolver& solver, F&& exact)
{
    double du = 0, u = 0, ds = 0, s = 0;
    for (const Body& body : solver.bodies())
        for (std::size_t p = 0; p < body.points.count; ++p)
        {
            const Points<2>& q = body.points;
            const Exact e = exact(q.X[0][p], q.X[1][p]);
            const double dx = q.x[0][p] - q.X[0][p] - e.displacement[0], dy = q.x[1][p] - q.X[1][p] - e.displacement[1];
            du += dx * dx + dy * dy;
            u += e.displacement[0] * e.displacement[0] + e.displacement[1] * e.displacement[1];
            const double xx = q.stress[0][p] - e.stress.xx, yy = q.stress[1][p] - e.stress.yy, xy = q.stress[2][p] - e.stress.xy;
            ds += xx * xx + yy * yy + 2 * xy * xy;
            s += e.stress.xx * e.stress.xx + e.stress.yy * e.stress.yy + 2 * e.stress.xy * e.stress.xy;
        }
    return {std::sqrt(du / u), std::sqrt(ds / s)};
}
Exact exact_column(double, double Y)
{
    const double syy = rho * g * (Y - H);
    return {{0, -rho * g / M * (H * Y - Y * Y / 2)}, {nu / (1 - nu) * syy, syy, 0}};
}
std::string message_of(const std::function<void()>& action)
{
    try
    {
        action();
    }
    catch (const SceneError& e)
    {
        return e.what();
    }
    return "";
}
double largest_stress(const FemSolver& solver)
{
    double largest = 0;
    for (const Body& body : solver.bodies())
        for (std::size_t p = 0; p < body.points.count; ++p)
            largest = std::max(
                {largest, std::abs(body.points.stress[0][p]), std::abs(body.points.stress[1][p]), std::abs(body.points.stress[2][p])});
    return largest;
}

TEST(FemStatic, Q2HoldsTheColumnExactlyAtAnyCellSize)
{
    for (const char* L : {"2.0", "1.0", "0.5"})
    {
        const Scene scene = column({fmt::format("grid.cell_size={}", L), "fem.analysis=static"});
        const Vec<2> e = errors(*solved(scene), exact_column);
        EXPECT_LT(e[0], 1e-11) << L;
        EXPECT_LT(e[1], 1e-11) << L;
    }
}

TEST(FemStatic, Q1ConvergesWithOrderTwoInDisplacementAndOneInStress)
{
    const auto at = [](const char* setting)
    {
        const Scene scene = column({setting, "fem.analysis=static"}, "fem-q1");
        return errors(*solved(scene), exact_column);
    };
    const Vec<2> coarse = at("grid.cell_size=0.5"), fine = at("grid.cell_size=0.25");
    EXPECT_NEAR(std::log2(coarse[0] / fine[0]), 2, 0.02);
    EXPECT_NEAR(std::log2(coarse[1] / fine[1]), 1, 0.02);
}

TEST(FemStatic, RefinementIsAFinerLattice)
{
    // the same mesh; the points differ, so the nodes are compared
    const Scene refined = column({"fem.analysis=static", "fem.refinements=1"}, "fem-q1");
    const Scene finer = column({"fem.analysis=static", "grid.cell_size=0.5"}, "fem-q1");
    const auto a = solved(refined), b = solved(finer);
    EXPECT_EQ(a->unknowns(), b->unknowns());
    EXPECT_EQ(a->active_cells(), b->active_cells());
    EXPECT_NEAR(a->displacement().linfty_norm(), b->displacement().linfty_norm(), 1e-12 * b->displacement().linfty_norm());
    EXPECT_NEAR(a->strain_energy(), b->strain_energy(), 1e-10 * b->strain_energy());
}

TEST(FemStatic, TwoBodiesInSeriesShareTheirStress)
{
    const double E2 = 8 * E, M2 = 8 * M;
    const std::string rock = fmt::format(
        "[[material]]\nname = \"rock\"\nlaw = \"linear_elastic\"\ndensity = 2500.0\nyoungs_modulus = {}\npoissons_ratio = 0.3\n", E2);
    const Scene scene = scene_of(soil + rock + box("lower", 0, 0, 2, 2) + box("upper", 0, 2, 2, 4, "", "rock") + gravity + supports,
                                 {"fem.analysis=static"});
    const auto solver = solved(scene);
    const double weight = 2500 * g * 2;  // of the upper body, on the interface
    const Vec<2> e = errors(*solver,
                            [&](double, double Y)
                            {
                                const bool lower = Y < 2;
                                const double syy = lower ? -weight - rho * g * (2 - Y) : -2500 * g * (4 - Y);
                                const double interface = -(2 * weight + rho * g * 2) / M;
                                const double h = Y - 2;
                                const double uy = lower ? -(weight * Y + rho * g * (2 * Y - Y * Y / 2)) / M
                                                        : interface - 2500 * g * (2 * h - h * h / 2) / M2;
                                return Exact{{0, uy}, {nu / (1 - nu) * syy, syy, 0}};
                            });
    EXPECT_LT(e[0], 1e-11);
    EXPECT_LT(e[1], 1e-11);
}

TEST(FemStatic, ModulusOfPositionAndBodyForceHoldAManufacturedSolution)
{
    // nu = 0, E = E0 (1 + Y / H), u = a (Y^2 / 2 - H Y): the body force that balances it is -2 E0 a Y / (H rho)
    const double a = 1e-3;
    const std::string material = "[[material]]\nname = \"soil\"\nlaw = \"linear_elastic\"\ndensity = 1700.0\n"
                                 "youngs_modulus = \"5e7*(1+Y/4)\"\npoissons_ratio = 0.0\n";
    const std::string force = "[body_force]\nacceleration = [\"0\", \"-2*5e7*1e-3*Y/(4*1700)\"]\n";
    const Scene scene = scene_of(material + box("column", 0, 0, 2, H) + force + supports, {"fem.analysis=static"});
    const Vec<2> e = errors(*solved(scene),
                            [&](double, double Y) {
                                return Exact{{0, a * (Y * Y / 2 - H * Y)}, {0, E * (1 + Y / H) * a * (Y - H), 0}};
                            });
    EXPECT_LT(e[0], 1e-11);
    EXPECT_LT(e[1], 1e-11);
}

TEST(FemStatic, ShearCarriesTheLoadAboveIt)
{
    // a layer that gravity pulls sideways, and that cannot move in y
    const Scene scene = scene_of(soil + box("layer", 0, 0, 2, H) + "[gravity]\nacceleration = [2.0, 0.0]\n" +
                                     "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n" +
                                     "[[boundary]]\nname = \"all\"\nwhere = \"y >= 0\"\nfix = \"y\"\n",
                                 {"fem.analysis=static"});
    const auto solver = solved(scene);
    // the free sides bend the shear across the layer, but its mean on a level is rho b (H - Y)
    const Points<2>& q = solver->bodies()[0].points;
    double sum = 0;
    int n = 0;
    for (std::size_t p = 0; p < q.count; ++p)
        if (q.X[1][p] < 1)
            sum += q.stress[2][p], ++n;
    EXPECT_GT(q.x[0][q.count - 1] - q.X[0][q.count - 1], 0);
    EXPECT_NEAR(sum / n, rho * 2.0 * (H - 0.5), 0.05 * rho * 2.0 * H);
}

std::string traction(const std::string& face, double tx, double ty)
{
    return fmt::format("[[traction]]\nname = \"{0}\"\nbody = \"block\"\nface = \"{0}\"\ntraction = [\"{1:.17g}\", \"{2:.17g}\"]\n", face,
                       tx, ty);
}
std::string held(const std::string& name, const std::string& where, const std::string& fix)
{
    return fmt::format("[[boundary]]\nname = \"{}\"\nwhere = \"{}\"\nfix = \"{}\"\n", name, where, fix);
}
void expect_uniform_stress(const FemSolver& solver, const SymTensor<2>& s)
{
    const Points<2>& q = solver.bodies()[0].points;
    for (std::size_t p = 0; p < q.count; ++p)
    {
        EXPECT_NEAR(q.stress[0][p], s.xx, 1e-6);
        EXPECT_NEAR(q.stress[1][p], s.yy, 1e-6);
        EXPECT_NEAR(q.stress[2][p], s.xy, 1e-6);
    }
}

/// A uniform stress follows from its tractions, on each pair of faces; the other two are supported.
TEST(FemStatic, TractionsOnEachFace)
{
    const SymTensor<2> s{3e3, -5e3, 2e3};
    const std::string block = soil + box("block", 1, 1, 3, 3);
    for (const bool high : {true, false})
    {
        const double sign = high ? 1 : -1;
        const std::string loads = traction(high ? "right" : "left", sign * s.xx, 0) + traction(high ? "top" : "bottom", 0, sign * s.yy);
        const Scene scene =
            scene_of(block + loads + held("x", high ? "x <= 1" : "x >= 3", "x") + held("y", high ? "y <= 1" : "y >= 3", "y"),
                     {"fem.analysis=static"});
        const auto solver = solved(scene);
        expect_uniform_stress(*solver, {s.xx, s.yy, 0});
        EXPECT_NEAR(solver->restraints()[0].reaction[0], -sign * 2 * s.xx, 1e-6);
        EXPECT_NEAR(solver->restraints()[1].reaction[1], -sign * 2 * s.yy, 1e-6);
    }
    const std::string shears = traction("right", 0, s.xy) + traction("left", 0, -s.xy) + traction("top", s.xy, 0);
    const Scene shear_scene = scene_of(block + shears + held("base", "y <= 1", "xy"), {"fem.analysis=static"});
    const auto sheared = solved(shear_scene);
    expect_uniform_stress(*sheared, {0, 0, s.xy});
    EXPECT_NEAR(sheared->restraints()[0].reaction[0], -2 * s.xy, 1e-6);
}

/// A cap that moves compresses the column by M v t / H, and pushes it.
TEST(FemStatic, AWallPrescribesItsDisplacement)
{
    const double travel = -1e-3;
    const Scene scene =
        scene_of(soil + box("column", 0, 0, 2, H) + supports +
                     "[[wall]]\nname = \"cap\"\nmin = [0.0, 4.0]\nmax = [2.0, 4.0]\nfix = \"y\"\nvelocity = [\"0\", \"-2e-3*t\"]\n",
                 {"fem.analysis=static"});
    const auto solver = solved(scene);
    const double syy = M * travel / H;
    expect_uniform_stress(*solver, {lame * travel / H, syy, 0});
    const auto records = solver->restraints();
    ASSERT_EQ(records.size(), 3u);
    EXPECT_NEAR(records[0].reaction[1], -2 * syy, 1e-6);  // the base pushes up
    EXPECT_EQ(records[2].name, "cap");
    EXPECT_NEAR(records[2].reaction[1], 2 * syy, 1e-6);
    EXPECT_NEAR((*records[2].displacement)[1], travel, 1e-9);
}

/// An open door holds nothing, a closed one all that is in it.
TEST(FemStatic, ADoorHoldsNothingOnceOpen)
{
    for (const double opens : {0.5, 2.0})  // the scene ends at 1 s
    {
        const Scene scene =
            scene_of(soil + box("block", 0, 0, 6, H) + gravity + "[[wall]]\nname = \"floor\"\nmin = [0.0, 0.0]\nmax = [6.0, 0.0]\n" +
                         fmt::format("door = [2.0, 4.0]\ndoor_opens = {}\n", opens),
                     {"fem.analysis=static"});
        const auto solver = solved(scene);
        const Points<2>& q = solver->bodies()[0].points;
        double lowest = 0;
        for (std::size_t p = 0; p < q.count; ++p)
            if (q.X[1][p] < 0.2 && q.X[0][p] > 2.5 && q.X[0][p] < 3.5)
                lowest = std::min(lowest, q.x[1][p] - q.X[1][p]);
        EXPECT_EQ(lowest < -1e-3, opens < 1) << lowest;
    }
}

/// The largest component of the strain itself, whatever the stress beside it.
TEST(FemStatic, SaysWhenStrainsAreNotSmall)
{
    for (const double share : {0.8, 1.2})
    {
        const Scene scene = scene_of(
            soil + box("column", 0, 0, 2, H) + supports +
                fmt::format("[[wall]]\nname = \"cap\"\nmin = [0.0, 4.0]\nmax = [2.0, 4.0]\nfix = \"y\"\nvelocity = [\"0\", \"{}\"]\n",
                            -share * limits::small_strain * H),
            {"fem.analysis=static"});
        const auto solver = solved(scene);
        Guards guards(scene, *solver, 1);
        guards.watch(GuardSample{}, *solver);
        const auto found = guards.findings(true);
        EXPECT_EQ(std::any_of(found.begin(), found.end(), [](const Finding& f) { return f.code == "small_strain"; }), share > 1);
    }
}

TEST(FemStatic, LoadIsThatOfTheEndOfTheRamp)
{
    const auto half = solved(column({"gravity.ramp=2.0"})), full = solved(column({"fem.analysis=static"}));
    EXPECT_NEAR(half->displacement().linfty_norm() / full->displacement().linfty_norm(), 0.5, 1e-12);
}

TEST(FemOperators, LinearFieldHasItsStressItsEnergyAndNoForceInside)
{
    for (const char* method : {"fem-q1", "fem-q2"})
    {
        const Scene scene = column({"fem.analysis=static"}, method);
        const Lattice<2> lattice = mesh_lattice(scene);
        Elasticity elasticity(scene, lattice, [](const std::string&) {});
        elasticity.assemble(MassKind::none);
        const double xx = 2e-3, xy = -1e-3, yx = 4e-3, yy = -3e-3;
        Vector u(elasticity.dofs().n_dofs());
        for (std::size_t dof = 0; dof < u.size(); ++dof)
        {
            const auto& X = elasticity.nodes()[dof];
            u(dof) = elasticity.is_x(dof) ? xx * X[0] + xy * X[1] : yx * X[0] + yy * X[1];
        }
        std::vector<Body> bodies = make_bodies(scene, lattice, {});
        Sampler(scene, lattice, elasticity.dofs(), bodies).sample(u, bodies);
        const double sxx = (lame + 2 * shear) * xx + lame * yy, syy = lame * xx + (lame + 2 * shear) * yy, sxy = shear * (xy + yx);
        const Points<2>& q = bodies[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            EXPECT_NEAR(q.stress[0][p], sxx, 1e-12 * E);
            EXPECT_NEAR(q.stress[1][p], syy, 1e-12 * E);
            EXPECT_NEAR(q.stress[2][p], sxy, 1e-12 * E);
            EXPECT_NEAR(q.x[0][p] - q.X[0][p], xx * q.X[0][p] + xy * q.X[1][p], 1e-14);
        }
        Vector force(u.size());
        elasticity.stiffness().vmult(force, u);
        EXPECT_NEAR(force * u, (sxx * xx + syy * yy + sxy * (xy + yx)) * 2 * H, 1e-10 * E);
        Vec<2> on_top{0, 0};
        for (std::size_t dof = 0; dof < u.size(); ++dof)
        {
            const auto& X = elasticity.nodes()[dof];
            if (X[1] > H - 1e-9 && X[0] > 1e-9 && X[0] < 2 - 1e-9)
                on_top[elasticity.is_x(dof) ? 0 : 1] += force(dof);
            const bool inside = X[0] > 1e-9 && X[0] < 2 - 1e-9 && X[1] > 1e-9 && X[1] < H - 1e-9;
            EXPECT_TRUE(!inside || std::abs(force(dof)) < 1e-13 * E) << X;
        }
        const double share = scene.options<FemSpec>().degree == 1 ? 1 : 2 - 2.0 / 6;  // of the top side's two metres, less its corner nodes
        EXPECT_NEAR(on_top[0], sxy * share, 1e-10 * E);
        EXPECT_NEAR(on_top[1], syy * share, 1e-10 * E);
    }
}

TEST(FemOperators, MassAndWeightAreThoseOfTheBody)
{
    for (const MassKind kind : {MassKind::consistent, MassKind::lumped})
    {
        const Scene scene = column({}, "fem-q2", "velocity = [\"3\", \"0\"]");
        Elasticity elasticity(scene, mesh_lattice(scene), [](const std::string&) {});
        elasticity.assemble(kind);
        Vector v(elasticity.dofs().n_dofs());
        for (std::size_t dof = 0; dof < v.size(); ++dof)
            v(dof) = elasticity.is_x(dof) ? 3 : 4;
        const MotionSums sums = elasticity.motion(v);
        const double mass = rho * 2 * H;
        EXPECT_NEAR(sums.momentum[0], 3 * mass, 1e-9 * mass);
        EXPECT_NEAR(sums.momentum[1], 4 * mass, 1e-9 * mass);
        EXPECT_NEAR(sums.kinetic_energy, 12.5 * mass, 1e-9 * mass);
        EXPECT_NEAR(sums.angular_momentum, mass * (1 * 4 - 2 * 3), 1e-9 * mass);
        Vector up(v);
        for (std::size_t dof = 0; dof < v.size(); ++dof)
            up(dof) = elasticity.is_x(dof) ? 0 : 1;
        EXPECT_NEAR(elasticity.load(0) * up, -mass * g, 1e-9 * mass);
    }
}

TEST(FemOperators, SupportsHoldMidSideNodesToo)
{
    const Scene scene = scene_of(soil + box("column", 0, 0, 1, 2) + gravity +
                                     "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n"
                                     "[[boundary]]\nname = \"side\"\nwhere = \"x <= 0\"\nfix = \"x\"\n",
                                 {"fem.analysis=static"});
    // 3 x 5 nodes: the base holds 6 components, the side 4 more
    EXPECT_EQ(solver_of(scene)->unknowns(), 30u - 10u);
}

TEST(FemDynamic, FreeFlightKeepsMomentumAndStaysFreeOfStress)
{
    for (const char* integrator : {"newmark", "central_difference"})
    {
        const Scene scene =
            scene_of(soil + box("block", 0.3, 0.2, 3.3, 2.2, "velocity = [\"2\", \"1\"]"), {fmt::format("fem.integrator={}", integrator)});
        const auto solver = solver_of(scene);
        EXPECT_FALSE(solver->is_static());
        const double dt = 0.5 * solver->critical_time_step(scene);
        run(*solver, dt, 100);
        const MotionSums sums = solver->sums();
        const double mass = rho * 6;
        EXPECT_NEAR(sums.momentum[0], 2 * mass, 1e-12 * 2 * mass);
        EXPECT_NEAR(sums.momentum[1], mass, 1e-12 * 2 * mass);
        EXPECT_LT(largest_stress(*solver), 1e-13 * E);
        const Points<2>& q = solver->bodies()[0].points;
        for (std::size_t p = 0; p < q.count; ++p)
            EXPECT_NEAR(q.x[0][p] - q.X[0][p], 200 * dt, 1e-12);
        EXPECT_NEAR(solver->velocity(0, 0)[0], 2, 1e-11);
    }
}

TEST(FemDynamic, FreeFallIsExactFromTheFirstStep)
{
    for (const char* integrator : {"newmark", "central_difference"})
        for (const int steps : {1, 7})
        {
            const Scene scene = scene_of(soil + box("block", 1, 3, 3, 5) + gravity, {fmt::format("fem.integrator={}", integrator)});
            const auto solver = solver_of(scene);
            const double dt = 1e-3, t = steps * dt;
            run(*solver, dt, steps);
            const Points<2>& q = solver->bodies()[0].points;
            EXPECT_NEAR(q.x[1][5] - q.X[1][5], -0.5 * g * t * t, 1e-14) << integrator;
            EXPECT_NEAR(solver->sums().momentum[1], -rho * 4 * g * t, 1e-10 * rho) << integrator;
        }
}

TEST(FemDynamic, NewmarkKeepsTheEnergyOfAFreeVibration)
{
    const Scene scene = scene_of(soil + box("column", 0, 0, 2, H, "velocity = [\"0.1*Y\", \"sin(Y)\"]") +
                                 "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n");
    const auto solver = solver_of(scene);
    solver->prepare(0, 1e-3);
    const double start = solver->sums().kinetic_energy;
    double least = start;
    for (int step = 0; step < 500; ++step)
    {
        solver->advance(1e-3);
        solver->prepare((step + 1) * 1e-3, 1e-3);
        const double kinetic = solver->sums().kinetic_energy;
        least = std::min(least, kinetic);
        ASSERT_NEAR(kinetic + solver->strain_energy(), start, 1e-10 * start) << step;
    }
    EXPECT_LT(least, 0.5 * start);
}

TEST(FemDynamic, SuddenGravityReachesTwiceTheStaticSettlement)
{
    // nu = 0: M = E, the tip turns at t = 2 H / c
    const double c = std::sqrt(E / rho), settlement = rho * g * H * H / (2 * E);
    for (const char* integrator : {"newmark", "central_difference"})
    {
        const Scene scene = column({"material.0.poissons_ratio=0", "grid.cell_size=0.25", fmt::format("fem.integrator={}", integrator)});
        const auto solver = solver_of(scene);
        const int n = 1000;
        const double dt = 2 * H / c / n;
        run(*solver, dt, n);
        const Points<2>& q = solver->bodies()[0].points;
        const double at_top = q.x[1][q.count - 1] - q.X[1][q.count - 1];
        EXPECT_NEAR(at_top, -2 * settlement, 0.01 * settlement) << integrator;
    }
}

TEST(FemDynamic, CentralDifferencesAreStableUpToTheirLimitAndRefusedAboveIt)
{
    for (const char* method : {"fem-q1", "fem-q2"})
    {
        const Scene scene = column({"fem.integrator=central_difference", "fem.refinements=1"}, method);
        const auto below = solver_of(scene);
        const double limit = below->critical_time_step(scene);
        // a square bilinear element is stable below h / c, a biquadratic one below a part of it
        const double crossing = 0.5 / std::sqrt(M / rho);
        EXPECT_LT(limit, 1.5 * crossing);
        EXPECT_GT(limit, 0.2 * crossing);
        run(*below, 0.999 * limit, 3000);
        EXPECT_LT(below->displacement().linfty_norm(), 3 * rho * g * H * H / (2 * M));

        const auto above = solver_of(scene);
        const std::string message = message_of([&] { above->prepare(0, 1.001 * limit); });
        EXPECT_NE(message.find("time.dt"), std::string::npos) << message;
        EXPECT_NE(message.find("newmark"), std::string::npos) << message;
    }
}

TEST(FemDynamic, LimitIsTheOneAtWhichTheSchemeTurnsUnstable)
{
    // omega dt = 2 is sharp: a growing mode just above shows that the eigenvalue is the largest, not merely large
    const Scene scene = column({"fem.integrator=central_difference"}, "fem-q1", "velocity = [\"sin(37*X*Y)\", \"sin(91*X+53*Y)\"]");
    const auto solver = solver_of(scene);
    const double dt = 1.01 * solver->critical_time_step(scene);
    Vector u(solver->displacement()), v(solver->elasticity().initial_velocity()), a(u);
    for (int step = 0; step < 2000; ++step)
    {
        solver->elasticity().stiffness().vmult(a, u);
        solver->elasticity().hold(a);
        for (std::size_t dof = 0; dof < u.size(); ++dof)
            v(dof) -= dt * a(dof) / solver->elasticity().lumped_mass()(dof);
        u.add(dt, v);
    }
    EXPECT_GT(u.linfty_norm(), 1e6);
}

TEST(FemDynamic, SharedNodesTakeTheVelocityThatKeepsMomentum)
{
    const std::string light =
        "[[material]]\nname = \"light\"\nlaw = \"linear_elastic\"\ndensity = 850.0\nyoungs_modulus = 5e7\npoissons_ratio = 0.3\n";
    const Scene scene = scene_of(soil + light + box("left", 0, 0, 2, 2, "velocity = [\"1\", \"0\"]") +
                                     box("right", 2, 0, 4, 2, "velocity = [\"-2\", \"0\"]", "light"),
                                 {"fem.integrator=central_difference"});
    const auto solver = solver_of(scene);
    solver->prepare(0, 1e-4);
    EXPECT_NEAR(solver->sums().momentum[0], 0, 1e-9 * rho);
}

TEST(FemScene, AnalysisFollowsFromTheScene)
{
    EXPECT_TRUE(solver_of(column({"damping.local=0.7"}))->is_static());
    EXPECT_TRUE(solver_of(column({"gravity.ramp=0.5"}))->is_static());
    EXPECT_TRUE(solver_of(column({"time.stop_unbalanced=1e-6"}))->is_static());
    EXPECT_FALSE(solver_of(column())->is_static());
    EXPECT_FALSE(solver_of(column({"gravity.ramp=0.5", "fem.analysis=dynamic"}))->is_static());
}

TEST(FemScene, RefusesDampingInADynamicAnalysis)
{
    const Scene scene = column({"damping.local=0.7", "fem.analysis=dynamic"});
    const std::string message = message_of([&] { make_fem(scene); });
    EXPECT_NE(message.find("damping.local=0"), std::string::npos) << message;
}

TEST(FemScene, RefusesBoxesThatDoNotShareLatticeLines)
{
    const Scene scene = scene_of(soil + box("first", 0, 0, 2, 2) + box("second", 0.5, 3, 2.5, 5));
    const std::string message = message_of([&] { make_fem(scene); });
    EXPECT_NE(message.find("body 'second'"), std::string::npos) << message;
}

TEST(FemScene, RefusesAStaticAnalysisOfWhatCanMove)
{
    const auto refusal = [](const std::string& boundaries, const std::string& more_bodies = "")
    {
        const Scene scene = scene_of(soil + box("block", 0, 0, 2, 2) + more_bodies + gravity + boundaries, {"fem.analysis=static"});
        return message_of([&] { solved(scene); });
    };
    const std::string base = "[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"xy\"\n";
    EXPECT_EQ(refusal(base), "");
    EXPECT_NE(refusal("").find("body 'block' can move"), std::string::npos);
    EXPECT_NE(refusal("[[boundary]]\nname = \"base\"\nwhere = \"y <= 0\"\nfix = \"y\"\n").find("body 'block' can move"), std::string::npos);
    const std::string pin = "[[boundary]]\nname = \"pin\"\nwhere = \"y <= 0 && x <= 0\"\nfix = \"xy\"\n";
    EXPECT_NE(refusal(pin).find("body 'block' can move"), std::string::npos);
    EXPECT_NE(refusal(base, box("far", 4, 4, 5, 5)).find("body 'far' can move"), std::string::npos);
    // bodies that meet in one corner turn about it
    EXPECT_NE(refusal(base, box("hinged", 2, 2, 3, 3)).find("singular"), std::string::npos);
}

TEST(FemScene, WarnsOfASteppedDisk)
{
    const Scene scene =
        scene_of(std::string(soil) + "[[body]]\nname = \"disk\"\nmaterial = \"soil\"\nshape = \"disk\"\ncenter = [3.0, 3.0]\nradius = 2.0\n"
                                     "velocity = [\"3-Y\", \"X-3\"]\n");
    std::string warning;
    const auto solver = make_fem(scene, [&](const std::string& message) { warning = message; });
    EXPECT_NE(warning.find("stepped"), std::string::npos) << warning;
    // its points beyond the steps take values of the mesh
    const Points<2>& q = solver->bodies()[0].points;
    for (std::size_t p = 0; p < q.count; ++p)
        EXPECT_NEAR(solver->velocity(0, p)[0], 3 - q.X[1][p], 1.0);
}

TEST(FemScene, RunWritesAFile)
{
    const auto folder = std::filesystem::temp_directory_path() / "fem_test_run";
    std::filesystem::create_directories(folder);
    std::ofstream(folder / "scene.toml") << "[grid]\nsize = [6.0, 6.0]\ncell_size = 1.0\n[time]\nend = 0.1\n"
                                         << soil << box("column", 0, 0, 2, H) << gravity << supports;
    RunOptions options;
    options.scene = (folder / "scene.toml").string();
    options.method = "fem-q2";
    options.output = (folder / "out.h5").string();
    options.quiet = true;
    EXPECT_EQ(run_scene(options, [](const Scene& scene) { return make_fem(scene); }), ExitCode::completed);
    EXPECT_TRUE(std::filesystem::exists(folder / "out.h5"));
    EXPECT_TRUE(std::filesystem::exists(folder / "out.xdmf"));
    std::filesystem::remove_all(folder);
}
}  // namespace

/// The point function of Mohr-Coulomb at the quadrature points of a bilinear element: the same strength as in a cell of particles.
TEST(PointFunction, ServesQuadraturePoints)
{
    dealii::Triangulation<2> mesh;
    dealii::GridGenerator::hyper_cube(mesh);
    const dealii::FE_Q<2> element(1);
    dealii::DoFHandler<2> dofs(mesh);
    dofs.distribute_dofs(element);
    dealii::FEValues<2> values(element, dealii::QGauss<2>(2), dealii::update_gradients | dealii::update_JxW_values);
    values.reinit(dofs.begin_active());
    std::vector<test::IntegrationPoint> points(values.n_quadrature_points);
    constexpr std::array<unsigned int, 4> corner{0, 1, 3, 2};  // around the square
    for (unsigned int q = 0; q < points.size(); ++q)
        for (std::size_t n = 0; n < 4; ++n)
        {
            points[q].dx[n] = values.shape_grad(corner[n], q)[0];
            points[q].dy[n] = values.shape_grad(corner[n], q)[1];
            points[q].area = values.JxW(q);
        }
    const ElasticModuli moduli(5e7, 0.3);
    constexpr double phi = 0.5, c = 9800;
    const MohrCoulomb law{{moduli}, {c, std::sin(phi)}, {moduli, 0.0, std::numeric_limits<double>::infinity()}, {}};
    const double strength = 2 * c * std::cos(phi) / (1 - std::sin(phi));
    EXPECT_NEAR(test::pressure_on_top(law, points, 3 * strength * (1 - 0.09) / 5e7, 120), strength, 1e-3 * strength);
}
}  // namespace testbed
