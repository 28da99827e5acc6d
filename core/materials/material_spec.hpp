#pragma once
/// What a scene says of a material.

#include "core/materials/laws.hpp"

#include <string>

namespace testbed
{
struct MaterialSpec : Laws::Keys
{
    std::string name;
    Law law{};
    double density = 0, poissons_ratio = 0;
    std::string youngs_modulus;  ///< number or expression of X, Y

    bool has_strength() const { return Laws::has_strength(law); }

    template <class V>
    void describe(V& v)
    {
        v.required("name", name, "", "referred to by bodies");
        v.required_choice("law", law, "plane-strain law");
        v.required("density", density, "kg/m^3", "initial density");
        v.expression("youngs_modulus", youngs_modulus, "X, Y", "Pa", "number, or expression of the initial position");
        v.required("poissons_ratio", poissons_ratio, "-", "in (-1, 1/2)");
        Laws::Keys::describe(v);
    }
};
}  // namespace testbed
