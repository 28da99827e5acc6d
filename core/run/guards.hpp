#pragma once
/// Guards: what a run watches so that a wrong answer does not pass as a right one. Each is small and about one idea; none changes the run.

#include "core/run/ledger.hpp"
#include "core/run/solver.hpp"

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace testbed
{
/// What the run looks like when the history is sampled.
struct GuardSample
{
    double t = 0, dt = 0;
    EnergyBalance energy;
    double energy_scale = 0;  ///< see Ledger::scale()
    MotionSums motion;        ///< of the nodes
    PointSums points;
    PointMotion point_motion;
    double gravity_work = 0, gravity_work_error = 0;  ///< on the points, and the most that its trapezoids may miss of a ramp [J/m]
    bool is_fresh = true;  ///< else point_motion is that of an earlier sample, and nothing else that costs a pass is asked for
};

/// Why a run is suspect. Codes: energy, loss, gravity_work, hourglass, momentum, drift, released, noise, crossing, mixed_cells, volume,
/// outside, courant, not_at_rest, separated, contact_lost, small_strain, time_step.
struct Finding
{
    std::string code, sentence;
};

class Guard
{
public:
    virtual ~Guard() = default;
    virtual void watch(const GuardSample&, const Solver&) {}
    /// A longer look, once, at the last sample of a run that did not diverge.
    virtual void at_end(const GuardSample&, const Solver&) {}
    /// What is wrong with the run up to the last sample. @param completed to the end of the scene
    virtual std::optional<Finding> finding(bool completed) const = 0;
    /// What is worth a word and not wrong, or nothing.
    virtual std::string note() const { return ""; }
    /// What it remembers from sample to sample, for a restart.
    virtual void write_state(StateWriter&) = 0;
    virtual void read_state(StateReader&) = 0;
};

/// A guard whose template state(archive) lists what it remembers.
template <class Derived>
class Remembering : public Guard
{
public:
    void write_state(StateWriter& writer) final { static_cast<Derived*>(this)->state(writer); }
    void read_state(StateReader& reader) final { static_cast<Derived*>(this)->state(reader); }
};

/// The limits, each with its reason in docs/methods.md ("Soundness").
namespace limits
{
inline constexpr double energy_gain = 0.02;        ///< of the energy of the run
inline constexpr double energy_loss = 0.5;         ///< so, to the numbers, of an elastic body without damping
inline constexpr double gravity_work = 0.01;       ///< at the nodes against that on the points
inline constexpr double gravity_work_flow = 0.05;  ///< so, where the law may flow
inline constexpr double hourglass = 0.1;           ///< of the energy of the run
inline constexpr double momentum = 5e-4;           ///< change over mass times speed, where no force acts
inline constexpr double drift = 0.01;              ///< of the mean settlement of an oscillation
inline constexpr double released = 10;             ///< kinetic energy over that of a body as fast as the walls
inline constexpr double stress_error = 0.25;       ///< of the stresses at rest, from their average over cells, in the L2 norm
inline constexpr double noise_share = 0.3;         ///< of the energy at the end
inline constexpr double rounding = 1e-18;          ///< of the kinetic energy: what moves less about the centre of mass is rounding
inline constexpr double worth_noise = 0.01;        ///< noise of less than this share of the largest energy is not
inline constexpr double is_static = 0.01;          ///< kinetic over strain energy: what moves less is at rest for a look at its stresses
inline constexpr double crossed = 0.01;            ///< volume at rest in other cells than at the start
inline constexpr double squeezed = 0.01;           ///< change of volume of points at rest, in the mean weighted by energy
inline constexpr double mixed = 0.01;              ///< volume in cells of two stiffnesses
inline constexpr double contrast = 4;              ///< of stiffnesses
inline constexpr double smallest_volume = 0.2;     ///< current over initial
inline constexpr double largest_volume = 10;       ///< so, where the law cannot flow
inline constexpr double courant = 1;               ///< max |v| dt / L
inline constexpr double at_rest = 1e-3;            ///< kinetic over strain energy
inline constexpr double small_strain = 0.05;       ///< of the FEM reference
}  // namespace limits

class Guards
{
public:
    /// @param dt of the run [s]
    Guards(const Scene& scene, const Solver& solver, double dt_critical);

    void watch(const GuardSample& sample, const Solver& solver);
    /// After the last sample, unless the run diverged.
    void at_end(const Solver& solver);
    std::vector<Finding> findings(bool completed) const;
    std::string note() const;
    const std::optional<GuardSample>& last() const { return last_; }
    template <class Archive>
    void state(Archive& a)
    {
        for (std::size_t k = 0; k < guards_.size(); ++k)
            a.group("guard/" + std::to_string(k),
                    [&]
                    {
                        if constexpr (Archive::reads)
                            guards_[k]->read_state(a);
                        else
                            guards_[k]->write_state(a);
                    });
    }

private:
    std::vector<std::unique_ptr<Guard>> guards_;
    std::optional<GuardSample> last_;
};

}  // namespace testbed
