#pragma once
/// Over-nonlocal softening (Vermeer & Brinkgreve 1994; weight of Galavi & Schweiger 2010): softening is driven by
///     (1 - m) own + m mean plastic shear strain,
/// with the mean weighted by a function of distance and by volume. The strain goes to the method's own cells or nodes, is
/// averaged there, and comes back with the same weights. Built only for scenes that have it.

#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"

namespace testbed
{
/// Weight of a distance r [m]; not normalised.
double nonlocal_weight(const NonlocalSpec& spec, double r);

inline bool has_nonlocal_softening(const Scene& scene)
{
    return std::any_of(scene.materials.begin(), scene.materials.end(),
                       [](const MaterialSpec& m) { return m.softening && m.softening->nonlocal; });
}

class NonlocalStrain
{
public:
    NonlocalStrain(const Scene& scene, double cell_size);

    /// @param stride of the entities (cells or nodes) of the lattice @param entities how many have a number
    void resize(std::size_t stride, std::size_t entities);

    /// Sets the softening strain of all points whose law asks for it, from their plastic shear strain.
    /// @param number Index<2> -> number of the cell or node
    template <class Support, class Number>
    void apply(const Lattice<2>& lattice, std::vector<Body>& bodies, const Gather& gather, Number&& number)
    {
        partial_.assign(gather.blocks() * 2, 0.0);
        std::size_t first_bin = 0;
        for (std::size_t b = 0; b < bodies.size(); ++b)
        {
            const Points<2>& q = bodies[b].points;
            if (over_nonlocal_[b] > 0)
                spread<Support, 2>(lattice, bodies[b], first_bin, partial_,
                                   [&](std::size_t p, const auto& lanes)
                                   {
                                       const Pack v = volume<Support>(q, p, lanes);
                                       return std::array<Pack, 2>{v, v * lanes.load(&q.plastic_shear[p])};
                                   });
            first_bin += bodies[b].bins.list().size();
        }
        collect(gather);
        if (along_.empty())
            average_by_distance(gather.active());
        else
            average_by_directions(gather.active());
        for (std::size_t b = 0; b < bodies.size(); ++b)
            if (over_nonlocal_[b] > 0)
            {
                Points<2>& q = bodies[b].points;
                const Pack m(over_nonlocal_[b]);
                interpolate<Support>(lattice, bodies[b], mean_, number,
                                     [&](std::size_t p, const auto& lanes, Pack mean)
                                     {
                                         const Pack driver = (Pack(1.0) - m) * lanes.load(&q.plastic_shear[p]) + m * mean;
                                         lanes.store(&q.softening_strain[p], max(driver, Pack(0.0)));
                                     });
            }
    }
    std::size_t bytes() const
    {
        return (partial_.capacity() + volume_.capacity() + strain_.capacity() + mean_.capacity() + weight_.capacity() + along_.capacity() +
                row_volume_.capacity() + row_strain_.capacity()) *
               sizeof(double);
    }

private:
    void collect(const Gather& gather);
    /// Means by a weight that is a product of one in each direction: along the rows, then across them.
    void average_by_directions(const std::vector<std::uint32_t>& active);
    /// Means by any weight of the distance.
    void average_by_distance(const std::vector<std::uint32_t>& active);
    /// Zeros before and after volume_ and strain_, so that the weight may reach beyond the lattice.
    std::size_t padding() const { return static_cast<std::size_t>(reach_) * (stride_ + 1); }

    std::vector<double> over_nonlocal_;  ///< m by body, zero for a body without
    std::size_t stride_ = 0;
    int reach_;                                    ///< of the weight [cells]
    std::vector<double> weight_;                   ///< (2 reach + 1)^2, or empty
    std::vector<double> along_;                    ///< 2 reach + 1 of a weight that is a product, or empty
    std::vector<double> volume_, strain_, mean_;   ///< by entity; strain: times volume; both padded by the reach of the weight
    std::vector<double> row_volume_, row_strain_;  ///< summed along the rows, padded, too; empty without along_
    std::vector<std::uint32_t> filled_;
    std::vector<double> partial_;
};
}  // namespace testbed
