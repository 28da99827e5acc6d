#include "lpfdm/lpfdm.hpp"

#include "core/run/particle_solver.hpp"
#include "lpfdm/convection.hpp"
#include "lpfdm/equations.hpp"
#include "lpfdm/frontier.hpp"
#include "lpfdm/initial_velocity.hpp"
#include "lpfdm/mesh/mesh_lpfdm.hpp"
#include "lpfdm/options.hpp"
#include "lpfdm/time_step.hpp"

namespace testbed
{
namespace
{
template <class Support>
class Lpfdm final : public ParticleSolver<Support>
{
public:
    explicit Lpfdm(const Scene& scene)
        : Base(scene, {.box = Support::has_box}),
          grid_(without_numbers(make_lattice(scene.grid))),
          frontier_(grid_.lattice.nodes()),
          options_(scene.options<LpfdmSpec>()),
          increment_{scene.options<LpfdmSpec>().convection == LpfdmSpec::Convection::two_sided ? 0.5 : 0.0}
    {
        if (options_.convection == LpfdmSpec::Convection::two_sided)
        {
            faces_.emplace(grid_.lattice.nodes());
            faces_->full_mass = cloud_.least_node_mass(grid_.lattice.cell_size);
        }
        for (Body& body : bodies_)
        {
            const Points<2>& q = body.points;
            wave_speed_ = std::max(wave_speed_, wave_speed(body.material, q));
            if (options_.volume_cap > 0)
                body.counted_volume = options_.volume_cap * q.initial_volume;
        }
        rebuild();
        set_initial_velocity<S>(grid_, scene, bodies_, sums_.all());
    }

    void do_prepare(const Step& step) override
    {
        node_ops_.begin_step(step);
        bool others = false;  // cells and nodes in use
        if (cloud_.has_moved())
            timer_("bins", [&] { others = rebuild(); });
        if (cloud_.nonlocal)
            timer_("nonlocal strain",
                   [&]
                   {
                       cloud_.nonlocal->template apply<Support>(grid_.lattice, bodies_, grid_.gather,
                                                                [&](const Index<2>& at) { return grid_.lattice.cell(at); });
                   });
        timer_("cell averages (7)(8)", [&] { cell_averages(grid_, sums_.all()); });
        timer_("nodal forces (9)(10)", [&] { nodal_forces(grid_); });
        timer_("convection (13)",
               [&]
               {
                   if (frontier_.template extend<S>(grid_, others, step, options_.frontier, faces_ ? &*faces_ : nullptr))
                       gradients_over_ = 0;
                   convect_velocity(step.last_dt);
                   frontier_.keep_mass(nodes_);
                   restrain();
               });
        if (options_.hourglass > 0)
            timer_("hourglass",
                   [&]
                   {
                       const double power = resist_hourglass(grid_, hourglass_rate(), hourglass_);
                       node_ops_.note_hourglass((1 - 2 * hourglass_rate() * step.kick()) * power);  // half of the decay is then done
                   });
        this->apply_loads("node operations (11)(15)", grid_.lattice, nodes_, step);
    }

    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        timer_("acceleration (12)(14)",
               [&]
               {
                   node_ops_.kick(nodes_, step.kick());
                   restrain();
               });
        if (faces_)
            timer_("convection (13)",
                   [&]
                   {
                       cell_gradients(grid_, dt);
                       if (step.is_first())
                           faces_->find(grid_);
                       convect(grid_, *faces_, dt, 0.5, nullptr);
                       restrain();
                   });
        timer_("cell strain (5)",
               [&]
               {
                   cell_gradients(grid_, dt);
                   gradients_over_ = dt;
                   if constexpr (Support::has_box)
                       mid_steps_.find(grid_, increment_.theta, dt);
               });
        timer_("points (6), material", [&] { move_all_points(dt); });
        node_ops_.end_step(step);
    }

    MotionSums sums() const override { return nodal_sums(grid_.lattice, nodes_, this->lag(), this->internal_); }

    PointMotion point_motion() const override
    {
        return point_motion_of(bodies_, [&](std::size_t body, std::size_t p) { return Lpfdm::velocity(body, p); });
    }
    std::optional<NodalWork> work() const override { return node_ops_.work(nodes_, this->lag()); }
    std::pair<const Lattice<2>*, const Nodes<2>*> nodes() const override { return {&grid_.lattice, &nodes_}; }

