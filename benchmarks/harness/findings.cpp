#include "benchmarks/harness/findings.hpp"

#include "core/run/results.hpp"

#include <algorithm>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <limits>

namespace testbed
{
namespace
{
constexpr double excess = 1e-3;  ///< share of the change that may be missing in the sum of disturbances

std::string table(const Findings& f, const std::vector<Mode>& modes, int top)
{
    std::string text = "  growth/step    frequency Hz   phase rad/step   damping ratio\n";
    for (std::size_t k = 0; k < modes.size() && k < static_cast<std::size_t>(top); ++k)
        text += fmt::format("  {:<13.9f}  {:<13.6g}  {:<15.6g}  {:.4g}\n", f.per_step(modes[k]), f.hertz(modes[k]),
                            modes[k].phase() / f.steps, modes[k].damping_ratio());
    if (modes.size() > static_cast<std::size_t>(top))
        text += fmt::format("  and {} more\n", modes.size() - static_cast<std::size_t>(top));
    return text;
}

std::string unknowns_text(const OneStepMap& map)
{
    using Kind = Unknown::Kind;
    const auto velocities = map.all(Kind::velocity);
    const bool nodal = !velocities.empty() && map.unknowns[static_cast<std::size_t>(velocities[0])].is_nodal;
    return fmt::format("{} unknowns: {} velocities of {}, {} positions, {} stresses, {} volumes, boxes and others", map.unknowns.size(),
                       velocities.size(), nodal ? "nodes" : "points", map.all(Kind::position).size(), map.all(Kind::stress).size(),
                       map.all(Kind::other).size());
}

/// A number of JSON, which knows no infinity.
std::string number(double v)
{
    return std::isfinite(v) ? fmt::format("{:.17g}", v) : "null";
}
std::string quoted(const std::string& text)
{
    std::string out = "\"";
    for (const char c : text)
        if (c == '"' || c == '\\')
            out += {'\\', c};
        else
            out += static_cast<unsigned char>(c) < 0x20 ? fmt::format("\\u{:04x}", static_cast<int>(c)) : std::string(1, c);
    return out + '"';
}

const char* kind(const Findings& f, const Mode& mode)
{
    const auto is_in = [&](const std::vector<Mode>& list)
    { return std::any_of(list.begin(), list.end(), [&](const Mode& m) { return m.eigenvalue == mode.eigenvalue; }); };
    return is_in(f.unstable) ? "unstable" : is_in(f.swinging) ? "swinging" : is_in(f.hardly_felt) ? "hardly_felt" : "decaying";
}

/// Velocities of a shape where they live, largest one of size 1: rows of x, y.
std::vector<double> velocities(const OneStepMap& map, const Eigen::VectorXd& shape)
{
    std::array<std::vector<double>, 2> component;
    for (const Eigen::Index n : map.all(Unknown::Kind::velocity))
        component[static_cast<std::size_t>(map.unknowns[static_cast<std::size_t>(n)].component)].push_back(shape[n]);
    std::vector<double> rows;
    for (std::size_t k = 0; k < component[0].size(); ++k)
        rows.insert(rows.end(), {component[0][k], component[1][k]});
    return rows;
}

/// Turns a complex shape to the phase in which its largest velocity is real, and scales that to 1.
Eigen::VectorXcd turned(const OneStepMap& map, const Eigen::VectorXcd& shape)
{
    std::complex<double> largest = 0;
    for (const Eigen::Index n : map.all(Unknown::Kind::velocity))
        if (std::abs(shape[n]) > std::abs(largest))
            largest = shape[n];
    return std::abs(largest) > 0 ? Eigen::VectorXcd(shape / largest) : shape;
}
}  // namespace

std::string as_text(const Findings& f, const Scene& scene, const ModesOptions& options)
{
    const double dt = f.start.dt;
    std::string text = fmt::format(
        "scene            {}\nmethod           {}\nstate            t = {:.6g} s after {} step{} of {:.6g} ms; {}\n", scene.path,
        variant_label(scene), f.start.t, f.start.steps, f.start.steps == 1 ? "" : "s", 1e3 * dt, unknowns_text(f.map));
    text += fmt::format(
        "map              of {} step{}, columns by differences of both sides; {}\n", f.steps, f.steps == 1 ? "" : "s",
        f.map.kinks == 0 ? "all are smooth"
                         : fmt::format("{} have a kink (a box or a point on a lattice line, a surface, yield): their mean", f.map.kinks));
    if (f.map.excess > excess)
        text += fmt::format(
            "                 WARNING: disturbances do not add up ({:.2g} of the change): a limiter, a face or local damping chooses "
            "by their signs\n                 at this state. The modes are those of single disturbances; take a state that "
            "deforms (--at, a velocity of the body)\n",
            f.map.excess);
    text += fmt::format("spectral radius  {:.9f}{}\n", f.spectrum.radius,
                        f.steps == 1 ? "" : fmt::format(", {:.9f} a step", std::pow(f.spectrum.radius, 1.0 / f.steps)));
    if (f.critical)
        text += fmt::format("critical step    {:.5g} ms, {:.4f} of the claimed {:.5g} ms\n", 1e3 * *f.critical, *f.critical / f.claimed,
                            1e3 * f.claimed);
    else if (!options.leave_out_critical)
        text += fmt::format("critical step    {} (claimed {:.5g} ms)\n",
                            f.spectrum.radius > 1 + options.tolerance
                                ? fmt::format("none: grows with every step from {:.3g} ms to {:.3g} ms", 1e3 * dt / 1024, 1e3 * dt)
                                : fmt::format("above {:.4g} ms", 64e3 * dt),
                            1e3 * f.claimed);
    text += fmt::format("null modes       {} velocity patterns deform the body and meet no resistance, {} of them hourglass (x, y)\n",
                        f.null.deforming, f.null.hourglass);
    text += fmt::format("                 {} move it as a rigid body\n", f.null.rigid);
    text += f.null.unseen == 0 ? "                 none is unseen, each moves the points\n"
                               : fmt::format("                 {} are unseen, they move no point; a step leaves {:.4g} of them\n",
                                             f.null.unseen, f.null.unseen_kept);
    text +=
        fmt::format("neutral          {} of the state's patterns stay as they are, {} more drift at a constant rate, {} are forgotten\n",
                    f.spectrum.steady, f.spectrum.drifting, f.spectrum.forgotten);
    text += fmt::format("unstable         {}\n{}", f.unstable.size(), f.unstable.empty() ? "" : table(f, f.unstable, options.top));
    text +=
        fmt::format("swinging         {}, {} first\n{}", f.swinging.size(), f.frequency ? "the nearest to the frequency" : "the slowest",
                    f.swinging.empty() ? "" : table(f, f.swinging, options.top));
    if (f.frequency && !f.swinging.empty())
        text += fmt::format("  phase of the first over 2 pi f dt, less 1: {:.4g}\n", f.hertz(f.swinging[0]) / *f.frequency - 1);
    text += fmt::format("hardly felt      {} modes that turn by less than {} rad in a step\n", f.hardly_felt.size(), hardly);
    text += fmt::format("decaying         {}{}\n", f.decaying.size(),
                        f.decaying.empty() ? ""
                                           : fmt::format(", a step leaves {:.6g} to {:.6g}", f.per_step(f.decaying.back()),
                                                         f.per_step(f.decaying.front())));
    return text;
}

std::string as_json(const Findings& f, const Scene& scene)
{
    std::vector<std::string> modes;
    for (const Mode& m : f.spectrum.modes)
        modes.push_back(
            fmt::format(R"({{"kind": "{}", "eigenvalue": [{}, {}], "growth_per_step": {}, "frequency": {}, "damping_ratio": {}}})",
                        kind(f, m), number(m.eigenvalue.real()), number(m.eigenvalue.imag()), number(f.per_step(m)), number(f.hertz(m)),
                        number(m.damping_ratio())));
    std::vector<std::string> lines;
    const auto add = [&](const char* name, const std::string& value) { lines.push_back(fmt::format("  \"{}\": {}", name, value)); };
    add("scene", quoted(scene.path));
    add("variant", quoted(variant_label(scene)));
    add("time", number(f.start.t));
    add("dt", number(f.start.dt));
    add("steps", fmt::format("{}", f.steps));
    add("unknowns", fmt::format("{}", f.map.unknowns.size()));
    add("kinks", fmt::format("{}", f.map.kinks));
    add("excess", number(f.map.excess));
    add("spectral_radius", number(f.spectrum.radius));
    add("growth_per_step", number(std::pow(f.spectrum.radius, 1.0 / f.steps)));
    add("critical_dt", f.critical ? number(*f.critical) : "null");
    add("claimed_dt", number(f.claimed));
    add("null_modes", fmt::format("{}", f.null.deforming));
    add("hourglass_modes", fmt::format("{}", f.null.hourglass));
    add("rigid_modes", fmt::format("{}", f.null.rigid));
    add("unseen_modes", fmt::format("{}", f.null.unseen));
    add("unseen_kept", number(f.null.unseen_kept));
    add("steady", fmt::format("{}", f.spectrum.steady));
    add("drifting", fmt::format("{}", f.spectrum.drifting));
    add("forgotten", fmt::format("{}", f.spectrum.forgotten));
    add("modes", modes.empty() ? "[]" : fmt::format("[\n    {}\n  ]", fmt::join(modes, ",\n    ")));
    return fmt::format("{{\n{}\n}}\n", fmt::join(lines, ",\n"));
}

std::string as_csv(const Findings& f)
{
    std::string text = "kind,eigenvalue_real,eigenvalue_imaginary,growth_per_step,frequency,damping_ratio\n";
    for (const Mode& m : f.spectrum.modes)
        text += fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", kind(f, m), m.eigenvalue.real(), m.eigenvalue.imag(),
                            f.per_step(m), f.hertz(m), m.damping_ratio());
    return text;
}

