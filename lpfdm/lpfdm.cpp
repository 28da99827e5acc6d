#include "lpfdm/lpfdm.hpp"

#include "core/body_force.hpp"
#include "core/gather.hpp"
#include "core/node_ops.hpp"
#include "core/support.hpp"
#include "lpfdm/convection.hpp"

#include <atomic>
#include <cmath>

namespace testbed
{
namespace
{
template <class Support>
class Lpfdm final : public Solver
{
public:
    explicit Lpfdm(const Scene& scene)
        : lattice_(make_lattice(scene.grid)),
          near_(lattice_),
          bodies_(make_bodies(scene, lattice_, {.box = Support::has_box, .initial_position = scene.body_force.has_value()})),
          node_ops_(make_node_ops(scene, lattice_)),
          cells_(lattice_.cells()),
          nodes_(lattice_.nodes()),
          was_active_(lattice_.nodes(), 0),
          gather_(lattice_.cells()),
          options_(scene.lpfdm)
    {
        if (scene.body_force)
        {
            cell_force_.resize(lattice_.cells());
            body_force_.emplace(*scene.body_force, scene.expression_constants());
        }
        if (options_.hourglass > 0)
            hourglass_.resize(lattice_.cells());
        for (const Body& body : bodies_)
            wave_speed_ = std::max(wave_speed_, std::sqrt(moduli(body.material).constrained() * body.points.initial_volume / body.points.mass));
        rebuild();
        sum_points();
        set_initial_velocity(scene);
    }

    void prepare(double t, double dt) override
    {
        timer_("bins", [&] { if (moved_) rebuild(); });
        timer_("cell averages (7)(8)", [&] { sum_points(); });
        timer_("nodal forces (9)(10)", [&] { nodal_forces(); });
        timer_("convection (13)", [&] {
            extend_to_frontier();
            convect_velocity(dt);
            node_ops_.apply_fixities(nodes_.vx, nodes_.vy);
        });
        if (!hourglass_.empty())
            timer_("hourglass", [&] { resist_hourglass(); });
        internal_ = force_norm(nodes_);
        timer_("node operations (11)(15)", [&] {
            if (body_force_)
                add_body_force(t);
            node_ops_.apply_forces(nodes_, t);
            node_ops_.apply_fixities(nodes_.fx, nodes_.fy);
        });
        lag_ = started_ ? 0.5 * dt : 0;
    }

    void advance(double dt) override
    {
        // the given initial velocity is that of t = 0: the first kick is half a step
        timer_("acceleration (12)(14)", [&] {
            accelerate(nodes_, started_ ? dt : 0.5 * dt);
            node_ops_.apply_fixities(nodes_.vx, nodes_.vy);
        });
        started_ = true;
        timer_("cell strain (5)", [&] { cell_gradients(dt); });
        timer_("points (6), material", [&] { move_points(dt); });
    }

    MotionSums sums() const override { return nodal_sums(lattice_, nodes_, lag_, internal_); }

    const std::vector<Body>& bodies() const override { return bodies_; }

    /// Bilinear, as eq. (6) moves the point.
    Vec2 velocity(std::size_t body, std::size_t p) const override
    {
        const Points& q = bodies_[body].points;
        const double cx = (q.x[p] - lattice_.origin[0]) / lattice_.cell_size, cy = (q.y[p] - lattice_.origin[1]) / lattice_.cell_size;
        if (!(cx >= 0 && cx < lattice_.nx && cy >= 0 && cy < lattice_.ny))
            return {0, 0};
        const int i = static_cast<int>(cx), j = static_cast<int>(cy);
        const double a = cx - i, b = cy - j;
        Vec2 v{0, 0};
        for (int k = 0; k < 4; ++k)
        {
            const std::size_t n = near_.corner(lattice_.node(i, j), k);
            const double w = ((k & 1) ? a : 1 - a) * ((k & 2) ? b : 1 - b);
            v[0] += w * nodes_.vx[n];
            v[1] += w * nodes_.vy[n];
        }
        return v;
    }

