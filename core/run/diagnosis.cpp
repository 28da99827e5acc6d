#include "core/run/diagnosis.hpp"

#include <cmath>
#include <fmt/format.h>
#include <map>

namespace testbed
{
namespace
{
// A smooth field has (k L)^4 / 16 of its energy in the pattern, 2 % at eight cells a wave; noise has a quarter.
constexpr double pattern_rules = 0.2;
// Points of one cell see one smooth field: their spread is of the order of L over the size of the body.
constexpr double oscillates = 0.7;
// Points that move half a cell in a step are at the limit of convection within the next ones.
constexpr double fast = 0.5;
// Beyond this a point's box or volume reaches over neighbours that it has no more.
constexpr double grown = 3;

bool found(const RunFacts& facts, const char* code)
{
    return std::any_of(facts.findings.begin(), facts.findings.end(), [&](const Finding& f) { return f.code == code; });
}

/// The time step times a share, as the scene gives it.
std::string smaller_step(const Scene& scene, const RunFacts& facts, double share)
{
    return scene.time.dt ? fmt::format("time.dt={:.2g}", share * facts.dt) : fmt::format("time.cfl={:.2g}", share * scene.time.cfl);
}

double largest_volume_ratio(const std::vector<Body>& bodies)
{
    double largest = 0;
    for (const Body& body : bodies)
        for (std::size_t p = 0; p < body.points.count; ++p)
            largest = std::max(largest, body.points.current_volume(p) / body.points.initial_volume);
    return largest;
}

double full_mass(const std::vector<Body>& bodies, double cell_size)
{
    double density = 0;
    for (const Body& body : bodies)
        density = std::max(density, body.points.mass / body.points.initial_volume);
    return density * cell_size * cell_size;
}
}  // namespace

double checkerboard_share(const Lattice<2>& lattice, const Nodes<2>& nodes)
{
    double pattern = 0, all = 0;
    const std::size_t above = lattice.node_stride();
    for (const auto n : nodes.active())
    {
        if (!lattice.has_node(lattice.node_index(n) + testbed::all<2>(1)))
            continue;
        const std::array<std::size_t, 4> corner{n, n + 1, n + above, n + above + 1};
        const auto light = [&](std::size_t k) { return !(nodes.mass[k] > 0); };
        if (std::any_of(corner.begin(), corner.end(), light))
            continue;
        for (const auto* v : {&nodes.v[0], &nodes.v[1]})
        {
            const double h = (*v)[corner[0]] - (*v)[corner[1]] - (*v)[corner[2]] + (*v)[corner[3]];
            double square = 0;
            for (const std::size_t k : corner)
                square += (*v)[k] * (*v)[k];
            pattern += nodes.mass[n] * h * h / 4;
            all += nodes.mass[n] * square;
        }
    }
    return all > 0 ? pattern / all : 0;
}

double mass_of_fastest(const Nodes<2>& nodes, double full)
{
    double fastest = 0, mass = full;
    for (const auto n : nodes.active())
        if (const double square = nodes.v[0][n] * nodes.v[0][n] + nodes.v[1][n] * nodes.v[1][n]; nodes.mass[n] > 0 && square > fastest)
        {
            fastest = square;
            mass = nodes.mass[n];
        }
    return mass / full;
}

double stress_oscillation(const std::vector<Body>& bodies, const Lattice<2>& lattice)
{
    double within = 0, total = 0;
    for (const Body& body : bodies)
    {
        struct Sums
        {
            double n = 0, s = 0, square = 0;
            void add(double v)
            {
                ++n;
                s += v;
                square += v * v;
            }
            double spread() const { return std::max(0.0, square - s * s / n); }
        };
        std::map<std::pair<double, double>, Sums> cells;
        Sums all;
        const Points<2>& q = body.points;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            const double mean = 0.5 * (q.stress[0][p] + q.stress[1][p]);
            cells[{std::floor((q.x[0][p] - lattice.origin[0]) / lattice.cell_size),
                   std::floor((q.x[1][p] - lattice.origin[1]) / lattice.cell_size)}]
                .add(mean);
            all.add(mean);
        }
        for (const auto& [place, cell] : cells)
            within += cell.spread();
        total += all.spread();
    }
    return total > 0 ? std::sqrt(within / total) : 0;
}

Diagnosis diagnose(const Scene& scene, const Solver& solver, const RunFacts& facts)
{
    const bool nearly_incompressible = std::any_of(scene.materials.begin(), scene.materials.end(),
                                                   [](const MaterialSpec& material) { return material.poissons_ratio > 0.45; });
    const auto [lattice, nodes] = solver.nodes();
    const Traits traits = traits_of(scene);
    const Remedies& remedies = traits.remedies;
    const bool locks = traits.may_lock && nearly_incompressible;
    if (!lattice)  // the FEM reference, and cells from a file
        return found(facts, "noise") && locks ? Diagnosis{"locking", remedies.locking} : Diagnosis{};
    const bool in_one_cell = traits.reach == 1;
    const auto& bodies = solver.bodies();
    if (found(facts, "time_step"))
        return {"time_step", smaller_step(scene, facts, 0.9 * facts.dt_critical / facts.dt)};
    if (found(facts, "separated") || found(facts, "contact_lost"))
        return {"separation", remedies.crossing};
    // points that fly too fast from the start, not such that something has thrown
    const double courant = solver.point_motion().speed * facts.dt / lattice->cell_size;
    if (courant > fast && !found(facts, "energy") && !found(facts, "volume"))
        return {"time_step", smaller_step(scene, facts, fast / (2 * courant))};
    // the last motion of a body that came to rest tells nothing of its stresses
    if (!found(facts, "crossing") && checkerboard_share(*lattice, *nodes) > pattern_rules)
        return {"null_mode", remedies.null_mode};
    const double oscillation = stress_oscillation(bodies, *lattice);
    const bool noise = found(facts, "noise");
    if (locks && (noise || (in_one_cell && oscillation > oscillates)))
        return {"locking", remedies.locking};
    if (found(facts, "crossing"))
        return {"crossing", remedies.crossing};
    if (found(facts, "released"))
        return {in_one_cell ? "crossing" : "separation", remedies.crossing};
    if (found(facts, "mixed_cells"))
        return {"mixed_cells", ""};
    if (found(facts, "drift"))
        return {"ratchet", smaller_step(scene, facts, 0.5)};
    if (noise)
        return {"null_mode", remedies.null_mode};
    if (largest_volume_ratio(bodies) > grown)
        return {"tension", remedies.tension};
    if (traits.divides_by_slivers || mass_of_fastest(*nodes, full_mass(bodies, lattice->cell_size)) < sliver_mass)
        return {"sliver", remedies.sliver};
    if (in_one_cell && oscillation > oscillates)
        return {"crossing", remedies.crossing};
    return {};
}
}  // namespace testbed
