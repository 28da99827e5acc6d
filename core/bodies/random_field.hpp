#pragma once
/// Random strength. Numbers come from a counter, not from a state: the same field for any order of points and any number of
/// threads, and on every machine, where std::normal_distribution would differ between libraries.

#include "core/materials/material_spec.hpp"
#include "core/materials/mohr_coulomb.hpp"

#include <cstdint>

namespace testbed
{
/// Standard normal deviate number `counter` of a stream: splitmix64 (Steele et al. 2014), Box-Muller.
double standard_normal(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter);

/// Gaussian field of mean 0 and variance 1 with correlation exp(-r^2 / theta^2): white noise on a square lattice of spacing
/// theta / 2, smoothed with exp(-2 r^2 / theta^2). A function of position alone.
class CorrelatedField
{
public:
    CorrelatedField(std::uint64_t seed, std::uint64_t stream, double theta) : seed_(seed), stream_(stream), theta_(theta) {}
    double operator()(const Vec<2>& X) const;

private:
    std::uint64_t seed_, stream_;
    double theta_;
};

inline constexpr double largest_random_friction = 80 * std::numbers::pi / 180;

/// Draws the strength of points about their mean one.
class RandomStrength
{
public:
    /// @param least friction angle: the dilatancy angle, below which flow would create energy [rad]
    RandomStrength(const RandomSpec& spec, double least) : spec_(spec), least_(least) {}

    /// @param cohesion [Pa] @param friction [rad]: means, replaced by the drawn values @param id of the point
    void draw(const Vec<2>& X, std::uint32_t id, double& cohesion, double& friction);
    /// Share of the values drawn that were cut to [0, infinity) or [dilatancy angle, 80 degrees].
    double truncated_share() const { return drawn_ > 0 ? static_cast<double>(truncated_) / static_cast<double>(drawn_) : 0; }

private:
    double deviate(std::uint64_t stream, const Vec<2>& X, std::uint32_t id) const;
    void scale(double& value, double deviation, double z, double least, double largest);

    RandomSpec spec_;
    double least_;
    std::size_t drawn_ = 0, truncated_ = 0;
};
}  // namespace testbed