    std::size_t unknowns() const override { return 2 * nodes_with_mass(nodes_); }
    std::size_t active_cells() const override { return gather_.active().size(); }
    std::size_t bytes() override
    {
        return bytes_of(bodies_) + cells_.bytes() + nodes_.bytes() + gather_.bytes() + was_active_.capacity() +
               workspace_.capacity() * sizeof(double) + (hourglass_.capacity() + cell_force_.capacity()) * sizeof(Vec2) +
               (first_cell_.capacity() + left_.capacity()) * sizeof(std::uint32_t) + (body_force_ ? body_force_->bytes() : 0);
    }
    const PhaseTimer& timer() const override { return timer_; }
    const char* kinematics() const override { return "hypoelastic"; }

private:
    static constexpr int S = Support::S;

    /// Points changed their cells: sorts them, finds the cells and nodes in use and the nodes reached for the first time.
    void rebuild()
    {
        std::vector<const Bins*> bins;
        for (Body& body : bodies_)
        {
            body.bins.template rebuild<Support::has_box>(body.points, workspace_);
            bins.push_back(&body.bins);
        }
        for (const auto c : gather_.active())
            cells_.clear(c);
        gather_.rebuild<S>(bins, [&](int i, int j) { return lattice_.cell(i, j); });
        make_room(workspace_, gather_.blocks() * 4);
        find_active_nodes();
        moved_ = false;
    }

    void find_active_nodes()
    {
        const std::vector<std::uint32_t> before = std::move(nodes_.active);
        nodes_.active = {};
        for (const auto c : gather_.active())
            for (int k = 0; k < 4; ++k)
                nodes_.active.push_back(static_cast<std::uint32_t>(near_.corner(lattice_.node(lattice_.cell_i(c), lattice_.cell_j(c)), k)));
        std::sort(nodes_.active.begin(), nodes_.active.end());
        nodes_.active.erase(std::unique(nodes_.active.begin(), nodes_.active.end()), nodes_.active.end());
        nodes_.active.shrink_to_fit();
        std::set_difference(before.begin(), before.end(), nodes_.active.begin(), nodes_.active.end(), std::back_inserter(left_));
        first_cell_.resize(nodes_.active.size());
        for (std::size_t a = 0; a < nodes_.active.size(); ++a)
            first_cell_[a] = static_cast<std::uint32_t>(lattice_.cell(lattice_.node_i(nodes_.active[a]), lattice_.node_j(nodes_.active[a])));
    }

    /// Eqs. (7), (8): mass and smeared stress of each cell.
    void sum_points()
    {
        std::size_t first_bin = 0;
        for (const Body& body : bodies_)
        {
            const Points& q = body.points;
            spread<Support, 4>(lattice_, body, first_bin, workspace_, [&](std::size_t p, const auto& lanes) {
                const Pack v = volume<Support>(q, p, lanes);
                return std::array<Pack, 4>{Pack(q.mass), v * lanes.load(&q.sxx[p]), v * lanes.load(&q.syy[p]), v * lanes.load(&q.sxy[p])};
            });
            first_bin += body.bins.list().size();
        }
        const double area = lattice_.cell_size * lattice_.cell_size;
        gather_.sum<4>(workspace_, [&](std::size_t c, const std::array<double, 4>& s) {
            cells_.mass[c] = s[0];
            cells_.stress[c] = {s[1] / area, s[2] / area, s[3] / area};
        });
    }

    /// Eqs. (9), (10): a quarter of the mass of the cells around a node, and their forces. Empty cells add nothing.
    void nodal_forces()
    {
        const double half_side = 0.5 * lattice_.cell_size;
        for_each_node([&](std::size_t i, std::size_t first_cell) {
            double mass = 0;
            Vec2 force{0, 0};
            for (int k = 0; k < 4; ++k)
            {
                const std::size_t c = near_.around(first_cell, k);
                const Vec2 f = square_force(k, cells_.stress[c], half_side);
                mass += cells_.mass[c];
                force[0] += f[0];
                force[1] += f[1];
            }
            nodes_.mass[i] = 0.25 * mass;
            nodes_.fx[i] = force[0];
            nodes_.fy[i] = force[1];
        });
    }

