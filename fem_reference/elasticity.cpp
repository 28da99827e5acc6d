#include "fem_reference/elasticity.hpp"

#include "core/loads/walls.hpp"
#include "core/scene/geometry.hpp"

#include <deal.II/base/quadrature_lib.h>
#include <deal.II/base/symmetric_tensor.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/fe/mapping_q1.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/full_matrix.h>
#include <deal.II/lac/tridiagonal_matrix.h>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <random>

namespace testbed
{
namespace
{
Place place_of(const dealii::Point<2>& X, double t = 0)
{
    return {X[0], X[1], X[0], X[1], t};
}

/// Of the displacement field that is the shape function.
Gradient<> gradient_of(unsigned int component, const dealii::Tensor<1, 2>& d)
{
    return component == 0 ? Gradient<>{.xx = d[0], .xy = d[1]} : Gradient<>{.yy = d[1], .yx = d[0]};
}

double contract(const SymTensor<>& stress, const Gradient<>& d)
{
    return stress.xx * d.xx + stress.yy * d.yy + stress.xy * d.shear();
}

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

Elasticity::Elasticity(const Scene& scene, const Lattice& lattice, const Warn& warn)
    : scene_(scene),
      element_(dealii::FE_Q<2>(static_cast<unsigned int>(scene.fem.degree)), 2)
{
    make_mesh(scene, lattice, warn, mesh_);
    dofs_.reinit(mesh_);
    dofs_.distribute_dofs(element_);
    nodes_.resize(dofs_.n_dofs());
    dealii::DoFTools::map_dofs_to_support_points(dealii::MappingQ1<2>(), dofs_, nodes_);
    component_.resize(dofs_.n_dofs());
    std::vector<dealii::types::global_dof_index> ids(element_.n_dofs_per_cell());
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        cell->get_dof_indices(ids);
        for (unsigned int i = 0; i < ids.size(); ++i)
            component_[ids[i]] = static_cast<unsigned char>(element_.system_to_component_index(i).first);
    }
    read_media();
    find_supports(warn);
}

void Elasticity::read_media()
{
    const Constants constants = scene_.expression_constants();
    for (const BodySpec& body : scene_.bodies)
    {
        const MaterialSpec& material = scene_.material(body.material);
        const bool varies = !is_number(material.youngs_modulus);
        Expression modulus(material.youngs_modulus, constants);
        const double base = varies ? 1.0 : modulus({});
        media_.push_back({material.density, {base, material.poissons_ratio}, std::move(modulus), varies, {}});
        if (body.velocity)
            media_.back().velocity.emplace(*body.velocity, constants);
    }
    if (scene_.body_force)
        body_force_.emplace(scene_.body_force->acceleration, constants);
}

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
            const Vec2 travel = wall_path(*support.wall, scene_.expression_constants(), t).back();
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

void Elasticity::make_sparsity()
{
    dealii::DynamicSparsityPattern pattern(dofs_.n_dofs());
    dealii::DoFTools::make_sparsity_pattern(dofs_, pattern);
    sparsity_.copy_from(pattern);
}

double Elasticity::stiffness_ratio(const Medium& medium, const dealii::Point<2>& X) const
{
    if (!medium.varies)
        return 1;
    const double modulus = medium.youngs_modulus(place_of(X));
    if (!(modulus > 0) || !std::isfinite(modulus))
        throw SceneError(fmt::format("{}: youngs_modulus = {} at ({}, {}) m, must be positive", scene_.path, modulus, X[0], X[1]));
    return modulus;
}

dealii::FullMatrix<double> Elasticity::cell_stiffness(const Medium& medium, const dealii::FEValues<2>& values) const
{
    const unsigned int n = element_.n_dofs_per_cell();
    dealii::FullMatrix<double> result(n, n);
    std::vector<Gradient<>> gradient(n);
    for (const unsigned int q : values.quadrature_point_indices())
    {
        const double ratio = stiffness_ratio(medium, values.quadrature_point(q));
        for (unsigned int i = 0; i < n; ++i)
            gradient[i] = gradient_of(element_.system_to_component_index(i).first, values.shape_grad(i, q));
        for (unsigned int j = 0; j < n; ++j)
        {
            const SymTensor<> stress = elastic_stress(medium.moduli, gradient[j], ratio);
            for (unsigned int i = 0; i < n; ++i)
                result(i, j) += contract(stress, gradient[i]) * values.JxW(q);
        }
    }
    return result;
}

Elasticity::CellMass Elasticity::cell_mass() const
{
    using namespace dealii;
    const unsigned int n = element_.n_dofs_per_cell();
    FEValues<2> values(element_, QGauss<2>(element_.degree + 1), update_values | update_JxW_values);
    FEValues<2> nodal(element_, QGaussLobatto<2>(element_.degree + 1), update_values | update_JxW_values);
    values.reinit(dofs_.begin_active());
    nodal.reinit(dofs_.begin_active());
    CellMass mass{FullMatrix<double>(n, n), std::vector<double>(n), std::vector<double>(n)};
    for (unsigned int i = 0; i < n; ++i)
    {
        for (const unsigned int q : values.quadrature_point_indices())
        {
            mass.share[i] += values.shape_value(i, q) * values.JxW(q);
            for (unsigned int j = 0; j < n; ++j)
                if (element_.system_to_component_index(j).first == element_.system_to_component_index(i).first)
                    mass.consistent(i, j) += values.shape_value(i, q) * values.shape_value(j, q) * values.JxW(q);
        }
        for (const unsigned int q : nodal.quadrature_point_indices())
            mass.lumped[i] += nodal.shape_value(i, q) * nodal.JxW(q);
    }
    return mass;
}

void Elasticity::assemble(MassKind mass_kind)
{
    make_sparsity();
    stiffness_.reinit(sparsity_);
    if (mass_kind == MassKind::consistent)
        consistent_mass_.reinit(sparsity_);
    if (mass_kind == MassKind::lumped)
        lumped_mass_.reinit(dofs_.n_dofs());
    if (scene_.gravity)
        weight_.reinit(dofs_.n_dofs());

    // all cells are the same square: one matrix per body does, unless its stiffness varies
    const CellMass mass = cell_mass();
    std::vector<dealii::FullMatrix<double>> stiffness(media_.size());
    dealii::FEValues<2> values(element_, dealii::QGauss<2>(element_.degree + 1),
                               dealii::update_gradients | dealii::update_quadrature_points | dealii::update_JxW_values);
    std::vector<dealii::types::global_dof_index> ids(element_.n_dofs_per_cell());
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        const Medium& medium = media_[cell->material_id()];
        auto& K = stiffness[cell->material_id()];
        if (medium.varies || K.empty())
        {
            values.reinit(cell);
            K = cell_stiffness(medium, values);
        }
        cell->get_dof_indices(ids);
        stiffness_.add(ids, K);
        if (mass_kind == MassKind::consistent)
        {
            auto M = mass.consistent;
            M *= medium.density;
            consistent_mass_.add(ids, M);
        }
        for (unsigned int i = 0; i < ids.size(); ++i)
        {
            if (mass_kind == MassKind::lumped)
                lumped_mass_(ids[i]) += medium.density * mass.lumped[i];
            if (scene_.gravity)
                weight_(ids[i]) += medium.density * mass.share[i] * scene_.gravity->acceleration[component_[ids[i]]];
        }
    }
}

