#pragma once
/// What LPFDM and MPM have in common: a cloud of points, operations at nodes, and loads, each only if the scene has it.

#include "core/bodies/cloud.hpp"
#include "core/bodies/density_scaling.hpp"
#include "core/loads/body_force.hpp"
#include "core/loads/tractions.hpp"
#include "core/run/solver.hpp"

namespace testbed
{
template <class Support>
class ParticleSolver : public Solver
{
public:
    const std::vector<Body>& bodies() const final { return cloud_.bodies; }
    const PhaseTimer& timer() const final { return timer_; }
    std::vector<RestraintRecord> restraints() const final { return node_ops_.records(); }
    NodalWork* work_done() final { return &node_ops_.work_done(); }
    /// All laws add up one strain so far.
    Kinematics kinematics() const final { return testbed::kinematics(bodies_.front().material); }

protected:
    static constexpr int S = Support::S;

    ParticleSolver(const Scene& scene, PointNeeds needs) : ParticleSolver(scene, needs, NodeOps(scene, make_lattice(scene.grid))) {}
    /// @param node_ops for nodes that are not those of the lattice
    ParticleSolver(const Scene& scene, PointNeeds needs, NodeOps node_ops)
        : cloud_(scene, needs.with_initial_position(scene.body_force.has_value())),
          bodies_(cloud_.bodies),
          node_ops_(std::move(node_ops))
    {
        if (scene.body_force)
            body_force_.emplace(*scene.body_force, scene.expression_constants());
        if (!scene.tractions.empty())
            tractions_.emplace(scene);
        if (scene.time.density_scaling)
            node_ops_.weigh_with(weight_.emplace().nodes);
        if (scene.damping)
            damping_ = scene.damping->local;
    }

    /// The forces of the outside, once those of the stresses are at the nodes.
    void apply_loads(const char* phase, const Lattice<2>& lattice, Nodes<2>& nodes, const Step& step)
    {
        internal_ = force_norm(nodes);
        if (body_force_)
            timer_("forcing", [&] { body_force_->evaluate(bodies_, step.t); });
        timer_(phase,
               [&]
               {
                   if (body_force_)
                       node_ops_.apply_load(nodes, [&] { add_body_force(); });
                   if (tractions_)
                       node_ops_.apply_load(nodes,
                                            [&]
                                            {
                                                tractions_->apply(lattice, bodies_, nodes, step.t);
                                                gather_forces();
                                            });
                   if (weight_)
                       find_weight();
                   node_ops_.apply_forces(lattice, nodes, step);
               });
    }
    /// What a step depends on beside the unknowns of nodes. Returns the lattice with the numbers that it has in the state.
    template <class Archive>
    Lattice<2> state_of_points(Archive& a, Lattice<2> lattice)
    {
        cloud_.state(a);
        node_ops_.state(a);
        a.value("last_dt", "s", this->last_dt_);
        lattice.state(a);
        return lattice;
    }
    std::size_t bytes_of_points_and_loads() const
    {
        return cloud_.bytes() + (body_force_ ? body_force_->bytes() : 0) + (weight_ ? weight_->bytes() : 0);
    }

    Cloud<Support> cloud_;
    std::vector<Body>& bodies_;
    NodeOps node_ops_;
    std::optional<BodyForce> body_force_;
    std::optional<Tractions> tractions_;
    std::optional<NodalWeight> weight_;
    PhaseTimer timer_;
    double damping_ = 0;
    double internal_ = 0;  ///< norm of the internal nodal forces at the last prepare() [N/m]

private:
    /// Adds the body force to the nodes.
    virtual void add_body_force() = 0;
    /// After forces were added to single nodes: what some of them hand on to others.
    virtual void gather_forces() {}
    /// The masses of the nodes that have weight.
    virtual void find_weight() = 0;
};
}  // namespace testbed
