#include "benchmarks/harness/bench.hpp"

#include "benchmarks/harness/bench_scenes.hpp"
#include "core/base/provenance.hpp"
#include "core/run/results.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
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

/// One measurement to be made.
struct Item
{
    std::string method;
    BenchScene scene;
    double points;
    int points_per_cell;
};

struct Measurement
{
    Item item;
    int team = 1;
    std::size_t points = 0, cells = 0, steps = 0;
    double setup = 0, seconds = 0, fastest = 0;  ///< per step: median and least of ten slices [s]
    double bytes = 0, traffic = 0;               ///< per point
    double triad = 0;                            ///< bandwidth of the same team [B/s]
    std::vector<std::pair<std::string, double>> phases{};

    double rate() const { return static_cast<double>(points) / seconds; }
    double share_of_bound() const { return rate() * traffic / triad; }
};

/// Where the cases are: beside an installed program, else in the sources.
std::filesystem::path cases()
{
    const auto installed = std::filesystem::read_symlink("/proc/self/exe").parent_path() / INSTALLED;
    return std::filesystem::exists(installed) ? installed : std::filesystem::path(BENCHMARKS);
}

Measurement measure(const Item& item, int team, double seconds)
{
    set_threads(team);
    const Stopwatch setup;
    const std::string path = (cases() / item.scene.file).string();
    const Scene scene = load_scene(path, item.method, item.scene.settings(item.points, item.points_per_cell)).scene;
    const std::unique_ptr<Solver> solver = method_of(scene).make(scene);
    Measurement m{.item = item, .team = team, .setup = setup.seconds()};
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
    if (item.scene.begin > 0)
        advance(static_cast<std::size_t>(item.scene.begin / dt));
    const double once = advance(3);
    const auto before = solver->timer().phases();
    auto slice = static_cast<std::size_t>(seconds / 10 / once);
    if (item.scene.begin > 0)  // not beyond the run's end
        slice = std::min(slice, static_cast<std::size_t>((scene.time.end - item.scene.begin) / dt / 10));
    slice = std::max<std::size_t>(3, slice);
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

/// What is measured: all that the options leave open.
struct Plan
{
    std::vector<Item> items;
    std::vector<int> teams;
};

std::vector<std::string> methods_with_points()
{
    std::vector<std::string> names;
    for (const Method& method : methods())
        for (const Variant& variant : method.variants)
            if (method.make)
                names.push_back(variant.name);
    return names;
}

/// @throws SceneError
Plan plan_of(const BenchOptions& options, int cores)
{
    for (const std::string& method : options.methods)
        if (!find_method(method).make)
            throw SceneError(fmt::format("bench: '{}' is a program of its own, and has no particles", method));
    for (const double points : options.points)
        if (!(points >= 16 && points <= 1e9))
            throw SceneError(fmt::format("bench: --points from 16 to 1e9, not {}", points));
    if (!(options.seconds > 0 && options.seconds <= 3600))
        throw SceneError(fmt::format("bench: --seconds above 0 and at most 3600, not {}", options.seconds));
    const auto or_else = [](const auto& given, const auto& list) { return given.empty() ? list : given; };
    const auto is_wanted = [](const std::vector<std::string>& list, const char* name)
    { return list.empty() || std::find(list.begin(), list.end(), name) != list.end(); };
    Plan plan{{}, or_else(options.threads, cores > 1 ? std::vector<int>{1, cores} : std::vector<int>{1})};
    for (const BenchScene& scene : bench_scenes())
    {
        if (!is_wanted(options.scenes, scene.name) || !is_wanted(options.laws, scene.law))
            continue;
        const auto all_points =
            or_else(options.points, scene.own ? std::vector<double>{scene.own->points} : std::vector<double>{300, 1e4, 1e5, 1e6});
        const auto all_counts =
            or_else(options.points_per_cell, scene.own ? std::vector<int>{scene.own->points_per_cell} : std::vector<int>{4, 2});
        for (const std::string& method : or_else(options.methods, methods_with_points()))
            for (const double points : all_points)
                for (const int count : all_counts)
                    plan.items.push_back({method, scene, points, count});
    }
    if (plan.items.empty())
        throw SceneError("bench: no scene has both this --scene and this --law");
    return plan;
}

/// The machine and how busy it is before the first measurement.
struct Machine
{
    int cores = static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
    double load = load_average();

    bool is_busy() const { return load > 0.5 * cores; }
};

void print_heading(const Machine& machine, const std::vector<int>& teams, const std::vector<double>& triad)
{
    fmt::print("{}, {} cores, commit {}, load {:.2f}\n", cpu_name(), machine.cores, build().commit, machine.load);
    for (std::size_t k = 0; k < teams.size(); ++k)
        fmt::print("triad, {} thread{}: {:.1f} GB/s\n", teams[k], teams[k] > 1 ? "s" : "", 1e-9 * triad[k]);
    fmt::print("{:<16} {:<10} {:>6} {:>9} {:>7} {:>11} {:>11} {:>9} {:>9} {:>9}\n", "method", "scene", "a cell", "points", "threads",
               "Mpoint-st/s", "fastest", "B/point", "of bound", "set-up s");
}

void print_row(const Measurement& m)
{
    fmt::print("{:<16} {:<10} {:>6} {:>9} {:>7} {:>11.1f} {:>11.1f} {:>9.1f} {:>9.2f} {:>9.2f}\n", m.item.method, m.item.scene.name,
               fmt::format("{0} x {0}", m.item.points_per_cell), m.points, m.team, 1e-6 * m.rate(),
               1e-6 * static_cast<double>(m.points) / m.fastest, m.bytes, m.share_of_bound(), m.setup);
    std::fflush(stdout);
}

/// The file with its heading, or a closed one without a path. @throws SceneError
std::ofstream open_csv(const std::string& path, const Machine& machine)
{
    std::ofstream csv;
    if (path.empty())
        return csv;
    csv.open(path);
    if (!csv)
        throw SceneError(fmt::format("cannot write '{}': {}", path, std::strerror(errno)));
    csv << fmt::format("# {}, {} cores, {}, {}, commit {}, load {:.2f}{}\n", cpu_name(), machine.cores, build().compiler, build().flags,
                       build().commit, machine.load, machine.is_busy() ? ", busy" : "")
        << "method,law,points,cells,threads,steps,seconds_per_step,fastest_seconds_per_step,particle_steps_per_second,bytes_per_point,"
           "traffic_bytes_per_point,triad_bytes_per_second,share_of_traffic_bound,setup_seconds,phases,scene,points_per_cell\n";
    return csv;
}

std::string csv_row(const Measurement& m)
{
    std::vector<std::string> phases;
    for (const auto& [name, seconds] : m.phases)
        phases.push_back(fmt::format("{}: {:.4g}", name, seconds));
    return fmt::format("{},{},{},{},{},{},{:.6g},{:.6g},{:.6g},{:.5g},{:.5g},{:.5g},{:.4g},{:.4g},\"{}\",{},{}\n", m.item.method,
                       m.item.scene.law, m.points, m.cells, m.team, m.steps, m.seconds, m.fastest, m.rate(), m.bytes, m.traffic, m.triad,
                       m.share_of_bound(), m.setup, fmt::join(phases, "; "), m.item.scene.name, m.item.points_per_cell);
}
}  // namespace

void bench(const BenchOptions& options)
{
    const Machine machine;
    const Plan plan = plan_of(options, machine.cores);
    if (machine.is_busy())
        fmt::print(stderr, "warning: the load average is {:.2f}: the numbers are those of a busy machine, and are marked so\n",
                   machine.load);
    std::vector<double> triad;
    for (const int team : plan.teams)
        triad.push_back(triad_bandwidth(team));
    print_heading(machine, plan.teams, triad);
    std::ofstream csv = open_csv(options.output, machine);
    for (const Item& item : plan.items)
        for (std::size_t k = 0; k < plan.teams.size(); ++k)
            try
            {
                Measurement m = measure(item, plan.teams[k], options.seconds);
                m.triad = triad[k];
                print_row(m);
                csv << csv_row(m) << std::flush;
            }
            catch (const Diverged& e)
            {
                fmt::print("{:<16} {:<10} {:>6} {:>9.0f} {:>7} diverged: {}\n", item.method, item.scene.name,
                           fmt::format("{0} x {0}", item.points_per_cell), item.points, plan.teams[k], e.what());
            }
    if (!options.output.empty() && !csv)
        throw OutputError(fmt::format("writing '{}' failed (disk full?)", options.output));
}
}  // namespace testbed
