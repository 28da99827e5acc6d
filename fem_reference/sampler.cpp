#include "fem_reference/sampler.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace testbed
{
Sampler::Sampler(const Scene& scene, const Lattice<2>& lattice, const dealii::DoFHandler<2>& dofs, const std::vector<Body>& bodies)
    : cell_size_(lattice.cell_size / cells_per_lattice_cell(scene)),
      nx_(lattice.size[0] * cells_per_lattice_cell(scene)),
      ny_(lattice.size[1] * cells_per_lattice_cell(scene)),
      shapes_(dofs.get_fe().n_dofs_per_cell() / 2),
      cells_(static_cast<std::size_t>(nx_) * static_cast<std::size_t>(ny_))
{
    const auto& element = dofs.get_fe();
    std::vector<dealii::types::global_dof_index> ids(element.n_dofs_per_cell());
    std::uint32_t number = 0;
    for (const auto& active : dofs.active_cell_iterators())
    {
        const auto centre = active->center();
        const auto i = static_cast<std::size_t>((centre[0] - lattice.origin[0]) / cell_size_);
        const auto j = static_cast<std::size_t>((centre[1] - lattice.origin[1]) / cell_size_);
        cells_[j * static_cast<std::size_t>(nx_) + i] = {active->material_id(), true, number++};
        active->get_dof_indices(ids);
        for (unsigned int k = 0; k < shapes_; ++k)
            for (unsigned int c = 0; c < 2; ++c)
                dofs_.push_back(ids[element.component_to_system_index(c, k)]);
    }
    Patterns known;
    for (unsigned int b = 0; b < bodies.size(); ++b)
    {
        const Points<2>& q = bodies[b].points;
        std::vector<Location>& found = locations_.emplace_back();
        for (std::size_t p = 0; p < q.count; ++p)
        {
            const Vec<2> place{(q.X[0][p] - lattice.origin[0]) / cell_size_, (q.X[1][p] - lattice.origin[1]) / cell_size_};
            const auto [i, j] = cell_of(place, b);
            const dealii::Point<2> unit(std::clamp(place[0] - i, 0.0, 1.0), std::clamp(place[1] - j, 0.0, 1.0));
            found.push_back({cell(i, j).number, pattern_at(unit, element, known)});
        }
    }
}

const Sampler::Cell& Sampler::cell(int i, int j) const
{
    static const Cell none;
    const bool inside = i >= 0 && i < nx_ && j >= 0 && j < ny_;
    return inside ? cells_[static_cast<std::size_t>(j) * static_cast<std::size_t>(nx_) + static_cast<std::size_t>(i)] : none;
}

std::pair<int, int> Sampler::cell_of(const Vec<2>& place, unsigned int body) const
{
    const double reach = 1e-6;
    for (const bool own : {true, false})
        for (const double dy : {reach, -reach})
            for (const double dx : {reach, -reach})
            {
                const int i = static_cast<int>(std::floor(place[0] + dx)), j = static_cast<int>(std::floor(place[1] + dy));
                if (const Cell& at = cell(i, j); at.exists && (at.body == body || !own))
                    return {i, j};
            }
    const int i0 = static_cast<int>(std::floor(place[0])), j0 = static_cast<int>(std::floor(place[1]));
    double nearest = std::numeric_limits<double>::infinity();
    std::pair<int, int> best{0, 0};
    for (int ring = 1; ring <= std::max(nx_, ny_) && !std::isfinite(nearest); ++ring)
        for (int j = j0 - ring; j <= j0 + ring; ++j)
            for (int i = i0 - ring; i <= i0 + ring; ++i)
            {
                if (const Cell& at = cell(i, j); !at.exists || at.body != body)
                    continue;
                const double dx = place[0] - std::clamp<double>(place[0], i, i + 1), dy = place[1] - std::clamp<double>(place[1], j, j + 1);
                const double distance = std::hypot(dx, dy);
                if (distance < nearest)
                {
                    nearest = distance;
                    best = {i, j};
                }
            }
    return best;
}

std::uint32_t Sampler::pattern_at(const dealii::Point<2>& unit, const dealii::FiniteElement<2>& element, Patterns& known)
{
    const auto [at, is_new] =
        known.emplace(std::pair{std::llround(1e9 * unit[0]), std::llround(1e9 * unit[1])}, static_cast<std::uint32_t>(patterns_.size()));
    if (is_new)
    {
        Pattern& pattern = patterns_.emplace_back();
        const auto& shape = element.base_element(0);
        for (unsigned int k = 0; k < shapes_; ++k)
        {
            pattern.value.push_back(shape.shape_value(k, unit));
            pattern.dx.push_back(shape.shape_grad(k, unit)[0] / cell_size_);
            pattern.dy.push_back(shape.shape_grad(k, unit)[1] / cell_size_);
        }
    }
    return at->second;
}

void Sampler::sample(const Vector& displacement, std::vector<Body>& bodies) const
{
    for (std::size_t b = 0; b < bodies.size(); ++b)
    {
        Points<2>& q = bodies[b].points;
        const ElasticModuli base = moduli(bodies[b].material);
        parallel_for(q.count,
                     [&](std::size_t p)
                     {
                         const auto [cell, pattern] = locations_[b][p];
                         const Pattern& at = patterns_[pattern];
                         const std::uint32_t* dof = &dofs_[2 * shapes_ * cell];
                         Vec<2> u{0, 0};
                         Gradient<2> d;
                         for (std::size_t k = 0; k < shapes_; ++k)
                         {
                             const double ux = displacement(dof[2 * k]), uy = displacement(dof[2 * k + 1]);
                             u = {u[0] + at.value[k] * ux, u[1] + at.value[k] * uy};
                             d = d + Gradient<2>{at.dx[k] * ux, at.dy[k] * uy, at.dy[k] * ux, at.dx[k] * uy};
                         }
                         const SymTensor<2> stress = elastic_stress(base, d, stiffness_ratio(q, p));
                         q.x[0][p] = q.X[0][p] + u[0];
                         q.x[1][p] = q.X[1][p] + u[1];
                         q.stress[0][p] = stress.xx;
                         q.stress[1][p] = stress.yy;
                         q.stress[2][p] = stress.xy;
                     });
    }
}

Vec<2> Sampler::value(const Vector& field, std::size_t body, std::size_t point) const
{
    const auto [cell, pattern] = locations_[body][point];
    const std::uint32_t* dof = &dofs_[2 * shapes_ * cell];
    Vec<2> sum{0, 0};
    for (std::size_t k = 0; k < shapes_; ++k)
    {
        sum[0] += patterns_[pattern].value[k] * field(dof[2 * k]);
        sum[1] += patterns_[pattern].value[k] * field(dof[2 * k + 1]);
    }
    return sum;
}

std::size_t Sampler::bytes() const
{
    std::size_t total = cells_.capacity() * sizeof(Cell) + dofs_.capacity() * sizeof(dofs_[0]);
    for (const Pattern& pattern : patterns_)
        total += 3 * pattern.value.capacity() * sizeof(double);
    for (const auto& found : locations_)
        total += found.capacity() * sizeof(Location);
    return total;
}
}  // namespace testbed
