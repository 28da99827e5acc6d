#include "fem_reference/elasticity.hpp"

#include <deal.II/lac/tridiagonal_matrix.h>
#include <random>

/// Elasticity: velocity fields, and the largest frequency.
namespace testbed
{
namespace
{
/// Of a symmetric tridiagonal matrix; beside[k] stands left of diagonal[k].
double largest_eigenvalue(const std::vector<double>& diagonal, const std::vector<double>& beside)
{
    const auto n = static_cast<unsigned int>(diagonal.size());
    dealii::TridiagonalMatrix<double> matrix(n, true);
    for (unsigned int k = 0; k < n; ++k)
    {
        matrix(k, k) = diagonal[k];
        if (k > 0)
            matrix(k - 1, k) = beside[k];
    }
    matrix.compute_eigenvalues();
    return matrix.eigenvalue(n - 1);
}
}  // namespace

/// In nodes that bodies share, the mean weighted with density: momentum is kept.
Vector Elasticity::initial_velocity() const
{
    Vector velocity(dofs_.n_dofs()), density(dofs_.n_dofs());
    std::vector<dealii::types::global_dof_index> ids(element_.n_dofs_per_cell());
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        const Medium& medium = media_[cell->material_id()];
        cell->get_dof_indices(ids);
        for (const auto id : ids)
        {
            density(id) += medium.density;
            if (medium.velocity)
                velocity(id) += medium.density * (*medium.velocity)(place_of(nodes_[id]))[component_[id]];
        }
    }
    for (std::size_t dof = 0; dof < velocity.size(); ++dof)
        velocity(dof) /= density(dof);
    hold(velocity);
    return velocity;
}

MotionSums Elasticity::motion(const Vector& velocity) const
{
    Vector momentum(velocity);
    if (lumped_mass_.size() > 0)
        momentum.scale(lumped_mass_);
    else if (!consistent_mass_.empty())
        consistent_mass_.vmult(momentum, velocity);
    const auto s = ordered_sum<4>(velocity.size(),
                                  [&](std::size_t dof)
                                  {
                                      const double p = momentum(dof);
                                      const Vec<2> arm{nodes_[dof][0] - scene_.grid.origin[0], nodes_[dof][1] - scene_.grid.origin[1]};
                                      return std::array<double, 4>{0.5 * p * velocity(dof), is_x(dof) ? p : 0, is_x(dof) ? 0 : p,
                                                                   is_x(dof) ? -arm[1] * p : arm[0] * p};
                                  });
    return {s[0], s[0], {s[1], s[2]}, s[3], 0};
}

/// Lanczos on M^-1/2 K M^-1/2: its largest Ritz value grows to the largest eigenvalue within few dozen products.
double Elasticity::largest_frequency() const
{
    Vector scale(lumped_mass_), v(scale.size()), before(scale.size()), next(scale.size());
    std::mt19937 random;
    for (std::size_t dof = 0; dof < scale.size(); ++dof)
    {
        scale(dof) = 1 / std::sqrt(lumped_mass_(dof));
        v(dof) = static_cast<double>(random()) / static_cast<double>(std::mt19937::max()) - 0.5;
    }
    hold(scale);
    v.scale(scale);
    v /= v.l2_norm();
    std::vector<double> diagonal, beside{0};
    double largest = 0;
    for (std::size_t k = 0; k < std::min<std::size_t>(unknowns(), 300); ++k)
    {
        Vector scaled(v);
        scaled.scale(scale);
        stiffness_.vmult(next, scaled);
        next.scale(scale);
        diagonal.push_back(next * v);
        next.add(-diagonal.back(), v, -beside.back(), before);
        beside.push_back(next.l2_norm());
        const double previous = largest;
        largest = largest_eigenvalue(diagonal, beside);
        if ((k > 20 && largest - previous < 1e-7 * largest) || beside.back() < 1e-12 * largest)
            break;
        before = v;
        v.equ(1 / beside.back(), next);
    }
    return std::sqrt(largest);
}
}  // namespace testbed
