#pragma once
/// The energy ledger of a run: what came in, what is stored, what was taken away, and what is left of the balance.

#include "core/bodies/point_sums.hpp"
#include "core/loads/nodal_work.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace testbed
{
/// All since the start of the run, per metre of thickness [J/m].
struct EnergyBalance
{
    double kinetic = 0, elastic = 0;                 ///< stored now
    double gravity = 0;                              ///< a part of external, at the nodes
    double external = 0;                             ///< came in: gravity, supports and walls, tractions, body force, confinement
    double damping = 0, hourglass = 0, plastic = 0;  ///< taken away
    double numerical = 0;  ///< what is stored and taken away beyond what came in: made by the numbers, lost by them if negative
};

class Ledger
{
public:
    /// @param has_strength whether some law dissipates; then what the stresses' work leaves beside the elastic energy is plastic, else it
    /// is numerical @param confinement pressure on free surfaces [Pa]
    Ledger(bool has_strength, double confinement) : has_strength_(has_strength), confinement_(confinement) {}

    /// The first call is the start. @param kinetic [J/m]
    /// @param work of the nodes; without it only what is stored is known
    /// @param plastic what the laws dissipated, where the work at the nodes does not tell [J/m]
    EnergyBalance at(double kinetic, const PointSums& points, const std::optional<NodalWork>& work, double plastic)
    {
        if (!started_)
        {
            kinetic_ = kinetic;
            elastic_ = points.elastic_work;
            volume_ = points.volume;
            started_ = true;
        }
        EnergyBalance b{.kinetic = kinetic, .elastic = points.elastic_work};
        if (!work)
            return b;
        const double pressed = confinement_ * (volume_ - points.volume);
        b.gravity = work->gravity;
        b.external = work->gravity + work->restraints + work->loads + pressed;
        b.damping = work->damping;
        b.hourglass = work->hourglass;
        const double stored = (b.kinetic - kinetic_) + (b.elastic - elastic_);
        if (has_strength_)
            b.plastic = work->of_strain ? work->internal() + pressed - (b.elastic - elastic_) : plastic;
        b.numerical = stored + b.damping + b.hourglass + b.plastic - b.external;
        most_external_ = std::max(most_external_, std::abs(b.external));
        return b;
    }
    template <class Archive>
    void state(Archive& a)
    {
        a.value("started", "-", started_);
        a.value("kinetic", "J/m", kinetic_);
        a.value("elastic", "J/m", elastic_);
        a.value("volume", "m^2", volume_);
        a.value("most_external", "J/m", most_external_);
    }
    /// Energy that the run has had to do with so far: at the start, and brought in [J/m].
    double scale() const { return kinetic_ + elastic_ + most_external_; }

private:
    bool has_strength_, started_ = false;
    double confinement_, kinetic_ = 0, elastic_ = 0, volume_ = 0, most_external_ = 0;
};
}  // namespace testbed
