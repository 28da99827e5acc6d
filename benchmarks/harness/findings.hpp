#pragma once
/// What `testbed modes` finds, and how it is told.

#include "benchmarks/harness/modes.hpp"
#include "core/run/spectrum.hpp"

#include <cmath>
#include <numbers>

namespace testbed
{
inline constexpr double hardly = 1e-3;  ///< phase below which a mode is not shown among the slowest: it is hardly felt, not slow [rad]

/// The state about which the map is made, and how it was reached.
struct Start
{
    State state;
    double t = 0, dt = 0;
    std::int64_t steps = 0;
};

struct Findings
{
    Start start;
    OneStepMap map;
    Spectrum spectrum;
    NullModes null;
    std::optional<double> critical;
    double claimed = 0;                                           ///< critical step by the method's own formula [s]
    std::vector<Mode> unstable, swinging, decaying, hardly_felt;  ///< swinging: the slowest first, or the nearest to a frequency
    int steps = 1;
    std::optional<double> frequency;

    double per_step(const Mode& m) const { return std::pow(m.growth(), 1.0 / steps); }
    double hertz(const Mode& m) const { return m.phase() / (2 * std::numbers::pi * steps * start.dt); }
};

std::string as_text(const Findings& f, const Scene& scene, const ModesOptions& options);
std::string as_json(const Findings& f, const Scene& scene);
/// Every mode of the map.
std::string as_csv(const Findings& f);
/// Shapes of the first `top` modes of each sort that is shown, an HDF5 file. @throws OutputError
void write_shapes(const std::string& path, const Findings& f, const Scene& scene, int top);
}  // namespace testbed
