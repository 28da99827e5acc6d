#pragma once
/// What the laws dissipate, summed from one sample to the next: for methods whose work at the nodes is not that of the stresses.

#include "core/bodies/body.hpp"

namespace testbed
{
/// Plastic work per plastic shear strain of a stress on the Mohr-Coulomb surface that flows on a face: the multiplier is half of the
/// plastic shear strain, so that it is (s1 (1 + sin psi) - s3 (1 - sin psi)) / 2 [Pa]; zero for a law without one.
double plastic_work_per_shear(const Body& body, std::size_t p);

class PlasticWork
{
public:
    /// Adds the work since the last call, with the mean of both stresses; a point that has unloaded counts with less than it took.
    /// Returns the sum [J/m].
    double add(const std::vector<Body>& bodies);
    template <class Archive>
    void state(Archive& a)
    {
        a.column("shear", "-", last_, &Last::shear);
        a.column("per_shear", "Pa", last_, &Last::per_shear);
        a.value("total", "J/m", total_);
    }

private:
    struct Last
    {
        double shear = 0, per_shear = 0;
    };
    std::vector<Last> last_;  ///< by id
    double total_ = 0;
};
}  // namespace testbed
