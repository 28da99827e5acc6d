#include "core/scene/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

namespace testbed
{
namespace
{
bool inside_polygon(const std::vector<Vec<2>>& v, const Vec<2>& p)
{
    bool inside = false;
    for (std::size_t k = 0, last = v.size() - 1; k < v.size(); last = k++)
        if ((v[k][1] > p[1]) != (v[last][1] > p[1]) && p[0] < v[k][0] + (p[1] - v[k][1]) / (v[last][1] - v[k][1]) * (v[last][0] - v[k][0]))
            inside = !inside;
    return inside;
}

/// Centres of the squares of a body's pattern that lie in a box, whether in its shape or not.
std::vector<Vec<2>> pattern(const BodySpec& body, const GridSpec& grid, const std::array<Vec<2>, 2>& box)
{
    const double h = spacing(body, grid);
    Vec<2> corner = grid.origin, size = grid.size;
    if (body.shape == BodySpec::Shape::box)
    {
        corner = *body.min;
        size = {(*body.max)[0] - corner[0], (*body.max)[1] - corner[1]};
    }
    std::array<long long, 2> from{}, to{};
    for (std::size_t k = 0; k < 2; ++k)  // one more on either side, whatever the rounding
    {
        from[k] = std::max(0LL, static_cast<long long>(std::floor((box[0][k] - corner[k]) / h)) - 1);
        to[k] = std::min(std::llround(size[k] / h), static_cast<long long>(std::ceil((box[1][k] - corner[k]) / h)) + 1);
    }
    std::vector<Vec<2>> points;
    for (long long j = from[1]; j < to[1]; ++j)
        for (long long i = from[0]; i < to[0]; ++i)
            points.push_back({corner[0] + (static_cast<double>(i) + 0.5) * h, corner[1] + (static_cast<double>(j) + 0.5) * h});
    return points;
}
}  // namespace

bool contains(const BodySpec& body, const Vec<2>& p, double slack)
{
    switch (body.shape)
    {
    case BodySpec::Shape::box:
        return p[0] >= (*body.min)[0] - slack && p[0] <= (*body.max)[0] + slack && p[1] >= (*body.min)[1] - slack &&
               p[1] <= (*body.max)[1] + slack;
    case BodySpec::Shape::disk: return std::hypot(p[0] - (*body.center)[0], p[1] - (*body.center)[1]) <= *body.radius + slack;
    case BodySpec::Shape::polygon: return inside_polygon(body.vertices, p);
    }
    throw std::logic_error("not a shape");
}

std::optional<std::array<std::size_t, 2>> crossing_edges(const std::vector<Vec<2>>& v)
{
    const auto turn = [](const Vec<2>& a, const Vec<2>& b, const Vec<2>& c)
    { return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]); };
    const std::size_t n = v.size();
    for (std::size_t i = 0; i < n; ++i)
        for (std::size_t j = i + 1; j < n; ++j)
        {
            const Vec<2>&a = v[i], &b = v[(i + 1) % n], &c = v[j], &d = v[(j + 1) % n];
            if (turn(a, b, c) * turn(a, b, d) < 0 && turn(c, d, a) * turn(c, d, b) < 0)
                return std::array{i, j};
        }
    return std::nullopt;
}

std::array<Vec<2>, 2> extent(const BodySpec& body)
{
    switch (body.shape)
    {
    case BodySpec::Shape::box: return {*body.min, *body.max};
    case BodySpec::Shape::disk:
    {
        const Vec<2>& center = *body.center;
        const double r = *body.radius;
        return {Vec<2>{center[0] - r, center[1] - r}, Vec<2>{center[0] + r, center[1] + r}};
    }
    case BodySpec::Shape::polygon:
    {
        std::array<Vec<2>, 2> box{body.vertices[0], body.vertices[0]};
        for (const Vec<2>& v : body.vertices)
            for (std::size_t k = 0; k < 2; ++k)
            {
                box[0][k] = std::min(box[0][k], v[k]);
                box[1][k] = std::max(box[1][k], v[k]);
            }
        return box;
    }
    }
    throw std::logic_error("not a shape");
}

std::vector<Vec<2>> outline(const BodySpec& body)
{
    switch (body.shape)
    {
    case BodySpec::Shape::box: return {*body.min, {(*body.max)[0], (*body.min)[1]}, *body.max, {(*body.min)[0], (*body.max)[1]}};
    case BodySpec::Shape::polygon: return body.vertices;
    case BodySpec::Shape::disk:
    {
        std::vector<Vec<2>> circle;
        for (int k = 0; k < 64; ++k)
        {
            const double angle = 2 * std::numbers::pi * k / 64;
            circle.push_back({(*body.center)[0] + *body.radius * std::cos(angle), (*body.center)[1] + *body.radius * std::sin(angle)});
        }
        return circle;
    }
    }
    throw std::logic_error("not a shape");
}

std::vector<Vec<2>> fill(const Scene& scene, const BodySpec& body)
{
    const bool is_inclusion = !body.inside.empty();
    const BodySpec& host = is_inclusion ? scene.body(body.inside) : body;
    std::vector<const BodySpec*> inclusions;
    for (const BodySpec& other : scene.bodies)
        if (other.inside == host.name && !is_inclusion)
            inclusions.push_back(&other);
    std::vector<Vec<2>> points = pattern(host, scene.grid, extent(body));
    std::erase_if(points,
                  [&](const Vec<2>& p)
                  {
                      const auto in = [&](const BodySpec* inclusion) { return contains(*inclusion, p); };
                      return !contains(host, p) || !contains(body, p) || std::any_of(inclusions.begin(), inclusions.end(), in);
                  });
    return points;
}

std::vector<Vec<2>> initial_positions(const Scene& scene)
{
    std::vector<Vec<2>> all;
    for (const BodySpec& body : scene.bodies)
    {
        const std::vector<Vec<2>> part = fill(scene, body);
        all.insert(all.end(), part.begin(), part.end());
    }
    return all;
}

std::vector<std::uint32_t> numbers_without_inclusions(const Scene& scene, const BodySpec& body)
{
    Scene alone = scene;
    std::erase_if(alone.bodies, [&](const BodySpec& other) { return other.inside == body.name; });
    const std::vector<Vec<2>> part = fill(scene, body), all = fill(alone, body);
    std::vector<std::uint32_t> numbers;
    for (std::uint32_t n = 0; n < all.size() && numbers.size() < part.size(); ++n)
        if (all[n] == part[numbers.size()])
            numbers.push_back(n);
    return numbers;
}

bool is_number(const std::string& text)
{
    if (text.empty() || text.find_first_not_of("0123456789+-.eE") != std::string::npos)  // a constant may be called nan
        return false;
    char* stop = nullptr;
    std::strtod(text.c_str(), &stop);
    return *stop == '\0';
}
}  // namespace testbed
