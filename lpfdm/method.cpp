/// LPFDM's row in the list of methods.

#include "core/bodies/nonlocal.hpp"
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
using Cells = LpfdmSpec::Cells;

/// What a mesh does not have is refused.
void check_mesh(const Scene& scene, const LpfdmSpec& lpfdm, Problems& problems)
{
    const bool is_file = lpfdm.cells == Cells::file, is_made = lpfdm.has_mesh() && !is_file;
    if (!(lpfdm.shake >= 0 && lpfdm.shake <= 0.24))
        problems.add("lpfdm.shake", fmt::format("must lie in [0, 0.24], beyond that a cell may turn inside out; not {}", lpfdm.shake));
    else if (lpfdm.shake > 0 && !is_made)
        problems.add("lpfdm.shake", "only for cells = \"triangles\" or \"quadrilaterals\"");
    if (is_file == lpfdm.mesh.empty())
        problems.add("lpfdm.mesh", is_file ? "missing (the mesh of cells = \"file\")" : "only for cells = \"file\"");
    if (!lpfdm.has_mesh())
        return;
    const auto only = [&](bool is_lawful, const char* key, const char* why)
    {
        if (!is_lawful)
            problems.add(key, why);
    };
    only(lpfdm.support == Support::point, "lpfdm.support", "cells that are no lattice are for support = \"point\"");
    only(lpfdm.convection == Convection::upwind || lpfdm.convection == Convection::none, "lpfdm.convection",
         "cells that are no lattice have \"upwind\" or \"none\"");
    only(lpfdm.frontier != LpfdmSpec::Frontier::arrival, "lpfdm.frontier", "cells that are no lattice have \"extrapolate\" or \"literal\"");
    only(lpfdm.hourglass == 0, "lpfdm.hourglass", "cells that are no lattice have no hourglass control: 0 is asked");
    only(!scene.time.sharp_limit, "time.sharp_limit", "not for cells that are no lattice");
    only(scene.tractions.empty(), "traction", "not for cells that are no lattice; use [confinement] for a pressure");
    only(!has_nonlocal_softening(scene), "material", "nonlocal softening is not for cells that are no lattice");
    only(!is_file || scene.walls.empty(), "wall",
         "walls go from line to line of the lattice: not for a mesh from a file; use [[boundary]]");
    const auto is_smooth = [](const WallSpec& wall) { return wall.motion == WallSpec::Motion::smooth && wall.velocity; };
    only(lpfdm.cells != Cells::triangles || std::none_of(scene.walls.begin(), scene.walls.end(), is_smooth), "wall",
         "a wall that moves smoothly finds soil between two nodes of a square: for triangles motion = \"hand_off\" is asked");
    const auto moves = [](const WallSpec& wall) { return wall.velocity.has_value(); };
    only(lpfdm.shake == 0 || std::none_of(scene.walls.begin(), scene.walls.end(), moves), "lpfdm.shake",
         "a wall that moves goes from one straight line of nodes to the next: 0 is asked");
}

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
    check_mesh(scene, lpfdm, problems);
}

void warn(const Scene& scene, Problems& problems)
{
    if (!scene.tractions.empty() && scene.options<LpfdmSpec>().support == Support::domain)
        problems.warn("traction",
                      "domains reach into the cells outside a loaded face, and what they hold there may run away; use [confinement] "
                      "for a pressure, or lpfdm.support = \"point\"");
    if (scene.options<LpfdmSpec>().cells == Cells::triangles && scene.options<LpfdmSpec>().shake == 0 &&
        !(scene.damping && scene.damping->acts()))
        problems.warn("lpfdm.cells", "points of a body whose faces lie on lines of the lattice lie on the diagonals, too, and change "
                                     "triangles in the smallest motion, which "
                                     "makes energy without damping: shift the body by a part of their distance, or use lpfdm.shake");
}

Traits traits(const Scene& scene)
{
    const auto& lpfdm = scene.options<LpfdmSpec>();
    const bool by_points = lpfdm.support == Support::point;
    const std::string domains = by_points && lpfdm.volume_cap == 0 && !lpfdm.has_mesh() ? "lpfdm.support=domain" : "";
    return {.reach = by_points ? 1 : 2,
            .shares_cells = true,
            .damps_hourglass = lpfdm.hourglass > 0,
            .remedies = {.crossing = domains,
                         .null_mode = lpfdm.hourglass == 0 && !lpfdm.has_mesh() ? "lpfdm.hourglass=0.05" : "",
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
