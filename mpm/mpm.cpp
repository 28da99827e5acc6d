#include "mpm/mpm.hpp"

#include "core/body_force.hpp"
#include "core/density_scaling.hpp"
#include "core/gather.hpp"
#include "core/nonlocal.hpp"
#include "core/tractions.hpp"
#include "mpm/edges.hpp"
#include "mpm/time_step.hpp"
#include "mpm/transfer.hpp"

#include <atomic>
#include <cmath>

namespace testbed
{
namespace
{
template <class Shape, class Strain>
class Mpm final : public Solver
{
public:
    explicit Mpm(const Scene& scene)
        : lattice_(without_numbers(make_lattice(scene.grid))),
          bodies_(make_bodies(scene, make_lattice(scene.grid),
                              {.box = Shape::has_box, .velocity = true, .initial_position = scene.body_force.has_value()})),
          node_ops_(scene, make_lattice(scene.grid)),
          nodes_(lattice_.nodes()),
          gather_(lattice_.nodes()),
          options_(scene.mpm)
    {
        if (scene.body_force)
            body_force_.emplace(*scene.body_force, scene.expression_constants());
        if (!scene.tractions.empty())
            tractions_.emplace(scene);
        if (has_nonlocal_softening(scene))
            nonlocal_.emplace(scene, lattice_.cell_size);
        if (scene.time.density_scaling)
            weight_.emplace();
        if (scene.damping)
            damping_ = scene.damping->local;
        rebuild();
    }

    void do_prepare(const Step& step) override
    {
        const auto [t, dt, last_dt] = step;
        node_ops_.begin_step(t, dt);
        timer_("bins",
               [&]
               {
                   if (moved_)
                       rebuild();
               });
        if (nonlocal_)
            timer_("nonlocal strain", [&]
                   { nonlocal_->template apply<Shape>(lattice_, bodies_, gather_, [&](int i, int j) { return lattice_.node(i, j); }); });
        if (options_.scheme == "usf")
        {
            timer_("points to nodes",
                   [&]
                   {
                       points_to_nodes<Scatter::momentum>();
                       restrain_mapped_velocity();
                   });
            if (started_)
                timer_("stress", [&] { update_stress(step.last_dt); });
            timer_("points to nodes", [&] { points_to_nodes<Scatter::force>(); });
        }
        else
            timer_("points to nodes",
                   [&]
                   {
                       to_nodes<Scatter::momentum_and_force>(sums_.all());
                       restrain_mapped_velocity();
                   });
        fold_forces();
        internal_ = force_norm(nodes_);
        timer_("node operations",
               [&]
               {
                   if (body_force_)
                       body_force_->template apply<Shape>(lattice_, bodies_, gather_, step.t,
                                                          [&](std::size_t n, const std::array<double, 2>& f)
                                                          {
                                                              nodes_.fx[n] += f[0];
                                                              nodes_.fy[n] += f[1];
                                                          });
                   fold_forces();
                   if (tractions_)
                       tractions_->apply(lattice_, bodies_, nodes_, step.t);
                   if (weight_)
                       find_weight();
                   node_ops_.apply_forces(lattice_, nodes_, weight_ ? weight_->nodes : nodes_.mass, step.t);
               });
        lag_ = 0.5 * last_dt;
    }

    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        timer_("acceleration", [&] { accelerate_and_keep_increment(step.kick()); });
        started_ = true;
        const bool remap = options_.scheme == "musl";
        timer_("nodes to points", [&] { update_velocity(remap); });
        if (remap)
        {
            timer_("remap velocity",
                   [&]
                   {
                       keep_velocity(carrier_x_, carrier_y_);
                       to_nodes<Scatter::momentum>(workspace_);
                       node_ops_.restrain(lattice_, nodes_, nodes_.vx, nodes_.vy);
                       extend(nodes_.vx, nodes_.vy);
                   });
            timer_("points, material", [&] { move_points<true>(carrier_x_, carrier_y_, dt); });
        }
        else if (options_.scheme == "usl")
            timer_("points, material", [&] { move_points<true>(nodes_.vx, nodes_.vy, dt); });
        else
            timer_("points", [&] { move_points<false>(nodes_.vx, nodes_.vy, dt); });
        node_ops_.end_step(dt);
    }

