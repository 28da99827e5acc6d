#include "core/run/one_step_map.hpp"

#include <map>
#include <optional>
#include <random>

namespace testbed
{
namespace
{
constexpr double kink = 1e-3;  ///< least change of a column from one side to the other that is one

struct Quantity
{
    const char* name;
    Unknown::Kind kind;
    int component;
};
/// Parts of the state that a step changes and the next one reads.
constexpr std::array of_points{
    Quantity{"x", Unknown::Kind::position, 0},          Quantity{"y", Unknown::Kind::position, 1},
    Quantity{"velocity_x", Unknown::Kind::velocity, 0}, Quantity{"velocity_y", Unknown::Kind::velocity, 1},
    Quantity{"stress_xx", Unknown::Kind::stress, 0},    Quantity{"stress_yy", Unknown::Kind::stress, 1},
    Quantity{"stress_xy", Unknown::Kind::stress, 2},    Quantity{"stress_zz", Unknown::Kind::stress, 3},
    Quantity{"volume", Unknown::Kind::other, 0},        Quantity{"half_width_x", Unknown::Kind::other, 0},
    Quantity{"half_width_y", Unknown::Kind::other, 1},  Quantity{"plastic_shear_strain", Unknown::Kind::other, 0}};
constexpr std::array of_nodes{Quantity{"velocity_x", Unknown::Kind::velocity, 0}, Quantity{"velocity_y", Unknown::Kind::velocity, 1},
                              Quantity{"mass_before", Unknown::Kind::other, 0}};

/// Where the unknowns stand in the states of one solver: points by their id, nodes by column and line, for both change their order.
class Places
{
public:
    Places(Solver& solver, const State& about)
        : node_i_(about.find("node/i")),
          node_j_(about.find("node/j")),
          has_nodes_(node_i_ < about.parts.size())
    {
        for (const Body& body : solver.bodies())
        {
            const std::string prefix = "body/" + body.name + "/";
            const std::size_t id = about.find(prefix + "id"), x = about.find(prefix + "x"), y = about.find(prefix + "y");
            bodies_.push_back({id, x, y});
            const auto order = by_id(about, id);
            for (const Quantity& q : of_points)
                if (const std::size_t part = about.find(prefix + q.name); part < about.parts.size())
                    for (std::size_t k = 0; k < order.size(); ++k)
                        places_.push_back({part, bodies_.size() - 1, k, {}, q, {about.of(x)[order[k]], about.of(y)[order[k]]}});
        }
        if (!has_nodes_)
            return;
        const std::size_t mass = about.find("node/mass_before");
        for (const Quantity& q : of_nodes)
            for (std::size_t k = 0; k < about.parts[node_i_].count; ++k)
                if (about.of(mass)[k] > 0)
                    places_.push_back({about.find(std::string("node/") + q.name), 0, 0, node(about, k), q, {}});
    }

    std::size_t count() const { return places_.size(); }

    Unknown unknown(std::size_t n, const State& about, const StateScales& scales, const Lattice& lattice) const
    {
        const Place& p = places_[n];
        return {.kind = p.quantity.kind,
                .component = p.quantity.component,
                .is_nodal = p.node.has_value(),
                .place = p.node ? lattice.node_position(*p.node) : p.at,
                .node = p.node.value_or(NodeIndex{0, 0}),
                .scale = scales.of(about.parts[p.part].unit)};
    }

    /// Number of each unknown in state.numbers; none for nodes that it does not have.
    std::vector<std::optional<std::size_t>> find(const State& state, const NodeIndex& shift = {0, 0}) const
    {
        std::vector<std::vector<std::size_t>> orders;
        for (const BodyParts& body : bodies_)
            orders.push_back(by_id(state, body.id));
        std::map<NodeIndex, std::size_t> nodes;
        if (has_nodes_)
            for (std::size_t k = 0; k < state.parts[node_i_].count; ++k)
                nodes.emplace(node(state, k), k);
        std::vector<std::optional<std::size_t>> found;
        for (const Place& p : places_)
            if (!p.node)
                found.emplace_back(state.parts[p.part].begin + orders[p.body][p.number]);
            else if (const auto n = nodes.find({p.node->i + shift.i, p.node->j + shift.j}); n != nodes.end())
                found.emplace_back(state.parts[p.part].begin + n->second);
            else
                found.emplace_back();
        return found;
    }

    /// Mean motion of all points from one state to another [cells].
    NodeIndex motion(const State& from, const State& to, double cell_size) const
    {
        Vec2 sum{0, 0};
        double points = 0;
        for (const BodyParts& body : bodies_)
            for (const auto& [state, sign] : {std::pair(&from, -1.0), std::pair(&to, 1.0)})
                for (std::size_t k = 0; k < state->parts[body.x].count; ++k)
                {
                    sum[0] += sign * state->of(body.x)[k];
                    sum[1] += sign * state->of(body.y)[k];
                    points += 0.5;
                }
        return {static_cast<int>(std::lround(sum[0] / points / cell_size)), static_cast<int>(std::lround(sum[1] / points / cell_size))};
    }

private:
    struct BodyParts
    {
        std::size_t id, x, y;
    };
    struct Place
    {
        std::size_t part, body, number;  ///< number: among the points of a body by id
        std::optional<NodeIndex> node;
        Quantity quantity;
        Vec2 at;
    };

