#pragma once
/// A scene: what is computed, with which method. The describe() of each struct is at once the parser, the strict check of keys,
/// `testbed doc` and the writer of the resolved scene.

#include "core/expression.hpp"
#include "core/material_spec.hpp"
#include "core/types.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace testbed
{
using Expr2 = std::array<std::string, 2>;

struct GridSpec
{
    Vec2 origin{0, 0}, size{0, 0};
    double cell_size = 0;

    template <class V>
    void describe(V& v)
    {
        v.optional("origin", origin, "m", "lower left corner of the lattice");
        v.required("size", size, "m", "extent of the lattice, a multiple of cell_size");
        v.required("cell_size", cell_size, "m", "side L of the square cells");
    }
};

struct TimeSpec
{
    double end = 0, cfl = 0.5;
    std::optional<double> dt, stop_unbalanced, wall_clock_limit;
    bool follows_limit = false;  ///< dt = "auto"
    bool density_scaling = false;

    template <class V>
    void describe(V& v)
    {
        v.required("end", end, "s", "the run completes with the first step that reaches this time");
        v.optional("cfl", cfl, "-", "time step as a share of the method's own limit at the start, or with dt = \"auto\" at all times");
        v.number_or("dt", dt, "auto", follows_limit, "s", "time step, replaces cfl; \"auto\" follows the limit as the state changes");
        v.optional(
            "density_scaling", density_scaling, "-",
            "for damped scenes on their way to rest: masses of stiffer bodies are raised, not their weight, so that all have one limit");
        v.optional(
            "stop_unbalanced", stop_unbalanced, "-",
            "the run completes earlier, when unbalanced over internal nodal forces and kinetic over strain energy are both below this");
        v.optional("wall_clock_limit", wall_clock_limit, "s", "the run stops with status time_limit");
    }
};

struct GravitySpec
{
    Vec2 acceleration{0, 0};
    double ramp = 0;
    std::string profile = "smooth";

    template <class V>
    void describe(V& v)
    {
        v.required("acceleration", acceleration, "m/s^2", "full value");
        v.optional("ramp", ramp, "s", "time over which it grows from zero; 0 applies it at once");
        v.choice("profile", profile, {"smooth", "linear"}, "of the ramp: (1 - cos)/2, or linear for loading to failure");
    }
};

struct DampingSpec
{
    double local = 0;

    template <class V>
    void describe(V& v)
    {
        v.required("local", local, "-", "alpha of local non-viscous damping, eqs. (14)-(15), in [0, 1)");
    }
};

struct BodySpec
{
    std::string name, material, shape, inside;
    int points_per_cell = 4;
    std::optional<Vec2> min, max, center;
    std::optional<double> radius;
    std::vector<Vec2> vertices;
    std::optional<Expr2> velocity;
    std::optional<std::array<std::string, 4>> initial_stress;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the body (the paper's cluster)");
        v.required("material", material, "", "name of a material");
        v.choice("shape", shape, {"box", "disk", "polygon"}, "box: min, max; disk: center, radius; polygon: vertices");
        v.optional("points_per_cell", points_per_cell, "-", "per direction; the points stand in a square pattern");
        v.optional("min", min, "m", "box: lower left corner; the points start from here, wherever it lies in a cell");
        v.optional("max", max, "m", "box: upper right corner; the extent is a multiple of L");
        v.optional("center", center, "m", "disk");
        v.optional("radius", radius, "m", "disk");
        v.optional("vertices", vertices, "m", "polygon: corners in order");
        v.optional("inside", inside, "", "an inclusion: takes those points of this other body that lie in its shape, and their size");
        v.optional("velocity", velocity, "m/s", "initial velocity, two expressions of X, Y");
        v.optional("initial_stress", initial_stress, "Pa", "four expressions of X, Y: xx, yy, zz, xy; such as K0 stress under gravity");
    }
};

struct BoundarySpec
{
    std::string name, where, fix;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the boundary");
        v.expression("where", where, "", "condition on node positions x, y, such as \"y <= 0\"");
        v.choice("fix", fix, {"x", "y", "xy"}, "velocity components held at zero; one component makes a roller");
    }
};

