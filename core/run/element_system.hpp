#pragma once
/// The largest eigenvalue of a system of small elements: the sharp limit of the time step for points as they stand, of which the closed
/// forms in core/run/time_step.hpp are bounds.

#include "core/loads/restraint.hpp"
#include "core/materials/elastic.hpp"

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace testbed
{
/// Nodes with two components each, dof = 2 node + component. Stiffness, viscosity and consistent mass are sums of dense blocks of
/// elements, the lumped mass is one number for each node.
class ElementSystem
{
public:
    /// @param nodes_per_element n @param nodes of the lattice
    ElementSystem(std::size_t nodes_per_element, std::size_t nodes);

    /// Starts another element. Its blocks are zero. @param nodes n numbers
    void add_element(std::span<const std::uint32_t> nodes);
    double* stiffness() { return &stiffness_[stiffness_.size() - 4 * n_ * n_]; }      ///< of the last element, 2n x 2n by rows [N/m^2]
    double* viscosity() { return &viscosity_[viscosity_.size() - 4 * n_ * n_]; }      ///< so, too [N s/m^2]
    double* consistent_mass() { return &consistent_[consistent_.size() - n_ * n_]; }  ///< n x n by rows [kg/m]
    std::vector<double> lumped_mass;                                                  ///< [kg/m]
    std::vector<char> is_fixed;                                                       ///< by dof

    std::size_t nodes_per_element() const { return n_; }
    std::size_t dofs() const { return is_fixed.size(); }

    /// M^-1 of the lumped mass; zero for what is fixed or has no mass.
    void divide_by_mass(std::vector<double>& values) const;
    void apply_stiffness(const std::vector<double>& in, std::vector<double>& out) const { apply(stiffness_, in, out); }
    void apply_viscosity(const std::vector<double>& in, std::vector<double>& out) const { apply(viscosity_, in, out); }
    /// C = M^-1 M_C: what points of nodal values (FLIP) leave of them.
    void apply_smoothing(const std::vector<double>& in, std::vector<double>& out) const;

private:
    void apply(const std::vector<double>& blocks, const std::vector<double>& in, std::vector<double>& out) const;

    std::size_t n_;
    std::vector<std::uint32_t> node_;
    std::vector<double> stiffness_, viscosity_, consistent_;
};

/// Adds V B^T D B of a point to the last element. @param xx, yy, shear the rows of B
template <std::size_t m>
void add_stiffness(ElementSystem& system, const std::array<double, m>& xx, const std::array<double, m>& yy,
                   const std::array<double, m>& shear, const ElasticModuli& law, double volume)
{
    double* block = system.stiffness();
    const double M = volume * law.constrained(), lame = volume * law.lame(), G = volume * law.shear();
    for (std::size_t a = 0; a < m; ++a)
        for (std::size_t b = 0; b < m; ++b)
            block[a * m + b] += M * (xx[a] * xx[b] + yy[a] * yy[b]) + lame * (xx[a] * yy[b] + yy[a] * xx[b]) + G * shear[a] * shear[b];
}

/// Marks the components that supports and walls prescribe.
inline void fix(ElementSystem& system, const std::vector<Restraint>& restraints, const Lattice<2>& lattice)
{
    for (const Restraint& restraint : restraints)
        for (std::size_t k = 0; k < 2; ++k)
            for (const Index<2>& n : restraint.components[k].nodes)
                if (lattice.has_node(n))
                    system.is_fixed[2 * lattice.node(n) + k] = 1;
}

/// Largest eigenvalue of X M^-1 K with X self-adjoint in M: Lanczos' iteration in the energy product of K. From below, right to
/// `tolerance`.
/// @param energy in -> K in @param smooth in -> X in, in place
double largest_eigenvalue(const ElementSystem& system,
                          const std::function<void(const std::vector<double>& in, std::vector<double>& out)>& energy,
                          const std::function<void(std::vector<double>&)>& smooth, double tolerance = 1e-4);
}  // namespace testbed
