#include "core/loads/node_ops.hpp"

#include <fmt/format.h>

namespace testbed
{
namespace
{
Restraint make_boundary(const BoundarySpec& spec, const Scene& scene, const Lattice<2>& lattice, std::span<const Vec<2>> places)
{
    const Expression where(spec.where, scene.expression_constants());
    Restraint restraint{spec.name, {}};
    for_each_index(all<2>(-1), lattice.size + all<2>(2),
                   [&](const Index<2>& n)
                   {
                       const Vec<2> x = places.empty() ? lattice.node_position(n) : places[lattice.node(n)];
                       if (std::isnan(x[0]) || !holds_near(where, x[0], x[1], 1e-6 * lattice.cell_size))
                           return;
                       for (std::size_t d = 0; d < restraint.components.size(); ++d)
                           if (fixes(spec.fix, d))
                               restraint.components[d].nodes.push_back(n);
                   });
    if (std::all_of(restraint.components.begin(), restraint.components.end(), [](const auto& component) { return component.empty(); }))
        throw SceneError(fmt::format("{}: boundary '{}': where = \"{}\" holds at no node", scene.path, spec.name, spec.where));
    return restraint;
}

/// The restraint other than `own` that holds all of the nodes in the component in which they are driven, if there is one.
const Restraint* in_the_way(const std::vector<Index<2>>& nodes, const Restraint& own, const std::vector<Restraint>& all)
{
    const auto holds = [&](const ComponentRestraint& other, const ComponentRestraint& driven)
    {
        const auto held = [&](const Index<2>& n) { return std::binary_search(other.nodes.begin(), other.nodes.end(), n); };
        return driven.velocity != 0 && other.velocity != driven.velocity && std::all_of(nodes.begin(), nodes.end(), held);
    };
    for (const Restraint& other : all)
        for (std::size_t d = 0; d < own.components.size(); ++d)
            if (&other != &own && holds(other.components[d], own.components[d]))
                return &other;
    return nullptr;
}
}  // namespace

NodeOps::NodeOps(const Scene& scene, const Lattice<2>& lattice, std::span<const Vec<2>> places)
{
    if (scene.gravity)
        gravity_ = make_gravity(*scene.gravity);
    if (scene.damping && scene.damping->local > 0)
        damping_ = LocalDamping{scene.damping->local};
    has_kinetic_damping_ = scene.damping && scene.damping->kinetic;
    for (const BoundarySpec& spec : scene.boundaries)
        restraints_.push_back(make_boundary(spec, scene, lattice, places));
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
    is_loaded_ = false;
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

void NodeOps::apply_forces(const Lattice<2>& lattice, Nodes<2>& nodes, const Step& step)
{
    if (gravity_)
    {
        gravity_->apply(nodes, weight_of(nodes), step.t);
        gravity_now_ = gravity_->now(step.t);
    }
    find_driven(lattice, nodes);
    driven_.react(restraints_, nodes);
    for (const Restraint& r : restraints_)
        for (std::size_t k = 0; k < r.components.size(); ++k)
            power_.restraints += r.reaction[k] * r.components[k].velocity;
    if (!damping_)
        return;
    damping_->apply(nodes);
    power_.restraints += driven_.hold_faces(restraints_, nodes);  // what damping puts on the nodes of a face must not move the wall
}

double NodeOps::load_power(const Nodes<2>& nodes) const
{
    const auto power = [&](std::size_t i, const auto& lanes)
    { return std::array{total<2>([&](auto d) { return lanes.load(&load_[d][i]) * lanes.load(&nodes.v[d][i]); })}; };
    return sum_over_nodes<1>(nodes, power)[0];
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

std::optional<double> NodeOps::kick(Nodes<2>& nodes, double dt)
{
    const double moving = has_kinetic_damping_ ? kinetic_energy(nodes) : 0, before = is_loaded_ ? load_power(nodes) : 0;
    const Kick kick = damping_ ? accelerate(nodes, weight_of(nodes), dt, *damping_) : accelerate(nodes, weight_of(nodes), dt);
    add_work(kick, is_loaded_ ? 0.5 * (before + load_power(nodes)) : 0, dt, work_);
    const bool falls = kick.work < 0 || moving < std::exchange(moving_, moving);
    if (!has_kinetic_damping_ || !falls)
        return {};
    moving_ = 0;
    stop(nodes, dt, moving + kick.work);
    return moving;
}

void NodeOps::stop(Nodes<2>& nodes, double dt, double energy)
{
    const std::vector<double>& weight = weight_of(nodes);
    double loads = is_loaded_ ? load_power(nodes) : 0;
    const auto s = sum_over_nodes<4>(nodes,
                                     [&](std::size_t i, const auto& lanes)
                                     {
                                         const Pack step = inverse_mass(nodes, i, lanes) * Pack(dt), w = lanes.load(&weight[i]);
                                         const auto f = load(nodes.f, i, lanes), v = load(nodes.v, i, lanes);
                                         Vec<2, Pack> half, way;
                                         std::array<Pack, 4> sums{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
                                         unrolled<2>(
                                             [&](auto d)
                                             {
                                                 half[d] = Pack(0.5) * step * f[d];
                                                 way[d] = Pack(0.5 * dt) * (half[d] - v[d]);
                                                 sums[0] += f[d] * way[d];
                                                 sums[1 + d] = w * way[d];
                                                 if (damping_)
                                                     sums[3] += damping_->taken(f[d], v[d] - step * f[d]) * way[d];
                                             });
                                         store(nodes.v, i, lanes, half);
                                         return sums;
                                     });
    loads -= is_loaded_ ? load_power(nodes) : 0;
    add_work({s[0], {s[1], s[2]}, s[3]}, loads, -0.5 * dt, work_);
    work_.note_stopped(energy + s[0] - kinetic_energy(nodes));
}

NodalWork NodeOps::work(const Nodes<2>& nodes, double lag) const
{
    const std::vector<double>& mass = weight_of(nodes);
    const auto s = sum_over_nodes<3>(nodes,
                                     [&](std::size_t i, const auto& lanes)
                                     {
                                         const Pack m = lanes.load(&mass[i]);
                                         const Vec<2, Pack> v = load(nodes.v, i, lanes);
                                         Pack taken(0.0);
                                         if (damping_)
                                             taken =
                                                 total<2>([&](auto d) { return damping_->taken(lanes.load(&nodes.f[d][i]), v[d]) * v[d]; });
                                         return std::array{m * v[0], m * v[1], taken};
                                     });
    NodalWork now = work_;
    add_work({lag * nodal_power(nodes), {lag * s[0], lag * s[1]}, lag * s[2]}, is_loaded_ ? load_power(nodes) : 0, lag, now);
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
