#include "lpfdm/mesh/mesh_lpfdm.hpp"

#include "core/run/particle_solver.hpp"
#include "lpfdm/mesh/equations.hpp"
#include "lpfdm/mesh/limits.hpp"
#include "lpfdm/mesh/make_mesh.hpp"
#include "lpfdm/time_step.hpp"

namespace testbed
{
namespace
{
class MeshLpfdm final : public ParticleSolver<PointSupport>
{
public:
    MeshLpfdm(const Scene& scene, NumberedMesh made)
        : ParticleSolver(scene, {}, node_ops_of(scene, made)),
          lattice_(make_lattice(scene.grid)),
          numbers_(made.numbers),
          grid_(std::move(made.mesh)),
          options_(scene.options<LpfdmSpec>()),
          shape_(limit_beside_square(grid_.mesh, bodies_, lattice_.cell_size)),
          cells_(bodies_.size())
    {
        if (options_.volume_cap > 0)
            for (Body& body : bodies_)
                body.counted_volume = options_.volume_cap * body.points.initial_volume;
        cloud_.sort();
        try
        {
            find_cells();
        }
        catch (const Diverged& e)
        {
            throw SceneError(fmt::format("{}: at the start {}; the mesh must cover the bodies and where they go", scene.path, e.what()));
        }
        check_size_of_points(scene);
        cell_averages(grid_, bodies_, cells_);
        use_nodes(grid_);
        set_initial_velocity(scene);
    }

    void do_prepare(const Step& step) override
    {
        node_ops_.begin_step(step);
        timer_("bins", [&] { find_cells(); });
        std::vector<std::uint32_t> left;
        timer_("cell averages (7)(8)",
               [&]
               {
                   cell_averages(grid_, bodies_, cells_);
                   left = use_nodes(grid_);
               });
        timer_("nodal forces (9)(10)", [&] { nodal_forces(grid_); });
        timer_("convection (13)",
               [&]
               {
                   reach_nodes(grid_, left, step, options_.frontier);
                   if (options_.convection == LpfdmSpec::Convection::upwind && !step.is_first())
                   {
                       cell_gradients(grid_, step.last_dt);
                       convect(grid_, step.last_dt);
                   }
                   grid_.mass_before = grid_.nodes.mass;
                   restrain();
               });
        apply_loads("node operations (11)(15)", numbers_, grid_.nodes, step);
    }

    void do_advance(const Step& step) override
    {
        timer_("acceleration (12)(14)",
               [&]
               {
                   node_ops_.kick(grid_.nodes, step.kick());
                   restrain();
               });
        timer_("cell strain (5)", [&] { cell_gradients(grid_, step.dt); });
        timer_("points (6), material",
               [&]
               {
                   for (std::size_t b = 0; b < bodies_.size(); ++b)
                       move_points(grid_, lattice_, bodies_[b], cells_[b], step.dt);
               });
        node_ops_.end_step(step);
    }

    MotionSums sums() const override
    {
        const auto place = [&](std::size_t n)
        {
            const Vec<2>& x = grid_.mesh.place(n);
            return Vec<2>{x[0] - lattice_.origin[0], x[1] - lattice_.origin[1]};
        };
        return nodal_sums(place, grid_.nodes, lag(), internal_);
    }
    /// Where they have a lattice.
    std::pair<const Lattice<2>*, const Nodes<2>*> nodes() const override
    {
        if (options_.cells == LpfdmSpec::Cells::file)
            return {nullptr, nullptr};
        return {&numbers_, &grid_.nodes};
    }
    std::optional<NodalWork> work() const override { return node_ops_.work(grid_.nodes, lag()); }

    /// As eq. (6) moves the point.
    Vec<2> velocity(std::size_t body, std::size_t p) const override
    {
        const Vec<2> x = at(bodies_[body].points.x, p);
        std::vector<double> weights;
        const auto cell = grid_.mesh.find(x);
        return cell ? velocity_at(grid_, *cell, x, weights) : Vec<2>{0, 0};
    }

    std::size_t unknowns() const override { return 2 * nodes_with_mass(grid_.nodes); }
    std::size_t active_cells() const override
    {
        return static_cast<std::size_t>(std::count_if(grid_.mass.begin(), grid_.mass.end(), [](double m) { return m > 0; }));
    }
    std::size_t bytes() const override
    {
        std::size_t points = 0;
        for (const auto& cells : cells_)
            points += cells.capacity();
        return bytes_of_points_and_loads() + grid_.bytes() + points * sizeof(std::uint32_t);
    }
    void write_state(StateWriter& writer) override { state(writer); }
    void read_state(StateReader& reader) override { state(reader); }

