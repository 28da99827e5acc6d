#pragma once
/// The lattice of MPM with what lives on it: unknowns of nodes, those that hold too little mass to count, and those beyond its edges.

#include "core/lattice/gather.hpp"
#include "mpm/edges.hpp"
#include "mpm/small_nodes.hpp"
#include "mpm/transfer.hpp"

#include <atomic>

namespace testbed
{
template <class Shape>
struct MpmGrid
{
    static constexpr int S = Shape::S, dim = Body::dim;
    static constexpr bool reaches_beyond = Shape::reaches_beyond;  ///< the lattice's edge
    static_assert(!reaches_beyond || Shape::S == 3, "LatticeEdges folds quadratic B-splines");

    Lattice<dim> lattice;
    Nodes<dim> nodes;
    Gather gather;       ///< from points to nodes
    LatticeEdges edges;  ///< empty where shapes end at the edge
    SmallNodes small;    ///< empty unless a node has too little mass to count
    double least_mass;   ///< of a node that counts [kg/m]

    MpmGrid(const Lattice<dim>& l, double least) : lattice(l), nodes(l.nodes()), gather(l.nodes()), least_mass(least) {}

    /// The nodes that bins touch.
    void find_nodes(const std::vector<const Bins<dim>*>& bins)
    {
        gather.template rebuild<S, dim>(bins, [&](const Index<dim>& at) { return lattice.node(at); });
        for (const auto n : nodes.active())  // what is left must not be taken for soil
            nodes.clear(n);
        nodes.set_active(gather.active());
        if constexpr (reaches_beyond)
            edges.rebuild(lattice, nodes.active());
    }

    void renumber(const Lattice<dim>& to)
    {
        nodes.renumber(lattice, to);
        gather = Gather(to.nodes());
        lattice = to;
    }

    /// Mass, velocity and internal force of the nodes, or a part of them, from the sums of all bins.
    template <Scatter what>
    void to_nodes(const std::vector<double>& sums)
    {
        constexpr std::size_t Q = sums_of<what>;
        std::atomic<bool> has_small{false};
        gather.template sum<Q>(sums,
                               [&](std::size_t i, const std::array<double, Q>& s)
                               {
                                   if constexpr (what != Scatter::force)
                                   {
                                       nodes.mass[i] = s[0];
                                       for (std::size_t d = 0; d < dim; ++d)
                                           nodes.v[d][i] = s[1 + d];
                                       if constexpr (!reaches_beyond)
                                           to_velocity(i, has_small);
                                   }
                                   if constexpr (what != Scatter::momentum)
                                       for (std::size_t d = 0; d < dim; ++d)
                                           nodes.f[d][i] = s[Q - dim + d];
                               });
        if constexpr (reaches_beyond && what != Scatter::force)
        {
            edges.fold_mass(nodes.mass);
            for (auto& component : nodes.v)
                edges.fold(component);
            parallel_for(nodes.active().size(), [&](std::size_t a) { to_velocity(nodes.active()[a], has_small); });
        }
        if constexpr (what != Scatter::force)
            take_small_nodes(has_small);
    }

    /// Sums of nodes that do not count, and of those beyond the edge of the lattice, go to others.
    void fold(VectorField<dim>& values) const
    {
        for (auto& component : values)
        {
            if constexpr (reaches_beyond)
                edges.fold(component);
            small.fold(component);
        }
    }
    void gather_forces() { fold(nodes.f); }
    /// Values of nodes that do not count, and beyond the edge of the lattice, where the shapes reach there.
    void extend(VectorField<dim>& values) const
    {
        for (auto& component : values)
        {
            small.extend(component);
            if constexpr (reaches_beyond)
                edges.extend(component);
        }
    }
    /// Copies the velocity of the nodes in use.
    void keep_velocity(VectorField<dim>& to) const
    {
        for (auto& component : to)
            component.resize(nodes.mass.size());
        nodes.for_each([&](std::size_t i, const auto& lanes) { store(to, i, lanes, load(nodes.v, i, lanes)); });
    }

    std::size_t bytes() const { return nodes.bytes() + gather.bytes() + edges.bytes() + small.bytes(); }

private:
    /// Divides the momentum by the mass, if it is more than a node needs to count.
    void to_velocity(std::size_t i, std::atomic<bool>& has_small)
    {
        if (!(nodes.mass[i] > least_mass))
            return has_small.store(true, std::memory_order_relaxed);
        const double inverse = 1 / nodes.mass[i];
        for (auto& component : nodes.v)
            component[i] *= inverse;
    }
    /// The nodes that do not count go to their neighbours; those that have none count all the same.
    void take_small_nodes(bool has_small)
    {
        small.clear();
        if (!has_small)
            return;
        if (least_mass > 0)
            small.find(lattice, nodes, least_mass);
        for (const auto n : nodes.active())
            if (!(nodes.mass[n] > least_mass) && !small.has(n))
            {
                const double inverse = inverse_mass(nodes, n);
                for (auto& component : nodes.v)
                    component[n] *= inverse;
            }
        small.fold_momentum(nodes);
    }
};
}  // namespace testbed
