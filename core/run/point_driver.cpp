#include "core/run/point_driver.hpp"

#include "core/materials/material.hpp"
#include "core/scene/geometry.hpp"
#include "core/scene/reader.hpp"

#include <iterator>

namespace testbed
{
namespace
{
constexpr int most_steps = 1000000;  // a line of the answer each

struct PointState
{
    SymTensor<2> stress;
    double stress_zz = 0, plastic_shear_strain = 0;
};

/// One law with its state.
template <class Law>
class DrivenPoint
{
public:
    DrivenPoint(const Law& law, const std::vector<double>& initial) : law_(law)
    {
        state_.stress = {initial[0], initial[1], initial[3]};
        if constexpr (requires { state_.stress_zz; })
            state_.stress_zz = initial[2];
    }
    PointState now() const { return of(state_); }
    void advance(const Gradient<2>& d) { law_.update(state_, d); }
    double stress_xx_after(const Gradient<2>& d) const
    {
        auto trial = state_;
        law_.update(trial, d);
        return trial.stress.xx;
    }

private:
    using State = typename Law::template State<double>;
    PointState of(const State& s) const
    {
        if constexpr (requires { s.stress_zz; })
            return {s.stress, s.stress_zz, s.plastic_shear_strain};
        else
            return {s.stress, law_.elastic_out_of_plane_stress(s.stress), 0};
    }
    Law law_;
    State state_;
};

/// The lateral strain increment that leads to the lateral stress `target`: the stress grows with it.
/// @throws SceneError, beginning with `where`, if none does
template <class Point>
double find_lateral_strain(const Point& point, Gradient<2> d, double target, const std::string& where)
{
    const auto excess = [&](double xx)
    {
        d.xx = xx;
        return point.stress_xx_after(d) - target;
    };
    double size = std::abs(d.yy) + std::abs(d.xy) + std::abs(d.yx) + 1e-9, low = -size, high = size;
    for (int k = 0; k < 60 && excess(low) > 0; ++k)
        low *= 2;
    for (int k = 0; k < 60 && excess(high) < 0; ++k)
        high *= 2;
    if (!(excess(low) <= 0 && excess(high) >= 0))
        throw SceneError(fmt::format("{}: stress_xx = {:.6g} Pa cannot be reached: the law does not carry it", where, target));
    for (int k = 0; k < 200 && high - low > 1e-16 * (std::abs(low) + std::abs(high)); ++k)
        (excess(0.5 * (low + high)) > 0 ? high : low) = 0.5 * (low + high);
    return 0.5 * (low + high);
}

template <class Law>
std::string drive(const Law& law, const PointPathSpec& spec, const std::string& path)
{
    std::string text = "step,strain_xx,strain_yy,shear_xy,stress_xx,stress_yy,stress_zz,stress_xy,plastic_shear_strain,work\n";
    DrivenPoint<Law> point(law, spec.initial_stress);
    Gradient<2> total;
    double work = 0;
    std::int64_t step = 0;
    const auto write = [&]
    {
        const PointState s = point.now();
        fmt::format_to(std::back_inserter(text), "{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", step,
                       total.xx, total.yy, total.shear(), s.stress.xx, s.stress.yy, s.stress_zz, s.stress.xy, s.plastic_shear_strain, work);
    };
    write();
    for (std::size_t number = 0; number < spec.segments.size(); ++number)
    {
        const SegmentSpec& segment = spec.segments[number];
        const double n = segment.steps, from = point.now().stress.xx;
        for (int k = 1; k <= segment.steps; ++k)
        {
            Gradient<2> d{segment.gradient[0] / n, segment.gradient[1] / n, segment.gradient[2] / n, segment.gradient[3] / n};
            if (segment.stress_xx)
                d.xx = find_lateral_strain(point, d, from + (*segment.stress_xx - from) * k / n,
                                           fmt::format("{}: segment[{}], step {}", path, number, k));
            const SymTensor<2> before = point.now().stress;
            point.advance(d);
            const SymTensor<2> after = point.now().stress;
            work += 0.5 * ((before.xx + after.xx) * d.xx + (before.yy + after.yy) * d.yy + (before.xy + after.xy) * d.shear());
            total = total + d;
            if (!std::isfinite(after.xx + after.yy + after.xy + point.now().stress_zz + work))
                throw SceneError(fmt::format("{}: segment[{}], step {}: the stress is not finite", path, number, k));
            ++step;
            write();
        }
    }
    return text;
}

void check_path(const PointPathSpec& spec, Problems& problems)
{
    // the checks of a scene apply to its material
    Scene scene;
    scene.materials = {spec.material};
    check_materials(scene, problems, [](std::size_t) { return std::string("material"); });
    if (spec.material.random)
        problems.add("material.random", "a single point has no random field");
    if (spec.material.softening && spec.material.softening->nonlocal)
        problems.add("material.softening.nonlocal", "a single point has no neighbours");
    if (spec.material.strength)
        for (const auto& [text, name] :
             {std::pair{spec.material.strength->cohesion, "cohesion"}, {spec.material.strength->friction_angle, "friction_angle"}})
            if (!text.empty() && !is_number(text))
                problems.add(fmt::format("material.strength.{}", name), "a number is asked: a single point has no position");
    if (!is_number(spec.material.youngs_modulus))
        problems.add("material.youngs_modulus", "a number is asked: a single point has no position");
    if (!(spec.cell_size > 0))
        problems.add("cell_size", "must be positive");
    if (spec.initial_stress.size() != 4)
        problems.add("initial_stress", "four numbers are asked: xx, yy, zz, xy");
    if (spec.segments.empty())
        problems.add("segment", "no [[segment]] in the file");
    double steps = 0;
    for (const SegmentSpec& segment : spec.segments)
        steps += segment.steps;
    if (steps > most_steps)
        problems.add("segment", fmt::format("{:.0f} steps in all are more than {}", steps, most_steps));
    for (std::size_t k = 0; k < spec.segments.size(); ++k)
    {
        if (spec.segments[k].gradient.size() != 4)
            problems.add(fmt::format("segment[{}].gradient", k), "four numbers are asked: xx, yy, xy, yx");
        for (const double g : spec.segments[k].gradient)
            if (std::abs(g) > spec.segments[k].steps)
                problems.add(fmt::format("segment[{}].gradient", k),
                             fmt::format("{} in {} steps is a strain above 1 per step", g, spec.segments[k].steps));
        if (spec.segments[k].steps < 1)
            problems.add(fmt::format("segment[{}].steps", k), "at least one step is asked");
    }
}
}  // namespace

std::string drive_point(const std::string& path)
{
    return drive_point(read_point_path(read_text(path), path), path);
}

PointPathSpec read_point_path(const std::string& text, const std::string& path)
{
    Problems problems(path);
    PointPathSpec spec;
    Constants constants;
    {
        const toml::table root = parse_toml(text, path);
        Reader reader(root, "", problems, constants);
        spec.describe(reader);
    }
    if (problems.errors().empty())
        check_path(spec, problems);
    if (!problems.errors().empty())
        throw SceneError(problems.text());
    return spec;
}

std::string drive_point(const PointPathSpec& spec, const std::string& path)
{
    const MaterialSpec& m = spec.material;
    const ElasticModuli moduli(evaluate_constant(m.youngs_modulus, {}), m.poissons_ratio);
    const Strength<> strength =
        m.strength ? Strength<>{evaluate_constant(m.strength->cohesion, {}), std::sin(evaluate_constant(m.strength->friction_angle, {}))}
                   : Strength<>{0, 0};
    return std::visit([&](const auto& law) { return drive(law, spec, path); },
                      Laws::make(m.law, m, {moduli, strength, spec.cell_size, {}}));
}
}  // namespace testbed
