#pragma once
/// A body force given as an expression, evaluated at each point and spread like mass. Built only for scenes that have one.

#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"

namespace testbed
{
class BodyForce
{
public:
    BodyForce(const BodyForceSpec& spec, const Constants& constants) : acceleration_(spec.acceleration, constants) {}

    /// Adds the force of all bodies: sink(entity, {F_x, F_y}) for each active cell or node of `gather`.
    template <class Support, class Sink>
    void apply(const Lattice& lattice, const std::vector<Body>& bodies, const Gather& gather, double t, Sink&& sink)
    {
        partial_.resize(gather.blocks() * 2);
        std::size_t first_bin = 0;
        for (const Body& body : bodies)
        {
            const Points& q = body.points;
            bx_.activate(q.count);
            by_.activate(q.count);
            for (std::size_t p = 0; p < q.count; ++p)
            {
                const Vec2 b = acceleration_({q.X[p], q.Y[p], q.x[p], q.y[p], t});
                bx_[p] = q.mass * q.weight_share * b[0];
                by_[p] = q.mass * q.weight_share * b[1];
            }
            spread<Support, 2>(lattice, body, first_bin, partial_,
                               [&](std::size_t p, const auto& lanes) {
                                   return std::array<Pack, 2>{lanes.load(&bx_[p]), lanes.load(&by_[p])};
                               });
            first_bin += body.bins.list().size();
        }
        gather.sum<2>(partial_, sink);
    }
    std::size_t bytes() const { return bx_.bytes() + by_.bytes() + partial_.capacity() * sizeof(double); }

private:
    VectorExpression acceleration_;
    Field<double> bx_{"body_force_x", "N/m"}, by_{"body_force_y", "N/m"};
    std::vector<double> partial_;
};
}  // namespace testbed
