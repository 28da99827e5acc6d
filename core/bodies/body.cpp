#include "core/bodies/body.hpp"

#include "core/bodies/density_scaling.hpp"
#include "core/bodies/random_field.hpp"
#include "core/scene/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
namespace
{
/// Parameters of a material at its points; one value if it is the same everywhere.
struct PointParameters
{
    std::vector<double> stiffness, cohesion, friction;
    double truncated_share = 0;

    Varying varying() const { return {stiffness.size() > 1, cohesion.size() > 1}; }
    double largest_stiffness() const { return *std::max_element(stiffness.begin(), stiffness.end()); }
};

class ParameterReader
{
public:
    ParameterReader(const Scene& scene, const MaterialSpec& material) : scene_(scene), material_(material) {}

    /// Values of a parameter at the points, one if the text is a number. @throws SceneError where it is not valid
    std::vector<double> read(const char* key, const std::string& text, const std::vector<Vec<2>>& positions, bool everywhere,
                             auto&& is_valid, const char* rule) const
    {
        const Expression expression(text, scene_.expression_constants());
        std::vector<double> values(everywhere || !is_number(text) ? positions.size() : 1);
        for (std::size_t p = 0; p < values.size(); ++p)
        {
            const Vec<2>& X = positions[p];
            values[p] = expression({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]});
            if (!std::isfinite(values[p]) || !is_valid(values[p]))
                throw SceneError(fmt::format("{}: material '{}': {} = {} at ({}, {}) m, {}", scene_.path, material_.name, key, values[p],
                                             X[0], X[1], rule));
        }
        return values;
    }

private:
    const Scene& scene_;
    const MaterialSpec& material_;
};

PointParameters read_parameters(const Scene& scene, const BodySpec& body, const MaterialSpec& material,
                                const std::vector<Vec<2>>& positions, std::uint32_t first_id)
{
    const ParameterReader reader(scene, material);
    PointParameters out;
    out.stiffness = reader.read(
        "youngs_modulus", material.youngs_modulus, positions, false, [](double v) { return v > 0; }, "must be positive");
    if (!material.has_strength())
        return out;
    const StrengthSpec& strength = *material.strength;
    const bool varies = material.random || !is_number(strength.cohesion) || !is_number(strength.friction_angle);
    out.cohesion = reader.read(
        "strength.cohesion", strength.cohesion, positions, varies, [](double v) { return v >= 0; }, "must not be negative");
    out.friction = reader.read(
        "strength.friction_angle", strength.friction_angle, positions, varies,
        [&](double v) { return v >= strength.dilatancy_angle && v < 0.5 * std::numbers::pi; },
        "must lie between the dilatancy angle and pi/2 (radians)");
    if (material.random)
    {
        // an inclusion must not change the soil around it
        const std::vector<std::uint32_t> number = numbers_without_inclusions(scene, body);
        RandomStrength random(*material.random, strength.dilatancy_angle);
        for (std::size_t p = 0; p < positions.size(); ++p)
            random.draw(positions[p], first_id + number[p], out.cohesion[p], out.friction[p]);
        out.truncated_share = random.truncated_share();
    }
    return out;
}

void set_initial_stress(const std::array<std::string, 4>& text, const Constants& constants, Points<2>& q)
{
    std::vector<Expression> stress;
    for (const std::string& component : text)
        stress.emplace_back(component, constants);
    for (std::size_t p = 0; p < q.count; ++p)
    {
        const Place here{.X = q.x[0][p], .Y = q.x[1][p], .x = q.x[0][p], .y = q.x[1][p]};
        q.stress[0][p] = stress[0].finite(here);
        q.stress[1][p] = stress[1].finite(here);
        if (q.szz.active())
            q.szz[p] = stress[2].finite(here);
        q.stress[2][p] = stress[3].finite(here);
    }
}

/// The part of a body's law that the method asks for.
MaterialSpec needed_material(const Scene& scene, const BodySpec& spec, PointNeeds needs)
{
    MaterialSpec material = scene.material(spec.material);
    if (material.has_strength() && !needs.strength)
        material.law = Laws::place_of<LinearElastic>();
    return material;
}

