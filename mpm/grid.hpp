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
    static constexpr int S = Shape::S;
    static constexpr bool reaches_beyond = Shape::reaches_beyond;  ///< the lattice's edge
    static_assert(!reaches_beyond || Shape::S == 3, "LatticeEdges folds quadratic B-splines");

    Lattice lattice;
    Nodes nodes;
    Gather gather;       ///< from points to nodes
    LatticeEdges edges;  ///< empty where shapes end at the edge
    SmallNodes small;    ///< empty unless a node has too little mass to count
    double least_mass;   ///< of a node that counts [kg/m]

    MpmGrid(const Lattice& l, double least) : lattice(l), nodes(l.nodes()), gather(l.nodes()), least_mass(least) {}

    /// The nodes that bins touch.
    void find_nodes(const std::vector<const Bins*>& bins)
    {
        gather.template rebuild<S>(bins, [&](int i, int j) { return lattice.node(i, j); });
        for (const auto n : nodes.active())  // what is left must not be taken for soil
            nodes.mass[n] = nodes.vx[n] = nodes.vy[n] = nodes.fx[n] = nodes.fy[n] = 0;
        nodes.set_active(gather.active());
        if constexpr (reaches_beyond)
            edges.rebuild(lattice, nodes.active());
    }

    void renumber(const Lattice& to)
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
                                       nodes.vx[i] = s[1];
                                       nodes.vy[i] = s[2];
                                       if constexpr (!reaches_beyond)
                                           to_velocity(i, has_small);
                                   }
                                   if constexpr (what != Scatter::momentum)
                                   {
                                       nodes.fx[i] = s[Q - 2];
                                       nodes.fy[i] = s[Q - 1];
                                   }
                               });
        if constexpr (reaches_beyond && what != Scatter::force)
        {
            edges.fold_mass(nodes.mass);
            edges.fold(nodes.vx);
            edges.fold(nodes.vy);
            parallel_for(nodes.active().size(), [&](std::size_t a) { to_velocity(nodes.active()[a], has_small); });
        }
        if constexpr (what != Scatter::force)
            take_small_nodes(has_small);
    }

    /// Sums of nodes that do not count, and of those beyond the edge of the lattice, go to others.
    void fold(std::vector<double>& values) const
    {
        if constexpr (reaches_beyond)
            edges.fold(values);
        small.fold(values);
    }
    void gather_forces()
    {
        fold(nodes.fx);
        fold(nodes.fy);
    }
    /// Values of nodes that do not count, and beyond the edge of the lattice, where the shapes reach there.
    void extend(std::vector<double>& x, std::vector<double>& y) const
    {
        small.extend(x);
        small.extend(y);
        if constexpr (reaches_beyond)
        {
            edges.extend(x);
            edges.extend(y);
        }
    }
    /// Copies the velocity of the nodes in use.
    void keep_velocity(std::vector<double>& x, std::vector<double>& y) const
    {
        x.resize(nodes.vx.size());
        y.resize(nodes.vy.size());
        nodes.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                lanes.store(&x[i], lanes.load(&nodes.vx[i]));
                lanes.store(&y[i], lanes.load(&nodes.vy[i]));
            });
    }

    std::size_t bytes() const { return nodes.bytes() + gather.bytes() + edges.bytes() + small.bytes(); }

private:
    /// Divides the momentum by the mass, if it is more than a node needs to count.
    void to_velocity(std::size_t i, std::atomic<bool>& has_small)
    {
        if (!(nodes.mass[i] > least_mass))
            return has_small.store(true, std::memory_order_relaxed);
        const double inverse = 1 / nodes.mass[i];
        nodes.vx[i] *= inverse;
        nodes.vy[i] *= inverse;
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
                nodes.vx[n] *= inverse;
                nodes.vy[n] *= inverse;
            }
        small.fold_momentum(nodes);
    }
};
}  // namespace testbed
