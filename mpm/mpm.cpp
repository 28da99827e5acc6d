#include "mpm/mpm.hpp"

#include "mpm/options.hpp"

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
    switch (options.shape)
    {
    case MpmSpec::Shape::cpgimp: return make_mpm_of<GimpShape, PointStrain>(scene);
    case MpmSpec::Shape::bspline: return make_mpm_of<BSplineShape, PointStrain>(scene);
    case MpmSpec::Shape::linear:
        switch (options.strain)
        {
        case MpmSpec::Strain::four_point: return make_mpm_of<LinearShape, PointStrain>(scene);
        case MpmSpec::Strain::b_bar: return make_mpm_of<LinearShape, BBarStrain>(scene);
        }
    }
    throw std::logic_error("not a shape, or not a strain");
}
}  // namespace testbed
