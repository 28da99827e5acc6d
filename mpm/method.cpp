/// MPM's row in the list of methods.

#include "core/scene/problems.hpp"
#include "core/scene/reader.hpp"
#include "core/scene/writer.hpp"
#include "mpm/mpm.hpp"
#include "mpm/options.hpp"

#include <algorithm>

namespace testbed
{
namespace
{
using Shape = MpmSpec::Shape;
using Strain = MpmSpec::Strain;

/// "linear with four_point or b_bar; bspline with four_point; ..."
std::string lawful_combinations()
{
    std::vector<std::pair<std::string, std::vector<std::string>>> strains;
    for (const auto& [shape, strain] : mpm_combinations)
    {
        if (strains.empty() || strains.back().first != name_of(shape))
            strains.push_back({name_of(shape), {}});
        strains.back().second.push_back(name_of(strain));
    }
    std::vector<std::string> texts;
    for (const auto& [shape, of_shape] : strains)
        texts.push_back(fmt::format("{} with {}", shape, fmt::join(of_shape, " or ")));
    return fmt::format("{}", fmt::join(texts, "; "));
}

void check(const Scene& scene, Problems& problems)
{
    const auto& mpm = scene.options<MpmSpec>();
    if (mpm.flip < 0 || mpm.flip > 1)
        problems.add("mpm.flip", fmt::format("must lie in [0, 1], not {}", mpm.flip));
    if (std::find(mpm_combinations.begin(), mpm_combinations.end(), std::pair{mpm.shape, mpm.strain}) == mpm_combinations.end())
        problems.add("mpm.strain", fmt::format("{} does not go with shape = \"{}\"; shapes and strains that go together: {}",
                                               name_of(mpm.strain), name_of(mpm.shape), lawful_combinations()));
    if (mpm.xpic_order < 1 || mpm.xpic_order > 20)
        problems.add("mpm.xpic_order", fmt::format("must lie in [1, 20], not {}", mpm.xpic_order));
    if (mpm.transfer == MpmSpec::Transfer::xpic && mpm.flip != 1)
        problems.add("mpm.flip", "blends FLIP with PIC; transfer = \"xpic\" has no use for it");
    if (mpm.transfer == MpmSpec::Transfer::xpic && scene.damping && scene.damping->kinetic)
        problems.add("damping.kinetic", "stops points that transfer = \"xpic\" filters; damping.local goes with it");
    if (mpm.null_space_filter != MpmSpec::Filter::none && mpm.shape != Shape::linear)
        problems.add("mpm.null_space_filter", "works cell by cell and needs shape = \"linear\"; for wider shapes take transfer = \"xpic\"");
    if (!(mpm.mass_cutoff >= 0 && mpm.mass_cutoff <= 0.25))
        problems.add("mpm.mass_cutoff", fmt::format("must lie in [0, 0.25], not {}", mpm.mass_cutoff));
}

void warn(const Scene& scene, Problems& problems)
{
    const auto& mpm = scene.options<MpmSpec>();
    const auto inside = [&](const Vec<2>& low, const Vec<2>& high)
    {
        const double slack = 1e-6 * scene.grid.cell_size;
        bool is_inside = true;
        for (std::size_t k = 0; k < 2; ++k)
            is_inside &= high[k] > scene.grid.origin[k] + slack && low[k] < scene.grid.origin[k] + scene.grid.size[k] - slack;
        return is_inside;
    };
    for (std::size_t k = 0; k < scene.walls.size(); ++k)
        if (mpm.shape == Shape::bspline && inside(scene.walls[k].min, scene.walls[k].max))
            problems.warn(fmt::format("wall[{}]", k),
                          "quadratic B-splines are right at the edges of the lattice alone: at a wall inside it "
                          "the velocity that points see is not the wall's, and the first cells beside it are "
                          "wrong");
    if (mpm.strain == Strain::four_point)
        warn_of_locking(scene, problems);
}

Traits traits(const Scene& scene)
{
    const auto& mpm = scene.options<MpmSpec>();
    const bool linear = mpm.shape == Shape::linear, usl = mpm.scheme == MpmSpec::Scheme::usl;
    const bool filters = mpm.null_space_filter != MpmSpec::Filter::none,
               may_blend = mpm.flip == 1 && mpm.transfer == MpmSpec::Transfer::flip;
    const auto null_mode = [&]
    {
        if (linear)
            return filters ? "" : "mpm.null_space_filter=cell";
        return may_blend ? "mpm.flip=0.99" : "";
    };
    return {.reach = linear ? 1 : 2,
            .may_lock = mpm.strain != Strain::b_bar,
            .divides_by_slivers = usl,
            .remedies = {.crossing = linear && mpm.strain == Strain::four_point && !filters ? "mpm.shape=cpgimp" : "",
                         .null_mode = null_mode(),
                         .locking = linear ? "mpm.strain=b_bar" : "",
                         .tension = "",
                         .sliver = usl                             ? "mpm.scheme=musl"
                                   : mpm.mass_cutoff < sliver_mass ? fmt::format("mpm.mass_cutoff={}", sliver_mass)
                                                                   : ""}};
}
}  // namespace

Method mpm_method(MakeSolver make)
{
    return {.name = "mpm",
            .about = "options of MPM",
            .variants = {{"mpm-linear", "linear shape functions, strain at each point, FLIP, MUSL",
                          [](Scene& s) { s.options<MpmSpec>() = {}; }},
                         {"mpm-linear-bbar", "linear shape functions, volumetric strain averaged over each cell, FLIP, MUSL",
                          [](Scene& s) { s.options<MpmSpec>() = {.strain = Strain::b_bar}; }},
                         {"mpm-bspline", "quadratic B-splines, linear at the edges of the lattice; FLIP, MUSL",
                          [](Scene& s) { s.options<MpmSpec>() = {.shape = Shape::bspline, .mass_cutoff = 1e-14}; }},
                         {"mpm-cpgimp", "contiguous-particle GIMP: each point's box stretches with it; FLIP, MUSL",
                          [](Scene& s) { s.options<MpmSpec>() = {.shape = Shape::cpgimp, .mass_cutoff = 1e-14}; }}},
            .options = MethodOptions(MpmSpec{}),
            .check = check,
            .warn = warn,
            .traits = traits,
            .make = std::move(make)};
}
}  // namespace testbed
