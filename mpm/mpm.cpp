#include "mpm/mpm.hpp"

#include "core/lattice/gather.hpp"
#include "core/run/particle_solver.hpp"
#include "mpm/edges.hpp"
#include "mpm/null_space.hpp"
#include "mpm/small_nodes.hpp"
#include "mpm/time_step.hpp"
#include "mpm/velocity_update.hpp"
#include "mpm/xpic.hpp"

#include <atomic>
#include <cmath>
#include <limits>

namespace testbed
{
namespace
{
template <class Shape, class Strain>
class Mpm final : public ParticleSolver<Shape>
{
public:
    explicit Mpm(const Scene& scene)
        : Base(scene, {.box = Shape::has_box, .velocity = true}),
          lattice_(without_numbers(make_lattice(scene.grid))),
          nodes_(lattice_.nodes()),
          gather_(lattice_.nodes()),
          options_(scene.mpm),
          increment_{scene.mpm.increment == MpmSpec::Increment::midpoint ? 0.5 : 0.0},
          least_mass_(options_.mass_cutoff * cloud_.least_node_mass(lattice_.cell_size))
    {
        if (options_.transfer == MpmSpec::Transfer::xpic)
            xpic_.emplace(options_.xpic_order);
        rebuild();
    }

    void do_prepare(const Step& step) override
    {
        node_ops_.begin_step(step.t, step.dt);
        if (cloud_.has_moved())
            timer_("bins", [&] { rebuild(); });
        if (cloud_.nonlocal)
            timer_(
                "nonlocal strain", [&]
                { cloud_.nonlocal->template apply<Shape>(lattice_, bodies_, gather_, [&](int i, int j) { return lattice_.node(i, j); }); });
        if (options_.scheme == MpmSpec::Scheme::usf)
            stress_first(step);
        else
            timer_("points to nodes",
                   [&]
                   {
                       to_nodes<Scatter::momentum_and_force>(sums_.all());
                       restrain_mapped_velocity();
                   });
        gather_forces();
        this->apply_loads("node operations", lattice_, nodes_, step.t);
    }

    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        if (xpic_)
            timer_("xpic", [&] { filter_velocity(); });
        if (options_.null_space_filter == MpmSpec::Filter::cell)
            timer_("null-space filter", [&] { filter_points(); });
        timer_("acceleration", [&] { accelerate_and_keep_increment(step.kick()); });
        const bool remap = options_.scheme == MpmSpec::Scheme::musl;
        timer_("nodes to points", [&] { update_velocity(remap); });
        switch (options_.scheme)
        {
        case MpmSpec::Scheme::musl:
            timer_("remap velocity",
                   [&]
                   {
                       keep_velocity(carrier_x_, carrier_y_);
                       to_nodes<Scatter::momentum>(cloud_.workspace);
                       node_ops_.restrain(lattice_, nodes_, nodes_.vx, nodes_.vy, false);
                       extend(nodes_.vx, nodes_.vy);
                   });
            timer_("points, material", [&] { move_points<true>(carrier_x_, carrier_y_, dt); });
            break;
        case MpmSpec::Scheme::usl: timer_("points, material", [&] { move_points<true>(nodes_.vx, nodes_.vy, dt); }); break;
        case MpmSpec::Scheme::usf: timer_("points", [&] { move_points<false>(nodes_.vx, nodes_.vy, dt); }); break;
        }
        if (xpic_)
            timer_("xpic", [&] { move_by_filter(dt); });
        node_ops_.end_step(dt);
    }

