#include "fem_reference/fem.hpp"

#include <algorithm>
#include <cmath>
#include <deal.II/base/multithread_info.h>
#include <deal.II/lac/precondition.h>
#include <deal.II/lac/solver_cg.h>
#include <deal.II/lac/sparse_direct.h>
#include <fmt/format.h>
#include <malloc.h>

namespace testbed
{
FemSolver::FemSolver(const Scene& scene, const Warn& warn, MassKind mass_kind)
    : path_(scene.path),
      lattice_(mesh_lattice(scene)),
      bodies_(make_bodies(scene, make_lattice(scene.grid), {.strength = false})),
      elasticity_(scene, lattice_, warn),
      sampler_(scene, lattice_, elasticity_.dofs(), bodies_),
      mass_kind_(mass_kind)
{
    const auto n = elasticity_.dofs().n_dofs();
    for (Vector* field : {&displacement_, &acceleration_, &load_})
        field->reinit(n);
    velocity_ = elasticity_.initial_velocity();
}

void FemSolver::assemble_once()
{
    if (!assembled_)
        timer_("assembly", [&] { elasticity_.assemble(mass_kind_); });
    assembled_ = true;
}

void FemSolver::do_prepare(const Step& step)
{
    const auto [t, dt, last_dt] = step;
    assemble_once();
    time_ = t;
    prepare_step(t, dt);
}

Vector FemSolver::imbalance() const
{
    Vector force(load_.size());
    elasticity_.stiffness().vmult(force, displacement_);
    force.sadd(-1, 1, load_);
    elasticity_.hold(force);
    return force;
}

MotionSums FemSolver::sums() const
{
    Vector now(velocity_);
    now.add(lag_, acceleration_);
    MotionSums result = elasticity_.motion(now);
    Vector internal(load_.size());
    elasticity_.stiffness().vmult(internal, displacement_);
    if (const double size = internal.l2_norm(); size > 0)
        result.unbalanced = imbalance().l2_norm() / size;
    return result;
}

double FemSolver::strain_energy() const
{
    Vector internal(load_.size());
    elasticity_.stiffness().vmult(internal, displacement_);
    return 0.5 * (internal * displacement_);
}

void FemSolver::update_points()
{
    sampler_.sample(displacement_, bodies_);
}

double FemSolver::critical_time_step(const Scene& scene)
{
    return testbed::critical_time_step(scene) / (scene.options<FemSpec>().degree * cells_per_lattice_cell(scene));
}

std::size_t FemSolver::bytes() const
{
    return bytes_of(bodies_) + elasticity_.bytes() + sampler_.bytes() + 4 * load_.memory_consumption() + factor_bytes();
}

namespace
{
/// LU factors of UMFPACK with the memory they take, which neither UMFPACK nor deal.II tells.
class Factors
{
public:
    /// @throws dealii::ExceptionBase if the matrix is singular
    void factorise(const Matrix& matrix)
    {
        const std::size_t before = heap_in_use();
        solver_.factorize(matrix);
        bytes_ = std::max(heap_in_use(), before) - before;
    }
    void solve(Vector& field) const { solver_.solve(field); }
    std::size_t bytes() const { return bytes_; }

private:
    static std::size_t heap_in_use()
    {
        const struct mallinfo2 info = ::mallinfo2();
        return info.uordblks + info.hblkhd;
    }
    dealii::SparseDirectUMFPACK solver_;
    std::size_t bytes_ = 0;
};

class StaticFem final : public FemSolver
{
public:
    StaticFem(const Scene& scene, const Warn& warn) : FemSolver(scene, warn, MassKind::none)
    {
        elasticity_.check_supports();
        velocity_ = 0.0;
        extent_ = std::max(scene.grid.size[0], scene.grid.size[1]);
    }
    bool is_static() const override { return true; }

    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        timer_("loads", [&] { load_ = elasticity_.load(time_ + dt); });
        double driving = 0;
        try
        {
            timer_("factorisation", [&] { factorise(); });
            timer_("solve",
                   [&]
                   {
                       const Vector walls = elasticity_.prescribed(time_ + dt);
                       elasticity_.stiffness().vmult(displacement_, walls);
                       displacement_.sadd(-1, 1, load_);
                       elasticity_.hold(displacement_);
                       driving = displacement_.l2_norm();
                       factors_.solve(displacement_);
                       elasticity_.hold(displacement_);
                       displacement_ += walls;
                   });
        }
        catch (const dealii::ExceptionBase&)
        {
            fail();
        }
        // a mechanism within the mesh, such as cells that meet in a corner, may pass the factorisation by rounding
        if (!(displacement_.linfty_norm() < 1e6 * extent_) || !(imbalance().l2_norm() <= 1e-6 * driving))
            fail();
    }

private:
    void prepare_step(double, double) override {}
    void factorise()
    {
        Matrix matrix;
        elasticity_.combine(1, 0, matrix);
        factors_.factorise(matrix);
    }
    std::size_t factor_bytes() const override { return factors_.bytes(); }
    [[noreturn]] void fail() const
    {
        throw SceneError(fmt::format("{}: the stiffness matrix is singular: a part of the mesh can move without strain; add supports "
                                     "([[boundary]]), or set fem.analysis = \"dynamic\"",
                                     path_));
    }

