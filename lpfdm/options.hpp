#pragma once
/// What a scene says of LPFDM: its table [lpfdm].

#include "core/base/choice.hpp"

#include <string>

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

    enum class Cells
    {
        lattice,
        triangles,
        quadrilaterals,
        file
    };
    friend constexpr auto names(Cells)
    {
        return choice_names<Cells>({{Cells::lattice, "lattice"},
                                    {Cells::triangles, "triangles"},
                                    {Cells::quadrilaterals, "quadrilaterals"},
                                    {Cells::file, "file"}});
    }

    Support support = Support::domain;
    Convection convection = Convection::two_sided;
    Frontier frontier = Frontier::arrival;
    double hourglass = 0.05, volume_cap = 0;
    Cells cells = Cells::lattice;
    double shake = 0;
    int shake_seed = 1;
    std::string mesh = "";

    bool has_mesh() const { return cells != Cells::lattice; }

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
        v.choice(
            "cells", cells,
            "lattice: its squares; triangles: two for each of them; quadrilaterals: the squares as a mesh, slow, to be shaken; file: of "
            "any convex shape. Meshes are for support = \"point\" alone");
        v.optional("shake", shake, "-",
                   "nodes of triangles and quadrilaterals are moved at random, by at most this many cells in each direction, at most 0.24; "
                   "not those at the edges of the lattice, of supports or walls");
        v.optional("shake_seed", shake_seed, "-", "of the random numbers for that");
        v.optional("mesh", mesh, "", "cells = \"file\": what `testbed mesh` wrote; its place is relative to the scene's");
    }
};
}  // namespace testbed