    MotionSums sums() const override { return nodal_sums(lattice_, nodes_, lag_, internal_); }
    const std::vector<Body>& bodies() const override { return bodies_; }
    Vec2 velocity(std::size_t body, std::size_t p) const override { return {bodies_[body].points.vx[p], bodies_[body].points.vy[p]}; }
    std::size_t unknowns() const override { return 2 * nodes_with_mass(nodes_); }
    std::size_t active_cells() const override
    {
        std::size_t n = 0;
        for (const Body& body : bodies_)
            n += body.bins.list().size();
        return n;
    }
    std::size_t bytes() const override
    {
        return bytes_of(bodies_) + nodes_.bytes() + gather_.bytes() + edges_.bytes() + sums_.bytes() +
               (workspace_.capacity() + carrier_x_.capacity() + carrier_y_.capacity() + mapped_x_.capacity() + mapped_y_.capacity()) *
                   sizeof(double) +
               (body_force_ ? body_force_->bytes() : 0) + (nonlocal_ ? nonlocal_->bytes() : 0) + (weight_ ? weight_->bytes() : 0);
    }
    const PhaseTimer& timer() const override { return timer_; }
    std::vector<RestraintRecord> restraints() const override { return node_ops_.records(); }
    const char* kinematics() const override { return "hypoelastic"; }
    std::vector<StepLimit> step_limits() override
    {
        if (std::exchange(moved_, false))
            rebuild();
        return mpm_step_limits<Shape>(lattice_, bodies_, options_, damping_);
    }
    std::optional<double> sharp_step_limit() override
    {
        ElementSystem elements = mpm_elements<Shape, Strain>(lattice_, bodies_);
        fix(elements, node_ops_.restraints(), lattice_);
        return mpm_sharp_limit(elements, options_, damping_);
    }

private:
    static constexpr int S = Shape::S;
    static constexpr bool reaches_beyond = std::is_same_v<Shape, BSplineShape>;  ///< the lattice's edge

    void rebuild()
    {
        std::vector<const Bins*> bins;
        bool other_bins = false;
        for (Body& body : bodies_)
        {
            other_bins |= body.bins.template rebuild<Shape>(body.points, workspace_);
            bins.push_back(&body.bins);
        }
        if (other_bins)
        {
            if (const Lattice lattice = with_numbers_for<S>(lattice_, bins); lattice.numbered != lattice_.numbered)
                renumber(lattice);
            gather_.rebuild<S>(bins, [&](int i, int j) { return lattice_.node(i, j); });
            for (const auto n : nodes_.active())  // what is left must not be taken for soil
                nodes_.mass[n] = nodes_.vx[n] = nodes_.vy[n] = nodes_.fx[n] = nodes_.fy[n] = 0;
            nodes_.set_active(gather_.active());
            if constexpr (reaches_beyond)
                edges_.rebuild(lattice_, nodes_.active());
        }
        if (options_.scheme != "usf")
            other_bins ? sums_.update(lattice_, bodies_) : sums_.update_changed(lattice_, bodies_);
        moved_ = false;
    }

    /// The masses of the nodes that have weight.
    void find_weight()
    {
        weight_->nodes.assign(nodes_.mass.size(), 0.0);
        const auto take = [&](std::size_t n, double mass) { weight_->nodes[n] = mass; };
        if (options_.scheme == "usf")
        {
            points_to_nodes<Scatter::momentum>();  // the nodes' velocity is what it was: forces have not moved a point
            restrain_mapped_velocity();
            weight_->collect<sums_of<Scatter::momentum>>(bodies_, gather_, workspace_, S * S, take);
        }
        else
            weight_->collect<sums_of<Scatter::momentum_and_force>>(bodies_, gather_, sums_.all(), S * S, take);
        if constexpr (reaches_beyond)
            edges_.fold_mass(weight_->nodes);
    }

    void renumber(const Lattice& to)
    {
        nodes_.renumber(lattice_, to);
        gather_ = Gather(to.nodes());
        if (nonlocal_)
            nonlocal_->resize(to.node_stride(), to.nodes());
        lattice_ = to;
    }

    /// Mass, velocity and internal force of the nodes, or a part of them, from the points.
    template <Scatter what>
    void points_to_nodes()
    {
        make_room(workspace_, gather_.blocks() * sums_of<what>);
        std::size_t first_bin = 0;
        for (const Body& body : bodies_)
        {
            scatter<Shape, Strain, what>(lattice_, body, first_bin, workspace_);
            first_bin += body.bins.list().size();
        }
        to_nodes<what>(workspace_);
    }
    /// The same from the sums of all bins.
    template <Scatter what>
    void to_nodes(const std::vector<double>& sums)
    {
        constexpr std::size_t Q = sums_of<what>;
        gather_.sum<Q>(sums,
                       [&](std::size_t i, const std::array<double, Q>& s)
                       {
                           if constexpr (what != Scatter::force)
                           {
                               nodes_.mass[i] = s[0];
                               nodes_.vx[i] = s[1];
                               nodes_.vy[i] = s[2];
                               if constexpr (!reaches_beyond)
                                   to_velocity(i);
                           }
                           if constexpr (what != Scatter::momentum)
                           {
                               nodes_.fx[i] = s[Q - 2];
                               nodes_.fy[i] = s[Q - 1];
                           }
                       });
        if constexpr (reaches_beyond && what != Scatter::force)
        {
            edges_.fold_mass(nodes_.mass);
            edges_.fold(nodes_.vx);
            edges_.fold(nodes_.vy);
            parallel_for(nodes_.active().size(), [&](std::size_t a) { to_velocity(nodes_.active()[a]); });
        }
    }
    void to_velocity(std::size_t i)
    {
        const double inverse = inverse_mass(nodes_, i);
        nodes_.vx[i] *= inverse;
        nodes_.vy[i] *= inverse;
    }
    void fold_forces()
    {
        if constexpr (reaches_beyond)
        {
            edges_.fold(nodes_.fx);
            edges_.fold(nodes_.fy);
        }
    }
    /// Values beyond the edge of the lattice, where the shapes reach there.
    void extend(std::vector<double>& x, std::vector<double>& y)
    {
        if constexpr (reaches_beyond)
        {
            edges_.extend(x);
            edges_.extend(y);
        }
    }

