#pragma once
/// Sums over all points, made in one pass when the history is sampled.

#include "core/bodies/body.hpp"

#include <limits>

namespace testbed
{
struct PointSums
{
    double strain_energy = 0;  ///< of the stress on the current volume [J/m]
    double elastic_work = 0;   ///< what it takes to get there: the law adds up increments on a volume that changes [J/m]
    double max_stress = 0;     ///< largest component in the plane [Pa]
    double volume = 0;         ///< [m^2]
    double mass = 0;           ///< that has weight [kg/m]
    Vec<2> moment{0, 0};       ///< sum of it times x [kg]
    double smallest = std::numeric_limits<double>::infinity(), largest = 0;  ///< current over initial volume
    double outside = 0;                                                      ///< points that are not on the lattice
};

/// Energy of the stress of all points on their current volume [J/m].
double strain_energy(const std::vector<Body>& bodies);
PointSums point_sums(const std::vector<Body>& bodies, const Lattice<2>& lattice);

/// Work that brought a point to its stress over the energy of the stress on the current volume. The laws add up increments of stress, so
/// that stress is proportional to the logarithmic strain, and the volume grows on the way: along a straight path to the volume ratio e^a
/// it is 2 (a - 1 + e^-a) / a^2.
double work_over_energy(double volume_ratio);
}  // namespace testbed