    /// Bilinear, as eq. (6) moves the point.
    Vec<2> velocity(std::size_t body, std::size_t p) const override
    {
        const Lattice<2>& lattice = grid_.lattice;
        Index<2> cell;
        Vec<2> share;
        for (std::size_t d = 0; d < 2; ++d)
        {
            const double place = (bodies_[body].points.x[d][p] - lattice.origin[d]) / lattice.cell_size;
            if (!(place >= 0 && place < lattice.size[d]))
                return {0, 0};
            cell[d] = static_cast<int>(place);
            share[d] = place - cell[d];
        }
        if (!lattice.has_node(cell) || !lattice.has_node(cell + all<2>(1)))
            return {0, 0};
        Vec<2> v{0, 0};
        for (std::size_t k = 0; k < 4; ++k)
        {
            const std::size_t n = grid_.corner(lattice.node(cell), k);
            const double w = (is_upper(k, 0) ? share[0] : 1 - share[0]) * (is_upper(k, 1) ? share[1] : 1 - share[1]);
            for (std::size_t d = 0; d < 2; ++d)
                v[d] += w * nodes_.v[d][n];
        }
        return v;
    }

    std::size_t unknowns() const override { return 2 * nodes_with_mass(nodes_); }
    std::size_t active_cells() const override { return grid_.gather.active().size(); }
    std::size_t bytes() const override
    {
        const std::size_t numbers =
            frontier_.mass_before.capacity() + 2 * hourglass_[0].capacity() + cell_weight_.capacity() + 2 * cell_force_[0].capacity();
        return this->bytes_of_points_and_loads() + grid_.bytes() + sums_.bytes() + mid_steps_.bytes() + (faces_ ? faces_->bytes() : 0) +
               numbers * sizeof(double);
    }
    void write_state(StateWriter& writer) override { state(writer); }
    void read_state(StateReader& reader) override { state(reader); }
    std::vector<StepLimit> step_limits() override { return lpfdm_step_limits(grid_, bodies_, hourglass_rate(), damping_); }
    std::optional<double> sharp_step_limit() override
    {
        ElementSystem elements = lpfdm_elements<Support>(grid_.lattice, bodies_, hourglass_rate());
        fix(elements, node_ops_.restraints(), grid_.lattice);
        return lpfdm_sharp_limit(elements, damping_);
    }

private:
    using Base = ParticleSolver<Support>;
    using Base::bodies_, Base::body_force_, Base::cloud_, Base::damping_, Base::node_ops_, Base::S, Base::timer_, Base::weight_;

    template <class Archive>
    void state(Archive& a)
    {
        const Lattice<2> lattice = this->state_of_points(a, grid_.lattice);
        if constexpr (Archive::reads)
            rebuild_as_read(lattice);
        std::vector<Index<2>> at;
        for (const auto n : nodes_.active())
            at.push_back(lattice.node_index(n));
        a.group("node",
                [&]
                {
                    a.indices(at);
                    for (std::size_t d = 0; d < 2; ++d)
                        a.nodal(Components<2>::velocity[d], "m/s", lattice, at, nodes_.v[d]);
                    a.nodal("mass_before", "kg/m", lattice, at, frontier_.mass_before);
                });
    }

    /// After bodies were read: cells and nodes in use, and the sums, as they were; all nodal values are zero.
    void rebuild_as_read(const Lattice<2>& lattice)
    {
        if (lattice.numbered != grid_.lattice.numbered)
            renumber(lattice);
        nodes_.clear();
        std::fill(frontier_.mass_before.begin(), frontier_.mass_before.end(), 0.0);
        for (auto& component : hourglass_)
            std::fill(component.begin(), component.end(), 0.0);
        grid_.template rebuild<S>(cloud_.bins());
        frontier_.left.clear();
        gradients_over_ = 0;
        sums_.update(grid_.lattice, bodies_);
    }

    /// Points changed their cells: sorts them and finds the cells and nodes in use. Returns whether these are others.
    bool rebuild()
    {
        if (!cloud_.sort())
        {
            sums_.update_changed(grid_.lattice, bodies_);
            return false;
        }
        const std::vector<const Bins<2>*> bins = cloud_.bins();
        if (const Lattice<2> lattice = with_numbers_for<S, 2>(grid_.lattice, bins); lattice.numbered != grid_.lattice.numbered)
            renumber(lattice);
        if (options_.hourglass > 0)
            for (const auto c : grid_.gather.active())  // the nodes around a cell that goes out of use may stay
                set(hourglass_, c, {0, 0});
        frontier_.left = grid_.template rebuild<S>(bins);
        sums_.update(grid_.lattice, bodies_);
        return true;
    }

    void restrain() { node_ops_.restrain(grid_.lattice, nodes_, nodes_.v); }

