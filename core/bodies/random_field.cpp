#include "core/bodies/random_field.hpp"

#include <bit>

namespace testbed
{
namespace
{
std::uint64_t mix(std::uint64_t z)
{
    z += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
}

/// In (0, 1).
double uniform(std::uint64_t key)
{
    return (static_cast<double>(mix(key) >> 11) + 0.5) * 0x1p-53;
}
}  // namespace

double standard_normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter)
{
    const std::uint64_t key = mix(mix(mix(seed) ^ stream) ^ counter);
    return std::sqrt(-2 * std::log(uniform(key))) * std::cos(2 * std::numbers::pi * uniform(~key));
}

double CorrelatedField::operator()(const Vec<2>& X) const
{
    const double spacing = 0.5 * theta_;
    constexpr int reach = 5;  // weights beyond are below 2e-5
    const auto i0 = static_cast<std::int64_t>(std::floor(X[0] / spacing)), j0 = static_cast<std::int64_t>(std::floor(X[1] / spacing));
    double sum = 0, squares = 0;
    for (std::int64_t j = j0 - reach; j <= j0 + reach + 1; ++j)
        for (std::int64_t i = i0 - reach; i <= i0 + reach + 1; ++i)
        {
            const double dx = X[0] / spacing - static_cast<double>(i), dy = X[1] / spacing - static_cast<double>(j);
            const double w = std::exp(-0.5 * (dx * dx + dy * dy));
            const std::uint64_t node = mix(static_cast<std::uint64_t>(i)) ^ static_cast<std::uint64_t>(j);
            sum += w * standard_normal(seed_, stream_, node);
            squares += w * w;
        }
    return sum / std::sqrt(squares);
}

double RandomStrength::deviate(std::uint64_t stream, const Vec<2>& X, std::uint32_t id) const
{
    const auto seed = static_cast<std::uint64_t>(spec_.seed);
    if (spec_.correlation_length)
        return CorrelatedField(seed, stream, *spec_.correlation_length)(X);
    return standard_normal(seed, stream, id);
}

void RandomStrength::scale(double& value, double deviation, double z, double least, double largest)
{
    if (deviation == 0 || value == 0)
        return;
    const double drawn = value * (1 + deviation * z);
    value = std::clamp(drawn, least, largest);
    ++drawn_;
    truncated_ += value != drawn;
}

void RandomStrength::draw(const Vec<2>& X, std::uint32_t id, double& cohesion, double& friction)
{
    scale(cohesion, spec_.cohesion_deviation, deviate(0, X, id), 0, std::numeric_limits<double>::infinity());
    scale(friction, spec_.friction_deviation, deviate(1, X, id), least_, largest_random_friction);
}
}  // namespace testbed
