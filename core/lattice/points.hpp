#pragma once
/// Material points of one body, a structure of arrays. Mass and initial volume are the same for all points of a body;
/// everything else is a field, present only when the method, the material or the scene needs it.

#include "core/base/field.hpp"

#include <cmath>

namespace testbed
{
struct Points
{
    Field<double> x{"x", "m"}, y{"y", "m"};  ///< current position
    Field<double> X{"X", "m"}, Y{"Y", "m"};  ///< initial position, if a step needs it; else see the id
    Field<double> sxx{"stress_xx", "Pa"}, syy{"stress_yy", "Pa"}, sxy{"stress_xy", "Pa"};
    Field<double> volume{"volume", "m^2"};                                   ///< current, per metre of thickness
    Field<double> half_x{"half_width_x", "m"}, half_y{"half_width_y", "m"};  ///< the point's own box, if it has one
    Field<double> vx{"velocity_x", "m/s"}, vy{"velocity_y", "m/s"};          ///< MPM: the velocity lives on the points
    Field<double> stiffness{"stiffness_ratio", "-"};                         ///< E(X, Y) / E of the material
    Field<double> szz{"stress_zz", "Pa"};                                    ///< if it does not follow from the others
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
    double current_volume(std::size_t p) const { return half_x.active() ? 4 * half_x[p] * half_y[p] : volume[p]; }

    template <class Archive>
    void state(Archive& a)
    {
        for_each_field([&](auto& field) { a.field(field, count); });
    }

private:
    template <class Self, class F>
    static void visit(Self& self, F& f)
    {
        const auto if_active = [&](auto&... fields) { ((fields.active() ? f(fields) : void()), ...); };
        if_active(self.x, self.y, self.X, self.Y, self.sxx, self.syy, self.sxy, self.volume, self.half_x, self.half_y, self.vx, self.vy,
                  self.stiffness, self.szz, self.plastic_shear, self.softening_strain, self.cohesion, self.sin_friction, self.id);
    }
};
}  // namespace testbed