    void move_all_points(double dt)
    {
        cloud_.for_each_body([&](Body& body, std::size_t first_bin)
                             { move_points<Support>(grid_, mid_steps_, body, increment_, dt, sums_.of(first_bin)); });
    }

    double hourglass_rate() const { return options_.hourglass * wave_speed_ / grid_.lattice.cell_size; }

    /// A quarter of those of the cells around them.
    void find_weight() override
    {
        weight_->nodes.assign(nodes_.mass.size(), 0.0);
        weight_->template collect<1 + symmetric_components<2>>(bodies_, grid_.gather, sums_.all(), block_size<S, 2>,
                                                               [&](std::size_t c, double mass) { cell_weight_[c] = mass; });
        for (const auto c : grid_.gather.active())
            for (std::size_t k = 0; k < 4; ++k)
                weight_->nodes[grid_.corner(grid_.first_node(c), k)] += 0.25 * cell_weight_[c];
    }

    void renumber(const Lattice<2>& to)
    {
        testbed::renumber(frontier_.mass_before, grid_.lattice, to);
        grid_.renumber(to);
        if (faces_)
            faces_->resize(to.nodes());
        if constexpr (Support::has_box)
            mid_steps_.resize(to.nodes());
        if (body_force_)
            for (auto& component : cell_force_)
                component.assign(to.cells(), 0.0);
        if (weight_)
            cell_weight_.assign(to.cells(), 0.0);
        if (cloud_.nonlocal)
            cloud_.nonlocal->resize(to.cell_stride(), to.cells());
        if (options_.hourglass > 0)
            for (auto& component : hourglass_)
                component.assign(to.cells(), 0.0);
    }

    /// Eq. (13), for the step that led here; there is none at the start.
    void convect_velocity(double dt)
    {
        if (options_.convection == LpfdmSpec::Convection::none || dt == 0)
            return;
        if (gradients_over_ != dt)
            cell_gradients(grid_, dt);
        switch (options_.convection)
        {
        case LpfdmSpec::Convection::none: return;
        case LpfdmSpec::Convection::upwind: return convect<UpwindConvection>(grid_, dt);
        case LpfdmSpec::Convection::central: return convect<CentralConvection>(grid_, dt);
        case LpfdmSpec::Convection::two_sided:
            faces_->find(grid_);
            return convect(grid_, *faces_, dt, 0.5, options_.frontier == LpfdmSpec::Frontier::arrival ? &frontier_.mass_before : nullptr);
        }
    }

    void add_body_force() override
    {
        body_force_->template apply<Support>(grid_.lattice, bodies_, grid_.gather,
                                             [&](std::size_t c, const Vec<2>& f) { set(cell_force_, c, f); });
        grid_.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                Vec<2, Pack> f = load(nodes_.f, n, lanes);
                unrolled<4>(
                    [&](auto k)
                    {
                        const std::size_t c = grid_.around(first_cell, k);
                        const Mask is_full = lanes.load(&grid_.cells.mass[c]) > Pack(0.0);  // what an empty cell holds is of another step
                        unrolled<2>([&](auto d) { f[d] += Pack(0.25) * select(is_full, lanes.load(&cell_force_[d][c]), Pack(0.0)); });
                    });
                store(nodes_.f, n, lanes, f);
            });
    }

    LpfdmGrid<2> grid_;
    Nodes<2>& nodes_ = grid_.nodes;
    Frontier frontier_;
    LpfdmSpec options_;
    StrainIncrement increment_;
    MidSteps mid_steps_;               ///< empty for points without a box
    LpfdmSums<Support> sums_;          ///< up to date from the end of a step on, but for bins that points left
    VectorField<2> hourglass_;         ///< empty unless the scene has them
    VectorField<2> cell_force_;        ///< so, too
    std::vector<double> cell_weight_;  ///< so, too
    std::optional<FreeFaces> faces_;   ///< so, too
    double wave_speed_ = 0;
    double gradients_over_ = 0;  ///< the step over which the cells hold the gradients of the present velocity; 0: none
};
}  // namespace

std::unique_ptr<Solver> make_lpfdm(const Scene& scene)
{
    if (scene.options<LpfdmSpec>().has_mesh())
        return make_mesh_lpfdm(scene);
    switch (scene.options<LpfdmSpec>().support)
    {
    case LpfdmSpec::Support::point: return std::make_unique<Lpfdm<PointSupport>>(scene);
    case LpfdmSpec::Support::domain: return std::make_unique<Lpfdm<DomainSupport>>(scene);
    }
    throw std::logic_error("not a support");
}
}  // namespace testbed
