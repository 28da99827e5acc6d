#include "core/loads/walls.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <limits>

namespace testbed
{
namespace
{
constexpr double slack = 1e-6;  // cells

/// How far soil lies beyond the nodes that its mass reaches [cells]: with boxes it lies where its mass does. Where all mass sits in
/// the middle of a point, nodes beyond have none until a point passes the line of nodes before, half the points' distance behind a wall,
/// and later where the soil is stretched: the whole distance is taken.
double reach_of(const Scene& scene)
{
    const bool mass_in_the_middle = traits_of(scene).reach == 1;
    int fewest = std::numeric_limits<int>::max();
    for (const BodySpec& body : scene.bodies)
        fewest = std::min(fewest, body.points_per_cell);
    return mass_in_the_middle ? 1.0 / fewest : 0.0;
}
}  // namespace

Wall::Wall(const WallSpec& spec, const Scene& scene, const Lattice<2>& lattice) : spec_(spec), lattice_(lattice), reach_(reach_of(scene))
{
    if (spec.velocity)
        velocity_.emplace(*spec.velocity, scene.expression_constants());
}

bool Wall::begin_step(const Step& step, Restraint& restraint)
{
    new_nodes_.clear();
    const Region now = region(step.t);
    const bool others = now != taken_;
    if (others)
    {
        check_on_lattice(now, step.t);
        take(now, restraint);
    }
    if (!velocity_)
        return others;
    const Vec<2> v = (*velocity_)({.t = step.t + 0.5 * step.dt});
    travel_rate_ = v;
    for (std::size_t k = 0; k < 2; ++k)
        restraint.components[k].velocity = fixes(spec_.fix, k) ? v[k] : 0;
    return others;
}

void Wall::end_step(const Step& step)
{
    for (std::size_t k = 0; k < 2; ++k)
        travel_[k] += step.dt * travel_rate_[k];
}

Wall::Region Wall::region(double t) const
{
    Region r{spec_.min, spec_.max, spec_.door && t >= spec_.door_opens};
    for (std::size_t k = 0; k < 2; ++k)
    {
        double shift = travel_[k];
        if (spec_.motion == WallSpec::Motion::hand_off)
            shift = lattice_.cell_size * std::trunc(shift / lattice_.cell_size + std::copysign(slack, shift));
        r.min[k] += shift;
        r.max[k] += shift;
    }
    return r;
}

/// Whether a place in the wall lies in its open door.
bool Wall::is_open_at(const Region& region, const Vec<2>& place) const
{
    if (!region.door_open)
        return false;
    const std::size_t along = door_direction(spec_);
    const double at = place[along] - (region.min[along] - spec_.min[along]), reach = slack * lattice_.cell_size;
    return at > (*spec_.door)[0] + reach && at < (*spec_.door)[1] - reach;
}

void Wall::take(const Region& region, Restraint& restraint)
{
    take_nodes(region, restraint);
    if (spec_.motion == WallSpec::Motion::smooth)
        take_faces(region, restraint);
    taken_ = region;
}

/// The nodes on and in the wall.
void Wall::take_nodes(const Region& region, Restraint& restraint)
{
    const double L = lattice_.cell_size;
    const auto first = [&](std::size_t k) { return static_cast<int>(std::ceil((region.min[k] - lattice_.origin[k]) / L - slack)); };
    const auto last = [&](std::size_t k) { return static_cast<int>(std::floor((region.max[k] - lattice_.origin[k]) / L + slack)); };
    std::vector<Index<2>> nodes;
    // a wall that ends at the edge of the lattice takes the ring around it, too
    const auto low = [&](std::size_t k) { return first(k) <= 0 ? -1 : first(k); };
    const auto high = [&](std::size_t k, int n) { return last(k) >= n ? n + 1 : last(k); };
    for (int j = low(1); j <= high(1, lattice_.size[1]); ++j)
        for (int i = low(0); i <= high(0, lattice_.size[0]); ++i)
            if (!is_open_at(region, lattice_.node_position({i, j})))
                nodes.push_back({i, j});
    if (taken_)
        std::set_difference(nodes.begin(), nodes.end(), covered_.begin(), covered_.end(), std::back_inserter(new_nodes_));
    covered_ = nodes;
    for (std::size_t k = 0; k < 2; ++k)
    {
        restraint.components[k].pairs.clear();
        restraint.components[k].nodes = fixes(spec_.fix, k) ? nodes : std::vector<Index<2>>{};
    }
}

/// Where a face lies between two lines of nodes, the pairs across it take the place of the nodes next to it.
void Wall::take_faces(const Region& region, Restraint& restraint) const
{
    const double L = lattice_.cell_size;
    std::vector<FacePair> pairs;
    for (std::size_t normal = 0; normal < 2; ++normal)
    {
        const std::size_t along = 1 - normal;
        const auto cells = [&](double x, std::size_t k) { return (x - lattice_.origin[k]) / L; };
        const int from = std::max(0, static_cast<int>(std::ceil(cells(region.min[along], along) - slack)));
        const int to = std::min(along == 0 ? lattice_.size[0] : lattice_.size[1],
                                static_cast<int>(std::floor(cells(region.max[along], along) + slack)));
        const bool is_plate = region.min[normal] == region.max[normal];
        if (!is_plate && region.min[along] == region.max[along])
            continue;  // the thin ends of a plate
        for (const double face : {region.min[normal], region.max[normal]})
        {
            const double position = cells(face, normal), below = std::floor(position + slack), share = position - below;
            if (share < slack)
                continue;  // on a line of nodes
            for (int k = from; k <= to; ++k)
            {
                const int line = static_cast<int>(below);
                const Index<2> low = normal == 0 ? Index<2>{line, k} : Index<2>{k, line};
                const Index<2> high = normal == 0 ? Index<2>{line + 1, k} : Index<2>{k, line + 1};
                Vec<2> place = lattice_.node_position(low);
                place[normal] = face;
                if (!is_open_at(region, place))
                    pairs.push_back({low, high, share, reach_});
            }
            if (is_plate)
                break;
        }
    }
    std::vector<Index<2>> at_faces;
    for (const FacePair& p : pairs)
        at_faces.insert(at_faces.end(), {p.low, p.high});
    std::sort(at_faces.begin(), at_faces.end());
    for (std::size_t k = 0; k < 2; ++k)
    {
        if (!fixes(spec_.fix, k))
            continue;
        ComponentRestraint& component = restraint.components[k];
        component.pairs = pairs;
        std::erase_if(component.nodes, [&](const Index<2>& n) { return std::binary_search(at_faces.begin(), at_faces.end(), n); });
    }
}

void Wall::check_on_lattice(const Region& region, double t) const
{
    const double reach = slack * lattice_.cell_size;
    const Vec<2> extent{lattice_.size[0] * lattice_.cell_size, lattice_.size[1] * lattice_.cell_size};
    for (std::size_t k = 0; k < 2; ++k)
        if (region.min[k] < lattice_.origin[k] - reach || region.max[k] > lattice_.origin[k] + extent[k] + reach)
            throw Diverged(fmt::format("wall '{}' left the lattice at t = {:.6g} s after a travel of ({:.4g}, {:.4g}) m", spec_.name, t,
                                       travel_[0], travel_[1]));
}
}  // namespace testbed
