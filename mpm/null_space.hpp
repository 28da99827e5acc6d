#pragma once
/// Null-space filter of the velocity of the points (Gritton & Berzins 2017, in its local form): of the velocities of the points of a cell
/// that part goes to which every node is blind, sum_p N_i(x_p) v_p = 0. What stays is their projection on the span of the shape functions
/// at these points, the bilinear field nearest to them. Mass and momentum of the nodes do not change, so that linear and angular momentum
/// are kept exactly. Cell by cell this is the null space of bilinear shapes: one cell's points see the same four nodes.

#include "mpm/transfer.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace testbed
{
/// Coefficients of the projection, G c = b with G = sum_p N N^T; the least ones where few points, or points in a line, do not
/// tell four nodes apart.
inline Eigen::Matrix<double, 4, 2> solve_projection(const Eigen::Matrix4d& gram, const Eigen::Matrix<double, 4, 2>& momentum)
{
    const Eigen::LDLT<Eigen::Matrix4d> factors(gram);
    if (const Eigen::Vector4d pivots = factors.vectorD(); pivots.minCoeff() > 1e-10 * pivots.maxCoeff())
        return factors.solve(momentum);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> modes(gram);
    Eigen::Vector4d inverse;
    for (int k = 0; k < 4; ++k)
        inverse[k] = modes.eigenvalues()[k] > 1e-12 * modes.eigenvalues()[3] ? 1 / modes.eigenvalues()[k] : 0;
    return modes.eigenvectors() * inverse.asDiagonal() * modes.eigenvectors().transpose() * momentum;
}

/// The points of one bin. @tparam Shape of two nodes, not smooth
template <class Shape>
void filter_null_space(const BinFrame<2>& frame, Points<2>& q, const Bin<2>& bin)
{
    static_assert(Shape::S == 2);
    std::array<Pack, 18> total;  // upper half of the Gram matrix, row by row, and the momentum
    set_zero(total);
    const auto shapes = [&](std::size_t p, const auto& lanes)
    {
        const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
        std::array<Pack, 4> N;
        unrolled<4>([&](auto k) { N[k] = at.template value<k>(); });
        return N;
    };
    for_each_pack(bin.begin, bin.end,
                  [&](std::size_t p, const auto& lanes)
                  {
                      const auto N = shapes(p, lanes);
                      const Vec<2, Pack> v = load(q.v, p, lanes);
                      std::size_t n = 0;
                      for (std::size_t i = 0; i < 4; ++i)
                      {
                          const Pack own = lanes.keep(N[i]);
                          for (std::size_t j = i; j < 4; ++j)
                              total[n++] += own * N[j];
                          for (std::size_t d = 0; d < 2; ++d)
                              total[10 + 4 * d + i] += own * v[d];
                      }
                  });
    std::array<double, 18> sums;
    sum(total, sums.data());
    Eigen::Matrix4d gram;
    Eigen::Matrix<double, 4, 2> momentum;
    std::size_t n = 0;
    for (int i = 0; i < 4; ++i)
    {
        for (int j = i; j < 4; ++j)
            gram(i, j) = gram(j, i) = sums[n++];
        momentum.row(i) << sums[10 + static_cast<std::size_t>(i)], sums[14 + static_cast<std::size_t>(i)];
    }
    const Eigen::Matrix<double, 4, 2> field = solve_projection(gram, momentum);
    for_each_pack(bin.begin, bin.end,
                  [&](std::size_t p, const auto& lanes)
                  {
                      const auto N = shapes(p, lanes);
                      for (int d = 0; d < 2; ++d)
                      {
                          Pack v(0.0);
                          for (int i = 0; i < 4; ++i)
                              v += N[static_cast<std::size_t>(i)] * Pack(field(i, d));
                          lanes.store(&q.v[static_cast<std::size_t>(d)][p], v);
                      }
                  });
}
}  // namespace testbed
