#pragma once
/// What a scene says of the FEM reference: its table [fem].

#include "core/base/choice.hpp"

namespace testbed
{
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
