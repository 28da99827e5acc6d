#pragma once
/// Material points of one body, a structure of arrays. Mass and initial volume are the same for all points of a body;
/// everything else is a field, present only when the method, the material or the scene needs it.

#include "core/base/field.hpp"
#include "core/base/types.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace testbed
{
/// The fields of a vector or tensor, by component.
template <std::size_t n>
std::array<Field<double>, n> fields(const std::array<const char*, n>& names, const char* unit)
{
    return [&]<std::size_t... k>(std::index_sequence<k...>)
    {
        return std::array<Field<double>, n>{Field<double>(names[k], unit)...};
    }
    (std::make_index_sequence<n>{});
}

/// Names of components, by dimension.
template <int dim>
struct Components;
template <>
struct Components<2>
{
    static constexpr std::array position{"x", "y"};
    static constexpr std::array initial_position{"X", "Y"};
    static constexpr std::array half_width{"half_width_x", "half_width_y"};
    static constexpr std::array velocity{"velocity_x", "velocity_y"};
    static constexpr std::array stress{"stress_xx", "stress_yy", "stress_xy"};
};
template <>
struct Components<3>
{
    static constexpr std::array position{"x", "y", "z"};
    static constexpr std::array initial_position{"X", "Y", "Z"};
    static constexpr std::array half_width{"half_width_x", "half_width_y", "half_width_z"};
    static constexpr std::array velocity{"velocity_x", "velocity_y", "velocity_z"};
    static constexpr std::array stress{"stress_xx", "stress_yy", "stress_zz", "stress_yz", "stress_zx", "stress_xy"};
};

template <int dim>
struct Points
{
    using Vector = std::array<Field<double>, dim>;
    using Tensor = std::array<Field<double>, symmetric_components<dim>>;

    Vector x = fields(Components<dim>::position, "m");
    Vector X = fields(Components<dim>::initial_position, "m");  ///< if a step needs it; else see the id
    Tensor stress = fields(Components<dim>::stress, "Pa");
    Field<double> volume{"volume", "m^2"};                                   ///< current, in plane strain per metre of thickness
    Vector half_width = fields(Components<dim>::half_width, "m");            ///< of the point's own box, if it has one
    Vector v = fields(Components<dim>::velocity, "m/s");                     ///< MPM: the velocity lives on the points
    Field<double> stiffness{"stiffness_ratio", "-"};                         ///< E(X, Y) / E of the material
    Field<double> szz{"stress_zz", "Pa"};                                    ///< plane strain: if it does not follow from the others
    Field<double> plastic_shear{"plastic_shear_strain", "-", shown_always};  ///< accumulated
    Field<double> softening_strain{"softening_strain", "-", shown_always};   ///< nonlocal: what drives softening
    Field<double> cohesion{"cohesion", "Pa", shown_at_start};                ///< of the point, before softening
    Field<double> sin_friction{
        "sin_friction_angle", "-", {Output::When::at_start, "friction_angle", "rad", [](double sine) { return std::asin(sine); }}};
    Field<std::uint32_t> id{"id", "-"};

    std::size_t count = 0;
    double mass = 0;            ///< of one point, that resists acceleration [kg/m]
    double weight_share = 1;    ///< the part of it that has weight; less than one with density scaling
    double initial_volume = 0;  ///< of one point [m^2]

    /// The one list that reordering, output and accounting walk: f(field) for every active field.
    template <class F>
    void for_each_field(F&& f)
    {
        visit(*this, f);
    }
    template <class F>
    void for_each_field(F&& f) const
    {
        visit(*this, f);
    }

    /// Volume of point p; a point with a box needs no volume of its own.
    double current_volume(std::size_t p) const
    {
        if (!has_box())
            return volume[p];
        double v = 1 << dim;
        for (const auto& half : half_width)
            v *= half[p];
        return v;
    }
    bool has_box() const { return half_width[0].active(); }
    SymTensor<dim> stress_at(std::size_t p) const { return tensor_of<SymTensor<dim>>(at(stress, p)); }
    template <class Lanes>
    TESTBED_INLINE SymTensor<dim, typename Lanes::Pack> stress_at(std::size_t p, const Lanes& lanes) const
    {
        return tensor_of<SymTensor<dim, typename Lanes::Pack>>(load(stress, p, lanes));
    }
    template <class Lanes>
    TESTBED_INLINE void set_stress(std::size_t p, const Lanes& lanes, const SymTensor<dim, typename Lanes::Pack>& s)
    {
        unrolled<symmetric_components<dim>>([&](auto k) TESTBED_INLINE { lanes.store(&stress[k][p], component<k>(s)); });
    }

    template <class Archive>
    void state(Archive& a)
    {
        for_each_field([&](auto& field) { a.field(field, count); });
    }

private:
    template <class Self, class F>
    static void visit(Self& self, F& f)
    {
        const auto one = [&](auto& field) { field.active() ? f(field) : void(); };
        const auto each = [&](auto&... lists) { (std::for_each(lists.begin(), lists.end(), one), ...); };
        each(self.x, self.X, self.stress);
        one(self.volume);
        each(self.half_width, self.v);
        const auto rest = [&](auto&... fields) { (one(fields), ...); };
        rest(self.stiffness, self.szz, self.plastic_shear, self.softening_strain, self.cohesion, self.sin_friction, self.id);
    }
};
}  // namespace testbed
