#include "core/scene/wall_path.hpp"

namespace testbed
{
std::vector<Vec<2>> wall_path(const WallSpec& spec, const Constants& constants, double end)
{
    std::vector<Vec<2>> path{{0, 0}};
    if (!spec.velocity)
        return path;
    const VectorExpression velocity(*spec.velocity, constants);
    constexpr int steps = 2000;
    for (int n = 0; n < steps; ++n)
    {
        const Vec<2> v = velocity({.t = (n + 0.5) * end / steps}), &last = path.back();
        path.push_back({last[0] + v[0] * end / steps, last[1] + v[1] * end / steps});
    }
    return path;
}
}  // namespace testbed
