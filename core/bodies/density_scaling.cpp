#include "core/bodies/density_scaling.hpp"

namespace testbed
{
void scale_densities(std::vector<Body>& bodies)
{
    const auto square_of_speed = [](const Body& b)
    { return gradient_stiffness(moduli(b.material)) * b.points.initial_volume / b.points.mass; };
    double slowest = std::numeric_limits<double>::infinity();
    for (const Body& body : bodies)
        slowest = std::min(slowest, square_of_speed(body));
    for (Body& body : bodies)
    {
        const double factor = square_of_speed(body) / slowest;
        body.points.mass *= factor;
        body.points.weight_share = 1 / factor;
    }
}
}  // namespace testbed
