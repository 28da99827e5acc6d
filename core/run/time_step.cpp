#include "core/run/time_step.hpp"

#include "core/base/parallel.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace testbed
{
const StepLimit& governing(const std::vector<StepLimit>& limits)
{
    return *std::min_element(limits.begin(), limits.end(), [](const StepLimit& a, const StepLimit& b) { return a.seconds < b.seconds; });
}

std::string description(const std::vector<StepLimit>& limits)
{
    std::string text;
    for (const StepLimit& limit : limits)
        text += fmt::format("{}{} {:.4g} s", text.empty() ? "" : ", ", limit.name, limit.seconds);
    return text;
}

double isolated_cell_limit(const std::vector<Body>& bodies, double cell_size)
{
    double fastest = 0;  // square of kappa / rho
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
        const double volume = parallel_max(q.count, [&](std::size_t p) { return q.current_volume(p) * stiffness_ratio(q, p); });
        fastest = std::max(fastest, gradient_stiffness(moduli(body.material)) * volume / q.mass);
    }
    return cell_size / std::sqrt(fastest);
}

std::optional<double> courant_limit(double cell_size, double speed)
{
    if (!(speed > 0))
        return std::nullopt;
    return cell_size / speed;
}
}  // namespace testbed
