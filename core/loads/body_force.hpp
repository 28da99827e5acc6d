#pragma once
/// A body force given as an expression, evaluated at each point and spread like mass. Built only for scenes that have one.

#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"
#include "core/scene/formula.hpp"

namespace testbed
{
class BodyForce
{
public:
    BodyForce(const BodyForceSpec& spec, const Constants& constants) : acceleration_(spec.acceleration, constants) {}

    /// Evaluates the expression at the points: the forcing of a manufactured solution is no part of a method. @throws ExpressionError
    void evaluate(const std::vector<Body>& bodies, double t)
    {
        std::size_t points = 0;
        for (const Body& body : bodies)
            points += body.points.count;
        bx_.resize(points + pack_size);
        by_.resize(points + pack_size);
        std::size_t first = 0;
        for (const Body& body : bodies)
        {
            const Points& q = body.points;
            const std::array<double*, 2> results{&bx_[first], &by_[first]};
            acceleration_.evaluate({q.X.data(), q.Y.data(), q.x.data(), q.y.data(), t}, q.count, results);
            first += q.count;
        }
    }

    /// Adds the force of all bodies: sink(entity, {F_x, F_y}) for each active cell or node of `gather`.
    template <class Support, class Sink>
    void apply(const Lattice& lattice, const std::vector<Body>& bodies, const Gather& gather, Sink&& sink)
    {
        partial_.resize(gather.blocks() * 2);
        std::size_t first_bin = 0, first = 0;
        for (const Body& body : bodies)
        {
            const Pack weight(body.points.mass * body.points.weight_share);
            spread<Support, 2>(lattice, body, first_bin, partial_,
                               [&](std::size_t p, const auto& lanes) {
                                   return std::array<Pack, 2>{weight * lanes.load(&bx_[first + p]), weight * lanes.load(&by_[first + p])};
                               });
            first_bin += body.bins.list().size();
            first += body.points.count;
        }
        gather.sum<2>(partial_, sink);
    }
    std::size_t bytes() const { return (bx_.capacity() + by_.capacity() + partial_.capacity()) * sizeof(double); }

private:
    Formula acceleration_;
    std::vector<double> bx_, by_;  ///< by point, body after body [m/s^2]
    std::vector<double> partial_;
};
}  // namespace testbed
