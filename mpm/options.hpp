#pragma once
/// What a scene says of MPM: its table [mpm].

#include "core/base/choice.hpp"

namespace testbed
{
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

/// Shapes and strains that go together: b_bar averages over a cell, which only linear shapes have to themselves.
inline constexpr auto mpm_combinations =
    std::to_array<std::pair<MpmSpec::Shape, MpmSpec::Strain>>({{MpmSpec::Shape::linear, MpmSpec::Strain::four_point},
                                                               {MpmSpec::Shape::linear, MpmSpec::Strain::b_bar},
                                                               {MpmSpec::Shape::bspline, MpmSpec::Strain::four_point},
                                                               {MpmSpec::Shape::cpgimp, MpmSpec::Strain::four_point}});
}  // namespace testbed
