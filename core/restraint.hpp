#pragma once
/// Velocities that supports and walls prescribe at nodes, and the force it takes.

#include "core/grid.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <string>

namespace testbed
{
/// Two neighbouring nodes on either side of a wall's face: the velocity interpolated at the face is prescribed.
struct FacePair
{
    std::uint32_t low, high;
    double share;  ///< of `high` in the interpolation, in (0, 1)
};

/// Restrains one component, x or y, at some nodes.
struct ComponentRestraint
{
    std::vector<std::uint32_t> nodes;  ///< ascending
    std::vector<std::uint32_t> used;   ///< those that are in use: an empty part of the lattice costs nothing
    std::vector<FacePair> pairs;
    double velocity = 0;  ///< [m/s]

    bool empty() const { return nodes.empty() && pairs.empty(); }

    void use(const std::vector<std::uint32_t>& active)
    {
        used.clear();
        std::set_intersection(nodes.begin(), nodes.end(), active.begin(), active.end(), std::back_inserter(used));
    }
    /// Brings the velocity v to the prescribed one: at a pair by the impulse that the face passes on to both nodes.
    void drive(const Nodes& carrier, std::vector<double>& v) const
    {
        for (const auto i : used)
            v[i] = velocity;
        for (const FacePair& p : pairs)
        {
            const auto [low, high] = impulse(carrier, p, velocity - ((1 - p.share) * v[p.low] + p.share * v[p.high]));
            v[p.low] += low * inverse_mass(carrier, p.low);
            v[p.high] += high * inverse_mass(carrier, p.high);
        }
    }
    /// Add the reaction to the force f, so that the prescribed velocity stays; return it [N/m]. At nodes, then at faces.
    double react_at_nodes(std::vector<double>& f) const
    {
        double reaction = 0;
        for (const auto i : used)
        {
            reaction -= f[i];
            f[i] = 0;
        }
        return reaction;
    }
    double react_at_faces(const Nodes& carrier, std::vector<double>& f) const
    {
        double reaction = 0;
        for (const FacePair& p : pairs)
        {
            const double a = (1 - p.share) * f[p.low] * inverse_mass(carrier, p.low) + p.share * f[p.high] * inverse_mass(carrier, p.high);
            const auto [low, high] = impulse(carrier, p, -a);
            f[p.low] += low;
            f[p.high] += high;
            reaction += low + high;
        }
        return reaction;
    }

private:
    /// What the face gives to both nodes to change its own velocity by dv. Without mass on both sides no soil lies at the face.
    static std::pair<double, double> impulse(const Nodes& carrier, const FacePair& p, double dv)
    {
        if (!(carrier.mass[p.low] > 0 && carrier.mass[p.high] > 0))
            return {0, 0};
        const double a = 1 - p.share, b = p.share;
        const double size = dv / (a * a / carrier.mass[p.low] + b * b / carrier.mass[p.high]);
        return {a * size, b * size};
    }
};

/// A support or a wall as the nodes see it.
struct Restraint
{
    std::string name;
    ComponentRestraint x, y;
    Vec2 reaction{0, 0};  ///< on the soil, from its forces, without damping and without the confining pressure [N/m]

    void drive(const Nodes& carrier, std::vector<double>& vx, std::vector<double>& vy) const
    {
        x.drive(carrier, vx);
        y.drive(carrier, vy);
    }
};
}  // namespace testbed
