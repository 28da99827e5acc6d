#pragma once
/// The frontier of the material: nodes that it reaches or leaves from one step to the next.

#include "lpfdm/free_faces.hpp"
#include "lpfdm/options.hpp"

#include <atomic>

namespace testbed
{
struct Frontier
{
    std::vector<double> mass_before;  ///< of nodes, in the step before [kg/m]
    std::vector<std::uint32_t> left;  ///< nodes that went out of use

    explicit Frontier(std::size_t nodes) : mass_before(nodes, 0.0) {}

    /// Nodes that material reaches for the first time take the mass-weighted mean velocity of their neighbours that were active before,
    /// or start from zero, as printed; at the start of a run they have one. Nodes that it left are cleared. Returns whether any changed.
    /// @param others whether other cells are in use than in the step before @param faces null if the convection has none
    template <int S>
    bool extend(LpfdmGrid<2>& grid, bool others, const Step& step, LpfdmSpec::Frontier kind, FreeFaces* faces)
    {
        Nodes<2>& nodes = grid.nodes;
        if (!others && (S == 1 || !has_moved(nodes)))  // with S = 1 a cell in use has mass
            return false;
        if (!step.is_first())
            reach(grid, kind);
        for (const auto n : left)
        {
            nodes.mass[n] = 0;
            set(nodes.f, n, {0, 0});
            if (faces)
                faces->forget(n);
        }
        const auto rest = [&](std::uint32_t n)
        {
            if (nodes.mass[n] > 0)
                return;
            mass_before[n] = 0;
            set(nodes.v, n, {0, 0});
        };
        std::for_each(nodes.active().begin(), nodes.active().end(), rest);
        std::for_each(left.begin(), left.end(), rest);
        left.clear();
        return true;
    }

    void keep_mass(const Nodes<2>& nodes)
    {
        nodes.for_each([&](std::size_t n, const auto& lanes) { lanes.store(&mass_before[n], lanes.load(&nodes.mass[n])); });
    }

private:
    void reach(LpfdmGrid<2>& grid, LpfdmSpec::Frontier kind) const
    {
        std::vector<std::pair<std::uint32_t, Vec<2>>> reached;  // all means are of what was active before
        for (const auto n : grid.nodes.active())
            if (grid.nodes.mass[n] > 0 && !mass_before[n])
                reached.emplace_back(n, kind != LpfdmSpec::Frontier::literal ? mean_of_neighbours(grid, n) : Vec<2>{0, 0});
        for (const auto& [n, v] : reached)
            set(grid.nodes.v, n, v);
    }

    /// Whether a node won or lost its mass; those without come to rest.
    bool has_moved(Nodes<2>& nodes) const
    {
        std::atomic<bool> moved{false};
        nodes.for_each(
            [&](std::size_t n, const auto& lanes)
            {
                const Pack mass = lanes.load(&nodes.mass[n]), was = lanes.load(&mass_before[n]);
                const auto has = mass > Pack(0.0);
                if (lanes.any(has != (was > Pack(0.0))))
                    moved.store(true, std::memory_order_relaxed);
                if (!lanes.any(!has))
                    return;
                Vec<2, Pack> v = load(nodes.v, n, lanes);
                for (Pack& component : v)
                    stdx::where(!has, component) = Pack(0.0);
                store(nodes.v, n, lanes, v);
            });
        return moved;
    }

    Vec<2> mean_of_neighbours(const LpfdmGrid<2>& grid, std::uint32_t node) const
    {
        double mass = 0;
        Vec<2> momentum{0, 0};
        const Index<2> at = grid.lattice.node_index(node);
        for_each_index(at + all<2>(-1), at + all<2>(2),
                       [&](const Index<2>& near)
                       {
                           if (!grid.lattice.has_node(near))
                               return;
                           const std::size_t n = grid.lattice.node(near);
                           if (!mass_before[n])
                               return;
                           mass += grid.nodes.mass[n];
                           for (std::size_t d = 0; d < 2; ++d)
                               momentum[d] += grid.nodes.mass[n] * grid.nodes.v[d][n];
                       });
        return mass > 0 ? Vec<2>{momentum[0] / mass, momentum[1] / mass} : Vec<2>{0, 0};
    }
};
}  // namespace testbed
