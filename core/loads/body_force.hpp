#pragma once
/// A body force given as an expression, evaluated at each point and spread like mass. Built only for scenes that have one.

#include "core/bodies/support.hpp"
#include "core/lattice/gather.hpp"
#include "core/lattice/nodes.hpp"
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
        for (auto& component : acceleration_at_points_)
            component.resize(points + pack_size);
        std::size_t first = 0;
        for (const Body& body : bodies)
        {
            const Points<2>& q = body.points;
            const std::array<double*, 2> results{&acceleration_at_points_[0][first], &acceleration_at_points_[1][first]};
            acceleration_.evaluate({q.X[0].data(), q.X[1].data(), q.x[0].data(), q.x[1].data(), t}, q.count, results);
            first += q.count;
        }
    }

    /// What evaluate() found, body after body [m/s^2].
    const VectorField<2>& at_points() const { return acceleration_at_points_; }

    /// Adds the force of all bodies: sink(entity, force) for each active cell or node of `gather`.
    template <class Support, class Sink>
    void apply(const Lattice<2>& lattice, const std::vector<Body>& bodies, const Gather& gather, Sink&& sink)
    {
        partial_.resize(gather.blocks() * 2);
        std::size_t first_bin = 0, first = 0;
        for (const Body& body : bodies)
        {
            const Pack weight(body.points.mass * body.points.weight_share);
            spread<Support, 2>(lattice, body, first_bin, partial_,
                               [&](std::size_t p, const auto& lanes)
                               {
                                   Vec<2, Pack> force = load(acceleration_at_points_, first + p, lanes);
                                   for (Pack& component : force)
                                       component *= weight;
                                   return force;
                               });
            first_bin += body.bins.list().size();
            first += body.points.count;
        }
        gather.sum<2>(partial_, sink);
    }
    std::size_t bytes() const { return (2 * acceleration_at_points_[0].capacity() + partial_.capacity()) * sizeof(double); }

private:
    Formula acceleration_;
    VectorField<2> acceleration_at_points_;  ///< body after body [m/s^2]
    std::vector<double> partial_;
};
}  // namespace testbed
