#include "core/loads/restraint.hpp"

#include <algorithm>
#include <utility>

namespace testbed
{
namespace
{
constexpr std::size_t worth_a_team = 64;

/// The weights with which the velocity at a face follows from those of its two nodes; none where no soil lies at the face. Where one
/// node has mass, the soil ends between the two: it lies at a face that is within its reach of that node, and moves with the node.
std::array<double, 2> weights(const Nodes<2>& carrier, const DrivenNodes::Pair& p)
{
    const bool low = carrier.mass[p.low] > 0, high = carrier.mass[p.high] > 0;
    if (low && high)
        return {1 - p.share, p.share};
    return {low && p.share <= p.reach ? 1.0 : 0.0, high && 1 - p.share <= p.reach ? 1.0 : 0.0};
}

/// What a face gives to its two nodes to change its own velocity by dv.
std::array<double, 2> impulse(const Nodes<2>& carrier, const DrivenNodes::Pair& p, double dv)
{
    const auto [a, b] = weights(carrier, p);
    const double size = a + b > 0 ? dv / (a * a * inverse_mass(carrier, p.low) + b * b * inverse_mass(carrier, p.high)) : 0;
    return {a * size, b * size};
}

/// Adds the reaction at a face to the forces f; returns it [N/m].
double hold_face(const Nodes<2>& carrier, const DrivenNodes::Pair& p, std::vector<double>& f)
{
    const auto [a, b] = weights(carrier, p);
    const double acceleration = a * f[p.low] * inverse_mass(carrier, p.low) + b * f[p.high] * inverse_mass(carrier, p.high);
    const auto [low, high] = impulse(carrier, p, -acceleration);
    f[p.low] += low;
    f[p.high] += high;
    return low + high;
}

/// take(number) for the nodes of an ascending list that are in use.
template <class Take>
void for_each_used(const std::vector<Index<2>>& ascending, const Lattice<2>& lattice, const std::vector<std::uint32_t>& active, Take&& take)
{
    const CellBox<2>& box = lattice.numbered;
    auto n = std::lower_bound(ascending.begin(), ascending.end(), box.low + all<2>(-1));
    auto place = active.begin();
    for (; n != ascending.end() && n->back() <= box.high.back() + 1; ++n)
        if (lattice.has_node(*n))
        {
            const auto number = static_cast<std::uint32_t>(lattice.node(*n));
            place = std::lower_bound(place, active.end(), number);
            if (place != active.end() && *place == number)
                take(number);
        }
}
}  // namespace

void DrivenNodes::find(const std::vector<Restraint>& restraints, const Lattice<2>& lattice, const Nodes<2>& nodes)
{
    const auto& active = nodes.active();
    const auto is_used = [&](std::uint32_t number) { return std::binary_search(active.begin(), active.end(), number); };
    const auto add = [&](const FacePair& p, std::uint16_t restraint, std::uint16_t component)
    {
        if (!lattice.has_node(p.low) || !lattice.has_node(p.high))
            return;
        const auto low = static_cast<std::uint32_t>(lattice.node(p.low));
        const auto high = static_cast<std::uint32_t>(lattice.node(p.high));
        const bool both = is_used(low) && is_used(high);
        if (both || (p.reach > 0 && (is_used(low) || is_used(high))))
            stages_.back().pairs.push_back({low, high, p.share, p.reach, restraint, component});
    };
    stages_.assign(1, {});
    for (std::size_t r = 0; r < restraints.size(); ++r)
    {
        const auto restraint = static_cast<std::uint16_t>(r);
        for (std::uint16_t k = 0; k < restraints[r].components.size(); ++k)
        {
            for_each_used(restraints[r].components[k].nodes, lattice, active,
                          [&](std::uint32_t n) {
                              stages_.back().nodes.push_back({n, restraint, k});
                          });
            for (const FacePair& p : restraints[r].components[k].pairs)
                add(p, restraint, k);
        }
        if (!stages_.back().pairs.empty())
            stages_.emplace_back();
    }
    for (Stage& stage : stages_)
    {
        const auto place = [](const Driven& d) { return std::pair(d.node, d.component); };
        std::stable_sort(stage.nodes.begin(), stage.nodes.end(), [&](const Driven& a, const Driven& b) { return place(a) < place(b); });
        const auto last =
            std::unique(stage.nodes.rbegin(), stage.nodes.rend(), [&](const Driven& a, const Driven& b) { return place(a) == place(b); });
        stage.nodes.erase(stage.nodes.begin(), last.base());
    }
}

double DrivenNodes::drive(const std::vector<Restraint>& restraints, const Nodes<2>& carrier, VectorField<2>& velocity) const
{
    double work = 0;
    for (const Stage& stage : stages_)
    {
        for (const Driven& d : stage.nodes)
            if (const double own = restraints[d.restraint].components[d.component].velocity; own != 0)
                work += carrier.mass[d.node] * (own - velocity[d.component][d.node]) * own;
        parallel_for(
            stage.nodes.size(),
            [&](std::size_t n)
            {
                const Driven& d = stage.nodes[n];
                velocity[d.component][d.node] = restraints[d.restraint].components[d.component].velocity;
            },
            worth_a_team);
        for (const Pair& p : stage.pairs)
        {
            std::vector<double>& v = velocity[p.component];
            const auto [a, b] = weights(carrier, p);
            const double face = a * v[p.low] + b * v[p.high];
            const double own = restraints[p.restraint].components[p.component].velocity;
            const auto [low, high] = impulse(carrier, p, own - face);
            v[p.low] += low * inverse_mass(carrier, p.low);
            v[p.high] += high * inverse_mass(carrier, p.high);
            work += (low + high) * own;
        }
    }
    return work;
}

void DrivenNodes::react(std::vector<Restraint>& restraints, Nodes<2>& nodes)
{
    for (Restraint& r : restraints)
        r.reaction = {0, 0};
    for (auto stage = stages_.rbegin(); stage != stages_.rend(); ++stage)  // a node of two is driven by the later one
    {
        taken_.resize(stage->nodes.size());
        parallel_for(
            stage->nodes.size(),
            [&](std::size_t n)
            {
                const Driven& d = stage->nodes[n];
                taken_[n] = std::exchange(nodes.f[d.component][d.node], 0.0);
            },
            worth_a_team);
        for (std::size_t n = 0; n < stage->nodes.size(); ++n)
            restraints[stage->nodes[n].restraint].reaction[stage->nodes[n].component] -= taken_[n];
    }
    for (const Stage& stage : stages_)
        for (const Pair& p : stage.pairs)
            restraints[p.restraint].reaction[p.component] += hold_face(nodes, p, nodes.f[p.component]);
}

double DrivenNodes::hold_faces(const std::vector<Restraint>& restraints, Nodes<2>& nodes) const
{
    double power = 0;
    for (const Stage& stage : stages_)
        for (const Pair& p : stage.pairs)
            power += hold_face(nodes, p, nodes.f[p.component]) * restraints[p.restraint].components[p.component].velocity;
    return power;
}
}  // namespace testbed