/// A body without points yet; its law has the largest stiffness of them.
Body empty_body(const Scene& scene, const BodySpec& spec, const MaterialSpec& material, const PointParameters& parameters,
                const Lattice<2>& lattice)
{
    const Varying varying = parameters.varying();
    const Strength<> strength = material.has_strength() && !varying.strength
                                    ? Strength<>{parameters.cohesion[0], std::sin(parameters.friction[0])}
                                    : Strength<>{0, 0};
    return {spec.name,
            {},
            Laws::make(material.law, material,
                       {{parameters.largest_stiffness(), material.poissons_ratio}, strength, scene.grid.cell_size, varying}),
            Bins(lattice),
            scene.confinement ? scene.confinement->pressure : 0.0,
            parameters.truncated_share};
}

/// Room for the fields of n squares of side h.
void allocate(Body& body, std::size_t n, double h, double density, PointNeeds needs)
{
    Points<2>& q = body.points;
    q.count = n;
    q.initial_volume = h * h;
    q.mass = density * h * h;
    const auto activate = [&](auto& fields, double value = 0)
    {
        for (Field<double>& field : fields)
            field.activate(n, value);
    };
    activate(q.x);
    activate(q.stress);
    if (needs.initial_position)
        activate(q.X);
    q.id.activate(n);
    if (needs.box)
        activate(q.half_width, h / 2);
    else
        q.volume.activate(n, h * h);
    if (needs.velocity)
        activate(q.v);
    std::visit([&](const auto& law) { law.allocate(q); }, body.material);
}

void set_positions(const std::vector<Vec<2>>& positions, std::uint32_t first_id, Points<2>& q)
{
    for (std::size_t p = 0; p < q.count; ++p)
    {
        set(q.x, p, positions[p]);
        if (q.X[0].active())
            set(q.X, p, positions[p]);
        q.id[p] = first_id + static_cast<std::uint32_t>(p);
    }
}

void set_parameters(const PointParameters& parameters, Points<2>& q)
{
    const Varying varying = parameters.varying();
    const double largest = parameters.largest_stiffness();
    for (std::size_t p = 0; p < q.count; ++p)
    {
        if (varying.stiffness)
            q.stiffness[p] = parameters.stiffness[p] / largest;
        if (varying.strength)
        {
            q.cohesion[p] = parameters.cohesion[p];
            q.sin_friction[p] = std::sin(parameters.friction[p]);
        }
    }
}

void set_velocity(const Expr2& text, const Constants& constants, Points<2>& q)
{
    const VectorExpression velocity(text, constants);
    for (std::size_t p = 0; p < q.count; ++p)
        set(q.v, p, velocity({.X = q.x[0][p], .Y = q.x[1][p], .x = q.x[0][p], .y = q.x[1][p]}));
}

}  // namespace

Lattice<2> make_lattice(const GridSpec& grid)
{
    Index<2> cells;
    for (std::size_t d = 0; d < cells.size(); ++d)
        cells[d] = static_cast<int>(std::lround(grid.size[d] / grid.cell_size));
    return {grid.origin, grid.cell_size, cells};
}

std::vector<Body> make_bodies(const Scene& scene, const Lattice<2>& lattice, PointNeeds needs)
{
    const Constants constants = scene.expression_constants();
    std::vector<Body> bodies;
    std::uint32_t next_id = 0;
    for (const BodySpec& spec : scene.bodies)
    {
        const std::vector<Vec<2>> positions = fill(scene, spec);
        if (positions.empty())
            throw SceneError(
                fmt::format("{}: body '{}' has no points; it is smaller than the spacing of its points", scene.path, spec.name));
        const MaterialSpec material = needed_material(scene, spec, needs);
        const PointParameters parameters = read_parameters(scene, spec, material, positions, next_id);
        bodies.push_back(empty_body(scene, spec, material, parameters, lattice));
        Points<2>& q = bodies.back().points;
        allocate(bodies.back(), positions.size(), spacing(spec, scene.grid), material.density, needs);
        set_positions(positions, next_id, q);
        next_id += static_cast<std::uint32_t>(q.count);
        set_parameters(parameters, q);
        if (needs.velocity && spec.velocity)
            set_velocity(*spec.velocity, constants, q);
        if (spec.initial_stress)
            set_initial_stress(*spec.initial_stress, constants, q);
    }
    if (scene.time.density_scaling)
        scale_densities(bodies);
    return bodies;
}
}  // namespace testbed