    NodeIndex node(const State& s, std::size_t k) const { return {static_cast<int>(s.of(node_i_)[k]), static_cast<int>(s.of(node_j_)[k])}; }
    static std::vector<std::size_t> by_id(const State& state, std::size_t id)
    {
        const auto ids = state.of(id);
        const double first = *std::min_element(ids.begin(), ids.end());
        std::vector<std::size_t> order(ids.size());
        for (std::size_t k = 0; k < ids.size(); ++k)
            order[static_cast<std::size_t>(ids[k] - first)] = k;
        return order;
    }

    std::size_t node_i_, node_j_;
    bool has_nodes_;
    std::vector<BodyParts> bodies_;
    std::vector<Place> places_;
};

/// All bins marked: whatever point is moved, the step finds its bin.
State with_all_marked(State state, const std::vector<Body>& bodies)
{
    for (const Body& body : bodies)
        for (double& mark : state.of(state.find("body/" + body.name + "/bins/marked")))
            mark = 1;
    return state;
}
}  // namespace

double StateScales::of(const std::string& unit) const
{
    if (unit == "m")
        return length;
    if (unit == "m/s")
        return velocity;
    if (unit == "Pa")
        return stress;
    if (unit == "kg/m")
        return mass;
    return unit == "m^2" ? length * length : 1;
}

StateScales state_scales(const std::vector<Body>& bodies, double cell_size)
{
    StateScales scales{.length = cell_size};
    for (const Body& body : bodies)
    {
        const double M = moduli(body.material).constrained();
        scales.stress = std::max(scales.stress, M);
        const double density = body.points.mass / body.points.initial_volume;
        scales.velocity = std::max(scales.velocity, std::sqrt(M / density));
        scales.mass = std::max(scales.mass, density * cell_size * cell_size);
    }
    return scales;
}

std::vector<Eigen::Index> OneStepMap::all(Unknown::Kind kind) const
{
    std::vector<Eigen::Index> found;
    for (std::size_t n = 0; n < unknowns.size(); ++n)
        if (unknowns[n].kind == kind)
            found.push_back(static_cast<Eigen::Index>(n));
    return found;
}

std::size_t unknowns_of(Solver& solver, const State& state)
{
    return Places(solver, state).count();
}

OneStepMap one_step_map(Solver& solver, const State& about, const Lattice& lattice, const StepSettings& settings)
{
    const StateScales scales = state_scales(solver.bodies(), lattice.cell_size);
    const State base = with_all_marked(about, solver.bodies());
    const Places places(solver, base);
    const auto count = static_cast<Eigen::Index>(places.count());
    const auto at = places.find(base);
    OneStepMap map;
    for (std::size_t n = 0; n < places.count(); ++n)
        map.unknowns.push_back(places.unknown(n, base, scales, lattice));

    const auto after = [&](const State& start)
    {
        restore(solver, start);
        solver.assume_last_step(settings.dt);
        for (int k = 0; k < settings.steps; ++k)
        {
            solver.prepare(settings.t + k * settings.dt, settings.dt);
            solver.advance(settings.dt);
        }
        return state_of(solver);
    };
    const State end = after(base);
    const NodeIndex shift = settings.steps > 1 ? places.motion(base, end, scales.length) : NodeIndex{0, 0};
    const auto unknowns = [&](const State& state)
    {
        const auto found = places.find(state, shift);
        Eigen::VectorXd values(count);
        for (Eigen::Index n = 0; n < count; ++n)
        {
            const auto& place = found[static_cast<std::size_t>(n)];
            values[n] = place ? state.numbers[*place] / map.unknowns[static_cast<std::size_t>(n)].scale : 0;
        }
        return values;
    };

    const Eigen::VectorXd middle = unknowns(end);
    map.matrix.resize(count, count);
    State changed = base;
    for (Eigen::Index n = 0; n < count; ++n)
    {
        double& number = changed.numbers[*at[static_cast<std::size_t>(n)]];
        const double value = number, scale = map.unknowns[static_cast<std::size_t>(n)].scale;
        bool has_kink = false;
        const auto slope = [&](double difference)
        {
            const double high = value + difference * scale, low = value - difference * scale;
            number = high;
            const Eigen::VectorXd up = unknowns(after(changed));
            number = low;
            const Eigen::VectorXd down = unknowns(after(changed));
            number = value;
            has_kink |= (up - 2 * middle + down).norm() > kink * difference;
            return Eigen::VectorXd((up - down) * (scale / (high - low)));
        };
        // upwind terms are of the form v |v|: the error is of first order, and the two differences are extrapolated to none
        const Eigen::VectorXd coarse = slope(settings.difference);
        map.matrix.col(n) = 2 * slope(settings.difference / 2) - coarse;
        map.kinks += has_kink;
    }
    std::mt19937 random(1);
    for (int k = 0; k < 4; ++k)
    {
        Eigen::VectorXd signs(count);
        for (double& sign : signs)
            sign = random() % 2 == 0 ? 1 : -1;
        const auto towards = [&](double difference)
        {
            State all = base;
            for (Eigen::Index n = 0; n < count; ++n)
                all.numbers[*at[static_cast<std::size_t>(n)]] += difference * signs[n] * map.unknowns[static_cast<std::size_t>(n)].scale;
            return unknowns(after(all));
        };
        const Eigen::VectorXd together = (towards(settings.difference) - towards(-settings.difference)) / (2 * settings.difference);
        const Eigen::VectorXd sum = map.matrix * signs;
        map.excess = std::max(map.excess, (together - sum).norm() / (sum - signs).norm());
    }
    return map;
}
}  // namespace testbed
