#include "core/node_ops.hpp"

#include <fmt/format.h>

namespace testbed
{
namespace
{
Restraint make_boundary(const BoundarySpec& spec, const Scene& scene, const Lattice& lattice)
{
    const Expression where(spec.where, scene.expression_constants());
    Restraint restraint{spec.name, {}, {}};
    for (std::size_t n = 0; n < lattice.nodes(); ++n)
    {
        const Vec2 x = lattice.node_position(n);
        if (!holds_near(where, x[0], x[1], 1e-6 * lattice.cell_size))
            continue;
        if (spec.fix != "y")
            restraint.x.nodes.push_back(static_cast<std::uint32_t>(n));
        if (spec.fix != "x")
            restraint.y.nodes.push_back(static_cast<std::uint32_t>(n));
    }
    if (restraint.x.empty() && restraint.y.empty())
        throw SceneError(
            fmt::format("{}: boundary '{}': where = \"{}\" holds at no node of the lattice", scene.path, spec.name, spec.where));
    return restraint;
}

/// The restraint other than `own` that holds all of the nodes in the component in which they are driven, if there is one.
const Restraint* in_the_way(const std::vector<std::uint32_t>& nodes, const Restraint& own, const std::vector<Restraint>& all)
{
    const auto holds = [&](const ComponentRestraint& other, const ComponentRestraint& driven)
    {
        const auto held = [&](std::uint32_t n) { return std::find(other.nodes.begin(), other.nodes.end(), n) != other.nodes.end(); };
        return driven.velocity != 0 && other.velocity != driven.velocity && std::all_of(nodes.begin(), nodes.end(), held);
    };
    for (const Restraint& other : all)
        if (&other != &own && (holds(other.x, own.x) || holds(other.y, own.y)))
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
        restraints_.push_back({spec.name, {}, {}});
    }
}

void NodeOps::begin_step(double t, double dt)
{
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

void NodeOps::apply_forces(Nodes& nodes, double t)
{
    if (gravity_)
        gravity_->apply(nodes, t);
    find_used(nodes);
    bool has_pairs = false;
    std::for_each(restraints_.rbegin(), restraints_.rend(),  // a node of two is driven by the later one
                  [&](Restraint& r) {
                      r.reaction = {r.x.react_at_nodes(nodes.fx), r.y.react_at_nodes(nodes.fy)};
                  });
    for (Restraint& r : restraints_)
    {
        r.reaction[0] += r.x.react_at_faces(nodes, nodes.fx);
        r.reaction[1] += r.y.react_at_faces(nodes, nodes.fy);
        has_pairs |= !r.x.pairs.empty() || !r.y.pairs.empty();
    }
    if (!damping_)
        return;
    damping_->apply(nodes);
    if (has_pairs)  // what damping puts on the nodes of a face must not move the wall
        for (const Restraint& r : restraints_)
        {
            r.x.react_at_faces(nodes, nodes.fx);
            r.y.react_at_faces(nodes, nodes.fy);
        }
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
