#include "core/node_ops.hpp"

#include <fmt/format.h>

namespace testbed
{
namespace
{
Restraint make_boundary(const BoundarySpec& spec, const Scene& scene, const Lattice& lattice)
{
    const Expression where(spec.where, scene.expression_constants());
    Restraint restraint{spec.name, {}};
    for (int j = -1; j <= lattice.ny + 1; ++j)
        for (int i = -1; i <= lattice.nx + 1; ++i)
        {
            const Vec2 x = lattice.node_position({i, j});
            if (!holds_near(where, x[0], x[1], 1e-6 * lattice.cell_size))
                continue;
            if (spec.fix != "y")
                restraint.components[0].nodes.push_back({i, j});
            if (spec.fix != "x")
                restraint.components[1].nodes.push_back({i, j});
        }
    if (restraint.components[0].empty() && restraint.components[1].empty())
        throw SceneError(
            fmt::format("{}: boundary '{}': where = \"{}\" holds at no node of the lattice", scene.path, spec.name, spec.where));
    return restraint;
}

/// The restraint other than `own` that holds all of the nodes in the component in which they are driven, if there is one.
const Restraint* in_the_way(const std::vector<NodeIndex>& nodes, const Restraint& own, const std::vector<Restraint>& all)
{
    const auto holds = [&](const ComponentRestraint& other, const ComponentRestraint& driven)
    {
        const auto held = [&](const NodeIndex& n) { return std::binary_search(other.nodes.begin(), other.nodes.end(), n); };
        return driven.velocity != 0 && other.velocity != driven.velocity && std::all_of(nodes.begin(), nodes.end(), held);
    };
    for (const Restraint& other : all)
        if (&other != &own && (holds(other.components[0], own.components[0]) || holds(other.components[1], own.components[1])))
            return &other;
    return nullptr;
}
}  // namespace

NodeOps::NodeOps(const Scene& scene, const Lattice& lattice)
{
    if (scene.gravity)
        gravity_ = make_gravity(*scene.gravity);
    if (scene.damping && scene.damping->local > 0)
        damping_ = LocalDamping{scene.damping->local};
    for (const BoundarySpec& spec : scene.boundaries)
        restraints_.push_back(make_boundary(spec, scene, lattice));
    first_wall_ = restraints_.size();
    for (const WallSpec& spec : scene.walls)
    {
        walls_.emplace_back(spec, scene, lattice);
        restraints_.push_back({spec.name, {}});
    }
}

void NodeOps::begin_step(double t, double dt)
{
    power_ = {};
    for (std::size_t k = 0; k < walls_.size(); ++k)
    {
        Restraint& own = restraints_[first_wall_ + k];
        if (walls_[k].begin_step(t, dt, own))
            seen_ = 0;
        if (const auto& nodes = walls_[k].new_nodes(); !nodes.empty())
            if (const Restraint* other = in_the_way(nodes, own, restraints_))
                throw Diverged(
                    fmt::format("wall '{}' was pushed through the soil and has reached '{}' after a travel of ({:.4g}, {:.4g}) m", own.name,
                                other->name, walls_[k].displacement()[0], walls_[k].displacement()[1]));
    }
}

void NodeOps::apply_forces(const Lattice& lattice, Nodes& nodes, double t)
{
    if (gravity_)
    {
        gravity_->apply(nodes, weight_of(nodes), t);
        const double factor = gravity_->factor(t);
        gravity_now_ = {factor * gravity_->acceleration[0], factor * gravity_->acceleration[1]};
    }
    find_driven(lattice, nodes);
    driven_.react(restraints_, nodes);
    for (const Restraint& r : restraints_)
        for (std::size_t k = 0; k < 2; ++k)
            power_.restraints += r.reaction[k] * r.components[k].velocity;
    if (!damping_)
        return;
    power_.damping = damping_->apply(nodes);
    power_.restraints += driven_.hold_faces(restraints_, nodes);  // what damping puts on the nodes of a face must not move the wall
}

void NodeOps::add_work(const Kick& kick, double dt, double before, NodalWork& work) const
{
    work.kick += kick.work;
    work.gravity += gravity_now_[0] * kick.transport[0] + gravity_now_[1] * kick.transport[1];
    work.restraints += power_.restraints * dt;
    work.loads += power_.loads * before;
    work.damping += power_.damping * before;
    work.hourglass += power_.hourglass * before;
}

void NodeOps::kick(Nodes& nodes, double dt)
{
    add_work(accelerate(nodes, weight_of(nodes), dt), dt, started_ ? dt : 0, work_);
    started_ = true;
}

NodalWork NodeOps::work(const Nodes& nodes, double lag) const
{
    const std::vector<double>& mass = weight_of(nodes);
    const auto momentum = sum_over_nodes<2>(nodes,
                                            [&](std::size_t i, const auto& lanes)
                                            {
                                                const Pack m = lanes.load(&mass[i]);
                                                return std::array{m * lanes.load(&nodes.vx[i]), m * lanes.load(&nodes.vy[i])};
                                            });
    NodalWork now = work_;
    add_work({lag * nodal_power(nodes), {lag * momentum[0], lag * momentum[1]}}, lag, 2 * lag, now);
    return now;
}

std::vector<RestraintRecord> NodeOps::records() const
{
    std::vector<RestraintRecord> all;
    for (std::size_t k = 0; k < restraints_.size(); ++k)
        all.push_back({restraints_[k].name, restraints_[k].reaction,
                       k < first_wall_ ? std::nullopt : std::optional(walls_[k - first_wall_].displacement())});
    return all;
}
}  // namespace testbed
