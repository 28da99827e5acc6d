#include "core/run/field_guards.hpp"

#include "core/bodies/point_sums.hpp"

#include <cmath>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace testbed
{
namespace
{
/// Values at the nodes that a body's points touch, on the smallest box of cells around them.
class NodeAverage
{
public:
    NodeAverage(const Points& q, const Vec2& origin, double cell_size) : q_(q), origin_(origin), cell_size_(cell_size)
    {
        Vec2 low{q.x[0], q.y[0]}, high = low;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            low = {std::min(low[0], q.x[p]), std::min(low[1], q.y[p])};
            high = {std::max(high[0], q.x[p]), std::max(high[1], q.y[p])};
        }
        const double room = ((high[0] - low[0]) / cell_size + 2) * ((high[1] - low[1]) / cell_size + 2);
        const double far = std::max({std::abs(low[0]), std::abs(low[1]), std::abs(high[0]), std::abs(high[1])}) / cell_size;
        is_compact_ = room < 64.0 * static_cast<double>(q.count + 1024) && far < 1e9;
        if (!is_compact_)
            return;
        i0_ = static_cast<int>(std::floor((low[0] - origin[0]) / cell_size));
        j0_ = static_cast<int>(std::floor((low[1] - origin[1]) / cell_size));
        stride_ = static_cast<std::size_t>((high[0] - low[0]) / cell_size) + 3;
        nodes_ = stride_ * (static_cast<std::size_t>((high[1] - low[1]) / cell_size) + 3);
    }
    /// A body in parts far from each other is not worth the memory of all between them.
    bool is_compact() const { return is_compact_; }

    /// Each point's own value less the average about it. @param value (point)
    template <class Value>
    std::vector<double> difference(Value&& value) const
    {
        std::vector<double> sum(nodes_, 0.0), volume(nodes_, 0.0), rest(q_.count);
        for (std::size_t p = 0; p < q_.count; ++p)
            at_corners(p,
                       [&](std::size_t n, double weight)
                       {
                           sum[n] += weight * q_.current_volume(p) * value(p);
                           volume[n] += weight * q_.current_volume(p);
                       });
        for (std::size_t p = 0; p < q_.count; ++p)
        {
            rest[p] = value(p);
            at_corners(p, [&](std::size_t n, double weight) { rest[p] -= volume[n] > 0 ? weight * sum[n] / volume[n] : 0; });
        }
        return rest;
    }

private:
    std::pair<int, int> cell(std::size_t p) const
    {
        return {static_cast<int>(std::floor((q_.x[p] - origin_[0]) / cell_size_)),
                static_cast<int>(std::floor((q_.y[p] - origin_[1]) / cell_size_))};
    }
    template <class F>
    void at_corners(std::size_t p, F&& f) const
    {
        const auto [i, j] = cell(p);
        const double a = (q_.x[p] - origin_[0]) / cell_size_ - i, b = (q_.y[p] - origin_[1]) / cell_size_ - j;
        const std::size_t n = static_cast<std::size_t>(i - i0_) + static_cast<std::size_t>(j - j0_) * stride_;
        f(n, (1 - a) * (1 - b));
        f(n + 1, a * (1 - b));
        f(n + stride_, (1 - a) * b);
        f(n + stride_ + 1, a * b);
    }

    const Points& q_;
    Vec2 origin_;
    double cell_size_;
    int i0_ = 0, j0_ = 0;
    std::size_t stride_ = 0, nodes_ = 0;
    bool is_compact_ = true;
};

/// f(body, point, its stress less the average about it, the out-of-plane part of that) for elastic bodies.
template <class F>
void for_each_unresolved(const std::vector<Body>& bodies, const Lattice& lattice, double cell_size, F&& f)
{
    for (const Body& body : bodies)
    {
        const Points& q = body.points;
        const NodeAverage average(q, lattice.origin, cell_size);
        if (!average.is_compact())
            continue;
        const auto rest = [&](const Field<double>& s) { return average.difference([&](std::size_t p) { return s[p]; }); };
        const auto sxx = rest(q.sxx), syy = rest(q.syy), sxy = rest(q.sxy);
        for (std::size_t p = 0; p < q.count; ++p)
            f(body, p, SymTensor<>{sxx[p], syy[p], sxy[p]}, moduli(body.material).poissons_ratio() * (sxx[p] + syy[p]));
    }
}

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
        const bool fem = family_of(scene) == Family::fem;
        mesh_ = scene.grid.cell_size / (fem ? std::pow(2.0, scene.fem.refinements) : 1.0);
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
            const Vec2& p = s.point_motion.momentum;
            const Vec2 frame{p[0] / s.point_motion.mass, p[1] / s.point_motion.mass};
            const double noise = unresolved_energy(solver.bodies(), lattice_, mesh_,
                                                   [&](std::size_t b, std::size_t k)
                                                   {
                                                       const Vec2 v = solver.velocity(b, k);
                                                       return Vec2{v[0] - frame[0], v[1] - frame[1]};
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
    Lattice lattice_;
    double mesh_, most_ = 0, error_ = 0, share_ = 0;
};

using CellKey = std::pair<int, int>;

CellKey cell_of(const Lattice& lattice, const Points& q, std::size_t p)
{
    const auto line = [&](double x, std::size_t k)
    { return static_cast<int>(std::clamp(std::floor((x - lattice.origin[k]) / lattice.cell_size + bin_tolerance), -1e9, 1e9)); };
    return {line(q.x[p], 0), line(q.y[p], 1)};
}

/// Points that belong to one cell as a whole carry their stress along when they cross a lattice line, and the nodal force jumps. What came
/// to rest in other cells than it started in is wrong from row to row. LPFDM, which shares the mass of a cell as a whole too, is wrong
/// before: a cell keeps the mass of its points, and is taken to be partly empty when they are squeezed, overfull when they are stretched.
class CrossingGuard final : public Remembering<CrossingGuard>
{
public:
    explicit CrossingGuard(const Scene& scene) : lattice_(make_lattice(scene.grid)), shares_cells_(family_of(scene) == Family::lpfdm) {}
    void watch(const GuardSample&, const Solver& solver) override
    {
        if (at_start_.empty())
            for_each_point(solver,
                           [&](const Points& q, std::size_t p)
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
        for_each_point(solver, [&](const Points& q, std::size_t p)
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
                const Points& q = body.points;
                const double energy = strain_energy(q, moduli(body.material), p);
                sum += energy * std::abs(q.current_volume(p) / q.initial_volume - 1);
                weight += energy;
            }
        return weight > 0 ? sum / weight : 0;
    }

    Lattice lattice_;
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
    Lattice lattice_;
    double share_ = 0, contrast_ = 0;
};
}  // namespace

double stress_error(const std::vector<Body>& bodies, const Lattice& lattice, double cell_size)
{
    const auto square = [](double xx, double yy, double zz, double xy) { return xx * xx + yy * yy + zz * zz + 2 * xy * xy; };
    double all = 0, rest = 0;
    for_each_unresolved(bodies, lattice, cell_size,
                        [&](const Body& body, std::size_t p, const SymTensor<>& r, double szz)
                        {
                            const Points& q = body.points;
                            const double V = q.current_volume(p);
                            all += V * square(q.sxx[p], q.syy[p], out_of_plane_stress(moduli(body.material), q, p), q.sxy[p]);
                            rest += V * square(r.xx, r.yy, szz, r.xy);
                        });
    return all > 0 ? std::sqrt(rest / all) : 0;
}

double unresolved_energy(const std::vector<Body>& bodies, const Lattice& lattice, double cell_size,
                         const std::function<Vec2(std::size_t, std::size_t)>& velocity)
{
    double total = 0;
    for_each_unresolved(bodies, lattice, cell_size,
                        [&](const Body& body, std::size_t p, const SymTensor<>& r, double szz)
                        {
                            const double softer = body.points.stiffness.active() ? body.points.stiffness[p] : 1.0;
                            total += body.points.current_volume(p) * elastic_energy_density(moduli(body.material), r, szz) / softer;
                        });
    for (std::size_t b = 0; b < bodies.size(); ++b)
        if (const NodeAverage average(bodies[b].points, lattice.origin, cell_size); average.is_compact())
            for (const std::size_t k : {0, 1})
                for (const double rest : average.difference([&](std::size_t p) { return velocity(b, p)[k]; }))
                    total += 0.5 * bodies[b].points.mass * rest * rest;
    return total;
}

std::vector<std::unique_ptr<Guard>> field_guards(const Scene& scene)
{
    std::vector<std::unique_ptr<Guard>> guards;
    if (scene.may_flow())
        return guards;
    guards.push_back(std::make_unique<NoiseGuard>(scene));
    const Family family = family_of(scene);
    if (family == Family::fem)
        return guards;
    if (family == Family::mpm ? scene.mpm.shape == MpmSpec::Shape::linear : scene.lpfdm.support == LpfdmSpec::Support::point)
        guards.push_back(std::make_unique<CrossingGuard>(scene));
    if (scene.bodies.size() > 1)
        guards.push_back(std::make_unique<MixedCellsGuard>(scene));
    return guards;
}
}  // namespace testbed
