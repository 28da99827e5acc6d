#pragma once
/// Nodes with little mass. The shape function of such a node is given to its neighbours that have more, in proportion to their mass: they
/// get its mass, momentum and force, and it takes the mean of their velocities. Linear momentum is kept and forces stay dual to strains, as
/// with extended B-splines (Hoellig, Reif & Wipper 2001); a mean does not reproduce a rotation, so that angular momentum is kept but for
/// the share of mass that is handed over. The classical cut-off (Sulsky, Zhou & Schreyer 1995) leaves the force of the node out instead,
/// and with it momentum.

#include "core/lattice/nodes.hpp"

#include <algorithm>
#include <cstdint>
#include <vector>

namespace testbed
{
class SmallNodes
{
public:
    /// Finds the active nodes of the lattice with at most `least` mass [kg/m] that have a neighbour with more.
    void find(const Lattice<2>& lattice, const Nodes<2>& nodes, double least)
    {
        list_.clear();
        masters_.clear();
        for (const auto n : nodes.active())
        {
            if (nodes.mass[n] > least)
                continue;
            if (const Index<2> at = lattice.node_index(n); is_on(lattice, at))  // beyond the edge: not a node of its own
                add(lattice, nodes, least, at, n);
        }
    }
    void clear() { list_.clear(); }
    bool has(std::uint32_t node) const
    {
        return std::binary_search(list_.begin(), list_.end(), Small{node, 0, 0},
                                  [](const Small& a, const Small& b) { return a.node < b.node; });
    }

    /// Mass and momentum, where nodes above `least` hold a velocity and the others a momentum; then all hold a velocity.
    void fold_momentum(Nodes<2>& nodes) const
    {
        for (const Small& s : list_)
        {
            for_masters(s,
                        [&](const Master& m)
                        {
                            const double given = m.share * nodes.mass[s.node], mass = nodes.mass[m.node] + given;
                            for (auto& v : nodes.v)
                                v[m.node] = (v[m.node] * nodes.mass[m.node] + m.share * v[s.node]) / mass;
                            nodes.mass[m.node] = mass;
                        });
            nodes.mass[s.node] = 0;
        }
        for (auto& v : nodes.v)
            extend(v);
    }
    /// Hands sums of small nodes, such as forces, to their neighbours. Idempotent.
    void fold(std::vector<double>& sums) const
    {
        for (const Small& s : list_)
        {
            for_masters(s, [&](const Master& m) { sums[m.node] += m.share * sums[s.node]; });
            sums[s.node] = 0;
        }
    }
    /// The transpose: small nodes take the mean of their neighbours.
    void extend(std::vector<double>& values) const
    {
        for (const Small& s : list_)
        {
            double mean = 0;
            for_masters(s, [&](const Master& m) { mean += m.share * values[m.node]; });
            values[s.node] = mean;
        }
    }
    std::size_t bytes() const { return list_.capacity() * sizeof(Small) + masters_.capacity() * sizeof(Master); }

private:
    struct Small
    {
        std::uint32_t node, first, end;  ///< masters_[first, end)
    };
    struct Master
    {
        std::uint32_t node;
        double share;
    };

    static bool is_on(const Lattice<2>& lattice, const Index<2>& at)
    {
        for (std::size_t d = 0; d < 2; ++d)
            if (at[d] < 0 || at[d] > lattice.size[d])
                return false;
        return true;
    }
    void add(const Lattice<2>& lattice, const Nodes<2>& nodes, double least, const Index<2>& at, std::uint32_t n)
    {
        const auto first = static_cast<std::uint32_t>(masters_.size());
        double total = 0;
        for_each_index(at + all<2>(-1), at + all<2>(2),
                       [&](const Index<2>& near)
                       {
                           if (!is_on(lattice, near) || !lattice.has_node(near))
                               return;
                           const std::size_t m = lattice.node(near);
                           if (!(nodes.mass[m] > least))
                               return;
                           masters_.push_back({static_cast<std::uint32_t>(m), nodes.mass[m]});
                           total += nodes.mass[m];
                       });
        for (std::size_t m = first; m < masters_.size(); ++m)
            masters_[m].share /= total;
        if (masters_.size() > first)
            list_.push_back({n, first, static_cast<std::uint32_t>(masters_.size())});
    }
    template <class F>
    void for_masters(const Small& s, F&& f) const
    {
        for (std::uint32_t m = s.first; m < s.end; ++m)
            f(masters_[m]);
    }

    std::vector<Small> list_;
    std::vector<Master> masters_;
};
}  // namespace testbed
