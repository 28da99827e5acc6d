#pragma once
/// A scene: what is computed, with which method. The describe() of each struct is at once the parser, the strict check of keys,
/// `testbed doc` and the writer of the resolved scene.

#include "core/base/choice.hpp"
#include "core/base/types.hpp"
#include "core/materials/material_spec.hpp"
#include "core/scene/expression.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace testbed
{
/// Components of a velocity.
enum class Fix
{
    x,
    y,
    xy
};
constexpr auto names(Fix)
{
    return choice_names<Fix>({{Fix::x, "x"}, {Fix::y, "y"}, {Fix::xy, "xy"}});
}
constexpr bool fixes(Fix fix, std::size_t component)
{
    return fix == Fix::xy || fix == (component == 0 ? Fix::x : Fix::y);
}

/// Of a box.
enum class Face
{
    left,
    right,
    bottom,
    top
};
constexpr auto names(Face)
{
    return choice_names<Face>({{Face::left, "left"}, {Face::right, "right"}, {Face::bottom, "bottom"}, {Face::top, "top"}});
}
constexpr std::size_t normal_of(Face face)
{
    return face == Face::left || face == Face::right ? 0 : 1;
}
constexpr bool is_low(Face face)
{
    return face == Face::left || face == Face::bottom;
}

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
    bool density_scaling = false, sharp_limit = false;

    template <class V>
    void describe(V& v)
    {
        v.required("end", end, "s", "the run completes with the first step that reaches this time");
        v.optional("cfl", cfl, "-", "time step as a share of the method's own limit at the start, or with dt = \"auto\" at all times");
        v.number_or("dt", dt, "auto", follows_limit, "s", "time step, replaces cfl; \"auto\" follows the limit as the state changes");
        v.optional(
            "density_scaling", density_scaling, "-",
            "for damped scenes on their way to rest: masses of stiffer bodies are raised, not their weight, so that all have one limit");
        v.optional("sharp_limit", sharp_limit, "-",
                   "the result file says the limit of the points as they stand at the start, too, an eigenvalue of the whole body");
        v.optional(
            "stop_unbalanced", stop_unbalanced, "-",
            "the run completes earlier, when unbalanced over internal nodal forces and kinetic over strain energy are both below this");
        v.optional("wall_clock_limit", wall_clock_limit, "s", "the run stops with status time_limit");
    }
};

struct GravitySpec
{
    enum class Profile
    {
        smooth,
        linear
    };
    friend constexpr auto names(Profile) { return choice_names<Profile>({{Profile::smooth, "smooth"}, {Profile::linear, "linear"}}); }

    Vec2 acceleration{0, 0};
    double ramp = 0;
    Profile profile = Profile::smooth;

    template <class V>
    void describe(V& v)
    {
        v.required("acceleration", acceleration, "m/s^2", "full value");
        v.optional("ramp", ramp, "s", "time over which it grows from zero; 0 applies it at once");
        v.choice("profile", profile, "of the ramp: (1 - cos)/2, or linear for loading to failure");
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
    enum class Shape
    {
        box,
        disk,
        polygon
    };
    friend constexpr auto names(Shape)
    {
        return choice_names<Shape>({{Shape::box, "box"}, {Shape::disk, "disk"}, {Shape::polygon, "polygon"}});
    }

    std::string name, material, inside;
    Shape shape = Shape::box;
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
        v.required_choice("shape", shape, "box: min, max; disk: center, radius; polygon: vertices");
        v.optional("points_per_cell", points_per_cell, "-", "per direction; the points stand in a square pattern");
        v.optional("min", min, "m", "box: lower left corner; the points start from here, wherever it lies in a cell");
        v.optional("max", max, "m", "box: upper right corner; the extent is a multiple of L");
        v.optional("center", center, "m", "disk");
        v.optional("radius", radius, "m", "disk");
        v.optional("vertices", vertices, "m", "polygon: corners in order");
        v.optional("inside", inside, "", "an inclusion: takes those points of this other body that lie in its shape, and their size");
        v.expression("velocity", velocity, "X, Y", "m/s", "initial velocity, two expressions");
        v.expression("initial_stress", initial_stress, "X, Y", "Pa", "four expressions: xx, yy, zz, xy; such as K0 stress under gravity");
    }
};

struct BoundarySpec
{
    std::string name, where;
    Fix fix = Fix::xy;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the boundary");
        v.expression("where", where, "x, y", "", "condition on the positions of nodes, such as \"y <= 0\"");
        v.required_choice("fix", fix, "velocity components held at zero; one component makes a roller");
    }
};

/// A rigid block (or plate, if min and max agree in one coordinate) that holds or drives the nodes it covers.
struct WallSpec
{
    enum class Motion
    {
        hand_off,
        smooth
    };
    friend constexpr auto names(Motion) { return choice_names<Motion>({{Motion::hand_off, "hand_off"}, {Motion::smooth, "smooth"}}); }