    /// The kinetic energy is that of the points: nodes see a part of it only. What they do not see moves no point, so that rest goes by
    /// that of the nodes.
    MotionSums sums() const override
    {
        MotionSums s = nodal_sums(lattice_, nodes_, this->lag(), internal_);
        s.kinetic_energy += point_motion().kinetic_energy - s.kinetic_before;
        return s;
    }
    PointMotion point_motion() const override
    {
        return point_motion_of(bodies_, [&](std::size_t body, std::size_t p) { return Mpm::velocity(body, p); });
    }
    /// With MUSL the strain is that of a velocity mapped once more, with XPIC the points move otherwise.
    std::optional<NodalWork> work() const override
    {
        NodalWork work = node_ops_.work(nodes_, this->lag());
        work.of_strain = options_.scheme != MpmSpec::Scheme::musl && !xpic_;
        return work;
    }
    std::pair<const Lattice*, const Nodes*> nodes() const override { return {&lattice_, &nodes_}; }
    Vec2 velocity(std::size_t body, std::size_t p) const override { return {bodies_[body].points.vx[p], bodies_[body].points.vy[p]}; }
    std::size_t unknowns() const override { return 2 * nodes_with_mass(nodes_); }
    std::size_t active_cells() const override { return cloud_.number_of_bins(); }
    std::size_t bytes() const override
    {
        const std::size_t numbers = carrier_x_.capacity() + carrier_y_.capacity() + mapped_x_.capacity() + mapped_y_.capacity();
        return this->bytes_of_points_and_loads() + nodes_.bytes() + gather_.bytes() + edges_.bytes() + small_.bytes() + sums_.bytes() +
               (xpic_ ? xpic_->bytes() : 0) + numbers * sizeof(double);
    }
    void write_state(StateWriter& writer) override { state(writer); }
    void read_state(StateReader& reader) override { state(reader); }
    std::vector<StepLimit> step_limits() override
    {
        if (cloud_.has_moved())
            rebuild();
        return mpm_step_limits<Shape>(lattice_, bodies_, options_, damping_);
    }
    /// Without the filters of the velocity, which are not in this system.
    std::optional<double> sharp_step_limit() override
    {
        if (xpic_ || options_.null_space_filter != MpmSpec::Filter::none)
            return std::nullopt;
        ElementSystem elements = mpm_elements<Shape, Strain>(lattice_, bodies_);
        fix(elements, node_ops_.restraints(), lattice_);
        return mpm_sharp_limit(elements, options_, damping_);
    }

private:
    using Base = ParticleSolver<Shape>;
    using Base::bodies_, Base::body_force_, Base::cloud_, Base::damping_, Base::node_ops_, Base::S, Base::timer_, Base::weight_,
        Base::internal_;
    static constexpr bool reaches_beyond = std::is_same_v<Shape, BSplineShape>;  ///< the lattice's edge

    template <class Archive>
    void state(Archive& a)
    {
        cloud_.state(a);
        node_ops_.state(a);
        a.value("last_dt", "s", this->last_dt_);
        Lattice lattice = lattice_;
        lattice.state(a);
        if constexpr (Archive::reads)
            rebuild_as_read(lattice);
    }

    /// After bodies were read: nodes in use and the sums, as they were.
    void rebuild_as_read(const Lattice& lattice)
    {
        if (lattice.numbered != lattice_.numbered)
            renumber(lattice);
        find_nodes(cloud_.bins());
        if (options_.scheme != MpmSpec::Scheme::usf)
            sums_.update(lattice_, bodies_);
    }

    void rebuild()
    {
        const bool other_bins = cloud_.sort();
        if (other_bins)
        {
            const std::vector<const Bins*> bins = cloud_.bins();
            if (const Lattice lattice = with_numbers_for<S>(lattice_, bins); lattice.numbered != lattice_.numbered)
                renumber(lattice);
            find_nodes(bins);
        }
        if (options_.scheme != MpmSpec::Scheme::usf)
            other_bins ? sums_.update(lattice_, bodies_) : sums_.update_changed(lattice_, bodies_);
    }

    /// USF: the stress follows the velocity of the step that led here.
    void stress_first(const Step& step)
    {
        timer_("points to nodes",
               [&]
               {
                   points_to_nodes<Scatter::momentum>();
                   restrain_mapped_velocity();
               });
        if (!step.is_first())
            timer_("stress", [&] { update_stress(step.last_dt); });
        timer_("points to nodes", [&] { points_to_nodes<Scatter::force>(); });
    }

