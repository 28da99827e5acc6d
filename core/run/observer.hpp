#pragma once
/// What is recorded of a run: the history of sums and probes, and snapshots of all points in the order of their ids.

#include "core/bodies/plastic_work.hpp"
#include "core/loads/node_ops.hpp"
#include "core/run/guards.hpp"
#include "core/run/results.hpp"
#include "core/run/solver.hpp"

#include <functional>
#include <map>
#include <optional>
#include <span>

namespace testbed
{
class Observer
{
public:
    /// @throws SceneError when a probe has no points
    Observer(const Scene& scene, const Solver& solver);

    /// Adds one sample to the history, and returns it. @param dt of the coming step [s]
    /// @param fresh whether the velocities of the points are looked at anew: that costs about a step
    /// @throws Diverged for a value that is not finite
    const GuardSample& sample(double t, double dt, bool fresh = true);
    /// Kinetic energy at the half step before over strain energy.
    static double kinetic_ratio(const Solver& solver);
    void snapshot(ResultFile& file, double t, std::int64_t step);
    void write_history(ResultFile& file) const;

    /// All that was recorded so far but the snapshots, which are in the result file.
    template <class Archive>
    void state(Archive& a);
    double guard_seconds() const { return guard_seconds_; }  ///< spent on what the guards alone need
    std::size_t snapshots() const { return snapshot_times_.size(); }
    /// The file that shows the snapshots in ParaView. @param name of the HDF5 file, without folder
    std::string xdmf(const std::string& name) const;

private:
    struct Location
    {
        std::uint32_t body, point;
    };
    struct Series
    {
        std::string name, unit;
        std::size_t columns = 1;
        std::vector<double> values{};
    };
    struct Probe
    {
        std::string name;
        std::vector<std::uint32_t> ids{};
        std::vector<Vec<2>> initial{};
        std::vector<Series> series{};
    };
    struct Exact
    {
        std::vector<Expression> displacement{}, stress{};
    };

    /// A dataset of a snapshot: a row for each point.
    struct Column
    {
        std::string name, unit;
        std::size_t columns;
        std::function<void(const Location&, const Place&, double*)> fill;
        bool at_start_only = false;
    };

    void list_columns();
    /// Columns for those fields of the points that say that they are shown.
    void list_fields();
    std::vector<Location> locations() const;
    Place place(const Location& at, const Vec<2>& initial, double t) const;
    std::array<double, 6> stress(const Location& at) const;
    std::array<double, 6> exact_stress(const Place& at) const;
    std::array<double, 3> exact_displacement(const Place& at) const;
    /// The work of gravity on the points up to time t [J/m].
    double gravity_work(double t, const Vec<2>& moment);
    /// @param has_work whether the method knows its work, and with it the energies of the ledger
    void write_ledger(const GuardSample& sample, bool has_work);
    void sample_probes(double t);
    void sample_restraints();
    /// Adds a row to the series of that name.
    static void add(std::vector<Series>& list, const std::string& name, const char* unit, std::span<const double> row);
    static void add(std::vector<Series>& list, const std::string& name, const char* unit, double value)
    {
        add(list, name, unit, {&value, 1});
    }

    const Scene& scene_;
    const Solver& solver_;
    Exact exact_;
    std::optional<Gravity> gravity_;
    std::vector<Series> history_;
    std::map<std::string, std::vector<Series>> supports_;
    std::vector<Probe> probes_;
    std::vector<double> snapshot_times_;
    std::vector<Column> columns_;
    Lattice<2> lattice_;
    Ledger ledger_;
    PlasticWork plastic_;
    GuardSample last_;
    double gravity_work_ = 0, gravity_work_error_ = 0, last_time_ = 0, guard_seconds_ = 0;
    Vec<2> last_moment_;
};

template <class Archive>
void Observer::state(Archive& a)
{
    std::size_t samples = 0;
    const auto list = [&](const std::string& name, std::vector<Series>& series)
    {
        a.group(name,
                [&]
                {
                    if constexpr (Archive::reads)
                        if (series.empty())  // else known from the start: those of a probe
                            for (const auto& part : a.coming())
                            {
                                samples = samples ? samples : part.count;  // the first one has one number for each
                                series.push_back({part.name, part.unit, part.count / samples});
                            }
                    for (Series& s : series)
                        a.column(s.name, s.unit, s.values);
                });
    };
    list("history", history_);
    for (const RestraintRecord& r : solver_.restraints())
        list("support/" + r.name, supports_[r.name]);
    for (Probe& probe : probes_)
        list("probe/" + probe.name, probe.series);
    a.column("snapshot_times", "s", snapshot_times_);
    a.group("ledger", [&] { ledger_.state(a); });
    a.group("plastic", [&] { plastic_.state(a); });
    a.value("gravity_work", "J/m", gravity_work_);
    a.value("gravity_work_error", "J/m", gravity_work_error_);
    a.value("last_time", "s", last_time_);
    a.vector("last_moment", "kg m", last_moment_);
    a.value("guard_seconds", "s", guard_seconds_);
    PointMotion& motion = last_.point_motion;
    a.value("kinetic_energy_points", "J/m", motion.kinetic_energy);
    a.value("speed", "m/s", motion.speed);
    a.vector("momentum", "kg/s", motion.momentum);
    a.value("mass", "kg/m", motion.mass);
}
}  // namespace testbed