    /// Nodes that material reaches for the first time take the mass-weighted mean velocity of their neighbours that were
    /// active before (or start from zero, as printed); nodes that it left are cleared.
    void extend_to_frontier()
    {
        std::vector<std::pair<std::uint32_t, Vec2>> reached;
        for (const auto n : nodes_.active)
            if (nodes_.mass[n] > 0 && !was_active_[n])
                reached.emplace_back(n, started_ && options_.frontier == "extrapolate" ? mean_of_neighbours(n) : Vec2{0, 0});
        for (const auto& [n, v] : reached)
            if (started_)
            {
                nodes_.vx[n] = v[0];
                nodes_.vy[n] = v[1];
            }
        for (const auto n : left_)
            nodes_.mass[n] = nodes_.fx[n] = nodes_.fy[n] = 0;
        const auto update = [&](std::uint32_t n) {
            was_active_[n] = nodes_.mass[n] > 0;
            if (!was_active_[n])
                nodes_.vx[n] = nodes_.vy[n] = 0;
        };
        std::for_each(nodes_.active.begin(), nodes_.active.end(), update);
        std::for_each(left_.begin(), left_.end(), update);
        left_.clear();
    }

    Vec2 mean_of_neighbours(std::uint32_t node) const
    {
        double mass = 0;
        Vec2 momentum{0, 0};
        const int i = lattice_.node_i(node), j = lattice_.node_j(node);
        for (int dj = -1; dj <= 1; ++dj)
            for (int di = -1; di <= 1; ++di)
            {
                if (i + di < -1 || i + di > lattice_.nx + 1 || j + dj < -1 || j + dj > lattice_.ny + 1)
                    continue;
                const std::size_t n = lattice_.node(i + di, j + dj);
                if (!was_active_[n])
                    continue;
                mass += nodes_.mass[n];
                momentum[0] += nodes_.mass[n] * nodes_.vx[n];
                momentum[1] += nodes_.mass[n] * nodes_.vy[n];
            }
        return mass > 0 ? Vec2{momentum[0] / mass, momentum[1] / mass} : Vec2{0, 0};
    }

    /// Eq. (13).
    void convect_velocity(double dt)
    {
        if (options_.convection == "none" || !started_)
            return;
        cell_gradients(dt);
        const double courant = dt / lattice_.cell_size;
        const auto run = [&](auto scheme) {
            for_each_node([&](std::size_t i, std::size_t first_cell) {
                convect<decltype(scheme)>(cells_, near_, first_cell, courant, nodes_.vx[i], nodes_.vy[i]);
            });
        };
        if (options_.convection == "upwind")
            run(UpwindConvection{});
        else
            run(CentralConvection{});
    }

    /// Viscous force against the pattern (+1, -1, -1, +1), which no gradient sees and no linear field contains.
    void resist_hourglass()
    {
        const double rate = options_.hourglass * wave_speed_ / lattice_.cell_size;
        for_each_cell([&](std::size_t c) {
            double ux[4], uy[4];
            corner_velocities(c, ux, uy);
            const double f = -0.25 * rate * cells_.mass[c];
            hourglass_[c] = {f * (ux[0] - ux[1] - ux[2] + ux[3]), f * (uy[0] - uy[1] - uy[2] + uy[3])};
        });
        for_each_node([&](std::size_t i, std::size_t first_cell) {
            for (int k = 0; k < 4; ++k)
            {
                const std::size_t c = near_.around(first_cell, k);
                if (cells_.mass[c] == 0)
                    continue;
                const double sign = (k == 0 || k == 3) ? 1 : -1;
                nodes_.fx[i] += sign * hourglass_[c][0];
                nodes_.fy[i] += sign * hourglass_[c][1];
            }
        });
    }

