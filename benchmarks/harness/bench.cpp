#include "benchmarks/harness/bench.hpp"

#include "core/base/provenance.hpp"
#include "core/run/results.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <thread>

namespace testbed
{
namespace
{
/// a = b + s c over arrays far larger than any cache, counted as 24 bytes per number (McCalpin's STREAM) [B/s].
double triad_bandwidth(int team)
{
    set_threads(team);
    constexpr std::size_t block = 4096, n = 6000 * block;
    std::vector<double> a(n), b(n, 1.0), c(n, 2.0);
    double best = 1e300;
    for (int repeat = 0; repeat < 5; ++repeat)
    {
        const Stopwatch watch;
        parallel_for(n / block,
                     [&](std::size_t k)
                     {
                         for (std::size_t i = k * block; i < (k + 1) * block; i += pack_size)
                             (Pack(&b[i], stdx::element_aligned) + Pack(0.5) * Pack(&c[i], stdx::element_aligned))
                                 .copy_to(&a[i], stdx::element_aligned);
                     });
        best = std::min(best, watch.seconds());
    }
    return 24.0 * n / best;
}

/// Bytes of the fields that a step must read, and write where it changes them, once per point.
double traffic(const Solver& solver)
{
    static const std::vector<std::string_view> unread{"id", "X", "Y"}, constant{"stiffness_ratio", "cohesion", "sin_friction_angle"};
    double bytes = 0, points = 0;
    for (const Body& body : solver.bodies())
    {
        const auto n = static_cast<double>(body.points.count);
        points += n;
        body.points.for_each_field(
            [&](const auto& field)
            {
                const auto is_in = [&](const auto& list) { return std::find(list.begin(), list.end(), field.name()) != list.end(); };
                if (!is_in(unread))
                    bytes += n * sizeof(double) * (is_in(constant) ? 1 : 2);
            });
    }
    return bytes / points;
}

struct Measurement
{
    std::string method, law;
    int team = 1;
    std::size_t points = 0, cells = 0, steps = 0;
    double setup = 0, seconds = 0, fastest = 0;  ///< per step: median and least of ten slices [s]
    double bytes = 0, traffic = 0;               ///< per point
    std::vector<std::pair<std::string, double>> phases;

