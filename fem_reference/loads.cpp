#include "fem_reference/elasticity.hpp"

#include <deal.II/base/quadrature_lib.h>
#include <deal.II/fe/fe_values.h>

/// Elasticity: nodal forces of gravity, body forces and tractions.
namespace testbed
{
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
            const Vec<2> b = (*body_force_)(place_of(values.quadrature_point(q), t));
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
                    const Vec<2> p = traction(place_of(values.quadrature_point(q), t));
                    for (unsigned int i = 0; i < ids.size(); ++i)
                        force(ids[i]) += p[component_[ids[i]]] * values.shape_value(i, q) * values.JxW(q);
                }
            }
    }
}
}  // namespace testbed