    void find_weight() override
    {
        weight_->nodes.assign(nodes_.mass.size(), 0.0);
        const auto take = [&](std::size_t n, double mass) { weight_->nodes[n] = mass; };
        if (options_.scheme == MpmSpec::Scheme::usf)
        {
            points_to_nodes<Scatter::momentum>();  // once more: the workspace holds forces now
            restrain_mapped_velocity();
            weight_->template collect<sums_of<Scatter::momentum>>(bodies_, gather_, cloud_.workspace, S * S, take);
        }
        else
            weight_->template collect<sums_of<Scatter::momentum_and_force>>(bodies_, gather_, sums_.all(), S * S, take);
        if constexpr (reaches_beyond)
            edges_.fold_mass(weight_->nodes);
    }

    /// The nodes that bins touch.
    void find_nodes(const std::vector<const Bins*>& bins)
    {
        gather_.rebuild<S>(bins, [&](int i, int j) { return lattice_.node(i, j); });
        for (const auto n : nodes_.active())  // what is left must not be taken for soil
            nodes_.mass[n] = nodes_.vx[n] = nodes_.vy[n] = nodes_.fx[n] = nodes_.fy[n] = 0;
        nodes_.set_active(gather_.active());
        if constexpr (reaches_beyond)
            edges_.rebuild(lattice_, nodes_.active());
    }

    void renumber(const Lattice& to)
    {
        nodes_.renumber(lattice_, to);
        gather_ = Gather(to.nodes());
        if (cloud_.nonlocal)
            cloud_.nonlocal->resize(to.node_stride(), to.nodes());
        lattice_ = to;
    }