    Factors factors_;
    double extent_ = 0;
};

/// Average acceleration, beta = 1/4, gamma = 1/2: no numerical damping, stable for any step.
class NewmarkFem final : public FemSolver
{
public:
    NewmarkFem(const Scene& scene, const Warn& warn) : FemSolver(scene, warn, MassKind::consistent) {}

    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        timer_("predictor",
               [&]
               {
                   displacement_.add(dt, velocity_, 0.25 * dt * dt, acceleration_);
                   velocity_.add(0.5 * dt, acceleration_);
                   load_ = elasticity_.load(time_ + dt);
                   acceleration_ = imbalance();
                   acceleration_ *= 4 / (dt * dt);
               });
        timer_("solve",
               [&]
               {
                   factors_.solve(acceleration_);
                   elasticity_.hold(acceleration_);
               });
        displacement_.add(0.25 * dt * dt, acceleration_);
        velocity_.add(0.5 * dt, acceleration_);
    }

private:
    void prepare_step(double t, double dt) override
    {
        if (dt != factorised_dt_)
            timer_("factorisation", [&] { factorise(dt); });
        factorised_dt_ = dt;
        if (!started_)
            timer_("initial acceleration", [&] { start(t); });
        started_ = true;
    }
    void factorise(double dt)
    {
        Matrix matrix;
        elasticity_.combine(1, 4 / (dt * dt), matrix);
        factors_.factorise(matrix);
    }
    void start(double t)
    {
        load_ = elasticity_.load(t);
        const Vector force = imbalance();
        if (force.l2_norm() == 0)
            return;
        Matrix mass;
        elasticity_.combine(0, 1, mass);
        dealii::PreconditionJacobi<Matrix> preconditioner;
        preconditioner.initialize(mass);
        dealii::SolverControl control(1000, 1e-14 * force.l2_norm());
        dealii::SolverCG<Vector>(control).solve(mass, acceleration_, force, preconditioner);
        elasticity_.hold(acceleration_);
    }
    std::size_t factor_bytes() const override { return factors_.bytes(); }

    Factors factors_;  ///< of K + 4 M / dt^2
    double factorised_dt_ = 0;
};

/// Leap-frog with lumped mass: velocities live on half steps.
class CentralDifferenceFem final : public FemSolver
{
public:
    CentralDifferenceFem(const Scene& scene, const Warn& warn) : FemSolver(scene, warn, MassKind::lumped) {}

    double critical_time_step(const Scene&) override { return stable_time_step(); }
    void do_advance(const Step& step) override
    {
        const double dt = step.dt;
        velocity_.add(step.kick(), acceleration_);
        displacement_.add(dt, velocity_);
        started_ = true;
    }

private:
    double stable_time_step()
    {
        assemble_once();
        if (limit_ == 0)
            timer_("largest eigenvalue", [&] { limit_ = 2 / elasticity_.largest_frequency(); });
        return limit_;
    }
    void prepare_step(double t, double dt) override
    {
        if (dt != checked_dt_)
            check(dt);
        timer_("loads", [&] { load_ = elasticity_.load(t); });
        timer_("internal forces, acceleration",
               [&]
               {
                   acceleration_ = imbalance();
                   for (std::size_t dof = 0; dof < acceleration_.size(); ++dof)
                       acceleration_(dof) /= elasticity_.lumped_mass()(dof);
               });
        lag_ = started_ ? 0.5 * dt : 0;
    }
    void check(double dt)
    {
        if (const double limit = stable_time_step(); dt > limit * (1 + 1e-6))
            throw SceneError(fmt::format("{}: the time step {:.6g} s is above the limit of central differences on this mesh, {:.6g} s; "
                                         "lower time.dt (or time.cfl to 1 or less), or set fem.integrator = \"newmark\"",
                                         path_, dt, limit));
        checked_dt_ = dt;
    }

    double limit_ = 0, checked_dt_ = 0;
};
}  // namespace

std::unique_ptr<Solver> make_fem(const Scene& scene, const Warn& warn)
{
    // the triangular solves are serial and dominate; threads in deal.II would only change the order of sums
    dealii::MultithreadInfo::set_thread_limit(1);
    const Warn say = warn ? warn : [](const std::string& message) { fmt::print(stderr, "warning: {}\n", message); };
    const bool damped = scene.damping && scene.damping->acts();
    const bool ramped = scene.gravity && scene.gravity->ramp > 0;
    const bool moving = std::any_of(scene.walls.begin(), scene.walls.end(), [](const WallSpec& wall) { return wall.velocity.has_value(); });
    using Analysis = FemSpec::Analysis;
    if (scene.options<FemSpec>().analysis == Analysis::statics ||
        (scene.options<FemSpec>().analysis == Analysis::by_scene && (damped || ramped || moving || scene.time.stop_unbalanced)))
        return std::make_unique<StaticFem>(scene, say);
    if (moving)
        throw SceneError(fmt::format("{}: walls move only in fem.analysis = \"static\" (the state at time.end)", scene.path));
    if (damped)
        throw SceneError(fmt::format("{}: fem.analysis = \"dynamic\" takes no damping; leave [damping] out (--set damping.local=0), "
                                     "or set fem.analysis = \"static\" for the state at rest",
                                     scene.path));
    switch (scene.options<FemSpec>().integrator)
    {
    case FemSpec::Integrator::central_difference: return std::make_unique<CentralDifferenceFem>(scene, say);
    case FemSpec::Integrator::newmark: return std::make_unique<NewmarkFem>(scene, say);
    }
    throw std::logic_error("not an integrator");
}
}  // namespace testbed