    void add_body_force(double t)
    {
        body_force_->template apply<Support>(lattice_, bodies_, gather_, t,
                                             [&](std::size_t c, const std::array<double, 2>& f) { cell_force_[c] = f; });
        for_each_node([&](std::size_t i, std::size_t first_cell) {
            for (int k = 0; k < 4; ++k)
                if (const std::size_t c = near_.around(first_cell, k); cells_.mass[c] > 0)
                {
                    nodes_.fx[i] += 0.25 * cell_force_[c][0];
                    nodes_.fy[i] += 0.25 * cell_force_[c][1];
                }
        });
    }

    /// Eqs. (5a)-(5d): gradient of the increment over dt.
    void cell_gradients(double dt)
    {
        const double scale = dt / (2 * lattice_.cell_size);
        for_each_cell([&](std::size_t c) {
            double ux[4], uy[4];
            corner_velocities(c, ux, uy);
            cells_.gradient[c] = square_gradient(ux, uy, scale);
        });
    }

    /// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6).
    void move_points(double dt)
    {
        std::atomic<bool> moved{false};
        for (Body& body : bodies_)
            std::visit([&](const auto& law) { moved = move_points(body, law, dt) || moved; }, body.material);
        moved_ = moved;
    }

    template <class Law>
    bool move_points(Body& body, const Law& law, double dt)
    {
        Points& q = body.points;
        const auto& bins = body.bins.list();
        std::atomic<bool> moved{false};
        parallel_for(bins.size(), [&](std::size_t b) {
            const BinFrame frame(lattice_, bins[b]);
            const BinMotion motion(*this, bins[b], dt);
            bool left = false;
            for_each_pack(bins[b].begin, bins[b].end, [&](std::size_t p, const auto& lanes) {
                Pack x = lanes.load(&q.x[p]), y = lanes.load(&q.y[p]);
                const Corner c = frame.corner<Support>(q, p, lanes, x, y);
                const Gradient<Pack> d = motion.gradient(c);
                motion.displace(c, x, y);
                law.update(q, p, lanes, d);
                stretch<Support>(q, p, lanes, d);
                lanes.store(&q.x[p], x);
                lanes.store(&q.y[p], y);
                left |= frame.left<Support>(q, p, lanes, x, y);
            });
            if (left)
                moved.store(true, std::memory_order_relaxed);
        });
        return moved;
    }

    /// What is constant in a bin: the gradients of its S x S cells and the increments of its (S+1) x (S+1) nodes.
    struct BinMotion
    {
        std::array<Gradient<>, S * S> cell;
        std::array<double, (S + 1) * (S + 1)> ux, uy;

        BinMotion(const Lpfdm& solver, const Bin& bin, double dt)
        {
            for (int j = 0; j < S; ++j)
                for (int i = 0; i < S; ++i)
                    cell[j * S + i] = solver.cells_.gradient[solver.lattice_.cell(bin.i + i, bin.j + j)];
            for (int j = 0; j <= S; ++j)
                for (int i = 0; i <= S; ++i)
                {
                    const std::size_t n = solver.lattice_.node(bin.i + i, bin.j + j);
                    ux[j * (S + 1) + i] = solver.nodes_.vx[n] * dt;
                    uy[j * (S + 1) + i] = solver.nodes_.vy[n] * dt;
                }
        }
        Gradient<Pack> gradient(const Corner& c) const
        {
            const auto wx = Support::weights(c.ax, c.wx), wy = Support::weights(c.ay, c.wy);
            Gradient<Pack> d{Pack(0.0), Pack(0.0), Pack(0.0), Pack(0.0)};
            for (int j = 0; j < S; ++j)
                for (int i = 0; i < S; ++i)
                {
                    const Pack w = wx[i] * wy[j];
                    const Gradient<>& g = cell[j * S + i];
                    d = d + Gradient<Pack>{w * Pack(g.xx), w * Pack(g.yy), w * Pack(g.xy), w * Pack(g.yx)};
                }
            return d;
        }
        void displace(const Corner& c, Pack& x, Pack& y) const
        {
            const auto wx = hat(c.ax + Pack(0.5) * c.wx), wy = hat(c.ay + Pack(0.5) * c.wy);
            for (int j = 0; j <= S; ++j)
            {
                Pack rx(0.0), ry(0.0);
                for (int i = 0; i <= S; ++i)
                {
                    rx += wx[i] * Pack(ux[j * (S + 1) + i]);
                    ry += wx[i] * Pack(uy[j * (S + 1) + i]);
                }
                x += wy[j] * rx;
                y += wy[j] * ry;
            }
        }
        /// Bilinear weights of the nodes 0..S at xi in [0, S).
        static std::array<Pack, S + 1> hat(Pack xi)
        {
            if constexpr (S == 1)
                return {Pack(1.0) - xi, xi};
            else
            {
                const Pack low = max(Pack(1.0) - xi, Pack(0.0)), high = max(xi - Pack(1.0), Pack(0.0));
                return {low, Pack(1.0) - low - high, high};
            }
        }
    };