    std::string name;
    Fix fix = Fix::xy;
    Motion motion = Motion::hand_off;
    Vec2 min{0, 0}, max{0, 0};
    std::optional<Expr2> velocity;
    std::optional<Vec2> door;
    double door_opens = 0;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the wall; its reaction and displacement go into the history");
        v.required("min", min, "m", "lower left corner at the start; half a cell of soil beside a wall moves with it, see docs/methods.md");
        v.required("max", max, "m", "upper right corner; equal to min in one coordinate makes a plate");
        v.expression("velocity", velocity, "t", "m/s", "two expressions; absent: an obstacle");
        v.choice("fix", fix, "velocity components that soil at the wall shares; xy is rough, one is smooth");
        v.choice("motion", motion,
                 "hand_off: after each cell of travel the next line of nodes is driven, as published; smooth: the velocity interpolated "
                 "at the wall's face is driven; both pull soil that they leave");
        v.optional("door", door, "m", "an opening, from .. to along the longer side; the soil half a cell within its ends is held");
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
    std::string name, body;
    Face face = Face::left;
    Expr2 traction{"0", "0"};

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name of the traction");
        v.required("body", body, "", "name of a box");
        v.required_choice("face", face, "of the box; its outermost row of points carries the load");
        v.expression("traction", traction, "X, Y, x, y, t", "Pa", "two expressions: force per area of the initial face");
    }
};

struct BodyForceSpec
{
    Expr2 acceleration{"0", "0"};

    template <class V>
    void describe(V& v)
    {
        v.expression("acceleration", acceleration, "X, Y, x, y, t", "m/s^2", "two expressions, per unit mass");
    }
};

struct ProbeSpec
{
    std::string name, where;

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "name in the history");
        v.expression("where", where, "X, Y", "", "condition on initial positions; the mean of these points is recorded");
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
        v.expression("displacement", displacement, "X, Y, x, y, t", "m", "two expressions");
        v.expression("stress", stress, "X, Y, x, y, t", "Pa", "four expressions: xx, yy, zz, xy");
    }
};

struct OutputSpec
{
    double history = 0, checkpoint = 0;
    int snapshots = 1;

    template <class V>
    void describe(V& v)
    {
        v.optional("history", history, "s", "interval of the history; 0 makes 200 samples, and every step is the finest");
        v.optional("checkpoint", checkpoint, "s",
                   "wall clock time between restart files, of which the last replaces the one before; 0: only when a run is stopped");
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
    enum class Support
    {
        point,
        domain
    };
    friend constexpr auto names(Support) { return choice_names<Support>({{Support::point, "point"}, {Support::domain, "domain"}}); }
    enum class Convection
    {
        upwind,
        central,
        two_sided,
        none
    };
    friend constexpr auto names(Convection)
    {
        return choice_names<Convection>({{Convection::upwind, "upwind"},
                                         {Convection::central, "central"},
                                         {Convection::two_sided, "two_sided"},
                                         {Convection::none, "none"}});
    }
    enum class Frontier
    {
        extrapolate,
        literal,
        arrival
    };
    friend constexpr auto names(Frontier)
    {
        return choice_names<Frontier>(
            {{Frontier::extrapolate, "extrapolate"}, {Frontier::literal, "literal"}, {Frontier::arrival, "arrival"}});
    }

    Support support = Support::domain;
    Convection convection = Convection::two_sided;
    Frontier frontier = Frontier::arrival;
    double hourglass = 0.05, volume_cap = 0;

    template <class V>
    void describe(V& v)
    {
        v.choice("support", support, "point: a point belongs to one cell; domain: its box spreads over the cells that it overlaps");
        v.choice(
            "convection", convection,
            "form of eq. (13); two_sided: central, from the next layer of cells where one side has no material, half of it before and half "
            "after the forces, strain and position at the middle of the step");
        v.choice(
            "frontier", frontier,
            "velocity of nodes reached for the first time: mean of neighbours, or zero; arrival: whenever mass arrives at a free face, "
            "it brings its velocity");
        v.optional("hourglass", hourglass, "-", "coefficient chi of the viscous hourglass force, at most 0.5; 0 leaves it out");
        v.optional(
            "volume_cap", volume_cap, "-",
            "support = \"point\": stress counts over at most this many times a point's initial volume: one alone in its cell, grown by "
            "tension, has more stiffness than mass; 0 sets no limit");
    }
};

struct MpmSpec
{
    enum class Shape
    {
        linear,
        bspline,
        cpgimp
    };
    friend constexpr auto names(Shape)
    {
        return choice_names<Shape>({{Shape::linear, "linear"}, {Shape::bspline, "bspline"}, {Shape::cpgimp, "cpgimp"}});
    }
    enum class Scheme
    {
        usl,
        usf,
        musl
    };
    friend constexpr auto names(Scheme)
    {
        return choice_names<Scheme>({{Scheme::usl, "usl"}, {Scheme::usf, "usf"}, {Scheme::musl, "musl"}});
    }
    enum class Strain
    {
        four_point,
        b_bar
    };
    friend constexpr auto names(Strain) { return choice_names<Strain>({{Strain::four_point, "four_point"}, {Strain::b_bar, "b_bar"}}); }
    enum class Increment
    {
        midpoint,
        forward
    };
    friend constexpr auto names(Increment)
    {
        return choice_names<Increment>({{Increment::midpoint, "midpoint"}, {Increment::forward, "forward"}});
    }
    enum class Transfer
    {
        flip,
        xpic
    };
    friend constexpr auto names(Transfer) { return choice_names<Transfer>({{Transfer::flip, "flip"}, {Transfer::xpic, "xpic"}}); }
    enum class Filter
    {
        none,
        cell
    };
    friend constexpr auto names(Filter) { return choice_names<Filter>({{Filter::none, "none"}, {Filter::cell, "cell"}}); }