    /// As on squares (lpfdm/time_step.hpp), for the stiffest of the cells.
    std::vector<StepLimit> step_limits() override
    {
        const double stiffness = shape_ * isolated_cell_limit(bodies_, lattice_.cell_size) * damping_factor(damping_);
        std::vector<StepLimit> limits{{"stiffness", stiffness}};
        const auto& active = grid_.nodes.active();
        const double speed = parallel_max(active.size(), [&](std::size_t a)
                                          { return std::hypot(grid_.nodes.v[0][active[a]], grid_.nodes.v[1][active[a]]); });
        add_limits_in_motion(limits, bodies_, stiffness, grid_.mesh.least_height(), speed);
        return limits;
    }

private:
    template <class Archive>
    void state(Archive& a)
    {
        std::uint32_t checksum = grid_.mesh.checksum();
        a.value("mesh_checksum", "-", checksum);
        if (checksum != grid_.mesh.checksum())
            throw SceneError("the mesh is another one than that of the restart file: lpfdm.mesh must not change on the way");
        state_of_points(a, numbers_);
        if constexpr (Archive::reads)
        {
            grid_.nodes.clear();
            std::fill(grid_.mass_before.begin(), grid_.mass_before.end(), 0.0);
        }
        std::vector<Index<2>> at;
        for (const auto n : grid_.nodes.active())
            at.push_back(numbers_.node_index(n));
        a.group("node",
                [&]
                {
                    a.indices(at);
                    for (std::size_t d = 0; d < 2; ++d)
                        a.nodal(Components<2>::velocity[d], "m/s", numbers_, at, grid_.nodes.v[d]);
                    a.nodal("mass_before", "kg/m", numbers_, at, grid_.mass_before);
                });
        if constexpr (Archive::reads)
            use_as_read(at);
    }

    /// Those that then are no longer in use are cleared by the next step.
    void use_as_read(const std::vector<Index<2>>& at)
    {
        std::vector<std::uint32_t> used;
        for (const Index<2>& n : at)
            used.push_back(static_cast<std::uint32_t>(numbers_.node(n)));
        grid_.nodes.set_active(std::move(used));
    }

    /// @throws SceneError where a point is far larger than the cell that holds it: the cells around it would be empty
    void check_size_of_points(const Scene& scene) const
    {
        constexpr double most = 2.5;  // areas of its cell; one point for two triangles of a square makes two
        for (std::size_t b = 0; b < bodies_.size(); ++b)
            for (const auto c : cells_[b])
                if (const double volume = bodies_[b].points.initial_volume; volume > most * grid_.mesh.area(c))
                    throw SceneError(fmt::format(
                        "{}: body '{}': a point stands for {:.3g} m^2, and lies in a cell of {:.3g} m^2 at ({:.4g}, {:.4g}) m: the mesh is "
                        "finer than the points, ask for more points_per_cell or a smaller grid.cell_size",
                        scene.path, bodies_[b].name, volume, grid_.mesh.area(c), grid_.mesh.places(c)[0][0], grid_.mesh.places(c)[0][1]));
    }

    /// Every point finds its cell. @throws Diverged when one has left the mesh
    void find_cells()
    {
        if (cloud_.has_moved())
            cloud_.sort();
        for (std::size_t b = 0; b < bodies_.size(); ++b)
            find_points(grid_.mesh, bodies_[b], cells_[b]);
    }

    /// Nodes start with the bodies' velocity at their own position, weighted by the mass that each body gives them.
    void set_initial_velocity(const Scene& scene)
    {
        VectorField<3> sums;  // of momentum and mass
        for (auto& component : sums)
            component.assign(grid_.mesh.nodes(), 0.0);
        std::vector<std::optional<VectorExpression>> velocity;
        for (const BodySpec& body : scene.bodies)
            velocity.push_back(body.velocity ? std::optional<VectorExpression>(std::in_place, *body.velocity, scene.expression_constants())
                                             : std::nullopt);
        for_each_point(bodies_, cells_,
                       [&](const Body& body, std::size_t b, std::size_t, std::uint32_t c)
                       {
                           for (const auto n : grid_.mesh.corners(c))
                           {
                               const Vec<2>& x = grid_.mesh.place(n);
                               const Vec<2> v = velocity[b] ? (*velocity[b])({x[0], x[1], x[0], x[1], 0}) : Vec<2>{0, 0};
                               const double m = body.points.mass / static_cast<double>(grid_.mesh.corners(c).size());
                               sums[0][n] += m * v[0];
                               sums[1][n] += m * v[1];
                               sums[2][n] += m;
                           }
                       });
        for (const auto n : grid_.nodes.active())
            set(grid_.nodes.v, n, {sums[0][n] / sums[2][n], sums[1][n] / sums[2][n]});
    }

    void restrain() { node_ops_.restrain(numbers_, grid_.nodes, grid_.nodes.v); }

    void add_body_force() override
    {
        const VectorField<2>& acceleration = body_force_->at_points();
        std::size_t number = 0;  // points come in the order of the bodies
        const auto force = [&](const Body& body, std::size_t, std::size_t)
        {
            const double mass = body.points.mass * body.points.weight_share;
            const Vec<2> a = at(acceleration, number++);
            return Vec<2>{mass * a[0], mass * a[1]};
        };
        spread_to_nodes(grid_.mesh, bodies_, cells_, force, grid_.nodes.f);
    }
    void find_weight() override
    {
        VectorField<1> weight{std::vector<double>(grid_.mesh.nodes(), 0.0)};
        const auto of_point = [](const Body& body, std::size_t, std::size_t)
        { return std::array{body.points.mass * body.points.weight_share}; };
        spread_to_nodes(grid_.mesh, bodies_, cells_, of_point, weight);
        weight_->nodes = std::move(weight[0]);
    }

    Lattice<2> lattice_;  ///< whose cells are the bins of the points
    Lattice<2> numbers_;  ///< of the nodes
    MeshGrid grid_;
    LpfdmSpec options_;
    double shape_;  ///< step limit of the stiffest cell over that of the square
    CellsOfPoints cells_;
};
}  // namespace

std::unique_ptr<Solver> make_mesh_lpfdm(const Scene& scene)
{
    return std::make_unique<MeshLpfdm>(scene, make_mesh(scene));
}
}  // namespace testbed
