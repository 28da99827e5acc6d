#include "fem_reference/method.hpp"

#include "core/scene/problems.hpp"
#include "core/scene/reader.hpp"
#include "core/scene/writer.hpp"
#include "fem_reference/options.hpp"

#include <cmath>

namespace testbed
{
namespace
{
void check(const Scene& scene, Problems& problems)
{
    const auto& fem = scene.options<FemSpec>();
    if (fem.degree != 1 && fem.degree != 2)
        problems.add("fem.degree", fmt::format("1 or 2 is asked, not {}", fem.degree));
    if (fem.refinements < 0 || fem.refinements > 10)
        problems.add("fem.refinements", "between 0 and 10 is asked");
}

void warn(const Scene& scene, Problems& problems)
{
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        if (scene.bodies[k].initial_stress)
            problems.warn(fmt::format("body[{}].initial_stress", k), "the FEM reference starts without stress: it is left out");
    if (scene.confinement)
        problems.warn("confinement", "the FEM reference leaves it out, as it does the initial stress that balances it");
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
        if (scene.materials[k].has_strength())
            problems.warn(fmt::format("material[{}].law", k), "the FEM reference is elastic: strength is left out");
    if (scene.options<FemSpec>().degree == 1)
        warn_of_locking(scene, problems);
}

Traits traits(const Scene& scene)
{
    const auto& fem = scene.options<FemSpec>();
    return {.has_points = false,
            .elements_per_cell = std::ldexp(1.0, fem.refinements),
            .may_lock = true,
            .remedies = {.locking = fem.degree == 1 ? "fem.degree=2" : ""}};
}
}  // namespace

Method fem_method()
{
    return {.name = "fem",
            .about = "options of the FEM reference",
            .variants = {{"fem-q1", "small-strain reference, bilinear elements", [](Scene& s) { s.options<FemSpec>().degree = 1; }},
                         {"fem-q2", "small-strain reference, biquadratic elements", [](Scene& s) { s.options<FemSpec>().degree = 2; }}},
            .options = MethodOptions(FemSpec{}),
            .check = check,
            .warn = warn,
            .traits = traits,
            .make = {}};
}
}  // namespace testbed
