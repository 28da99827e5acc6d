#include "core/run/observer.hpp"

#include "core/scene/geometry.hpp"

#include <cmath>
#include <fmt/format.h>

namespace testbed
{
Observer::Observer(const Scene& scene, const Solver& solver)
    : scene_(scene),
      solver_(solver),
      lattice_(make_lattice(scene.grid)),
      ledger_(scene.may_flow(), scene.confinement ? scene.confinement->pressure : 0)
{
    const Constants constants = scene.expression_constants();
    if (const auto found = scene.exact.find(name_of(solver.kinematics())); found != scene.exact.end())
    {
        if (found->second.displacement)
            for (const auto& text : *found->second.displacement)
                exact_.displacement.emplace_back(text, constants);
        if (found->second.stress)
            for (const auto& text : *found->second.stress)
                exact_.stress.emplace_back(text, constants);
    }
    if (scene.gravity)
        gravity_ = make_gravity(*scene.gravity);
    last_moment_ = point_sums(solver.bodies(), lattice_).moment;
    const std::vector<Vec<2>> initial = initial_positions(scene);
    for (const ProbeSpec& spec : scene.probes)
    {
        const Expression where(spec.where, constants);
        Probe probe{spec.name};
        for (std::uint32_t id = 0; id < initial.size(); ++id)
            if (const Vec<2>& X = initial[id]; where({.X = X[0], .Y = X[1], .x = X[0], .y = X[1]}) != 0)
            {
                probe.ids.push_back(id);
                probe.initial.push_back(X);
            }
        if (probe.ids.empty())
            throw SceneError(fmt::format("{}: probe '{}': where = \"{}\" holds at no point", scene.path, spec.name, spec.where));
        probe.series = {{"displacement", "m", 3}, {"velocity", "m/s", 3}, {"stress", "Pa", 6}};
        if (!exact_.displacement.empty())
            probe.series.push_back({"exact_displacement", "m", 3});
        if (!exact_.stress.empty())
            probe.series.push_back({"exact_stress", "Pa", 6});
        probes_.push_back(std::move(probe));
    }
    list_columns();
}

std::vector<Observer::Location> Observer::locations() const
{
    std::size_t n = 0;
    for (const Body& body : solver_.bodies())
        n += body.points.count;
    std::vector<Location> where(n);
    for (std::uint32_t b = 0; b < solver_.bodies().size(); ++b)
    {
        const Points<2>& q = solver_.bodies()[b].points;
        for (std::uint32_t p = 0; p < q.count; ++p)
            where[q.id[p]] = {b, p};
    }
    return where;
}

Place Observer::place(const Location& at, const Vec<2>& initial, double t) const
{
    const Points<2>& q = solver_.bodies()[at.body].points;
    return {initial[0], initial[1], q.x[0][at.point], q.x[1][at.point], t};
}

std::array<double, 6> Observer::stress(const Location& at) const
{
    const Body& body = solver_.bodies()[at.body];
    const Points<2>& q = body.points;
    return {q.stress[0][at.point], q.stress[2][at.point], 0, q.stress[1][at.point], 0, out_of_plane_stress(body.material, q, at.point)};
}

std::array<double, 6> Observer::exact_stress(const Place& at) const
{
    const auto& e = exact_.stress;  // xx, yy, zz, xy
    return {e[0](at), e[3](at), 0, e[1](at), 0, e[2](at)};
}

std::array<double, 3> Observer::exact_displacement(const Place& at) const
{
    return {exact_.displacement[0](at), exact_.displacement[1](at), 0};
}

double Observer::gravity_work(double t, const Vec<2>& moment)
{
    const double f = 0.5 * (gravity_->factor(last_time_) + gravity_->factor(t));
    double fall = 0;
    for (std::size_t k = 0; k < 2; ++k)
        fall += gravity_->acceleration[k] * (moment[k] - last_moment_[k]);
    gravity_work_ += f * fall;
    gravity_work_error_ += 0.5 * std::abs((gravity_->factor(t) - gravity_->factor(last_time_)) * fall);
    last_time_ = t;
    last_moment_ = moment;
    return gravity_work_;
}

const GuardSample& Observer::sample(double t, double dt, bool fresh)
{
    const MotionSums motion = solver_.sums();
    const PointSums state = point_sums(solver_.bodies(), lattice_);
    if (!std::isfinite(motion.kinetic_energy) || !std::isfinite(state.strain_energy))
        throw Diverged(fmt::format("energy is not finite at t = {:.6g} s", t));
    if (gravity_)
    {
        gravity_work(t, state.moment);
        add(history_, "gravity_factor", "-", gravity_->factor(t));
    }
    const Stopwatch watch;
    const auto work = solver_.work();
    const double plastic = work && !work->of_strain ? plastic_.add(solver_.bodies()) : 0;
    last_ = {t,
             dt,
             ledger_.at(motion.kinetic_energy, state, work, plastic),
             0,
             motion,
             state,
             fresh ? solver_.point_motion() : last_.point_motion,
             gravity_work_,
             gravity_work_error_,
             fresh};
    last_.energy_scale = ledger_.scale();
    guard_seconds_ += watch.seconds();
    add(history_, "time", "s", t);
    add(history_, "kinetic_energy", "J/m", motion.kinetic_energy);
    add(history_, "strain_energy", "J/m", state.strain_energy);
    add(history_, "gravity_work", "J/m", gravity_work_);
    add(history_, "linear_momentum", "kg/s", std::array{motion.momentum[0], motion.momentum[1], 0.0});
    add(history_, "angular_momentum", "kg m/s", motion.angular_momentum);
    add(history_, "unbalanced_force", "-", motion.unbalanced);
    add(history_, "max_stress", "Pa", state.max_stress);
    write_ledger(last_, work.has_value());
    sample_restraints();
    if (!probes_.empty())
        sample_probes(t);
    return last_;
}

void Observer::write_ledger(const GuardSample& s, bool has_work)
{
    add(history_, "kinetic_energy_points", "J/m", s.point_motion.kinetic_energy);
    add(history_, "volume_ratio_min", "-", s.points.smallest);
    add(history_, "volume_ratio_max", "-", s.points.largest);
    add(history_, "points_outside", "-", s.points.outside);
    add(history_, "courant_motion", "-", s.point_motion.speed * s.dt / lattice_.cell_size);
    if (!has_work)
        return;
    add(history_, "external_work", "J/m", s.energy.external);
    add(history_, "plastic_dissipation", "J/m", s.energy.plastic);
    add(history_, "damping_dissipation", "J/m", s.energy.damping);
    add(history_, "hourglass_dissipation", "J/m", s.energy.hourglass);
    add(history_, "numerical_energy", "J/m", s.energy.numerical);
}

void Observer::add(std::vector<Series>& list, const std::string& name, const char* unit, std::span<const double> row)
{
    auto found = std::find_if(list.begin(), list.end(), [&](const Series& s) { return s.name == name; });
    if (found == list.end())
        found = list.insert(list.end(), {name, unit, row.size()});
    found->values.insert(found->values.end(), row.begin(), row.end());
}

void Observer::sample_restraints()
{
    for (const RestraintRecord& r : solver_.restraints())
    {
        std::vector<Series>& series = supports_[r.name];
        add(series, "reaction", "N/m", std::array{r.reaction[0], r.reaction[1], 0.0});
        if (r.displacement)
            add(series, "displacement", "m", std::array{(*r.displacement)[0], (*r.displacement)[1], 0.0});
    }
}

void Observer::sample_probes(double t)
{
    const std::vector<Location> where = locations();
    for (Probe& probe : probes_)
    {
        std::vector<std::vector<double>> mean;
        for (const Series& s : probe.series)
            mean.emplace_back(s.columns, 0.0);
        for (std::size_t n = 0; n < probe.ids.size(); ++n)
        {
            const Location at = where[probe.ids[n]];
            const Place here = place(at, probe.initial[n], t);
            const Vec<2> v = solver_.velocity(at.body, at.point);
            const auto add = [&](std::size_t k, const auto& values)
            {
                for (std::size_t c = 0; c < values.size(); ++c)
                    mean[k][c] += values[c] / static_cast<double>(probe.ids.size());
            };
            add(0, std::array<double, 3>{here.x - here.X, here.y - here.Y, 0});
            add(1, std::array<double, 3>{v[0], v[1], 0});
            add(2, stress(at));
            std::size_t next = 3;
            if (!exact_.displacement.empty())
                add(next++, exact_displacement(here));
            if (!exact_.stress.empty())
                add(next, exact_stress(here));
        }
        for (std::size_t k = 0; k < mean.size(); ++k)
            probe.series[k].values.insert(probe.series[k].values.end(), mean[k].begin(), mean[k].end());
    }
}

double Observer::kinetic_ratio(const Solver& solver)
{
    const double strain = strain_energy(solver.bodies());
    return strain > 0 ? solver.sums().kinetic_before / strain : std::numeric_limits<double>::infinity();
}

void Observer::write_history(ResultFile& file) const
{
    for (const Series& s : history_)
        file.dataset("/history/" + s.name, s.unit, s.values, s.columns);
    for (const auto& [support, series] : supports_)
        for (const Series& s : series)
            file.dataset("/history/supports/" + support + "/" + s.name, s.unit, s.values, s.columns);
    for (const Probe& probe : probes_)
        for (const Series& s : probe.series)
            file.dataset("/history/probes/" + probe.name + "/" + s.name, s.unit, s.values, s.columns);
}

}  // namespace testbed
