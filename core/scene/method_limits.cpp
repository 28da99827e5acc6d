#include "core/scene/method_limits.hpp"

#include "core/scene/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace testbed
{
double largest_youngs_modulus(const Scene& scene, const MaterialSpec& material)
{
    double largest = 0;
    const Expression modulus(material.youngs_modulus, scene.expression_constants());
    for (const BodySpec& body : scene.bodies)
        if (body.material == material.name)
        {
            if (is_number(material.youngs_modulus))
                return modulus({});
            for (const Vec<2>& X : fill(scene, body))
                largest = std::max(largest, modulus({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]}));
        }
    return largest > 0 ? largest : modulus({});
}

double critical_time_step(const Scene& scene)
{
    double limit = std::numeric_limits<double>::infinity();
    for (const BodySpec& body : scene.bodies)
    {
        const MaterialSpec& m = scene.material(body.material);
        const ElasticModuli moduli(largest_youngs_modulus(scene, m), m.poissons_ratio);
        const double wave_speed = std::sqrt(moduli.constrained() / m.density);
        const double nu = m.poissons_ratio, isolated = std::sqrt(nu < 0 ? (1 - nu) / (1 - 2 * nu) : 1 - nu);
        limit = std::min(limit, scene.grid.cell_size / wave_speed * isolated);
    }
    return limit / std::sqrt(1 + (scene.damping ? scene.damping->local : 0));
}

double time_step(const Scene& scene)
{
    return scene.time.dt ? *scene.time.dt : scene.time.cfl * critical_time_step(scene);
}

}  // namespace testbed