Vector Elasticity::load(double t) const
{
    Vector force(dofs_.n_dofs());
    if (scene_.gravity)
        force.equ(make_gravity(*scene_.gravity).factor(t), weight_);
    if (body_force_)
        add_body_force(t, force);
    if (!scene_.tractions.empty())
        add_tractions(t, force);
    return force;
}

void Elasticity::add_body_force(double t, Vector& force) const
{
    using namespace dealii;
    FEValues<2> values(element_, QGauss<2>(element_.degree + 2), update_values | update_quadrature_points | update_JxW_values);
    std::vector<types::global_dof_index> ids(element_.n_dofs_per_cell());
    for (const auto& cell : dofs_.active_cell_iterators())
    {
        values.reinit(cell);
        cell->get_dof_indices(ids);
        for (const unsigned int q : values.quadrature_point_indices())
        {
            const Vec2 b = (*body_force_)(place_of(values.quadrature_point(q), t));
            const double mass = media_[cell->material_id()].density * values.JxW(q);
            for (unsigned int i = 0; i < ids.size(); ++i)
                force(ids[i]) += mass * b[component_[ids[i]]] * values.shape_value(i, q);
        }
    }
}

void Elasticity::add_tractions(double t, Vector& force) const
{
    using namespace dealii;
    FEFaceValues<2> values(element_, QGauss<1>(element_.degree + 1), update_values | update_quadrature_points | update_JxW_values);
    std::vector<types::global_dof_index> ids(element_.n_dofs_per_cell());
    for (const TractionSpec& spec : scene_.tractions)
    {
        const BodySpec& body = scene_.body(spec.body);
        const auto normal = static_cast<unsigned int>(normal_of(spec.face));
        const double face = (is_low(spec.face) ? *body.min : *body.max)[normal];
        const VectorExpression traction(spec.traction, scene_.expression_constants());
        for (const auto& cell : dofs_.active_cell_iterators())
            for (const unsigned int f : cell->face_indices())
            {
                if (!cell->at_boundary(f) || scene_.bodies[cell->material_id()].name != spec.body ||
                    std::abs(cell->face(f)->center()[normal] - face) > 1e-6 * scene_.grid.cell_size)
                    continue;
                values.reinit(cell, f);
                cell->get_dof_indices(ids);
                for (const unsigned int q : values.quadrature_point_indices())
                {
                    const Vec2 p = traction(place_of(values.quadrature_point(q), t));
                    for (unsigned int i = 0; i < ids.size(); ++i)
                        force(ids[i]) += p[component_[ids[i]]] * values.shape_value(i, q) * values.JxW(q);
                }
            }
    }
}

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

void Elasticity::combine(double stiffness, double mass, Matrix& result) const
{
    result.reinit(sparsity_);
    if (stiffness != 0)
        result.add(stiffness, stiffness_);
    if (mass != 0)
        result.add(mass, consistent_mass_);
    constraints_.condense(result);
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
                                      const Vec2 arm{nodes_[dof][0] - scene_.grid.origin[0], nodes_[dof][1] - scene_.grid.origin[1]};
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

std::size_t Elasticity::bytes() const
{
    return mesh_.memory_consumption() + dofs_.memory_consumption() + constraints_.memory_consumption() + sparsity_.memory_consumption() +
           stiffness_.memory_consumption() + consistent_mass_.memory_consumption() + lumped_mass_.memory_consumption() +
           weight_.memory_consumption() + nodes_.capacity() * sizeof(nodes_[0]) + component_.capacity();
}
}  // namespace testbed