    double rate() const { return static_cast<double>(points) / seconds; }
};

std::vector<std::string> settings(const std::string& law, double points)
{
    if (law == "elastic")
        return {fmt::format("constants.cells={}", std::max(1L, std::lround(std::sqrt(points) / 4)))};
    // the section of the cliff is 461 m2; its width of 50 m is a whole number of cells
    const double L = 50 / std::max(1.0, std::round(50 / std::sqrt(16 * 461 / points) / 5)) / 5;
    return {fmt::format("grid.cell_size={:.17g}", L), fmt::format("time.dt={:.17g}", 5e-4 * L)};
}

Measurement measure(const std::string& method, const std::string& law, double points, int team, double seconds,
                    const MakeSolver& make_solver)
{
    set_threads(team);
    const Stopwatch setup;
    const std::string scene_path = std::string(BENCHMARKS) + (law == "elastic" ? "/elastic/speed/scene.toml" : "/soil/cliff/scene.toml");
    const Scene scene = load_scene(scene_path, method, settings(law, points)).scene;
    const std::unique_ptr<Solver> solver = make_solver(scene);
    Measurement m;
    m.method = method;
    m.law = law;
    m.team = team;
    m.setup = setup.seconds();
    const double dt = time_step(scene, *solver);
    std::size_t step = 0;
    const auto advance = [&](std::size_t steps)
    {
        const Stopwatch watch;
        for (std::size_t n = 0; n < steps; ++n, ++step)
        {
            solver->prepare(static_cast<double>(step) * dt, dt);
            solver->advance(dt);
        }
        return watch.seconds() / static_cast<double>(steps);
    };
    const double once = advance(3);
    const auto before = solver->timer().phases();
    const std::size_t slice = std::max<std::size_t>(3, static_cast<std::size_t>(seconds / 10 / once));
    std::vector<double> slices;
    for (int k = 0; k < 10; ++k)
        slices.push_back(advance(slice));
    std::sort(slices.begin(), slices.end());
    m.seconds = 0.5 * (slices[4] + slices[5]);
    m.fastest = slices.front();
    m.steps = step;
    for (const auto& [name, total] : solver->timer().phases())
    {
        const auto old = std::find_if(before.begin(), before.end(), [&](const auto& p) { return std::string_view(p.first) == name; });
        m.phases.emplace_back(name, (total - (old == before.end() ? 0 : old->second)) / (10.0 * static_cast<double>(slice)));
    }
    for (const Body& body : solver->bodies())
        m.points += body.points.count;
    m.cells = solver->active_cells();
    m.bytes = static_cast<double>(solver->bytes()) / static_cast<double>(m.points);
    m.traffic = traffic(*solver);
    return m;
}
}  // namespace

void bench(const BenchOptions& options, const MakeSolver& make_solver)
{
    std::vector<std::string> methods = options.methods,
                             laws = options.laws.empty() ? std::vector<std::string>{"elastic", "mohr_coulomb"} : options.laws;
    if (methods.empty())
        for (const Variant& v : variants())
            if (v.family != Family::fem)
                methods.emplace_back(v.name);
    for (const std::string& method : methods)
        if (find_variant(method).family == Family::fem)
            throw SceneError("bench: the FEM reference has no particles");
    for (const double points : options.points)
        if (!(points >= 16 && points <= 1e9))
            throw SceneError(fmt::format("bench: --points from 16 to 1e9, not {}", points));
    if (!(options.seconds > 0 && options.seconds <= 3600))
        throw SceneError(fmt::format("bench: --seconds above 0 and at most 3600, not {}", options.seconds));
    const int all = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    std::vector<int> teams = options.threads;
    if (teams.empty())
        teams = all > 1 ? std::vector<int>{1, all} : std::vector<int>{1};

    const double load = load_average();
    const bool busy = load > 0.5 * all;
    if (busy)
        fmt::print(stderr, "warning: the load average is {:.2f}: the numbers are those of a busy machine, and are marked so\n", load);
    std::vector<double> triad;
    for (const int team : teams)
        triad.push_back(triad_bandwidth(team));
    fmt::print("{}, {} cores, commit {}, load {:.2f}\n", cpu_name(), all, build().commit, load);
    for (std::size_t k = 0; k < teams.size(); ++k)
        fmt::print("triad, {} thread{}: {:.1f} GB/s\n", teams[k], teams[k] > 1 ? "s" : "", 1e-9 * triad[k]);
    fmt::print("{:<16} {:<13} {:>9} {:>7} {:>11} {:>11} {:>9} {:>9} {:>9}\n", "method", "law", "points", "threads", "Mpoint-st/s",
               "fastest", "B/point", "of bound", "set-up s");

    std::ofstream csv;
    if (!options.output.empty())
    {
        csv.open(options.output);
        if (!csv)
            throw SceneError(fmt::format("cannot write '{}': {}", options.output, std::strerror(errno)));
        csv << fmt::format("# {}, {} cores, {}, {}, commit {}, load {:.2f}{}\n", cpu_name(), all, build().compiler, build().flags,
                           build().commit, load, busy ? ", busy" : "")
            << "method,law,points,cells,threads,steps,seconds_per_step,fastest_seconds_per_step,particle_steps_per_second,bytes_per_point,"
               "traffic_bytes_per_point,triad_bytes_per_second,share_of_traffic_bound,setup_seconds,phases\n";
    }
    for (const std::string& law : laws)
        for (const std::string& method : methods)
            for (const double points : options.points)
                for (std::size_t k = 0; k < teams.size(); ++k)
                {
                    Measurement m;
                    try
                    {
                        m = measure(method, law, points, teams[k], options.seconds, make_solver);
                    }
                    catch (const Diverged& e)
                    {
                        fmt::print("{:<16} {:<13} {:>9.0f} {:>7} diverged: {}\n", method, law, points, teams[k], e.what());
                        continue;
                    }
                    const double share = m.rate() * m.traffic / triad[k];
                    fmt::print("{:<16} {:<13} {:>9} {:>7} {:>11.1f} {:>11.1f} {:>9.1f} {:>9.2f} {:>9.2f}\n", method, law, m.points,
                               teams[k], 1e-6 * m.rate(), 1e-6 * static_cast<double>(m.points) / m.fastest, m.bytes, share, m.setup);
                    std::fflush(stdout);
                    std::vector<std::string> phases;
                    for (const auto& [name, seconds] : m.phases)
                        phases.push_back(fmt::format("{}: {:.4g}", name, seconds));
                    csv << fmt::format("{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.5g},{:.5g},{:.5g},{:.4g},{:.4g},\"{}\"\n", method, law,
                                       m.points, m.cells, teams[k], m.steps, m.seconds, m.fastest, m.rate(), m.bytes, m.traffic, triad[k],
                                       share, m.setup, fmt::join(phases, "; "))
                        << std::flush;
                }
    if (!options.output.empty() && !csv)
        throw OutputError(fmt::format("writing '{}' failed (disk full?)", options.output));
}
}  // namespace testbed
