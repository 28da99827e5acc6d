#pragma once
/// What a scene says of strength, for the laws that have one.

#include "core/base/choice.hpp"

#include <optional>
#include <string>
#include <vector>

namespace testbed
{
struct StrengthSpec
{
    std::string cohesion, friction_angle;  ///< numbers or expressions of X, Y
    double dilatancy_angle = 0;
    std::optional<double> tensile_strength;

    template <class V>
    void describe(V& v)
    {
        v.expression("cohesion", cohesion, "X, Y", "Pa", "number, or expression of the initial position");
        v.expression("friction_angle", friction_angle, "X, Y", "rad", "number, or expression of the initial position; in [0, pi/2)");
        v.optional("dilatancy_angle", dilatancy_angle, "rad", "from 0 to the friction angle");
        v.optional("tensile_strength", tensile_strength, "Pa", "no principal stress exceeds it; absent: the apex is the limit");
    }
};

struct NonlocalSpec
{
    enum class Weight
    {
        gauss,
        galavi_schweiger
    };
    friend constexpr auto names(Weight)
    {
        return choice_names<Weight>({{Weight::gauss, "gauss"}, {Weight::galavi_schweiger, "galavi_schweiger"}});
    }

    double internal_length = 0, over_nonlocal = 2;
    Weight weight = Weight::gauss;

    template <class V>
    void describe(V& v)
    {
        v.required("internal_length", internal_length, "m", "l of the weight");
        v.optional("over_nonlocal", over_nonlocal, "-", "m: softening is driven by (1 - m) own + m mean plastic shear strain");
        v.choice("weight", weight, "exp(-r^2/l^2), or r exp(-r^2/l^2)");
    }
};

struct SofteningSpec
{
    enum class Kind
    {
        drop,
        linear
    };
    friend constexpr auto names(Kind) { return choice_names<Kind>({{Kind::drop, "drop"}, {Kind::linear, "linear"}}); }

    Kind kind = Kind::drop;
    double residual = 1;
    std::optional<double> strain, band_thickness;
    std::optional<NonlocalSpec> nonlocal;

    template <class V>
    void describe(V& v)
    {
        v.required_choice("kind", kind, "drop: at first yield; linear: over the plastic shear strain");
        v.required("residual", residual, "-", "share of the cohesion that is left, in [0, 1]");
        v.optional("strain", strain, "-", "linear: plastic shear strain at which the residual is reached");
        v.optional("band_thickness", band_thickness, "m", "linear: crack-band scaling, strain holds for a band this thick, not L");
        v.table("nonlocal", nonlocal, "linear: softening driven by a nonlocal plastic shear strain");
    }
};

struct RandomSpec
{
    enum class RandomField
    {
        per_particle,
        correlated
    };
    friend constexpr auto names(RandomField)
    {
        return choice_names<RandomField>({{RandomField::per_particle, "per-particle"}, {RandomField::correlated, "correlated"}});
    }

    int seed = 1;
    double cohesion_deviation = 0, friction_deviation = 0;
    RandomField field = RandomField::per_particle;
    std::optional<double> correlation_length;

    template <class V>
    void describe(V& v)
    {
        v.required("seed", seed, "-", "another seed, another field");
        v.optional("cohesion_deviation", cohesion_deviation, "-", "relative standard deviation of the Gaussian cohesion");
        v.optional("friction_deviation", friction_deviation, "-", "relative standard deviation of the Gaussian friction angle");
        v.choice("field", field,
                 "per-particle: each point draws its own; correlated: a field of the initial position, the same for every L and method");
        v.optional("correlation_length", correlation_length, "m", "correlated: theta of the correlation exp(-r^2/theta^2)");
    }
};

/// Tables of a material, only for laws with strength.
struct StrengthKeys
{
    std::optional<StrengthSpec> strength;
    std::optional<SofteningSpec> softening;
    std::optional<RandomSpec> random;

    template <class V>
    void describe(V& v)
    {
        v.table("strength", strength, "of mohr_coulomb");
        v.table("softening", softening, "of the cohesion");
        v.table("random", random, "Gaussian strength about the given one, truncated at zero (and friction at 80 degrees)");
    }
};
}  // namespace testbed