/// A rigid block (or plate, if min and max agree in one coordinate) that holds or drives the nodes it covers.
struct WallSpec
{
    std::string name, fix = "xy", motion = "hand_off";
    Vec2 min{0, 0}, max{0, 0};
    std::optional<Expr2> velocity;
    std::optional<Vec2> door;
    double door_opens = 0;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the wall; its reaction and displacement go into the history");
        v.required("min", min, "m", "lower left corner at the start");
        v.required("max", max, "m", "upper right corner; equal to min in one coordinate makes a plate");
        v.optional("velocity", velocity, "m/s", "two expressions of t; absent: an obstacle");
        v.choice("fix", fix, {"x", "y", "xy"}, "velocity components that soil at the wall shares; xy is rough, one is smooth");
        v.choice("motion", motion, {"hand_off", "smooth"},
                 "hand_off: after each cell of travel the next line of nodes is driven, as published; smooth: the velocity interpolated "
                 "at the wall's face is driven");
        v.optional("door", door, "m", "an opening, from .. to along the longer side");
        v.optional("door_opens", door_opens, "s", "time at which the door opens");
    }
};

struct ConfinementSpec
{
    double pressure = 0;

    template <class V>
    void describe(V& v)
    {
        v.required("pressure", pressure, "Pa", "on every free surface, wherever it moves; start from an initial_stress that balances it");
    }
};

struct TractionSpec
{
    std::string name, body, face;
    Expr2 traction{"0", "0"};

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the traction");
        v.required("body", body, "", "name of a box");
        v.choice("face", face, {"left", "right", "bottom", "top"}, "of the box; its outermost row of points carries the load");
        v.required("traction", traction, "Pa", "two expressions of X, Y, t: force per area of the initial face");
    }
};

struct BodyForceSpec
{
    Expr2 acceleration{"0", "0"};

    template <class V>
    void describe(V& v)
    {
        v.required("acceleration", acceleration, "m/s^2", "two expressions of X, Y, x, y, t, per unit mass");
    }
};

struct ProbeSpec
{
    std::string name, where;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name in the history");
        v.expression("where", where, "", "condition on initial positions X, Y; the mean of these points is recorded");
    }
};

/// The exact solution for one kinematics.
struct ExactSpec
{
    std::optional<Expr2> displacement;
    std::optional<std::array<std::string, 4>> stress;

    template <class V>
    void describe(V& v)
    {
        v.optional("displacement", displacement, "m", "two expressions of X, Y, t");
        v.optional("stress", stress, "Pa", "four expressions of X, Y, t: xx, yy, zz, xy");
    }
};

struct OutputSpec
{
    double history = 0;
    int snapshots = 1;

    template <class V>
    void describe(V& v)
    {
        v.optional("history", history, "s", "interval of the history; 0 makes 200 samples, and every step is the finest");
        v.optional("snapshots", snapshots, "-", "equally spaced in time, the last at the end; one more is written at the start");
    }
};

/// A measured or published curve that the report compares with.
struct CurveSpec
{
    std::string name, source;
    std::vector<double> x, y;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "what the metrics call it");
        v.optional("source", source, "", "citation");
        v.required("x", x, "", "abscissae");
        v.required("y", y, "", "ordinates");
    }
};

struct ReportSpec
{
    std::vector<std::string> metrics;
    Constants reference;
    std::vector<CurveSpec> curves;

    template <class V>
    void describe(V& v)
    {
        v.optional("metrics", metrics, "", "groups of quantities that the report package computes from the result");
        v.named_numbers("reference", reference, "numbers that these metrics scale with");
        v.list("curve", curves, "curves that they compare with");
    }
};

struct LpfdmSpec
{
    std::string support = "domain", convection = "central", frontier = "extrapolate";
    double hourglass = 0.05;

    template <class V>
    void describe(V& v)
    {
        v.choice("support", support, {"point", "domain"},
                 "point: a point belongs to one cell; domain: its box spreads over the cells that it overlaps");
        v.choice("convection", convection, {"upwind", "central", "none"}, "form of eq. (13)");
        v.choice("frontier", frontier, {"extrapolate", "literal"},
                 "velocity of nodes reached for the first time: mean of neighbours, or zero");
        v.optional("hourglass", hourglass, "-", "coefficient chi of the viscous hourglass force, at most 0.5; 0 leaves it out");
    }
};

struct MpmSpec
{
    std::string shape = "linear", scheme = "musl", strain = "four_point";
    double flip = 1;

    template <class V>
    void describe(V& v)
    {
        v.choice("shape", shape, {"linear", "bspline", "cpgimp"}, "nodal shape functions as seen by the points");
        v.choice("scheme", scheme, {"usl", "usf", "musl"}, "stress update last, first, or last with remapped velocity");
        v.choice("strain", strain, {"four_point", "b_bar"}, "strain at each point, or with the cell's mean volumetric strain");
        v.optional("flip", flip, "-", "share of FLIP in the velocity update, the rest is PIC; in [0, 1]");
    }
};

