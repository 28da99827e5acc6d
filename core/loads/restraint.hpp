#pragma once
/// Velocities that supports and walls prescribe at nodes, and the force it takes.

#include "core/lattice/nodes.hpp"

#include <array>
#include <string>

namespace testbed
{
/// Two neighbouring nodes on either side of a wall's face: the velocity interpolated at the face is prescribed.
struct FacePair
{
    Index<2> low, high;
    double share;  ///< of `high` in the interpolation, in (0, 1)
    double reach =
        0;  ///< of soil whose mass sits in the middle of its points [cells]: so far beyond the nodes with mass it still lies at the face
};

/// Restrains one component at some nodes.
struct ComponentRestraint
{
    std::vector<Index<2>> nodes;  ///< ascending
    std::vector<FacePair> pairs;
    double velocity = 0;  ///< [m/s]

    bool empty() const { return nodes.empty() && pairs.empty(); }
};

/// A support or a wall.
struct Restraint
{
    std::string name;
    std::array<ComponentRestraint, 2> components;
    Vec<2> reaction{0, 0};  ///< on the soil, from its forces, without damping and without the confining pressure [N/m]
};

/// What all restraints do to the nodes in use: an empty part of the lattice costs nothing. Where two prescribe, the later one does.
class DrivenNodes
{
public:
    /// Notes which nodes in use the restraints take.
    void find(const std::vector<Restraint>& restraints, const Lattice<2>& lattice, const Nodes<2>& nodes);

    /// Brings the velocities to the prescribed ones: at a pair by the impulse that the face passes on to both nodes. Returns the work of
    /// what moves, impulse times its velocity [J/m].
    double drive(const std::vector<Restraint>& restraints, const Nodes<2>& carrier, VectorField<2>& velocity) const;

    /// Adds the reactions to the forces, so that the prescribed velocities stay, and notes them.
    void react(std::vector<Restraint>& restraints, Nodes<2>& nodes);
    /// The same once more at the faces, without noting them. Returns their power [W/m].
    double hold_faces(const std::vector<Restraint>& restraints, Nodes<2>& nodes) const;

    /// A FacePair by the numbers of its nodes.
    struct Pair
    {
        std::uint32_t low, high;
        double share, reach;
        std::uint16_t restraint, component;
    };

private:
    struct Driven
    {
        std::uint32_t node;
        std::uint16_t restraint, component;
    };
    /// The nodes of some restraints, and the pairs of the last of them.
    struct Stage
    {
        std::vector<Driven> nodes;  ///< ascending: threads share them out like the nodes themselves
        std::vector<Pair> pairs;
    };

    std::vector<Stage> stages_;
    std::vector<double> taken_;
};
}  // namespace testbed
