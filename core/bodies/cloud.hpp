#pragma once
/// The points of a scene as a method keeps them: bodies, sorted by bin, and passes over their bins.

#include "core/bodies/nonlocal.hpp"
#include "core/bodies/support.hpp"

#include <limits>
#include <optional>

namespace testbed
{
/// @tparam Support of a point, which says where its bin begins
template <class Support>
class Cloud
{
public:
    static constexpr int S = Support::S;

    /// @throws SceneError as make_bodies()
    Cloud(const Scene& scene, const PointNeeds& needs) : bodies(make_bodies(scene, make_lattice(scene.grid), needs))
    {
        if (has_nonlocal_softening(scene))
            nonlocal.emplace(scene, scene.grid.cell_size);
    }

    /// Whether a point may have left its bin since the last sort().
    bool has_moved() const
    {
        return std::any_of(bodies.begin(), bodies.end(), [](const Body& body) { return body.bins.has_marks(); });
    }
    /// Sorts the points that left their bins. Returns whether the lists of bins are others than before. @throws Diverged
    bool sort()
    {
        bool others = false;
        for (Body& body : bodies)
            others |= body.bins.template rebuild<Support>(body.points, workspace);
        return others;
    }
    std::vector<const Bins<2>*> bins() const
    {
        std::vector<const Bins<2>*> list;
        for (const Body& body : bodies)
            list.push_back(&body.bins);
        return list;
    }
    std::size_t number_of_bins() const
    {
        std::size_t n = 0;
        for (const Body& body : bodies)
            n += body.bins.list().size();
        return n;
    }
    /// Mass of a node among four full cells of the lightest body [kg/m].
    double least_node_mass(double cell_size) const
    {
        double density = std::numeric_limits<double>::infinity();
        for (const Body& body : bodies)
            density = std::min(density, body.points.mass / body.points.initial_volume);
        return density * cell_size * cell_size;
    }

    /// f(body, number of its first bin among all) for every body.
    template <class F>
    void for_each_body(F&& f)
    {
        std::size_t first_bin = 0;
        for (Body& body : bodies)
        {
            f(body, first_bin);
            first_bin += body.bins.list().size();
        }
    }
    /// kernel(body, bin, number of the bin among all, frame) for every bin of every body.
    template <class Kernel>
    void for_each_bin(const Lattice<2>& lattice, Kernel&& kernel)
    {
        for_each_body(
            [&](Body& body, std::size_t first_bin)
            {
                const auto& bins = body.bins.list();
                parallel_for(bins.size(), [&](std::size_t b) { kernel(body, bins[b], first_bin + b, BinFrame(lattice, bins[b])); });
            });
    }

    template <class Archive>
    void state(Archive& a)
    {
        for (Body& body : bodies)
            body.state(a);
    }
    std::size_t bytes() const { return bytes_of(bodies) + workspace.capacity() * sizeof(double) + (nonlocal ? nonlocal->bytes() : 0); }

    std::vector<Body> bodies;
    std::vector<double> workspace;           ///< the way of a field to its new order, and sums of bins on their way to nodes
    std::optional<NonlocalStrain> nonlocal;  ///< if a law softens by it
};
}  // namespace testbed
