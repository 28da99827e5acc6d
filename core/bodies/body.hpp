#pragma once
/// A body: points of one material, the paper's cluster. Bodies on one lattice are perfectly bonded.

#include "core/lattice/bins.hpp"
#include "core/materials/material.hpp"
#include "core/scene/scene.hpp"

#include <limits>

namespace testbed
{
struct Body
{
    static constexpr int dim = 2;
    std::string name;
    Points<dim> points;
    Material material;
    Bins<dim> bins;
    double confinement = 0;      ///< pressure on free surfaces: forces come from the stress beyond it [Pa]
    double truncated_share = 0;  ///< of the random strengths drawn
    double counted_volume = std::numeric_limits<double>::infinity();  ///< most of a point over which its stress counts [m^2]

    template <class Archive>
    void state(Archive& a)
    {
        a.group("body/" + name,
                [&]
                {
                    points.state(a);
                    a.group("bins", [&] { bins.state(a); });
                });
    }
};

/// What makes forces at the points [p, p + lanes) [Pa]: their stress beyond the confining pressure. The one place that puts it together.
template <class Lanes>
TESTBED_INLINE inline SymTensor<Body::dim, typename Lanes::Pack> total_stress(const Body& body, std::size_t p, const Lanes& lanes)
{
    using Pack = typename Lanes::Pack;
    SymTensor<Body::dim, Pack> s = body.points.stress_at(p, lanes);
    unrolled<Body::dim>([&](auto d) TESTBED_INLINE { component<d, d>(s) += Pack(body.confinement); });
    return s;
}

/// What a method asks of each point beyond position and stress.
struct PointNeeds
{
    bool box = false;              ///< half widths; the volume then follows from them
    bool velocity = false;         ///< velocity on the points
    bool initial_position = true;  ///< kept with the points, for what is evaluated there in each step
    bool strength = true;          ///< else the elastic part of a law is all that is asked

    PointNeeds with_initial_position(bool needed) const
    {
        PointNeeds needs = *this;
        needs.initial_position = needed;
        return needs;
    }
};

Lattice<2> make_lattice(const GridSpec& grid);

/// The bodies of a scene with their initial velocity if the method keeps it on the points.
/// @throws SceneError when a body has no points or a material parameter is out of range at a point
std::vector<Body> make_bodies(const Scene& scene, const Lattice<2>& lattice, PointNeeds needs);

/// Bytes of the arrays of all points and of their order.
inline std::size_t bytes_of(const std::vector<Body>& bodies)
{
    std::size_t total = 0;
    for (const Body& body : bodies)
    {
        body.points.for_each_field([&](const auto& field) { total += field.bytes(); });
        total += body.bins.bytes();
    }
    return total;
}
}  // namespace testbed