    template <class F>
    void for_each_cell(F&& f) const
    {
        parallel_for(gather_.active().size(), [&](std::size_t a) { f(gather_.active()[a]); });
    }
    template <class F>
    void for_each_node(F&& f) const
    {
        parallel_for(nodes_.active.size(), [&](std::size_t a) { f(nodes_.active[a], first_cell_[a]); });
    }
    void corner_velocities(std::size_t c, double (&ux)[4], double (&uy)[4]) const
    {
        const std::size_t first = lattice_.node(lattice_.cell_i(c), lattice_.cell_j(c));
        for (int k = 0; k < 4; ++k)
        {
            ux[k] = nodes_.vx[near_.corner(first, k)];
            uy[k] = nodes_.vy[near_.corner(first, k)];
        }
    }
    /// Nodes start with the bodies' velocity at their own position, weighted by the mass that each body gives them.
    void set_initial_velocity(const Scene& scene)
    {
        std::vector<double> mass(lattice_.nodes(), 0.0);
        std::size_t block = 0;
        for (std::size_t b = 0; b < bodies_.size(); ++b)
        {
            std::optional<VectorExpression> velocity;
            if (scene.bodies[b].velocity)
                velocity.emplace(*scene.bodies[b].velocity, scene.expression_constants());
            for (const Bin& bin : bodies_[b].bins.list())
                for (int k = 0; k < S * S; ++k, ++block)
                    for (int corner = 0; corner < 4; ++corner)
                    {
                        const std::size_t n = near_.corner(lattice_.node(bin.i + k % S, bin.j + k / S), corner);
                        const Vec2 x = lattice_.node_position(n);
                        const double m = 0.25 * workspace_[block * 4];
                        mass[n] += m;
                        if (!velocity)
                            continue;
                        const Vec2 v = (*velocity)({x[0], x[1], x[0], x[1], 0});
                        nodes_.vx[n] += m * v[0];
                        nodes_.vy[n] += m * v[1];
                    }
        }
        for (const auto n : nodes_.active)
            if (mass[n] > 0)
            {
                nodes_.vx[n] /= mass[n];
                nodes_.vy[n] /= mass[n];
            }
    }

    Lattice lattice_;
    Neighbours near_;
    std::vector<Body> bodies_;
    NodeOps node_ops_;
    Cells cells_;
    Nodes nodes_;
    std::vector<char> was_active_;
    std::vector<std::uint32_t> first_cell_, left_;
    Gather gather_;
    LpfdmSpec options_;
    std::vector<double> workspace_;  ///< sums of bins, and the way of a field to its new order
    std::vector<Vec2> hourglass_, cell_force_;  ///< empty unless the scene has them
    std::optional<BodyForce> body_force_;
    PhaseTimer timer_;
    double wave_speed_ = 0, internal_ = 0, lag_ = 0;
    bool moved_ = false, started_ = false;
};
}  // namespace

std::unique_ptr<Solver> make_lpfdm(const Scene& scene)
{
    if (scene.lpfdm.support == "point")
        return std::make_unique<Lpfdm<PointSupport>>(scene);
    return std::make_unique<Lpfdm<DomainSupport>>(scene);
}
}  // namespace testbed
