#pragma once
/// Drives one law along a strain path, alone: no lattice, no method.

#include "core/base/types.hpp"
#include "core/materials/material_spec.hpp"

#include <string>
#include <vector>

namespace testbed
{
struct SegmentSpec
{
    int steps = 100;
    std::vector<double> gradient;
    std::optional<double> stress_xx;

    template <class V>
    void describe(V& v)
    {
        v.optional("steps", steps, "-", "equal increments");
        v.required("gradient", gradient, "-", "displacement gradient over the segment: xx, yy, xy = du_x/dy, yx = du_y/dx");
        v.optional("stress_xx", stress_xx, "Pa", "leads the lateral stress to this value; the gradient's xx is then found, not given");
    }
};

struct PointPathSpec
{
    MaterialSpec material;
    double cell_size = 1;
    std::vector<double> initial_stress{0, 0, 0, 0};
    std::vector<SegmentSpec> segments;

    template <class V>
    void describe(V& v)
    {
        v.table("material", material, "as in a scene, numbers only");
        v.optional("cell_size", cell_size, "m", "L, for crack-band scaling");
        v.optional("initial_stress", initial_stress, "Pa", "xx, yy, zz, xy");
        v.list("segment", segments, "of the path, one after the other");
    }
};

/// The stress path of a path file as CSV: step, strains, stresses, plastic shear strain, work per volume.
/// @throws SceneError with file, line and key of what is wrong
std::string drive_point(const std::string& path);
/// The same from a path file that was read. @param path what messages call it
std::string drive_point(const PointPathSpec& spec, const std::string& path);
/// The text of a path file, checked. @throws SceneError
PointPathSpec read_point_path(const std::string& text, const std::string& path);
}  // namespace testbed