struct FemSpec
{
    int degree = 2, refinements = 0;
    std::string analysis = "auto", integrator = "newmark";

    template <class V>
    void describe(V& v)
    {
        v.optional("degree", degree, "-", "1 (Q1) or 2 (Q2)");
        v.optional("refinements", refinements, "-", "global refinements of the lattice mesh");
        v.choice("analysis", analysis, {"auto", "static", "dynamic"}, "auto: static if the scene is damped or ramped, else dynamic");
        v.choice("integrator", integrator, {"newmark", "central_difference"}, "dynamic: average acceleration, or explicit");
    }
};

struct Scene
{
    std::string title, method = "lpfdm";
    Constants constants;
    GridSpec grid;
    TimeSpec time;
    std::optional<GravitySpec> gravity;
    std::optional<DampingSpec> damping;
    std::vector<MaterialSpec> materials;
    std::vector<BodySpec> bodies;
    std::vector<BoundarySpec> boundaries;
    std::vector<WallSpec> walls;
    std::vector<TractionSpec> tractions;
    std::optional<BodyForceSpec> body_force;
    std::optional<ConfinementSpec> confinement;
    std::vector<ProbeSpec> probes;
    std::map<std::string, ExactSpec> exact;  ///< by kinematics
    OutputSpec output;
    ReportSpec report;
    LpfdmSpec lpfdm;
    MpmSpec mpm;
    FemSpec fem;

    std::string path;  ///< as given by the user

    template <class V>
    void describe(V& v)
    {
        v.optional("title", title, "", "one line for reports");
        v.optional("method", method, "", "a variant: see `testbed list`");
        v.named_numbers("constants", constants,
                        "names for the expressions of the scene; pi is known, and the cell size L if it is a number");
        v.table("grid", grid, "the fixed lattice");
        v.table("time", time, "duration and time step");
        v.table("gravity", gravity, "body force, eq. (11)");
        v.table("damping", damping, "for quasi-static scenes");
        v.list("material", materials, "constitutive laws");
        v.list("body", bodies, "clusters of material points");
        v.list("boundary", boundaries, "fixities and rollers");
        v.list("wall", walls, "rigid walls, moving or not");
        v.list("traction", tractions, "loads on faces");
        v.table("confinement", confinement, "cell pressure of a compression test");
        v.table("body_force", body_force, "acceleration field, for manufactured solutions");
        v.list("probe", probes, "means over chosen points in the history");
        v.tables("exact", exact, {"small_strain", "hypoelastic"}, "exact solution for methods that integrate this law");
        v.table("output", output, "what is written");
        v.table("report", report, "what is graded");
        v.table("lpfdm", lpfdm, "options of LPFDM");
        v.table("mpm", mpm, "options of MPM");
        v.table("fem", fem, "options of the FEM reference");
    }

    /// Name of the folder that holds the scene.
    std::string case_name() const { return std::filesystem::absolute(path).lexically_normal().parent_path().filename().string(); }
    const MaterialSpec& material(const std::string& name) const;
    const BodySpec& body(const std::string& name) const;
    /// Constants with L, as expressions see them.
    Constants expression_constants() const;
};

/// A variant is a family (lpfdm, mpm, fem) with a named set of options.
struct Variant
{
    std::string name, family, description;
    void (*apply)(Scene&);
};
const std::vector<Variant>& variants();
const Variant& find_variant(const std::string& name);

/// The name of the scene's variant, with the options that the scene changes in brackets.
std::string variant_label(const Scene& scene);

/// All problems of a scene at once, each with file, line and key.
struct SceneError : std::runtime_error
{
    using std::runtime_error::runtime_error;
};

struct LoadedScene
{
    Scene scene;
    std::vector<std::string> warnings;
};

/// @param overrides "key.path=value" strings; list entries by number from 0 or by name.
/// @throws SceneError
LoadedScene load_scene(const std::string& path, const std::string& method = "", const std::vector<std::string>& overrides = {});

std::string resolved_toml(const Scene& scene);
/// Documentation of all tables, or of one. @throws SceneError for an unknown table.
std::string scene_documentation(const std::string& table = "");
/// The nearest of the candidates, or nothing if none is near.
std::optional<std::string> nearest(const std::string& word, const std::vector<std::string>& candidates);
}  // namespace testbed
