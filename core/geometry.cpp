#include "core/geometry.hpp"

#include <cmath>
#include <cstdlib>

namespace testbed
{
namespace
{
bool inside_polygon(const std::vector<Vec2>& v, const Vec2& p)
{
    bool inside = false;
    for (std::size_t k = 0, last = v.size() - 1; k < v.size(); last = k++)
        if ((v[k][1] > p[1]) != (v[last][1] > p[1]) && p[0] < v[k][0] + (p[1] - v[k][1]) / (v[last][1] - v[k][1]) * (v[last][0] - v[k][0]))
            inside = !inside;
    return inside;
}
}  // namespace

std::vector<Vec2> fill(const BodySpec& body, const GridSpec& grid)
{
    const double h = spacing(body, grid);
    Vec2 corner = grid.origin, extent = grid.size;
    if (body.shape == "box")
    {
        corner = *body.min;
        extent = {(*body.max)[0] - corner[0], (*body.max)[1] - corner[1]};
    }
    const auto inside = [&](const Vec2& p)
    {
        if (body.shape == "disk")
            return std::hypot(p[0] - (*body.center)[0], p[1] - (*body.center)[1]) <= *body.radius;
        if (body.shape == "polygon")
            return inside_polygon(body.vertices, p);
        return true;
    };
    const auto columns = std::llround(extent[0] / h), rows = std::llround(extent[1] / h);
    std::vector<Vec2> points;
    for (long long j = 0; j < rows; ++j)
        for (long long i = 0; i < columns; ++i)
            if (const Vec2 p{corner[0] + (static_cast<double>(i) + 0.5) * h, corner[1] + (static_cast<double>(j) + 0.5) * h}; inside(p))
                points.push_back(p);
    return points;
}

bool is_number(const std::string& text)
{
    char* stop = nullptr;
    std::strtod(text.c_str(), &stop);
    return !text.empty() && *stop == '\0';
}
}  // namespace testbed
