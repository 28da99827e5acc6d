#include "core/scene/geometry.hpp"
#include "core/scene/method_limits.hpp"
#include "core/scene/problems.hpp"

#include <cmath>

namespace testbed
{
namespace
{
/// A positive number that is neither zero nor infinite to a double.
bool is_normal(double value)
{
    return value > 0 && std::isnormal(value);
}
}  // namespace

void check_bounds(const Scene& scene, Problems& problems)
{
    const auto ask = [&](double value, const std::string& key, const char* what, const char* unit)
    {
        if (!is_normal(value))
            problems.add(key, fmt::format("{} is {} {}: beyond what numbers can hold", what, value, unit));
    };
    const double L = scene.grid.cell_size;
    ask(L * L, "grid.cell_size", "the area of a cell", "m^2");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
    {
        const BodySpec& body = scene.bodies[k];
        const double h = spacing(body, scene.grid);
        ask(scene.material(body.material).density * h * h, fmt::format("body[{}]", k), "the mass of a point", "kg/m");
    }
    if (!problems.errors().empty())
        return;
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        const double modulus = largest_youngs_modulus(scene, m);
        if (!(modulus > 0))
            return;  // told where it is evaluated at the points
        const ElasticModuli moduli(modulus, m.poissons_ratio);
        const std::string key = fmt::format("material[{}].youngs_modulus", k);
        ask(moduli.constrained() * moduli.constrained(), key, "the square of the constrained modulus", "Pa^2");
        ask(moduli.shear(), key, "the shear modulus", "Pa");
        ask(moduli.constrained() / m.density, key, "the square of the wave speed", "m^2/s^2");
    }
    if (!problems.errors().empty() || !traits_of(scene).has_points)
        return;
    constexpr double most_steps = 1e12;
    const double dt = time_step(scene), steps = scene.time.end / dt;
    const char* key = scene.time.dt ? "time.dt" : "time.cfl";
    if (!is_normal(dt))
        problems.add(key, fmt::format("the time step is {} s: beyond what numbers can hold", dt));
    else if (!(steps < most_steps))
        problems.add("time.end",
                     fmt::format("{:.4g} s takes {:.2g} steps of {:.4g} s, more than {:.0g}", scene.time.end, steps, dt, most_steps));
    else if (!scene.time.dt && scene.time.cfl > 10)
        problems.add(key, fmt::format("a share of the critical time step is asked, not {}: no scheme holds far beyond 1", scene.time.cfl));
}
}  // namespace testbed
