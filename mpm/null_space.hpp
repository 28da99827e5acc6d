#pragma once
/// Null-space filter of the velocity of the points (Gritton & Berzins 2017, in its local form): of the velocities of the points of a cell
/// that part goes to which every node is blind, sum_p N_i(x_p) v_p = 0. What stays is their projection on the span of the shape functions
/// at these points, the bilinear field nearest to them. Mass and momentum of the nodes do not change, so that linear and angular momentum
/// are kept exactly. Cell by cell this is the null space of bilinear shapes: one cell's points see the same four nodes.

#include "mpm/transfer.hpp"

#include <Eigen/Eigenvalues>

namespace testbed
{
/// @tparam Shape LinearShape
template <class Shape>
void filter_null_space(const Lattice& lattice, std::vector<Body>& bodies)
{
    static_assert(Shape::S == 2);
    using Square = Eigen::Matrix4d;
    for (Body& body : bodies)
    {
        Points& q = body.points;
        const auto& bins = body.bins.list();
        parallel_for(bins.size(),
                     [&](std::size_t b)
                     {
                         const BinFrame frame(lattice, bins[b]);
                         const auto shapes = [&](std::size_t p)
                         {
                             const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, SomeLanes(1)), frame.scale);
                             return Eigen::Vector4d(at.value(0, 0)[0], at.value(1, 0)[0], at.value(0, 1)[0], at.value(1, 1)[0]);
                         };
                         Square gram = Square::Zero();
                         Eigen::Matrix<double, 4, 2> momentum = Eigen::Matrix<double, 4, 2>::Zero();
                         for (std::size_t p = bins[b].begin; p < bins[b].end; ++p)
                         {
                             const Eigen::Vector4d N = shapes(p);
                             gram += N * N.transpose();
                             momentum += N * Eigen::RowVector2d(q.vx[p], q.vy[p]);
                         }
                         // the pseudo-inverse: few points, or points in a line, see less than four nodes apart
                         const Eigen::SelfAdjointEigenSolver<Square> modes(gram);
                         Eigen::Vector4d inverse;
                         for (int k = 0; k < 4; ++k)
                             inverse[k] = modes.eigenvalues()[k] > 1e-12 * modes.eigenvalues()[3] ? 1 / modes.eigenvalues()[k] : 0;
                         const Eigen::Matrix<double, 4, 2> field =
                             modes.eigenvectors() * inverse.asDiagonal() * modes.eigenvectors().transpose() * momentum;
                         for (std::size_t p = bins[b].begin; p < bins[b].end; ++p)
                         {
                             const Eigen::RowVector2d v = shapes(p).transpose() * field;
                             q.vx[p] = v[0];
                             q.vy[p] = v[1];
                         }
                     });
    }
}
}  // namespace testbed
