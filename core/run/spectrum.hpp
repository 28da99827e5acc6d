#pragma once
/// What a map of a state does to it when it is repeated: modes that grow, swing and decay, and those that stay.

#include "core/run/one_step_map.hpp"

#include <complex>
#include <functional>
#include <optional>

namespace testbed
{
/// One eigenvalue that is not 1, with its shape.
struct Mode
{
    std::complex<double> eigenvalue;
    Eigen::VectorXcd shape;  ///< of norm 1

    double growth() const { return std::abs(eigenvalue); }
    /// Of what swings, in [0, pi] [rad].
    double phase() const { return std::abs(std::arg(eigenvalue)); }
    /// Share of critical damping of an oscillator with this decay and phase; negative if it grows.
    double damping_ratio() const { return -std::log(growth()) / std::hypot(std::log(growth()), phase()); }
};

struct Spectrum
{
    std::vector<Mode> modes;    ///< without the eigenvalue 1; of a pair that with the positive phase; the largest first
    std::size_t steady = 0;     ///< patterns that stay as they are
    std::size_t drifting = 0;   ///< patterns with the eigenvalue 1 that change all the same, by a constant rate: a body in free flight
    std::size_t forgotten = 0;  ///< eigenvalues next to 0: what a step makes anew, whatever it was; not among the modes
    double radius = 0;          ///< the largest |eigenvalue|
};

/// Eigenvalues of a map. Those that are 1 are taken out first, stage by stage, by the rank of A - 1: with their chains a difference of
/// 1e-10 in A would move them by 1e-5. @param tolerance of that rank
Spectrum spectrum(const Eigen::MatrixXd& map, double tolerance = 1e-7);

/// The largest |eigenvalue| alone.
double spectral_radius(const Eigen::MatrixXd& map, double tolerance = 1e-7);

/// Velocity patterns that one step does not see: they cause no stress and stay (rigid, deforming), or not even motion (unseen).
struct NullModes
{
    std::size_t rigid = 0;      ///< translations and the rotation, as far as supports leave them
    std::size_t deforming = 0;  ///< patterns that move the points otherwise without any resistance, `hourglass` among them
    std::size_t hourglass = 0;  ///< x and y: (+1, -1, -1, +1) on the nodes of all cells
    std::size_t unseen = 0;     ///< patterns that move no point: with FLIP those that no node feels
    double unseen_kept = 0;     ///< largest share of one of these that a step leaves
    Eigen::MatrixXd shapes;     ///< columns: the deforming ones, hourglass first, over all unknowns
};
NullModes null_modes(const OneStepMap& map, double tolerance = 1e-6);

/// The largest step up to which `radius` is at most 1 + tolerance, sought from `start` up or down by factors and then by bisection to 1e-4.
/// Nothing if there is none between start / 1024 and 64 start.
std::optional<double> critical_step(const std::function<double(double)>& radius, double start, double tolerance);
}  // namespace testbed
