#pragma once
/// Density scaling, as in FLAC: for a damped scene on its way to rest inertia is free, weight is not. Points of stiffer bodies get more
/// mass, so that every cell of every body has the step limit of the body that is slowest now; gravity keeps to their weight.

#include "core/bodies/body.hpp"
#include "core/lattice/gather.hpp"

namespace testbed
{
/// Raises the masses of the points, and notes what part of them has weight. A body whose stiffness varies counts by its stiffest point.
void scale_densities(std::vector<Body>& bodies);

/// Nodal masses that have weight. Built only for scenes with density scaling.
class NodalWeight
{
public:
    /// Sums the weight of the points over the cells or nodes of `gather`: sink(entity, mass that has weight).
    /// @param sums of all bins, Q numbers for each block, the first of which is the mass @param blocks of a bin
    template <std::size_t Q, class Sink>
    void collect(const std::vector<Body>& bodies, const Gather& gather, const std::vector<double>& sums, std::size_t blocks, Sink&& sink)
    {
        partial_.resize(gather.blocks());
        std::size_t block = 0;
        for (const Body& body : bodies)
            for (const std::size_t end = block + blocks * body.bins.list().size(); block < end; ++block)
                partial_[block] = body.points.weight_share * sums[block * Q];
        gather.sum<1>(partial_, [&](std::size_t e, const std::array<double, 1>& s) { sink(e, s[0]); });
    }
    std::vector<double> nodes;  ///< by node [kg/m]

    std::size_t bytes() const { return (partial_.capacity() + nodes.capacity()) * sizeof(double); }

private:
    std::vector<double> partial_;
};
}  // namespace testbed
