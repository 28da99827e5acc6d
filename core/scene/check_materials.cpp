#include "core/scene/checks.hpp"
#include "core/scene/geometry.hpp"

#include <algorithm>
#include <numbers>

namespace testbed
{
namespace
{
/// A number is checked here; an expression when it is evaluated at the points.
template <class IsValid>
void check_number(const std::string& text, const std::string& key, IsValid&& is_valid, const std::string& rule, Problems& problems)
{
    if (text.empty() || !is_number(text))
        return;
    if (const double value = std::strtod(text.c_str(), nullptr); !is_valid(value))
        problems.add(key, fmt::format("{}, not {}", rule, value));
}

void check_no_strength(const MaterialSpec& m, const std::string& key, Problems& problems)
{
    const auto refuse = [&](bool present, const char* name)
    {
        if (present)
            problems.add(key + "." + name, fmt::format("not used by law '{}'", name_of(m.law)));
    };
    refuse(m.strength.has_value(), "strength");
    refuse(m.softening.has_value(), "softening");
    refuse(m.random.has_value(), "random");
}

void check_yield_surface(const StrengthSpec& strength, const std::string& key, Problems& problems)
{
    const std::string angle_rule = "an angle in radians, from 0 to below pi/2, is asked (degrees: \"28.6*pi/180\")";
    const double right_angle = 0.5 * std::numbers::pi;
    check_number(
        strength.cohesion, key + ".cohesion", [](double c) { return c >= 0; }, "must not be negative", problems);
    check_number(
        strength.friction_angle, key + ".friction_angle", [&](double phi) { return phi >= 0 && phi < right_angle; }, angle_rule, problems);
    const double psi = strength.dilatancy_angle;
    if (!(psi >= 0 && psi < right_angle))
        problems.add(key + ".dilatancy_angle", fmt::format("{}, not {}", angle_rule, psi));
    else
        check_number(
            strength.friction_angle, key + ".friction_angle", [&](double phi) { return phi >= psi; },
            "must not be below the dilatancy angle", problems);
    if (strength.tensile_strength && *strength.tensile_strength < 0)
        problems.add(key + ".tensile_strength", "must not be negative");
}

void check_averaging(const NonlocalSpec& nonlocal, const GridSpec& grid, const std::string& key, Problems& problems)
{
    check_positive(nonlocal.internal_length, key + ".internal_length", problems);
    if (const double extent = std::max(grid.size[0], grid.size[1]); extent > 0 && nonlocal.internal_length > extent)
        problems.add(key + ".internal_length", fmt::format("{} m is longer than the lattice, {} m", nonlocal.internal_length, extent));
    if (!(nonlocal.over_nonlocal >= 1))
        problems.add(key + ".over_nonlocal",
                     fmt::format("must be at least 1 (nonlocal), above 1 to regularise; not {}", nonlocal.over_nonlocal));
}

void check_softening(const SofteningSpec& s, const GridSpec& grid, const std::string& key, Problems& problems)
{
    const bool linear = s.kind == SofteningSpec::Kind::linear;
    if (!(s.residual >= 0 && s.residual <= 1))
        problems.add(key + ".residual", fmt::format("a share in [0, 1] is asked, not {}", s.residual));
    if (linear && !s.strain)
        problems.add(key + ".strain", "missing, kind = \"linear\" needs it");
    const auto only_linear = [&](bool present, const char* name)
    {
        if (present && !linear)
            problems.add(key + "." + name, "only for kind = \"linear\"");
    };
    only_linear(s.strain.has_value(), "strain");
    only_linear(s.band_thickness.has_value(), "band_thickness");
    only_linear(s.nonlocal.has_value(), "nonlocal");
    check_positive(s.strain, key + ".strain", problems);
    check_positive(s.band_thickness, key + ".band_thickness", problems);
    if (s.band_thickness && s.nonlocal)
        problems.add(key + ".band_thickness", "crack-band scaling and nonlocal softening exclude each other");
    if (s.nonlocal)
        check_averaging(*s.nonlocal, grid, key + ".nonlocal", problems);
}

void check_random(const RandomSpec& r, const std::string& key, Problems& problems)
{
    if (r.seed < 0)
        problems.add(key + ".seed", "must not be negative");
    for (const auto& [value, name] : {std::pair{r.cohesion_deviation, "cohesion_deviation"}, {r.friction_deviation, "friction_deviation"}})
        if (!(value >= 0 && value <= 2))
            problems.add(key + "." + name, fmt::format("a relative deviation in [0, 2] is asked, not {}", value));
    check_positive(r.correlation_length, key + ".correlation_length", problems);
    if ((r.field == RandomSpec::RandomField::correlated) != r.correlation_length.has_value())
        problems.add(key + ".correlation_length",
                     r.correlation_length ? "only for field = \"correlated\"" : "missing, field = \"correlated\" needs it");
}

void check_strength(const Scene& scene, const MaterialSpec& m, const std::string& key, Problems& problems)
{
    if (!m.has_strength())
        return check_no_strength(m, key, problems);
    if (!m.strength)
        return problems.add(key + ".strength", fmt::format("missing, law '{}' needs it", name_of(m.law)));
    if (!is_number(m.youngs_modulus))
        problems.add(key + ".youngs_modulus", fmt::format("law '{}' takes a plain number, not an expression", name_of(m.law)));
    check_yield_surface(*m.strength, key + ".strength", problems);
    if (m.softening)
        check_softening(*m.softening, scene.grid, key + ".softening", problems);
    if (m.random)
        check_random(*m.random, key + ".random", problems);
}
}  // namespace

void check_materials(const Scene& scene, Problems& problems, const std::function<std::string(std::size_t)>& key_of)
{
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        const std::string key = key_of(k);
        check_positive(m.density, key + ".density", problems);
        if (!(m.poissons_ratio > -1 && m.poissons_ratio < 0.5))
            problems.add(key + ".poissons_ratio",
                         fmt::format("must lie in (-1, 0.5), not {}: at 0.5 an explicit method has no stable time step", m.poissons_ratio));
        check_number(
            m.youngs_modulus, key + ".youngs_modulus", [](double E) { return E > 0; }, "must be positive", problems);
        check_strength(scene, m, key, problems);
    }
}

void check_nonlocal(const Scene& scene, Problems& problems)
{
    const NonlocalSpec* first = nullptr;
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
        if (const auto& s = scene.materials[k].softening; s && s->nonlocal)
        {
            if (!first)
                first = &*s->nonlocal;
            else if (s->nonlocal->internal_length != first->internal_length || s->nonlocal->weight != first->weight)
                problems.add(fmt::format("material[{}].softening.nonlocal", k),
                             "all nonlocal materials share one internal_length and weight");
        }
}
}  // namespace testbed
