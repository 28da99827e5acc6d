#include "core/run/field_guards.hpp"

#include "core/bodies/point_sums.hpp"
#include "core/run/unresolved.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace testbed
{
namespace
{
bool is_static(const GuardSample& s)
{
    return s.motion.kinetic_before < limits::is_static * s.points.strain_energy;
}

/// Stresses at rest that are noise, from locking, null modes or points that cross, or of too few cells; motion that is nothing but noise.
/// Motion counts in the frame of supports and walls, without any in that of the centre of mass.
class NoiseGuard final : public Remembering<NoiseGuard>
{
public:
    explicit NoiseGuard(const Scene& scene) : is_free_(scene.boundaries.empty() && scene.walls.empty()), lattice_(make_lattice(scene.grid))
    {
        mesh_ = scene.grid.cell_size / traits_of(scene).elements_per_cell;
    }
    void watch(const GuardSample& s, const Solver&) override
    {
        if (s.is_fresh)
            most_ = std::max(most_, energy(s));
    }
    void at_end(const GuardSample& s, const Solver& solver) override
    {
        if (is_static(s))
            error_ = stress_error(solver.bodies(), lattice_, mesh_);
        else if (is_free_)  // after a blow on a wall it is no error of the method
        {
            const Vec<2>& p = s.point_motion.momentum;
            const Vec<2> frame{p[0] / s.point_motion.mass, p[1] / s.point_motion.mass};
            const double noise = unresolved_energy(solver.bodies(), lattice_, mesh_,
                                                   [&](std::size_t b, std::size_t k)
                                                   {
                                                       const Vec<2> v = solver.velocity(b, k);
                                                       return Vec<2>{v[0] - frame[0], v[1] - frame[1]};
                                                   });
            if (noise > limits::worth_noise * most_ && noise > limits::rounding * s.point_motion.kinetic_energy)
                share_ = noise / std::max(energy(s), 1e-300);
        }
    }
    std::optional<Finding> finding(bool) const override
    {
        if (error_ > limits::stress_error)
            return Finding{"noise", fmt::format("the stresses at rest differ by {:.2g} of themselves from their average over neighbouring "
                                                "cells: noise, or too few cells",
                                                error_)};
        if (share_ > limits::noise_share)
            return Finding{"noise",
                           fmt::format("{:.0f} % of the energy is at the end in patterns that the lattice does not resolve", 100 * share_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("most", "J/m", most_);
    }

private:
    double energy(const GuardSample& s) const
    {
        const auto& p = s.point_motion.momentum;
        const double carried = is_free_ ? 0.5 * (p[0] * p[0] + p[1] * p[1]) / s.point_motion.mass : 0;
        return std::max(0.0, s.point_motion.kinetic_energy - carried) + s.points.strain_energy;
    }

    bool is_free_;
    Lattice<2> lattice_;
    double mesh_, most_ = 0, error_ = 0, share_ = 0;
};

using CellKey = std::pair<int, int>;

CellKey cell_of(const Lattice<2>& lattice, const Points<2>& q, std::size_t p)
{
    const auto line = [&](double x, std::size_t k)
    { return static_cast<int>(std::clamp(std::floor((x - lattice.origin[k]) / lattice.cell_size + bin_tolerance), -1e9, 1e9)); };
    return {line(q.x[0][p], 0), line(q.x[1][p], 1)};
}

/// Points that belong to one cell as a whole carry their stress along when they cross a lattice line, and the nodal force jumps. What came
/// to rest in other cells than it started in is wrong from row to row. LPFDM, which shares the mass of a cell as a whole too, is wrong
/// before: a cell keeps the mass of its points, and is taken to be partly empty when they are squeezed, overfull when they are stretched.
class CrossingGuard final : public Remembering<CrossingGuard>
{
public:
    explicit CrossingGuard(const Scene& scene) : lattice_(make_lattice(scene.grid)), shares_cells_(traits_of(scene).shares_cells) {}
    void watch(const GuardSample&, const Solver& solver) override
    {
        if (at_start_.empty())
            for_each_point(solver,
                           [&](const Points<2>& q, std::size_t p)
                           {
                               at_start_.resize(std::max(at_start_.size(), std::size_t{q.id[p]} + 1));
                               at_start_[q.id[p]] = cell_of(lattice_, q, p);
                           });
    }
    void at_end(const GuardSample& s, const Solver& solver) override
    {
        if (!is_static(s))
            return;
        double crossed = 0;
        for_each_point(solver, [&](const Points<2>& q, std::size_t p)
                       { crossed += cell_of(lattice_, q, p) != at_start_[q.id[p]] ? q.current_volume(p) : 0; });
        share_ = crossed / s.points.volume;
        if (shares_cells_)
            squeezed_ = squeezed(solver.bodies());
    }
    std::optional<Finding> finding(bool) const override
    {
        if (share_ > limits::crossed)
            return Finding{"crossing",
                           fmt::format("points that hold {:.2g} of the volume came to rest in other cells than they started in; each "
                                       "crossing of a lattice line made the force jump",
                                       share_)};
        if (squeezed_ > limits::squeezed)
            return Finding{"crossing",
                           fmt::format("cells hold the points that they started with, though the volume of these changed by {:.2g} in the "
                                       "mean, weighted by energy: the stress at rest is wrong by as much",
                                       squeezed_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.column("column", "-", at_start_, &CellKey::first);
        a.column("line", "-", at_start_, &CellKey::second);
    }

private:
    template <class F>
    static void for_each_point(const Solver& solver, F&& f)
    {
        for (const Body& body : solver.bodies())
            for (std::size_t p = 0; p < body.points.count; ++p)
                f(body.points, p);
    }

    /// Mean of |J - 1|, weighted by the elastic energy.
    static double squeezed(const std::vector<Body>& bodies)
    {
        double sum = 0, weight = 0;
        for (const Body& body : bodies)
            for (std::size_t p = 0; p < body.points.count; ++p)
            {
                const Points<2>& q = body.points;
                const double energy = strain_energy(body.material, q, p);
                sum += energy * std::abs(q.current_volume(p) / q.initial_volume - 1);
                weight += energy;
            }
        return weight > 0 ? sum / weight : 0;
    }

    Lattice<2> lattice_;
    bool shares_cells_;
    std::vector<CellKey> at_start_;  ///< by id, which counts on from body to body
    double share_ = 0, squeezed_ = 0;
};

/// Cells that hold points of a stiff and of a soft body have one strain for both.
class MixedCellsGuard final : public Remembering<MixedCellsGuard>
{
public:
    explicit MixedCellsGuard(const Scene& scene) : lattice_(make_lattice(scene.grid)) {}
    void at_end(const GuardSample& s, const Solver& solver) override
    {
        if (!is_static(s))
            return;
        struct Cell
        {
            double volume = 0, softest = std::numeric_limits<double>::infinity(), stiffest = 0;
        };
        std::map<CellKey, Cell> cells;
        for (const Body& body : solver.bodies())
        {
            const double modulus = moduli(body.material).constrained();
            for (std::size_t p = 0; p < body.points.count; ++p)
            {
                Cell& cell = cells[cell_of(lattice_, body.points, p)];
                cell.volume += body.points.current_volume(p);
                cell.softest = std::min(cell.softest, modulus);
                cell.stiffest = std::max(cell.stiffest, modulus);
            }
        }
        double mixed = 0;
        for (const auto& [place, cell] : cells)
            if (cell.stiffest > limits::contrast * cell.softest)
            {
                mixed += cell.volume;
                contrast_ = std::max(contrast_, cell.stiffest / cell.softest);
            }
        share_ = mixed / s.points.volume;
    }
    std::optional<Finding> finding(bool) const override
    {
        if (share_ > limits::mixed)
            return Finding{"mixed_cells",
                           fmt::format("cells that hold {:.2g} of the volume share points of bodies whose stiffness differs {:.3g} "
                                       "times: they have one strain for both",
                                       share_, contrast_)};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive&)
    {
    }

private:
    Lattice<2> lattice_;
    double share_ = 0, contrast_ = 0;
};
}  // namespace

std::vector<std::unique_ptr<Guard>> field_guards(const Scene& scene)
{
    std::vector<std::unique_ptr<Guard>> guards;
    if (scene.may_flow())
        return guards;
    guards.push_back(std::make_unique<NoiseGuard>(scene));
    const Traits traits = traits_of(scene);
    if (!traits.has_points)
        return guards;
    if (traits.reach == 1)
        guards.push_back(std::make_unique<CrossingGuard>(scene));
    if (scene.bodies.size() > 1)
        guards.push_back(std::make_unique<MixedCellsGuard>(scene));
    return guards;
}
}  // namespace testbed
