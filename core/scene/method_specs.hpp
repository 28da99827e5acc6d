#pragma once
/// What a scene says of a method: its options.

#include "core/base/choice.hpp"

namespace testbed
{
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
}  // namespace testbed
