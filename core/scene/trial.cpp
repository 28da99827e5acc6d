#include "core/scene/trial.hpp"

#include "core/scene/geometry.hpp"

#include <fmt/format.h>

namespace testbed
{
namespace
{
class Trial
{
public:
    explicit Trial(const Scene& scene) : scene_(scene), constants_(scene.expression_constants()) {}

    /// @param key of the scene, for messages
    void at_points(const std::string& key, const std::string& text, const std::vector<Vec<2>>& points, bool of_time) const
    {
        named(key,
              [&]
              {
                  const Expression expression(text, constants_);
                  const bool end_too = of_time && depends_on(text, constants_, "t") && !depends_on(text, constants_, "x, y");
                  for (const Vec<2>& X : points)
                  {
                      expression.finite({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]});
                      if (end_too)
                          expression.finite({.X = X[0], .Y = X[1], .x = X[0], .y = X[1], .t = scene_.time.end});
                  }
              });
    }
    template <class Texts>
    void all_at_points(const std::string& key, const Texts& texts, const std::vector<Vec<2>>& points, bool of_time) const
    {
        for (const std::string& text : texts)
            at_points(key, text, points, of_time);
    }
    void holds_somewhere(const std::string& key, const std::string& where, const std::vector<Vec<2>>& points) const
    {
        named(key,
              [&]
              {
                  const Expression expression(where, constants_);
                  bool holds = false;
                  for (const Vec<2>& X : points)
                      holds |= expression.finite({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]}) != 0;
                  if (!holds)
                      throw ExpressionError(fmt::format("where = \"{}\" holds at no point", where));
              });
    }

private:
    template <class Body>
    void named(const std::string& key, Body&& body) const
    {
        try
        {
            body();
        }
        catch (const ExpressionError& e)
        {
            throw SceneError(fmt::format("{}: {}: {}", scene_.path, key, e.what()));
        }
    }

    const Scene& scene_;
    Constants constants_;
};

/// The points of the row that carries a traction.
std::vector<Vec<2>> loaded_row(const TractionSpec& spec, const BodySpec& body, const GridSpec& grid, std::vector<Vec<2>> points)
{
    const std::size_t normal = normal_of(spec.face);
    const bool low = is_low(spec.face);
    const double h = spacing(body, grid), face = (low ? *body.min : *body.max)[normal];
    std::erase_if(points, [&](const Vec<2>& p) { return std::abs(p[normal] - face) > h; });
    return points;
}
}  // namespace

void try_expressions(const Scene& scene)
{
    const Trial trial(scene);
    std::vector<Vec<2>> all;
    for (const BodySpec& body : scene.bodies)
    {
        const std::vector<Vec<2>> points = fill(scene, body);
        all.insert(all.end(), points.begin(), points.end());
        const std::string key = fmt::format("body '{}': ", body.name);
        if (body.velocity)
            trial.all_at_points(key + "velocity", *body.velocity, points, false);
        if (body.initial_stress)
            trial.all_at_points(key + "initial_stress", *body.initial_stress, points, false);
        for (const TractionSpec& traction : scene.tractions)
            if (traction.body == body.name)
                trial.all_at_points(fmt::format("traction '{}'", traction.name), traction.traction,
                                    loaded_row(traction, body, scene.grid, points), true);
    }
    if (scene.body_force)
        trial.all_at_points("body_force.acceleration", scene.body_force->acceleration, all, true);
    for (const ProbeSpec& probe : scene.probes)
        trial.holds_somewhere(fmt::format("probe '{}'", probe.name), probe.where, all);
    for (const auto& [kinematics, exact] : scene.exact)
    {
        if (exact.displacement)
            trial.all_at_points(fmt::format("exact.{}.displacement", kinematics), *exact.displacement, all, true);
        if (exact.stress)
            trial.all_at_points(fmt::format("exact.{}.stress", kinematics), *exact.stress, all, true);
    }
}
}  // namespace testbed
