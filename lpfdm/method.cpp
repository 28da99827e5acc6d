/// LPFDM's row in the list of methods.

#include "core/scene/problems.hpp"
#include "core/scene/reader.hpp"
#include "core/scene/writer.hpp"
#include "lpfdm/lpfdm.hpp"
#include "lpfdm/options.hpp"

namespace testbed
{
namespace
{
using Support = LpfdmSpec::Support;
using Convection = LpfdmSpec::Convection;

void check(const Scene& scene, Problems& problems)
{
    const auto& lpfdm = scene.options<LpfdmSpec>();
    if (!(lpfdm.volume_cap == 0 || lpfdm.volume_cap >= 1))
        problems.add("lpfdm.volume_cap", fmt::format("0 (no limit) or at least 1 is asked, not {}", lpfdm.volume_cap));
    else if (lpfdm.volume_cap > 0 && lpfdm.support != Support::point)
        problems.add("lpfdm.volume_cap", "only for support = \"point\"");
    if (lpfdm.hourglass < 0 || lpfdm.hourglass > 0.5)
        problems.add("lpfdm.hourglass",
                     fmt::format("must lie in [0, 0.5], beyond that it is unstable at the critical time step; not {}", lpfdm.hourglass));
}

void warn(const Scene& scene, Problems& problems)
{
    if (!scene.tractions.empty() && scene.options<LpfdmSpec>().support == Support::domain)
        problems.warn("traction",
                      "domains reach into the cells outside a loaded face, and what they hold there may run away; use [confinement] "
                      "for a pressure, or lpfdm.support = \"point\"");
}

Traits traits(const Scene& scene)
{
    const auto& lpfdm = scene.options<LpfdmSpec>();
    const bool by_points = lpfdm.support == Support::point;
    const std::string domains = by_points && lpfdm.volume_cap == 0 ? "lpfdm.support=domain" : "";
    return {.reach = by_points ? 1 : 2,
            .shares_cells = true,
            .damps_hourglass = lpfdm.hourglass > 0,
            .remedies = {.crossing = domains,
                         .null_mode = lpfdm.hourglass == 0 ? "lpfdm.hourglass=0.05" : "",
                         .tension = by_points && lpfdm.volume_cap == 0 ? "lpfdm.volume_cap=2.0" : "",
                         .sliver = by_points                                   ? domains
                                   : lpfdm.convection != Convection::two_sided ? "lpfdm.convection=two_sided"
                                                                               : ""}};
}
}  // namespace

Method lpfdm_method(MakeSolver make)
{
    return {.name = "lpfdm",
            .about = "options of LPFDM",
            .variants = {{"lpfdm-2000", "as published: a point belongs to one cell, upwind convection, no hourglass control",
                          [](Scene& s) {
                              s.options<LpfdmSpec>() = {Support::point, Convection::upwind, LpfdmSpec::Frontier::extrapolate, 0.0};
                          }},
                         {"lpfdm", "each point has a domain, convection on both sides of the forces, hourglass control",
                          [](Scene& s) { s.options<LpfdmSpec>() = {}; }}},
            .options = MethodOptions(LpfdmSpec{}),
            .check = check,
            .warn = warn,
            .traits = traits,
            .make = std::move(make)};
}
}  // namespace testbed
