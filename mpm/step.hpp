#pragma once
/// The step of MPM, for any shape and strain.

#include "core/run/particle_solver.hpp"
#include "mpm/mpm.hpp"
#include "mpm/null_space.hpp"
#include "mpm/passes.hpp"
#include "mpm/time_step.hpp"
#include "mpm/velocity_update.hpp"

namespace testbed
{
template <class Shape, class Strain>
class Mpm final : public ParticleSolver<Shape>
{
public:
    explicit Mpm(const Scene& scene)
        : Base(scene, {.box = Shape::has_box, .velocity = true}),
          grid_(without_numbers(make_lattice(scene.grid)),
                scene.options<MpmSpec>().mass_cutoff * cloud_.least_node_mass(scene.grid.cell_size)),
          options_(scene.options<MpmSpec>()),
          increment_{scene.options<MpmSpec>().increment == MpmSpec::Increment::midpoint ? 0.5 : 0.0}
    {
        if (options_.transfer == MpmSpec::Transfer::xpic)
            xpic_.emplace(options_.xpic_order);
        rebuild();
    }

    void do_prepare(const Step& step) override
    {
        node_ops_.begin_step(step);
        if (cloud_.has_moved())
            timer_("bins", [&] { rebuild(); });
        if (cloud_.nonlocal)
            timer_("nonlocal strain",
                   [&]
                   {
                       cloud_.nonlocal->template apply<Shape>(grid_.lattice, bodies_, grid_.gather,
                                                              [&](const Index<2>& at) { return grid_.lattice.node(at); });
                   });
        if (options_.scheme == MpmSpec::Scheme::usf)
            stress_first(step);
        else
            timer_("points to nodes",
                   [&]
                   {
                       grid_.template to_nodes<Scatter::momentum_and_force>(sums_.all());
                       restrain_mapped_velocity();
                   });
        grid_.gather_forces();
        this->apply_loads("node operations", grid_.lattice, nodes_, step);
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
                       grid_.keep_velocity(carrier_);
                       grid_.template to_nodes<Scatter::momentum>(cloud_.workspace);
                       node_ops_.restrain(grid_.lattice, nodes_, nodes_.v, false);
                       grid_.extend(nodes_.v);
                   });
            timer_("points, material", [&] { move_points<Strain, true>(cloud_, grid_, increment_, carrier_, dt, sums_.of(0)); });
            break;
        case MpmSpec::Scheme::usl:
            timer_("points, material", [&] { move_points<Strain, true>(cloud_, grid_, increment_, nodes_.v, dt, sums_.of(0)); });
            break;
        case MpmSpec::Scheme::usf:
            timer_("points", [&] { move_points<Strain, false>(cloud_, grid_, increment_, nodes_.v, dt, nullptr); });
            break;
        }
        if (xpic_)
            timer_("xpic", [&] { move_by_filter(dt); });
        node_ops_.end_step(step);
    }

    /// The kinetic energy is that of the points: nodes see a part of it only. What they do not see moves no point, so that rest goes by
    /// that of the nodes.
    MotionSums sums() const override
    {
        MotionSums s = nodal_sums(grid_.lattice, nodes_, this->lag(), this->internal_);
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
    std::pair<const Lattice<2>*, const Nodes<2>*> nodes() const override { return {&grid_.lattice, &nodes_}; }
    Vec<2> velocity(std::size_t body, std::size_t p) const override { return at(bodies_[body].points.v, p); }
    std::size_t unknowns() const override { return 2 * nodes_with_mass(nodes_); }
    std::size_t active_cells() const override { return cloud_.number_of_bins(); }
    std::size_t bytes() const override
    {
        const std::size_t numbers = 2 * (carrier_[0].capacity() + mapped_[0].capacity());
        return this->bytes_of_points_and_loads() + grid_.bytes() + sums_.bytes() + (xpic_ ? xpic_->bytes() : 0) + numbers * sizeof(double);
    }
    void write_state(StateWriter& writer) override { state(writer); }
    void read_state(StateReader& reader) override { state(reader); }
    std::vector<StepLimit> step_limits() override
    {
        if (cloud_.has_moved())
            rebuild();
        return mpm_step_limits<Shape>(grid_.lattice, bodies_, options_, damping_);
    }
    /// Without the filters of the velocity, which are not in this system.
    std::optional<double> sharp_step_limit() override
    {
        if (xpic_ || options_.null_space_filter != MpmSpec::Filter::none)
            return std::nullopt;
        ElementSystem elements = mpm_elements<Shape, Strain>(grid_.lattice, bodies_);
        fix(elements, node_ops_.restraints(), grid_.lattice);
        return mpm_sharp_limit(elements, options_, damping_);
    }

private:
    using Base = ParticleSolver<Shape>;
    using Base::bodies_, Base::body_force_, Base::cloud_, Base::damping_, Base::node_ops_, Base::S, Base::timer_, Base::weight_;

    template <class Archive>
    void state(Archive& a)
    {
        const Lattice<2> lattice = this->state_of_points(a, grid_.lattice);
        if constexpr (Archive::reads)
            rebuild_as_read(lattice);
    }

    /// After bodies were read: nodes in use and the sums, as they were.
    void rebuild_as_read(const Lattice<2>& lattice)
    {
        if (lattice.numbered != grid_.lattice.numbered)
            renumber(lattice);
        grid_.find_nodes(cloud_.bins());
        if (options_.scheme != MpmSpec::Scheme::usf)
            sums_.update(grid_.lattice, bodies_);
    }

    void rebuild()
    {
        const bool other_bins = cloud_.sort();
        if (other_bins)
        {
            const std::vector<const Bins<2>*> bins = cloud_.bins();
            if (const Lattice<2> lattice = with_numbers_for<S, 2>(grid_.lattice, bins); lattice.numbered != grid_.lattice.numbered)
                renumber(lattice);
            grid_.find_nodes(bins);
        }
        if (options_.scheme != MpmSpec::Scheme::usf)
            other_bins ? sums_.update(grid_.lattice, bodies_) : sums_.update_changed(grid_.lattice, bodies_);
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
            timer_("stress", [&] { update_stress<Strain>(cloud_, grid_, increment_, step.last_dt); });
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
            weight_->template collect<sums_of<Scatter::momentum>>(bodies_, grid_.gather, cloud_.workspace, block_size<S, 2>, take);
        }
        else
            weight_->template collect<sums_of<Scatter::momentum_and_force>>(bodies_, grid_.gather, sums_.all(), block_size<S, 2>, take);
        if constexpr (MpmGrid<Shape>::reaches_beyond)
            grid_.edges.fold_mass(weight_->nodes);
    }

    void renumber(const Lattice<2>& to)
    {
        grid_.renumber(to);
        if (cloud_.nonlocal)
            cloud_.nonlocal->resize(to.node_stride(), to.nodes());
    }
    void gather_forces() override { grid_.gather_forces(); }

    /// Mass, velocity and internal force of the nodes, or a part of them, from the points.
    template <Scatter what>
    void points_to_nodes()
    {
        make_room(cloud_.workspace, grid_.gather.blocks() * sums_of<what>);
        std::size_t first_bin = 0;
        for (const Body& body : bodies_)
        {
            scatter<Shape, Strain, what>(grid_.lattice, body, first_bin, cloud_.workspace);
            first_bin += body.bins.list().size();
        }
        grid_.template to_nodes<what>(cloud_.workspace);
    }
    void add_body_force() override
    {
        body_force_->template apply<Shape>(grid_.lattice, bodies_, grid_.gather,
                                           [&](std::size_t n, const std::array<double, 2>& f)
                                           {
                                               for (std::size_t d = 0; d < 2; ++d)
                                                   nodes_.f[d][n] += f[d];
                                           });
        grid_.gather_forces();
    }
    /// Supports and walls prescribe the velocity; the mapped one is kept, because the points feel the difference.
    void restrain_mapped_velocity()
    {
        if (!node_ops_.restrains())
            return grid_.extend(nodes_.v);
        grid_.keep_velocity(mapped_);
        node_ops_.restrain(grid_.lattice, nodes_, nodes_.v);
        grid_.extend(nodes_.v);
    }

    /// v += F / m dt; from here on the force holds the increment of the velocity.
    void accelerate_and_keep_increment(double dt)
    {
        const std::optional<double> stopped = node_ops_.kick(nodes_, dt);
        node_ops_.restrain(grid_.lattice, nodes_, nodes_.v);
        if (stopped)
            stop_points(*stopped);
        else if (node_ops_.restrains())
            nodes_.for_each(
                [&](std::size_t i, const auto& lanes)
                { unrolled<2>([&](auto d) { lanes.store(&nodes_.f[d][i], lanes.load(&nodes_.v[d][i]) - lanes.load(&mapped_[d][i])); }); });
        else
            nodes_.for_each(
                [&](std::size_t i, const auto& lanes)
                {
                    const Pack step = inverse_mass(nodes_, i, lanes) * Pack(dt);
                    unrolled<2>([&](auto d) { lanes.store(&nodes_.f[d][i], lanes.load(&nodes_.f[d][i]) * step); });
                });
        grid_.extend(nodes_.v);
        grid_.extend(nodes_.f);
    }
    /// The nodes have been: the increment is all their velocity. @param energy that they had, which is a part of the points' [J/m]
    void stop_points(double energy)
    {
        node_ops_.work_done().note_stopped(point_motion().kinetic_energy - energy);
        for (Body& body : bodies_)
            for (auto& component : body.points.v)
                std::fill_n(component.data(), body.points.count, 0.0);
        nodes_.f = nodes_.v;
    }

    void update_velocity(bool remap)
    {
        if (remap)
            make_room(cloud_.workspace, grid_.gather.blocks() * sums_of<Scatter::momentum>);
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
        remap ? testbed::update_velocity<Strain, true>(cloud_, grid_, rule) : testbed::update_velocity<Strain, false>(cloud_, grid_, rule);
    }
    /// What XPIC keeps of the velocity of the points, on the nodes.
    void filter_velocity()
    {
        const bool driven = node_ops_.restrains();
        make_room(cloud_.workspace, grid_.gather.blocks() * SmoothedSums<Shape>::Q);
        xpic_->filter(nodes_, driven ? mapped_ : nodes_.v, [&](VectorField<2>& field) { smooth(cloud_, grid_, field); });
        grid_.extend(xpic_->kept());
        xpic_->begin_update(bodies_);
    }
    /// What XPIC took from the velocity of the points moves them, too.
    void move_by_filter(double dt)
    {
        const bool sum = options_.scheme != MpmSpec::Scheme::usf;
        cloud_.for_each_bin(grid_.lattice,
                            [&](Body& body, const Bin<2>& bin, std::size_t number, const BinFrame<2>& frame) TESTBED_FLATTEN
                            {
                                xpic_->move(body, bin, dt);
                                if (sum ? sum_bin<Shape, Sums>(grid_.lattice, body, bin, sums_.of(number))
                                        : any_left<Shape>(body.points, bin, frame))
                                    body.bins.mark(static_cast<std::size_t>(&bin - body.bins.list().data()));
                            });
    }
    void filter_points()
    {
        if constexpr (!Shape::is_smooth)
            cloud_.for_each_bin(grid_.lattice, [](Body& body, const Bin<2>& bin, std::size_t, const BinFrame<2>& frame)
                                { filter_null_space<Shape>(frame, body.points, bin); });
    }

    MpmGrid<Shape> grid_;
    Nodes<2>& nodes_ = grid_.nodes;
    using Sums = NodeSums<Shape, Strain, Scatter::momentum_and_force>;
    BinSums<Shape, Sums> sums_;  ///< up to date from the end of a step on, but for bins that points left; empty if stress comes first
    MpmSpec options_;
    StrainIncrement increment_;
    std::optional<Xpic> xpic_;
    VectorField<2> carrier_;  ///< velocity before the remap; empty without one
    VectorField<2> mapped_;   ///< empty in a scene without supports and walls
};

template <class Shape, class Strain>
std::unique_ptr<Solver> make_mpm_of(const Scene& scene)
{
    return std::make_unique<Mpm<Shape, Strain>>(scene);
}
}  // namespace testbed
