#include "mpm/time_step.hpp"

#include <cmath>

namespace testbed
{
double mpm_sharp_limit(const ElementSystem& system, const MpmSpec& options, double alpha)
{
    const double f = options.flip;
    std::vector<double> smoothed, rest, h;
    const auto half_smooth = [&](std::vector<double>& v)  // H v; the iteration contracts by (1 - f) / (3 + f)
    {
        system.apply_smoothing(v, smoothed);
        h.assign(v.size(), 0.0);
        for (int k = 0; k < (f < 1 ? 20 : 1); ++k)
        {
            system.apply_smoothing(h, rest);
            for (std::size_t i = 0; i < h.size(); ++i)
                h[i] += 2 / (3 + f) * (smoothed[i] - (1 + f) * h[i] - (1 - f) * rest[i]);
        }
    };
    const bool last = options.scheme == MpmSpec::Scheme::usl;
    const double largest = largest_eigenvalue(
        system, [&](const auto& in, auto& out) { system.apply_stiffness(in, out); },
        [&](std::vector<double>& v)
        {
            half_smooth(v);
            for (std::size_t i = 0; i < v.size(); ++i)
                v[i] = last ? 2 * (v[i] - h[i]) : 2 * h[i];
        });
    return 2 / std::sqrt((1 + alpha) * largest);
}
}  // namespace testbed
