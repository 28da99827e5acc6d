#pragma once
/// The tables of a scene, but for materials and the options of the methods.

#include "core/base/choice.hpp"
#include "core/base/types.hpp"
#include "core/scene/expression.hpp"

#include <array>
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
    Vec<2> origin{0, 0}, size{0, 0};
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

    Vec<2> acceleration{0, 0};
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
    bool kinetic = false;

    bool acts() const { return local > 0 || kinetic; }

    template <class V>
    void describe(V& v)
    {
        v.optional("local", local, "-", "alpha of local non-viscous damping, eqs. (14)-(15), in [0, 1)");
        v.optional("kinetic", kinetic, "-",
                   "for elastic bodies on their way to rest: all that moves is stopped whenever the kinetic energy begins to fall");
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
    std::optional<Vec<2>> min, max, center;
    std::optional<double> radius;
    std::vector<Vec<2>> vertices;
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
    Vec<2> min{0, 0}, max{0, 0};
    std::optional<Expr2> velocity;
    std::optional<Vec<2>> door;
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
}  // namespace testbed
