#pragma once
/// Quadratic B-splines at the edge of the lattice: the shape function of a node beyond the edge is given to the two nodes behind
/// it, twice to the first and minus once to the second, as a linear field asks. Within half a cell of the edge the shapes
/// are then linear: positive, still of sum one, exact for linear fields, and the node on the edge alone counts on the edge.

#include "core/lattice/lattice.hpp"

namespace testbed
{
class LatticeEdges
{
public:
    /// Notes which of the active nodes lie beyond an edge.
    void rebuild(const Lattice<2>& lattice, const std::vector<std::uint32_t>& active)
    {
        beyond_.clear();
        const auto add = [&](std::size_t outer, std::size_t edge, std::size_t inner) { beyond_.push_back({outer, edge, inner}); };
        for (std::size_t d = 0; d < 2; ++d)  // what the corners gave to lines beyond the next edge goes on from there
            for (const auto n : active)
            {
                const Index<2> at = lattice.node_index(n);
                if (!is_beyond(lattice, at, d) || (d > 0 && is_beyond(lattice, at, 0)))
                    continue;
                Index<2> edge = at, inner = at;
                edge[d] = at[d] < 0 ? 0 : lattice.size[d];
                inner[d] = at[d] < 0 ? 1 : lattice.size[d] - 1;
                add(n, lattice.node(edge), lattice.node(inner));
            }
    }

    /// Gives what was summed with the shapes of nodes beyond the edge to those behind it. Idempotent.
    void fold(std::vector<double>& sums) const
    {
        for (const auto& [outer, edge, inner] : beyond_)
        {
            sums[edge] += 2 * sums[outer];
            sums[inner] -= sums[outer];
            sums[outer] = 0;
        }
    }
    /// The same for masses; what cancels but for rounding, because all its points lie on the edge, is no mass.
    void fold_mass(std::vector<double>& mass) const
    {
        fold(mass);
        for (const auto& [outer, edge, inner] : beyond_)
            if (mass[inner] < 1e-12 * mass[edge])
                mass[inner] = 0;
    }
    /// The transpose: nodal values beyond the edge, so that points there see the shapes of the nodes behind it.
    void extend(std::vector<double>& values) const
    {
        for (auto b = beyond_.rbegin(); b != beyond_.rend(); ++b)
            values[b->outer] = 2 * values[b->edge] - values[b->inner];
    }
    std::size_t bytes() const { return beyond_.capacity() * sizeof(Beyond); }

private:
    static bool is_beyond(const Lattice<2>& lattice, const Index<2>& at, std::size_t d) { return at[d] < 0 || at[d] > lattice.size[d]; }

    struct Beyond
    {
        std::size_t outer, edge, inner;
    };
    std::vector<Beyond> beyond_;
};
}  // namespace testbed