    Shape shape = Shape::linear;
    Scheme scheme = Scheme::musl;
    Strain strain = Strain::four_point;
    Increment increment = Increment::midpoint;
    double flip = 1;
    Transfer transfer = Transfer::flip;
    int xpic_order = 2;
    Filter null_space_filter = Filter::none;
    double mass_cutoff = 1e-7;

    template <class V>
    void describe(V& v)
    {
        v.choice("shape", shape, "nodal shape functions as seen by the points");
        v.choice("scheme", scheme, "stress update last, first, or last with remapped velocity");
        v.choice("strain", strain, "strain at each point, or with the cell's mean volumetric strain");
        v.choice("increment", increment,
                 "strain over the configuration at the middle of the step, second order, or at its start, first order");
        v.choice("transfer", transfer, "velocity update of the points: FLIP blended with PIC, or XPIC(m)");
        v.optional("flip", flip, "-", "share of FLIP in transfer = \"flip\", the rest is PIC; in [0, 1]");
        v.optional("xpic_order", xpic_order, "-", "m of transfer = \"xpic\": 1 is PIC; a larger one keeps more of what the nodes see");
        v.choice("null_space_filter", null_space_filter,
                 "cell: takes from the velocity of a cell's points what its nodes do not see; needs shape = \"linear\"");
        v.optional(
            "mass_cutoff", mass_cutoff, "-",
            "a node with less than this share of a full node's mass hands mass, momentum and force to its neighbours and takes their "
            "mean velocity; the default is what rounding asks for, 0 is off");
    }
};

struct FemSpec
{
    enum class Analysis
    {
        by_scene,
        statics,
        dynamics
    };
    friend constexpr auto names(Analysis)
    {
        return choice_names<Analysis>({{Analysis::by_scene, "auto"}, {Analysis::statics, "static"}, {Analysis::dynamics, "dynamic"}});
    }
    enum class Integrator
    {
        newmark,
        central_difference
    };
    friend constexpr auto names(Integrator)
    {
        return choice_names<Integrator>({{Integrator::newmark, "newmark"}, {Integrator::central_difference, "central_difference"}});
    }

    int degree = 2, refinements = 0;
    Analysis analysis = Analysis::by_scene;
    Integrator integrator = Integrator::newmark;

    template <class V>
    void describe(V& v)
    {
        v.optional("degree", degree, "-", "1 (Q1) or 2 (Q2)");
        v.optional("refinements", refinements, "-", "global refinements of the lattice mesh");
        v.choice("analysis", analysis, "auto: static if the scene is damped or ramped, else dynamic");
        v.choice("integrator", integrator, "dynamic: average acceleration, or explicit");
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
    /// Whether the law of some body has a strength, so that it may flow or break.
    bool may_flow() const;
    /// Constants with L, as expressions see them.
    Constants expression_constants() const;
};

enum class Family
{
    lpfdm,
    mpm,
    fem
};
constexpr auto names(Family)
{
    return choice_names<Family>({{Family::lpfdm, "lpfdm"}, {Family::mpm, "mpm"}, {Family::fem, "fem"}});
}

/// A family with a named set of options.
struct Variant
{
    std::string name;
    Family family;
    std::string description;
    void (*apply)(Scene&);
};
const std::vector<Variant>& variants();
const Variant& find_variant(const std::string& name);
inline Family family_of(const Scene& scene)
{
    return find_variant(scene.method).family;
}

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
/// What a scene may have at most: points have numbers of 32 bits, and some 150 bytes each.
struct SceneBounds
{
    double points = 1e9, cells = 2e9;
};
/// The same from the text of a scene. @param path what messages call it, and what names its case
LoadedScene load_scene_text(const std::string& text, const std::string& path, const std::string& method = "",
                            const std::vector<std::string>& overrides = {}, const SceneBounds& bounds = {});

std::string resolved_toml(const Scene& scene);
/// Documentation of all tables, or of one. @throws SceneError for an unknown table.
std::string scene_documentation(const std::string& table = "");
/// The nearest of the candidates, or nothing if none is near.
std::optional<std::string> nearest(const std::string& word, const std::vector<std::string>& candidates);
}  // namespace testbed