    /// Mass, velocity and internal force of the nodes, or a part of them, from the points.
    template <Scatter what>
    void points_to_nodes()
    {
        make_room(cloud_.workspace, gather_.blocks() * sums_of<what>);
        std::size_t first_bin = 0;
        for (const Body& body : bodies_)
        {
            scatter<Shape, Strain, what>(lattice_, body, first_bin, cloud_.workspace);
            first_bin += body.bins.list().size();
        }
        to_nodes<what>(cloud_.workspace);
    }
    /// The same from the sums of all bins.
    template <Scatter what>
    void to_nodes(const std::vector<double>& sums)
    {
        constexpr std::size_t Q = sums_of<what>;
        std::atomic<bool> has_small{false};
        gather_.sum<Q>(sums,
                       [&](std::size_t i, const std::array<double, Q>& s)
                       {
                           if constexpr (what != Scatter::force)
                           {
                               nodes_.mass[i] = s[0];
                               nodes_.vx[i] = s[1];
                               nodes_.vy[i] = s[2];
                               if constexpr (!reaches_beyond)
                                   to_velocity(i, has_small);
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
            parallel_for(nodes_.active().size(), [&](std::size_t a) { to_velocity(nodes_.active()[a], has_small); });
        }
        if constexpr (what != Scatter::force)
            take_small_nodes(has_small);
    }
    /// Divides the momentum by the mass, if it is more than a node needs to count.
    void to_velocity(std::size_t i, std::atomic<bool>& has_small)
    {
        if (!(nodes_.mass[i] > least_mass_))
            return has_small.store(true, std::memory_order_relaxed);
        const double inverse = 1 / nodes_.mass[i];
        nodes_.vx[i] *= inverse;
        nodes_.vy[i] *= inverse;
    }
    void add_body_force() override
    {
        body_force_->template apply<Shape>(lattice_, bodies_, gather_,
                                           [&](std::size_t n, const std::array<double, 2>& f)
                                           {
                                               nodes_.fx[n] += f[0];
                                               nodes_.fy[n] += f[1];
                                           });
        gather_forces();
    }
    /// The nodes that do not count go to their neighbours; those that have none count all the same.
    void take_small_nodes(bool has_small)
    {
        small_.clear();
        if (!has_small)
            return;
        if (least_mass_ > 0)
            small_.find(lattice_, nodes_, least_mass_);
        for (const auto n : nodes_.active())
            if (!(nodes_.mass[n] > least_mass_) && !small_.has(n))
            {
                const double inverse = inverse_mass(nodes_, n);
                nodes_.vx[n] *= inverse;
                nodes_.vy[n] *= inverse;
            }
        small_.fold_momentum(nodes_);
    }
    void gather_forces() override
    {
        if constexpr (reaches_beyond)
        {
            edges_.fold(nodes_.fx);
            edges_.fold(nodes_.fy);
        }
        small_.fold(nodes_.fx);
        small_.fold(nodes_.fy);
    }
    /// Values of nodes that do not count, and beyond the edge of the lattice, where the shapes reach there.
    void extend(std::vector<double>& x, std::vector<double>& y)
    {
        small_.extend(x);
        small_.extend(y);
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
        node_ops_.kick(nodes_, dt);
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

    void update_velocity(bool remap)
    {
        if (remap)
            make_room(cloud_.workspace, gather_.blocks() * sums_of<Scatter::momentum>);
        if (xpic_)
            update_velocity(*xpic_, remap);
        else if (options_.flip < 1)
            update_velocity(BlendUpdate{options_.flip}, remap);
        else
            update_velocity(FlipUpdate{}, remap);
    }
    template <class Update>
    void update_velocity(Update&& rule, bool remap)
    {
        remap ? update_velocity<true>(rule) : update_velocity<false>(rule);
    }
    /// The new velocity of the points; and the sums of their momentum, if nodes ask for them.
    template <bool with_remap, class Update>
    void update_velocity(Update& rule)
    {
        using Momentum = NodeSums<Shape, Strain, Scatter::momentum>;
        cloud_.for_each_bin(lattice_,
                            [&](Body& body, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                            {
                                Points& q = body.points;
                                const auto update = rule.template in_bin<S>(lattice_, nodes_, body, bin);
                                for_each_pack(bin.begin, bin.end,
                                              [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                              {
                                                  const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                                                  update.update(q, p, lanes, at);
                                              });
                                if constexpr (with_remap)
                                    sum_bin<Shape, Momentum>(lattice_, body, bin, &cloud_.workspace[number * Momentum::numbers]);
                            });
    }

    /// What XPIC keeps of the velocity of the points, on the nodes.
    void filter_velocity()
    {
        const bool driven = node_ops_.restrains();
        make_room(cloud_.workspace, gather_.blocks() * SmoothedSums<Shape>::Q);
        xpic_->filter(nodes_, driven ? mapped_x_ : nodes_.vx, driven ? mapped_y_ : nodes_.vy,
                      [&](std::vector<double>& x, std::vector<double>& y) { smooth(x, y); });
        extend(xpic_->kept_x(), xpic_->kept_y());
        xpic_->begin_update(bodies_);
    }
    /// A nodal field goes to the points and back.
    void smooth(std::vector<double>& x, std::vector<double>& y)
    {
        using Smoothed = SmoothedSums<Shape>;
        extend(x, y);
        cloud_.for_each_bin(lattice_,
                            [&](const Body& body, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                            {
                                Smoothed sums(lattice_, bin, x, y);
                                for_each_pack(bin.begin, bin.end,
                                              [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                              { sums.add(body.points, lanes, frame.template corner<Shape>(body.points, p, lanes)); });
                                sums.write(&cloud_.workspace[number * Smoothed::numbers]);
                            });
        gather_.template sum<2>(cloud_.workspace,
                                [&](std::size_t i, const std::array<double, 2>& s)
                                {
                                    x[i] = s[0];
                                    y[i] = s[1];
                                });
        for (auto* values : {&x, &y})
        {
            if constexpr (reaches_beyond)
                edges_.fold(*values);
            small_.fold(*values);
        }
        nodes_.for_each(
            [&](std::size_t i, const auto& lanes)
            {
                const Pack inverse = inverse_mass(nodes_, i, lanes);
                lanes.store(&x[i], lanes.load(&x[i]) * inverse);
                lanes.store(&y[i], lanes.load(&y[i]) * inverse);
            });
    }
    /// What XPIC took from the velocity of the points moves them, too.
    void move_by_filter(double dt)
    {
        const bool sum = options_.scheme != MpmSpec::Scheme::usf;
        cloud_.for_each_bin(lattice_,
                            [&](Body& body, const Bin& bin, std::size_t number, const BinFrame& frame) TESTBED_FLATTEN
                            {
                                xpic_->move(body, bin, dt);
                                if (sum ? sum_bin<Shape, Sums>(lattice_, body, bin, sums_.of(number)) : any_left(body.points, bin, frame))
                                    body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
                            });
    }
    static bool any_left(const Points& q, const Bin& bin, const BinFrame& frame)
    {
        bool left = false;
        for_each_pack(bin.begin, bin.end,
                      [&](std::size_t p, const auto& lanes)
                      { left |= stdx::any_of(frame.template left<Shape>(q, p, lanes, frame.template corner<Shape>(q, p, lanes))); });
        return left;
    }
    void filter_points()
    {
        if constexpr (std::is_same_v<Shape, LinearShape>)
            cloud_.for_each_bin(lattice_, [](Body& body, const Bin& bin, std::size_t, const BinFrame& frame)
                                { filter_null_space<Shape>(frame, body.points, bin); });
    }

    /// Stress alone, with the nodal velocity (USF).
    void update_stress(double dt)
    {
        cloud_.for_each_bin_with_law(lattice_,
                                     [&](Body& body, const auto& law, const Bin& bin, std::size_t, const BinFrame& frame)
                                     {
                                         Points& q = body.points;
                                         const typename Strain::template InBin<Shape> strain(lattice_, q, bin);
                                         const NodalVelocity<S> v(lattice_, bin, nodes_.vx, nodes_.vy);
                                         for_each_pack(bin.begin, bin.end,
                                                       [&](std::size_t p, const auto& lanes)
                                                       {
                                                           const ShapeAt<Shape> at(frame.corner<Shape>(q, p, lanes), frame.scale);
                                                           law.update(q, p, lanes,
                                                                      increment_.of(v.template gradient<Strain>(at, strain, dt)));
                                                       });
                                     });
    }

    /// Position with the carrier velocity; volume or box with the nodal velocity. If the stress is not updated first: stress, too, and the
    /// sums of the bins for the next step.
    template <bool with_stress>
    void move_points(const std::vector<double>& carrier_x, const std::vector<double>& carrier_y, double dt)
    {
        cloud_.for_each_bin_with_law(
            lattice_,
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
                                  const Gradient<Pack> d = increment_.of(v.template gradient<Strain>(at, strain, dt));
                                  if constexpr (with_stress)
                                      law.update(q, p, lanes, d);
                                  stretch<Shape>(q, p, lanes, increment_, d);
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
                    body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
            });
    }

    Lattice lattice_;
    Nodes nodes_;
    Gather gather_;
    LatticeEdges edges_;  ///< empty where shapes end at the edge
    SmallNodes small_;    ///< empty unless a node has too little mass to count
    using Sums = NodeSums<Shape, Strain, Scatter::momentum_and_force>;
    BinSums<Shape, Sums> sums_;  ///< up to date from the end of a step on, but for bins that points left; empty if stress comes first
    MpmSpec options_;
    StrainIncrement increment_;
    double least_mass_;  ///< of a node that counts [kg/m]
    std::optional<Xpic> xpic_;
    std::vector<double> carrier_x_, carrier_y_;
    std::vector<double> mapped_x_, mapped_y_;  ///< empty in a scene without supports and walls
};
}  // namespace

std::unique_ptr<Solver> make_mpm(const Scene& scene)
{
    switch (scene.mpm.shape)
    {
    case MpmSpec::Shape::cpgimp: return std::make_unique<Mpm<GimpShape, PointStrain>>(scene);
    case MpmSpec::Shape::bspline: return std::make_unique<Mpm<BSplineShape, PointStrain>>(scene);
    case MpmSpec::Shape::linear:
        if (scene.mpm.strain == MpmSpec::Strain::b_bar)
            return std::make_unique<Mpm<LinearShape, BBarStrain>>(scene);
        return std::make_unique<Mpm<LinearShape, PointStrain>>(scene);
    }
    throw std::logic_error("not a shape");
}
}  // namespace testbed