    /// Supports and walls prescribe the velocity; the mapped one is kept, because the points feel the difference.
    void restrain_mapped_velocity()
    {
        if (!node_ops_.restrains())
            return extend(nodes_.vx, nodes_.vy);
        keep_velocity(mapped_x_, mapped_y_);
        node_ops_.restrain(lattice_, nodes_, nodes_.vx, nodes_.vy);
        extend(nodes_.vx, nodes_.vy);
    }

    /// Copies the velocity of the nodes in use.
    void keep_velocity(std::vector<double>& x, std::vector<double>& y)
    {
        x.resize(nodes_.vx.size());
        y.resize(nodes_.vy.size());
        nodes_.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                lanes.store(&x[i], lanes.load(&nodes_.vx[i]));
                lanes.store(&y[i], lanes.load(&nodes_.vy[i]));
            });
    }

    /// v += F / m dt; from here on the force holds the increment of the velocity.
    void accelerate_and_keep_increment(double dt)
    {
        accelerate(nodes_, dt);
        node_ops_.restrain(lattice_, nodes_, nodes_.vx, nodes_.vy);
        if (node_ops_.restrains())
            nodes_.for_each(
                [&](std::size_t i, const auto& lanes)
                {
                    lanes.store(&nodes_.fx[i], lanes.load(&nodes_.vx[i]) - lanes.load(&mapped_x_[i]));
                    lanes.store(&nodes_.fy[i], lanes.load(&nodes_.vy[i]) - lanes.load(&mapped_y_[i]));
                });
        else
            nodes_.for_each(
                [&](std::size_t i, const auto& lanes)
                {
                    const Pack step = inverse_mass(nodes_, i, lanes) * Pack(dt);
                    lanes.store(&nodes_.fx[i], lanes.load(&nodes_.fx[i]) * step);
                    lanes.store(&nodes_.fy[i], lanes.load(&nodes_.fy[i]) * step);
                });
        extend(nodes_.vx, nodes_.vy);
        extend(nodes_.fx, nodes_.fy);
    }

    /// kernel(body, law, bin, number of the bin among all, frame) for every bin of every body.
    template <class Kernel>
    void for_each_bin(Kernel&& kernel)
    {
        std::size_t first_bin = 0;
        for (Body& body : bodies_)
        {
            const auto& bins = body.bins.list();
            std::visit(
                [&](const auto& law) {
                    parallel_for(bins.size(),
                                 [&](std::size_t b) { kernel(body, law, bins[b], first_bin + b, BinFrame(lattice_, bins[b])); });
                },
                body.material);
            first_bin += bins.size();
        }
    }

    void update_velocity(bool remap)
    {
        if (remap)
            make_room(workspace_, gather_.blocks() * sums_of<Scatter::momentum>);
        if (options_.flip < 1)
            remap ? update_velocity<true, true>() : update_velocity<true, false>();
        else
            remap ? update_velocity<false, true>() : update_velocity<false, false>();
    }
    /// v_p = flip (v_p + sum N dv) + (1 - flip) sum N v; and the sums of the new momentum, if nodes ask for them.
    template <bool with_pic, bool with_remap>
    void update_velocity()
    {
        using Momentum = NodeSums<Shape, Strain, Scatter::momentum>;
        const Pack flip(options_.flip), pic(1 - options_.flip);
        for_each_bin(
            [&](Body& body, const auto&, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
            {
                Points& q = body.points;
                const NodalVelocity<S> increment(lattice_, bin, nodes_.fx, nodes_.fy), total(lattice_, bin, nodes_.vx, nodes_.vy);
                for_each_pack(bin.begin, bin.end,
                              [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                              {
                                  const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                  const auto dv = increment.at(at);
                                  Pack vx = lanes.load(&q.vx[p]) + dv[0], vy = lanes.load(&q.vy[p]) + dv[1];
                                  if constexpr (with_pic)
                                  {
                                      const auto v = total.at(at);
                                      vx = flip * vx + pic * v[0];
                                      vy = flip * vy + pic * v[1];
                                  }
                                  lanes.store(&q.vx[p], vx);
                                  lanes.store(&q.vy[p], vy);
                              });
                if constexpr (with_remap)
                    sum_bin<Shape, Momentum>(lattice_, body, bin, &workspace_[number * Momentum::numbers]);
            });
    }

    /// Stress alone, with the nodal velocity (USF).
    void update_stress(double dt)
    {
        for_each_bin(
            [&](Body& body, const auto& law, const Bin& bin, std::size_t, const BinFrame& frame)
            {
                Points& q = body.points;
                const typename Strain::template InBin<Shape> strain(lattice_, q, bin);
                const NodalVelocity<S> v(lattice_, bin, nodes_.vx, nodes_.vy);
                for_each_pack(bin.begin, bin.end,
                              [&](std::size_t p, const auto& lanes)
                              {
                                  const ShapeAt<Shape> at(frame.corner<Shape>(q, p, lanes), frame.scale);
                                  law.update(q, p, lanes, v.template gradient<Strain>(at, strain, dt));
                              });
            });
    }

    /// Position with the carrier velocity; volume or box with the nodal velocity. If the stress is not updated first: stress, too, and the
    /// sums of the bins for the next step.
    template <bool with_stress>
    void move_points(const std::vector<double>& carrier_x, const std::vector<double>& carrier_y, double dt)
    {
        std::atomic<bool> moved{false};
        for_each_bin(
            [&](Body& body, const auto& law, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
            {
                Points& q = body.points;
                const typename Strain::template InBin<Shape> strain(lattice_, q, bin);
                const NodalVelocity<S> carrier(lattice_, bin, carrier_x, carrier_y), v(lattice_, bin, nodes_.vx, nodes_.vy);
                bool left = false;
                for_each_pack(bin.begin, bin.end,
                              [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                              {
                                  const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                  const Gradient<Pack> d = v.template gradient<Strain>(at, strain, dt);
                                  if constexpr (with_stress)
                                      law.update(q, p, lanes, d);
                                  stretch<Shape>(q, p, lanes, d);
                                  const auto step = carrier.at(at);
                                  const Pack x = lanes.load(&q.x[p]) + step[0] * Pack(dt), y = lanes.load(&q.y[p]) + step[1] * Pack(dt);
                                  lanes.store(&q.x[p], x);
                                  lanes.store(&q.y[p], y);
                                  if constexpr (!with_stress)
                                      left |= stdx::any_of(
                                          frame.template left<Shape>(q, p, lanes, frame.template corner<Shape>(q, p, lanes, x, y)));
                              });
                if constexpr (with_stress)
                    left |= sum_bin<Shape, Sums>(lattice_, body, bin, sums_.of(number));
                if (left)
                {
                    body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
                    moved.store(true, std::memory_order_relaxed);
                }
            });
        moved_ = moved;
    }

    Lattice lattice_;
    std::vector<Body> bodies_;
    NodeOps node_ops_;
    Nodes nodes_;
    Gather gather_;
    LatticeEdges edges_;  ///< empty where shapes end at the edge
    using Sums = NodeSums<Shape, Strain, Scatter::momentum_and_force>;
    BinSums<Shape, Sums> sums_;  ///< up to date from the end of a step on, but for bins that points left; empty if stress comes first
    MpmSpec options_;
    std::vector<double> workspace_;  ///< sums of the remapped momentum, and the way of a field to its new order
    std::vector<double> carrier_x_, carrier_y_;
    std::vector<double> mapped_x_, mapped_y_;  ///< empty in a scene without supports and walls
    std::optional<BodyForce> body_force_;
    std::optional<Tractions> tractions_;
    std::optional<NonlocalStrain> nonlocal_;
    std::optional<NodalWeight> weight_;
    PhaseTimer timer_;
    double damping_ = 0, internal_ = 0, lag_ = 0;
    bool moved_ = false, started_ = false;
};
}  // namespace

std::unique_ptr<Solver> make_mpm(const Scene& scene)
{
    if (scene.mpm.shape == "cpgimp")
        return std::make_unique<Mpm<GimpShape, PointStrain>>(scene);
    if (scene.mpm.shape == "bspline")
        return std::make_unique<Mpm<BSplineShape, PointStrain>>(scene);
    if (scene.mpm.strain == "b_bar")
        return std::make_unique<Mpm<LinearShape, BBarStrain>>(scene);
    return std::make_unique<Mpm<LinearShape, PointStrain>>(scene);
}
}  // namespace testbed
