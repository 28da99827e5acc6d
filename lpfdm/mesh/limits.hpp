#pragma once
/// What limits the time step of LPFDM on a mesh.

#include "core/run/time_step.hpp"
#include "lpfdm/mesh/mesh.hpp"

#include <Eigen/Eigenvalues>

namespace testbed
{
/// Square root of an isotropic law's stiffness, for (xx, yy, engineering shear) [sqrt(Pa)].
inline Eigen::Matrix3d stiffness_root(const ElasticModuli& law)
{
    Eigen::Matrix3d d;
    d << law.constrained(), law.lame(), 0, law.lame(), law.constrained(), 0, 0, 0, law.shear();
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(d).operatorSqrt();
}

/// Square of the highest frequency of an isolated cell full of unit density, an equal part of its mass at each corner. Its strain is that
/// of the cell: B of three rows, so that the largest eigenvalue of n A / m B^T D B is that of n D B B^T, 3 x 3. A cell that is partly full
/// has the same, because its stiffness and its mass shrink together.
/// @param slopes A grad N of its corners [m] @param area [m^2] @param root stiffness_root()
inline double cell_frequency_squared(std::span<const Vec<2>> slopes, double area, const Eigen::Matrix3d& root)
{
    Eigen::Matrix3d b = Eigen::Matrix3d::Zero();
    for (const Vec<2>& slope : slopes)
    {
        const double x = slope[0] / area, y = slope[1] / area;
        Eigen::Matrix<double, 3, 2> rows;
        rows << x, 0, 0, y, y, x;
        b += rows * rows.transpose();
    }
    const Eigen::Matrix3d similar = root * b * root;
    return static_cast<double>(slopes.size()) *
           Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(similar, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
}

/// Limit of an isolated cell of the mesh over that of a square of side L: the least over all cells and laws. By Irons' theorem no mesh of
/// such cells asks for less.
inline double limit_beside_square(const Mesh& mesh, const std::vector<Body>& bodies, double L)
{
    const std::vector<Vec<2>> square = polygon_slopes(std::vector<Vec<2>>{{0, 0}, {L, 0}, {L, L}, {0, L}});
    double least = std::numeric_limits<double>::infinity();
    for (const Body& body : bodies)
    {
        const Eigen::Matrix3d root = stiffness_root(moduli(body.material));
        const double of_square = cell_frequency_squared(square, L * L, root);
        for (std::size_t c = 0; c < mesh.cells(); ++c)
            least = std::min(least, of_square / cell_frequency_squared(mesh.slopes(c), mesh.area(c), root));
    }
    return std::sqrt(least);
}
}  // namespace testbed
