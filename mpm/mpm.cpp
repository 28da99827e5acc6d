#include "mpm/mpm.hpp"

#include "mpm/options.hpp"

#include <stdexcept>

namespace testbed
{
struct LinearShape;
struct BSplineShape;
struct GimpShape;
struct PointStrain;
struct BBarStrain;

/// Instantiated in mpm/shapes.
template <class Shape, class Strain>
std::unique_ptr<Solver> make_mpm_of(const Scene& scene);

std::unique_ptr<Solver> make_mpm(const Scene& scene)
{
    const auto& options = scene.options<MpmSpec>();
    switch (options.strain)
    {
    case MpmSpec::Strain::four_point:
        switch (options.shape)
        {
        case MpmSpec::Shape::linear: return make_mpm_of<LinearShape, PointStrain>(scene);
        case MpmSpec::Shape::bspline: return make_mpm_of<BSplineShape, PointStrain>(scene);
        case MpmSpec::Shape::cpgimp: return make_mpm_of<GimpShape, PointStrain>(scene);
        }
        break;
    case MpmSpec::Strain::b_bar:
        if (options.shape == MpmSpec::Shape::linear)
            return make_mpm_of<LinearShape, BBarStrain>(scene);
    }
    throw std::logic_error("shape and strain do not go together: see mpm_combinations");
}
}  // namespace testbed
