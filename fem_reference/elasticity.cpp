#include "fem_reference/elasticity.hpp"

#include "core/scene/geometry.hpp"

#include <deal.II/base/quadrature_lib.h>
#include <deal.II/dofs/dof_tools.h>
#include <deal.II/fe/fe_q.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/fe/mapping_q1.h>
#include <deal.II/lac/dynamic_sparsity_pattern.h>
#include <deal.II/lac/full_matrix.h>
#include <fmt/format.h>

namespace testbed
{
namespace
{
/// Of the displacement field that is the shape function.
Gradient<2> gradient_of(unsigned int component, const dealii::Tensor<1, 2>& d)
{
    return component == 0 ? Gradient<2>{.xx = d[0], .xy = d[1]} : Gradient<2>{.yy = d[1], .yx = d[0]};
}

double contract(const SymTensor<2>& stress, const Gradient<2>& d)
{
    return stress.xx * d.xx + stress.yy * d.yy + stress.xy * d.shear();
}
}  // namespace

Elasticity::Elasticity(const Scene& scene, const Lattice<2>& lattice, const Warn& warn)
    : scene_(scene),
      element_(dealii::FE_Q<2>(static_cast<unsigned int>(scene.options<FemSpec>().degree)), 2)
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
    std::vector<Gradient<2>> gradient(n);
    for (const unsigned int q : values.quadrature_point_indices())
    {
        const double ratio = stiffness_ratio(medium, values.quadrature_point(q));
        for (unsigned int i = 0; i < n; ++i)
            gradient[i] = gradient_of(element_.system_to_component_index(i).first, values.shape_grad(i, q));
        for (unsigned int j = 0; j < n; ++j)
        {
            const SymTensor<2> stress = elastic_stress(medium.moduli, gradient[j], ratio);
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

void Elasticity::combine(double stiffness, double mass, Matrix& result) const
{
    result.reinit(sparsity_);
    if (stiffness != 0)
        result.add(stiffness, stiffness_);
    if (mass != 0)
        result.add(mass, consistent_mass_);
    constraints_.condense(result);
}

std::size_t Elasticity::bytes() const
{
    return mesh_.memory_consumption() + dofs_.memory_consumption() + constraints_.memory_consumption() + sparsity_.memory_consumption() +
           stiffness_.memory_consumption() + consistent_mass_.memory_consumption() + lumped_mass_.memory_consumption() +
           weight_.memory_consumption() + nodes_.capacity() * sizeof(nodes_[0]) + component_.capacity();
}
}  // namespace testbed