void write_shapes(const std::string& path, const Findings& f, const Scene& scene, int top)
{
    ResultFile file(path);
    file.attribute("/", "format", std::string("testbed-modes"));
    file.attribute("/", "format_version", std::int64_t{1});
    file.attribute("/", "case", scene.case_name());
    file.attribute("/", "variant", variant_label(scene));
    file.attribute("/", "cell_size", scene.grid.cell_size);
    file.attribute("/", "cell_origin", std::span<const double>(scene.grid.origin));
    file.attribute("/", "time", f.start.t);
    file.attribute("/", "dt", f.start.dt);
    file.attribute("/", "spectral_radius", f.spectrum.radius);
    file.attribute("/", "critical_dt", f.critical.value_or(std::numeric_limits<double>::quiet_NaN()));
    std::vector<double> places, points;
    const auto add_places = [&](Unknown::Kind kind, std::vector<double>& to)
    {
        for (const Eigen::Index n : f.map.all(kind))
            if (const Unknown& u = f.map.unknowns[static_cast<std::size_t>(n)]; u.component == 0)
                to.insert(to.end(), {u.place[0], u.place[1]});
    };
    add_places(Unknown::Kind::velocity, places);
    add_places(Unknown::Kind::position, points);
    file.dataset("/places/velocities", "m", places, 2);
    file.dataset("/places/points", "m", points, 2);
    int number = 0;
    const auto add = [&](const std::string& name, const Eigen::VectorXcd& shape, double growth, double frequency)
    {
        const std::string group = fmt::format("/modes/{:04}", number++);
        const Eigen::VectorXcd t = turned(f.map, shape);
        file.attribute(group, "kind", name);
        file.attribute(group, "growth_per_step", growth);
        file.attribute(group, "frequency", frequency);
        file.dataset(group + "/velocity_real", "-", velocities(f.map, t.real()), 2);
        file.dataset(group + "/velocity_imaginary", "-", velocities(f.map, t.imag()), 2);
    };
    const auto few = [&](std::size_t n) { return std::min(n, static_cast<std::size_t>(top)); };
    for (std::size_t k = 0; k < few(f.unstable.size()); ++k)
        add("unstable", f.unstable[k].shape, f.per_step(f.unstable[k]), f.hertz(f.unstable[k]));
    for (std::size_t k = 0; k < few(static_cast<std::size_t>(f.null.shapes.cols())); ++k)
        add(k < f.null.hourglass ? "hourglass" : "null", f.null.shapes.col(static_cast<Eigen::Index>(k)).cast<std::complex<double>>(), 1,
            0);
    for (std::size_t k = 0; k < few(f.swinging.size()); ++k)
        add("swinging", f.swinging[k].shape, f.per_step(f.swinging[k]), f.hertz(f.swinging[k]));
    file.commit();
}
}  // namespace testbed
