#pragma once
/// Small-strain plane-strain elasticity on the mesh of a scene: K u + M a = f(t), per metre of thickness.

#include "core/bodies/body.hpp"
#include "core/loads/node_ops.hpp"
#include "core/run/solver.hpp"
#include "fem_reference/mesh.hpp"

#include <deal.II/dofs/dof_handler.h>
#include <deal.II/fe/fe_system.h>
#include <deal.II/fe/fe_values.h>
#include <deal.II/lac/affine_constraints.h>
#include <deal.II/lac/full_matrix.h>
#include <deal.II/lac/sparse_matrix.h>
#include <deal.II/lac/vector.h>

namespace testbed
{
using Matrix = dealii::SparseMatrix<double>;
using Vector = dealii::Vector<double>;

/// D : grad u. @param stiffness factor on the moduli
inline SymTensor<2> elastic_stress(const ElasticModuli& moduli, const Gradient<2>& gradient, double stiffness = 1)
{
    const LinearElastic law{moduli};
    LinearElastic::State<double> state;
    law.update(state, gradient, stiffness);
    return state.stress;
}

/// Of a point that has not moved.
inline Place place_of(const dealii::Point<2>& X, double t = 0)
{
    return {X[0], X[1], X[0], X[1], t};
}

enum class MassKind
{
    none,
    consistent,
    lumped  ///< by Gauss-Lobatto quadrature in the nodes
};

class Elasticity
{
public:
    /// Mesh, unknowns and supports; no matrices yet. @throws SceneError
    Elasticity(const Scene& scene, const Lattice<2>& lattice, const Warn& warn);

    /// Stiffness, gravity and mass. @throws SceneError for a Young's modulus that is not positive
    void assemble(MassKind mass_kind);

    /// Without supports: the rows of held components give the reactions [N/m^2].
    const Matrix& stiffness() const { return stiffness_; }
    const Matrix& consistent_mass() const { return consistent_mass_; }  ///< [kg/m]
    const Vector& lumped_mass() const { return lumped_mass_; }          ///< [kg/m]
    /// Gravity, body force and tractions at time t, in the initial geometry [N/m].
    Vector load(double t) const;
    Vector initial_velocity() const;
    /// Zero where a component is held.
    void hold(Vector& field) const { constraints_.set_zero(field); }
    /// Displacement that moving walls prescribe at time t, zero elsewhere [m].
    Vector prescribed(double t) const;
    /// Reactions to a displacement, and where walls are at time t.
    std::vector<RestraintRecord> restraints(const Vector& displacement, double t) const;
    /// stiffness K + mass M, with nothing but the diagonal in rows and columns where a component is held.
    void combine(double stiffness, double mass, Matrix& result) const;

    /// Kinetic energy and momenta of a velocity field; the arms are initial positions.
    MotionSums motion(const Vector& velocity) const;
    /// Largest angular frequency of the lumped system, held components left out [rad/s].
    double largest_frequency() const;
    /// @throws SceneError if a part of the mesh can move as a rigid body
    void check_supports() const;

    const dealii::DoFHandler<2>& dofs() const { return dofs_; }
    const std::vector<dealii::Point<2>>& nodes() const { return nodes_; }  ///< of each degree of freedom [m]
    bool is_x(std::size_t dof) const { return component_[dof] == 0; }
    bool is_held(std::size_t dof) const { return constraints_.is_constrained(dof); }
    std::size_t unknowns() const { return dofs_.n_dofs() - constraints_.n_constraints(); }
    std::size_t cells() const { return mesh_.n_active_cells(); }
    std::size_t bytes() const;

private:
    /// What the assembly asks of a body.
    struct Medium
    {
        double density;
        ElasticModuli moduli;
        Expression youngs_modulus;
        bool varies;
        std::optional<VectorExpression> velocity;
    };
    /// Of a cell with unit density.
    struct CellMass
    {
        dealii::FullMatrix<double> consistent;
        std::vector<double> share, lumped;  ///< integrals of the shape functions by Gauss and by Gauss-Lobatto quadrature
    };
    /// Held components of one boundary or wall.
    struct Support
    {
        std::string name;
        const WallSpec* wall;  ///< none for a boundary
        std::vector<dealii::types::global_dof_index> dofs;
    };
    void read_media();
    template <class Holds>
    void add_support(const std::string& name, Fix fix, const WallSpec* wall, Holds&& holds, const Warn& warn);
    void add_tractions(double t, Vector& force) const;
    void find_supports(const Warn& warn);
    void make_sparsity();
    double stiffness_ratio(const Medium& medium, const dealii::Point<2>& X) const;
    dealii::FullMatrix<double> cell_stiffness(const Medium& medium, const dealii::FEValues<2>& values) const;
    CellMass cell_mass() const;
    void add_body_force(double t, Vector& force) const;

    const Scene& scene_;
    dealii::Triangulation<2> mesh_;
    dealii::FESystem<2> element_;
    dealii::DoFHandler<2> dofs_;
    dealii::AffineConstraints<double> constraints_;
    dealii::SparsityPattern sparsity_;
    Matrix stiffness_, consistent_mass_;
    Vector lumped_mass_, weight_;  ///< weight: of the full gravity
    std::vector<Medium> media_;
    std::optional<VectorExpression> body_force_;
    std::vector<Support> supports_;
    std::vector<dealii::Point<2>> nodes_;
    std::vector<unsigned char> component_;
};
}  // namespace testbed
