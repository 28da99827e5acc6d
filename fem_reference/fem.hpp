#pragma once
/// Finite element reference: small-strain elasticity on the lattice cells of a scene, static (one linear solve) or dynamic
/// (Newmark's average acceleration, or central differences with lumped mass). Every material law is taken as linear elastic; points
/// and loads keep their initial geometry, so that turns of more than a few degrees, contact and damping are beyond it.

#include "fem_reference/sampler.hpp"

#include <memory>

namespace testbed
{
/// What the three analyses share: the mesh and its operators, the samples, the sums.
class FemSolver : public Solver
{
public:
    FemSolver(const Scene& scene, const Warn& warn, MassKind mass_kind);

    MotionSums sums() const override;
    void update_points() override;
    const std::vector<Body>& bodies() const override { return bodies_; }
    /// Newmark: at the time of the last prepare(); central differences: at the half step before.
    Vec<2> velocity(std::size_t body, std::size_t point) const override { return sampler_.value(velocity_, body, point); }
    std::size_t unknowns() const override { return elasticity_.unknowns(); }
    std::size_t active_cells() const override { return elasticity_.cells(); }
    std::size_t bytes() const override;
    const PhaseTimer& timer() const override { return timer_; }
    std::vector<RestraintRecord> restraints() const override { return elasticity_.restraints(displacement_, time_); }
    Kinematics kinematics() const override { return Kinematics::small_strain; }
    void write_state(StateWriter& writer) override { state(writer); }
    void read_state(StateReader& reader) override { state(reader); }
    /// The limit of a cell as large as the distance of nodes, without damping.
    double critical_time_step(const Scene& scene) override;

    const Elasticity& elasticity() const { return elasticity_; }
    const Vector& displacement() const { return displacement_; }
    /// Kinetic energy is in sums(); this is u K u / 2 [J/m].
    double strain_energy() const;

protected:
    void do_prepare(const Step& step) final;
    void assemble_once();
    /// Acceleration at time t, or what else a step needs.
    virtual void prepare_step(double t, double dt) = 0;
    /// Load less internal forces; held components are not out of balance.
    Vector imbalance() const;
    virtual std::size_t factor_bytes() const { return 0; }
    template <class Archive>
    void state(Archive& a)
    {
        for (const auto& [name, unit, field] : {std::tuple{"displacement", "m", &displacement_},
                                                {"velocity", "m/s", &velocity_},
                                                {"acceleration", "m/s^2", &acceleration_},
                                                {"load", "N/m", &load_}})
            a.part(name, unit, field->size(), [&, f = field](std::size_t k) -> double& { return (*f)(static_cast<unsigned>(k)); });
        a.value("started", "-", started_);
        a.value("last_dt", "s", last_dt_);
    }

    std::string path_;
    Lattice<2> lattice_;
    std::vector<Body> bodies_;
    Elasticity elasticity_;
    Sampler sampler_;
    MassKind mass_kind_;
    bool assembled_ = false, started_ = false;
    double time_ = 0, lag_ = 0;  ///< lag: of the velocity behind the forces [s]
    Vector displacement_, velocity_, acceleration_, load_;
    PhaseTimer timer_;
};

/// The solver that the scene asks for. @param warn takes warnings; they go to stderr if it is left out
/// @throws SceneError
std::unique_ptr<Solver> make_fem(const Scene& scene, const Warn& warn = {});
}  // namespace testbed
