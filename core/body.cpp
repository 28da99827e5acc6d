#include "core/body.hpp"

#include "core/geometry.hpp"

#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
template <class Law>
Material with_stiffness(const ElasticModuli& moduli, bool varies)
{
    if (varies)
        return VaryingStiffness<Law>{{moduli}};
    return Law{moduli};
}

Material make_material(const MaterialSpec& spec, const ElasticModuli& moduli, bool varies)
{
    if (spec.law == "linear_elastic")
        return with_stiffness<LinearElastic>(moduli, varies);
    if (spec.law == "hypoelastic_jaumann")
        return with_stiffness<HypoelasticJaumann>(moduli, varies);
    return with_stiffness<HypoelasticExactRotation>(moduli, varies);
}
}  // namespace

Lattice make_lattice(const GridSpec& grid)
{
    return {grid.origin, grid.cell_size, static_cast<int>(std::lround(grid.size[0] / grid.cell_size)),
            static_cast<int>(std::lround(grid.size[1] / grid.cell_size))};
}

std::vector<Body> make_bodies(const Scene& scene, const Lattice& lattice, PointNeeds needs)
{
    const Constants constants = scene.expression_constants();
    std::vector<Body> bodies;
    std::uint32_t next_id = 0;
    for (const BodySpec& spec : scene.bodies)
    {
        const std::vector<Vec2> positions = fill(spec, scene.grid);
        if (positions.empty())
            throw SceneError(
                fmt::format("{}: body '{}' has no points; it is smaller than the spacing of its points", scene.path, spec.name));
        const MaterialSpec& material = scene.material(spec.material);
        const Expression modulus(material.youngs_modulus, constants);
        const bool varies = !is_number(material.youngs_modulus);
        const std::size_t n = positions.size();
        std::vector<double> stiffness(varies ? n : 1);
        double largest = 0;
        for (std::size_t p = 0; p < stiffness.size(); ++p)
        {
            const Vec2& X = positions[p];
            stiffness[p] = modulus({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]});
            if (!(stiffness[p] > 0) || !std::isfinite(stiffness[p]))
                throw SceneError(fmt::format("{}: material '{}': youngs_modulus = {} at ({}, {}) m, must be positive", scene.path,
                                             material.name, stiffness[p], X[0], X[1]));
            largest = std::max(largest, stiffness[p]);
        }
        bodies.push_back({spec.name, {}, make_material(material, {largest, material.poissons_ratio}, varies), Bins(lattice)});

        Points& q = bodies.back().points;
        const double h = spacing(spec, scene.grid);
        q.count = n;
        q.initial_volume = h * h;
        q.mass = material.density * h * h;
        for (Field<double>* field : {&q.x, &q.y, &q.sxx, &q.syy, &q.sxy})
            field->activate(n);
        if (needs.initial_position)
        {
            q.X.activate(n);
            q.Y.activate(n);
        }
        q.id.activate(n);
        if (needs.box)
        {
            q.half_x.activate(n, h / 2);
            q.half_y.activate(n, h / 2);
        }
        else
            q.volume.activate(n, h * h);
        if (needs.velocity)
        {
            q.vx.activate(n);
            q.vy.activate(n);
        }
        if (varies)
            q.stiffness.activate(n);
        std::optional<VectorExpression> velocity;
        if (needs.velocity && spec.velocity)
            velocity.emplace(*spec.velocity, constants);
        for (std::size_t p = 0; p < n; ++p)
        {
            const Vec2& X = positions[p];
            q.x[p] = X[0];
            q.y[p] = X[1];
            if (needs.initial_position)
            {
                q.X[p] = X[0];
                q.Y[p] = X[1];
            }
            q.id[p] = next_id++;
            if (varies)
                q.stiffness[p] = stiffness[p] / largest;
            if (velocity)
            {
                const Vec2 v = (*velocity)({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]});
                q.vx[p] = v[0];
                q.vy[p] = v[1];
            }
        }
    }
    return bodies;
}
}  // namespace testbed
