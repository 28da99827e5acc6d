#include "fem_reference/elasticity.hpp"

#include "core/loads/walls.hpp"
#include "core/scene/geometry.hpp"

#include <deal.II/base/symmetric_tensor.h>
#include <fmt/format.h>
#include <map>
#include <numeric>

/// Elasticity: held components, what they react with, and whether they suffice.
namespace testbed
{
namespace
{
/// Sets of degrees of freedom that cells hold together.
class ConnectedParts
{
public:
    explicit ConnectedParts(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }
    std::size_t find(std::size_t i)
    {
        while (parent_[i] != i)
            i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    void join(std::size_t i, std::size_t j) { parent_[find(i)] = find(j); }

private:
    std::vector<std::size_t> parent_;
};
}  // namespace

template <class Holds>
void Elasticity::add_support(const std::string& name, Fix fix, const WallSpec* wall, Holds&& holds, const Warn& warn)
{
    Support support{name, wall, {}};
    bool holds_somewhere = false;
    for (std::size_t dof = 0; dof < nodes_.size(); ++dof)
        if (fixes(fix, component_[dof]) && holds(nodes_[dof]))
        {
            holds_somewhere = true;
            for (Support& earlier : supports_)  // a node of two belongs to the later one
                std::erase(earlier.dofs, dof);
            constraints_.add_line(dof);
            support.dofs.push_back(dof);
        }
    if (!holds_somewhere)
        warn(fmt::format("'{}' holds no node of the FEM mesh, which covers the bodies only", name));
    supports_.push_back(std::move(support));
}

void Elasticity::find_supports(const Warn& warn)
{
    const double reach = 1e-6 * scene_.grid.cell_size / cells_per_lattice_cell(scene_);
    for (const BoundarySpec& boundary : scene_.boundaries)
    {
        const Expression where(boundary.where, scene_.expression_constants());
        add_support(
            boundary.name, boundary.fix, nullptr, [&](const dealii::Point<2>& X) { return holds_near(where, X[0], X[1], reach); }, warn);
    }
    for (const WallSpec& wall : scene_.walls)
    {
        const bool open = wall.door && wall.door_opens <= scene_.time.end;
        const auto along = static_cast<unsigned int>(door_direction(wall));
        add_support(
            wall.name, wall.fix, &wall,
            [&](const dealii::Point<2>& X)
            {
                const bool in_door = open && X[along] > (*wall.door)[0] + reach && X[along] < (*wall.door)[1] - reach;
                return !in_door && X[0] >= wall.min[0] - reach && X[0] <= wall.max[0] + reach && X[1] >= wall.min[1] - reach &&
                       X[1] <= wall.max[1] + reach;
            },
            warn);
    }
    constraints_.close();
}

Vector Elasticity::prescribed(double t) const
{
    Vector u(dofs_.n_dofs());
    for (const Support& support : supports_)
        if (support.wall && support.wall->velocity)
        {
            const Vec<2> travel = wall_path(*support.wall, scene_.expression_constants(), t).back();
            for (const auto dof : support.dofs)
                u(dof) = travel[component_[dof]];
        }
    return u;
}

std::vector<RestraintRecord> Elasticity::restraints(const Vector& displacement, double t) const
{
    Vector reaction(displacement.size());
    if (!stiffness_.empty())
    {
        stiffness_.vmult(reaction, displacement);
        reaction -= load(t);
    }
    std::vector<RestraintRecord> records;
    for (const Support& support : supports_)
    {
        RestraintRecord record{support.name, {0, 0}, {}};
        for (const auto dof : support.dofs)
            record.reaction[component_[dof]] += reaction(dof);
        if (support.wall)
            record.displacement = wall_path(*support.wall, scene_.expression_constants(), t).back();
        records.push_back(std::move(record));
    }
    return records;
}

/// The supports must stop the three rigid motions of each part: their Gram matrix over the held components has full rank.
void Elasticity::check_supports() const
{
    ConnectedParts parts(dofs_.n_dofs());
    std::vector<dealii::types::global_dof_index> ids(element_.n_dofs_per_cell());
    std::map<std::size_t, unsigned int> body_of_part;
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        cell->get_dof_indices(ids);
        for (const auto id : ids)
            parts.join(id, ids[0]);
    }
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        cell->get_dof_indices(ids);
        body_of_part.emplace(parts.find(ids[0]), cell->material_id());
    }
    const double length = std::max(scene_.grid.size[0], scene_.grid.size[1]);
    for (const auto& [part, body] : body_of_part)
    {
        dealii::SymmetricTensor<2, 3> gram;
        for (std::size_t dof = 0; dof < nodes_.size(); ++dof)
        {
            if (!is_held(dof) || parts.find(dof) != part)
                continue;
            const double dx = (nodes_[dof][0] - nodes_[part][0]) / length, dy = (nodes_[dof][1] - nodes_[part][1]) / length;
            const std::array<double, 3> motion = is_x(dof) ? std::array<double, 3>{1, 0, -dy} : std::array<double, 3>{0, 1, dx};
            for (unsigned int i = 0; i < 3; ++i)
                for (unsigned int j = i; j < 3; ++j)
                    gram[i][j] += motion[i] * motion[j];
        }
        const auto stiffness = dealii::eigenvalues(gram);  // descending
        if (!(stiffness[2] > 1e-12 * stiffness[0]))
            throw SceneError(fmt::format("{}: body '{}' can move as a rigid body, and a static analysis has no unique solution; add "
                                         "[[boundary]] entries that stop it in x, in y and from turning, or set fem.analysis = "
                                         "\"dynamic\"",
                                         scene_.path, scene_.bodies[body].name));
    }
}
}  // namespace testbed
