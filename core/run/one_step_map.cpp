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

    Unknown unknown(std::size_t n, const State& about, const StateScales& scales, const Lattice<2>& lattice) const
    {
        const Place& p = places_[n];
        return {.kind = p.quantity.kind,
                .component = p.quantity.component,
                .is_nodal = p.node.has_value(),
                .place = p.node ? lattice.node_position(*p.node) : p.at,
                .node = p.node.value_or(Index<2>{0, 0}),
                .scale = scales.of(about.parts[p.part].unit)};
    }

    /// Number of each unknown in state.numbers; none for nodes that it does not have.
    std::vector<std::optional<std::size_t>> find(const State& state, const Index<2>& shift = {0, 0}) const
    {
        std::vector<std::vector<std::size_t>> orders;
        for (const BodyParts& body : bodies_)
            orders.push_back(by_id(state, body.id));
        std::map<Index<2>, std::size_t> nodes;
        if (has_nodes_)
            for (std::size_t k = 0; k < state.parts[node_i_].count; ++k)
                nodes.emplace(node(state, k), k);
        std::vector<std::optional<std::size_t>> found;
        for (const Place& p : places_)
            if (!p.node)
                found.emplace_back(state.parts[p.part].begin + orders[p.body][p.number]);
            else if (const auto n = nodes.find(*p.node + shift); n != nodes.end())
                found.emplace_back(state.parts[p.part].begin + n->second);
            else
                found.emplace_back();
        return found;
    }

    /// Mean motion of all points from one state to another [cells].
    Index<2> motion(const State& from, const State& to, double cell_size) const
    {
        Vec<2> sum{0, 0};
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
        std::optional<Index<2>> node;
        Quantity quantity;
        Vec<2> at;
    };

    Index<2> node(const State& s, std::size_t k) const { return {static_cast<int>(s.of(node_i_)[k]), static_cast<int>(s.of(node_j_)[k])}; }
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

/// Derivative with respect to one unknown by differences of both sides.
struct Slope
{
    Eigen::VectorXd value;
    bool has_kink;
};

/// The steps of a solver from a state and from those beside it, as vectors of the unknowns over their scales.
class StepsAbout
{
public:
    StepsAbout(Solver& solver, const State& about, const Lattice<2>& lattice, const StepSettings& settings)
        : solver_(solver),
          settings_(settings),
          base_(with_all_marked(about, solver.bodies())),
          changed_(base_),
          places_(solver, base_),
          at_(places_.find(base_))
    {
        const StateScales scales = state_scales(solver.bodies(), lattice.cell_size);
        for (std::size_t n = 0; n < places_.count(); ++n)
            unknowns_.push_back(places_.unknown(n, base_, scales, lattice));
        const State end = after(base_);
        if (settings.steps > 1)
            shift_ = places_.motion(base_, end, scales.length);
        middle_ = values(end);
    }

    const std::vector<Unknown>& unknowns() const { return unknowns_; }
    Eigen::Index count() const { return static_cast<Eigen::Index>(unknowns_.size()); }

    /// With respect to unknown n.
    Slope slope(Eigen::Index n, double difference)
    {
        double& number = number_of(changed_, n);
        const double value = number, scale = scale_of(n);
        const double high = value + difference * scale, low = value - difference * scale;
        number = high;
        const Eigen::VectorXd up = values(after(changed_));
        number = low;
        const Eigen::VectorXd down = values(after(changed_));
        number = value;
        return {(up - down) * (scale / (high - low)), (up - 2 * middle_ + down).norm() > kink * difference};
    }

    /// Derivative along a direction: all unknowns changed at once.
    Eigen::VectorXd slope_along(const Eigen::VectorXd& direction, double difference)
    {
        const auto towards = [&](double length)
        {
            State all = base_;
            for (Eigen::Index n = 0; n < count(); ++n)
                number_of(all, n) += length * direction[n] * scale_of(n);
            return values(after(all));
        };
        return (towards(difference) - towards(-difference)) / (2 * difference);
    }

private:
    double& number_of(State& state, Eigen::Index n) const { return state.numbers[*at_[static_cast<std::size_t>(n)]]; }
    double scale_of(Eigen::Index n) const { return unknowns_[static_cast<std::size_t>(n)].scale; }

    State after(const State& start)
    {
        restore(solver_, start);
        solver_.assume_last_step(settings_.dt);
        for (int k = 0; k < settings_.steps; ++k)
        {
            solver_.prepare(settings_.t + k * settings_.dt, settings_.dt);
            solver_.advance(settings_.dt);
        }
        return state_of(solver_);
    }
    Eigen::VectorXd values(const State& state) const
    {
        const auto found = places_.find(state, shift_);
        Eigen::VectorXd values(count());
        for (Eigen::Index n = 0; n < count(); ++n)
        {
            const auto& place = found[static_cast<std::size_t>(n)];
            values[n] = place ? state.numbers[*place] / scale_of(n) : 0;
        }
        return values;
    }

    Solver& solver_;
    const StepSettings settings_;
    State base_, changed_;  ///< changed: but for one number the same
    Places places_;
    std::vector<std::optional<std::size_t>> at_;  ///< numbers of the unknowns in the base
    std::vector<Unknown> unknowns_;
    Index<2> shift_{0, 0};    ///< of the body in the steps [cells]
    Eigen::VectorXd middle_;  ///< after the steps from the base
};

/// See OneStepMap::excess, largest of some directions.
double excess(StepsAbout& steps, const Eigen::MatrixXd& matrix, double difference)
{
    std::mt19937 random(1);
    double largest = 0;
    for (int k = 0; k < 4; ++k)
    {
        Eigen::VectorXd signs(steps.count());
        for (double& sign : signs)
            sign = random() % 2 == 0 ? 1 : -1;
        const Eigen::VectorXd together = steps.slope_along(signs, difference);
        const Eigen::VectorXd sum = matrix * signs;
        largest = std::max(largest, (together - sum).norm() / (sum - signs).norm());
    }
    return largest;
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

OneStepMap one_step_map(Solver& solver, const State& about, const Lattice<2>& lattice, const StepSettings& settings)
{
    StepsAbout steps(solver, about, lattice, settings);
    OneStepMap map;
    map.unknowns = steps.unknowns();
    map.matrix.resize(steps.count(), steps.count());
    for (Eigen::Index n = 0; n < steps.count(); ++n)
    {
        // upwind terms are of the form v |v|: the error is of first order, and the two differences are extrapolated to none
        const Slope coarse = steps.slope(n, settings.difference), fine = steps.slope(n, settings.difference / 2);
        map.matrix.col(n) = 2 * fine.value - coarse.value;
        map.kinks += coarse.has_kink || fine.has_kink;
    }
    map.excess = excess(steps, map.matrix, settings.difference);
    return map;
}
}  // namespace testbed
