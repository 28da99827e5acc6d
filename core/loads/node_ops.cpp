#include "core/loads/node_ops.hpp"

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
            if (fixes(spec.fix, 0))
                restraint.components[0].nodes.push_back({i, j});
            if (fixes(spec.fix, 1))
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

void NodeOps::begin_step(const Step& step)
{
    power_ = {};
    load_x_.clear();
    load_y_.clear();
    for (std::size_t k = 0; k < walls_.size(); ++k)
    {
        Restraint& own = restraints_[first_wall_ + k];
        if (walls_[k].begin_step(step, own))
            seen_ = 0;
        if (const auto& nodes = walls_[k].new_nodes(); !nodes.empty())
            if (const Restraint* other = in_the_way(nodes, own, restraints_))
                throw Diverged(
                    fmt::format("wall '{}' was pushed through the soil and has reached '{}' after a travel of ({:.4g}, {:.4g}) m", own.name,
                                other->name, walls_[k].displacement()[0], walls_[k].displacement()[1]));
    }
}

void NodeOps::apply_forces(const Lattice& lattice, Nodes& nodes, const Step& step)
{
    if (gravity_)
    {
        gravity_->apply(nodes, weight_of(nodes), step.t);
        const double factor = gravity_->factor(step.t);
        gravity_now_ = {factor * gravity_->acceleration[0], factor * gravity_->acceleration[1]};
    }
    find_driven(lattice, nodes);
    driven_.react(restraints_, nodes);
    for (const Restraint& r : restraints_)
        for (std::size_t k = 0; k < 2; ++k)
            power_.restraints += r.reaction[k] * r.components[k].velocity;
    if (!damping_)
        return;
    damping_->apply(nodes);
    power_.restraints += driven_.hold_faces(restraints_, nodes);  // what damping puts on the nodes of a face must not move the wall
}

double NodeOps::load_power(const Nodes& nodes) const
{
    double power = 0;
    for (const auto n : nodes.active())
        power += load_x_[n] * nodes.vx[n] + load_y_[n] * nodes.vy[n];
    return power;
}

void NodeOps::add_work(const Kick& kick, double loads, double dt, NodalWork& work) const
{
    work.kick += kick.work;
    work.gravity += gravity_now_[0] * kick.transport[0] + gravity_now_[1] * kick.transport[1];
    work.damping += kick.damping;
    work.loads += loads * dt;
    work.restraints += power_.restraints * dt;
    work.hourglass += power_.hourglass * dt;
}

void NodeOps::kick(Nodes& nodes, double dt)
{
    const bool loaded = !load_x_.empty();
    const double before = loaded ? load_power(nodes) : 0;
    const Kick kick = damping_ ? accelerate(nodes, weight_of(nodes), dt, *damping_) : accelerate(nodes, weight_of(nodes), dt);
    add_work(kick, loaded ? 0.5 * (before + load_power(nodes)) : 0, dt, work_);
}

NodalWork NodeOps::work(const Nodes& nodes, double lag) const
{
    const std::vector<double>& mass = weight_of(nodes);
    const auto s = sum_over_nodes<3>(nodes,
                                     [&](std::size_t i, const auto& lanes)
                                     {
                                         const Pack m = lanes.load(&mass[i]);
                                         const Pack vx = lanes.load(&nodes.vx[i]), vy = lanes.load(&nodes.vy[i]);
                                         Pack taken(0.0);
                                         if (damping_)
                                             taken = damping_->taken(lanes.load(&nodes.fx[i]), vx) * vx +
                                                     damping_->taken(lanes.load(&nodes.fy[i]), vy) * vy;
                                         return std::array{m * vx, m * vy, taken};
                                     });
    NodalWork now = work_;
    add_work({lag * nodal_power(nodes), {lag * s[0], lag * s[1]}, lag * s[2]}, load_x_.empty() ? 0 : load_power(nodes), lag, now);
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
