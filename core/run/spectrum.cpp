#include "core/run/spectrum.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <limits>

namespace testbed
{
namespace
{
using Matrix = Eigen::MatrixXd;
constexpr double forgotten = 1e-4;  ///< an eigenvalue of a chain of zeros is the root of a difference of 1e-10

/// QR with pivots, and the rank: how many of them exceed the tolerance.
struct Ranked
{
    Eigen::ColPivHouseholderQR<Matrix> qr;
    Eigen::Index rank = 0;

    Ranked(const Matrix& a, double tolerance) : qr(a)
    {
        const Eigen::Index most = std::min(a.rows(), a.cols());
        while (rank < most && std::abs(qr.matrixQR()(rank, rank)) > tolerance)
            ++rank;
    }
    /// Orthonormal columns that span what a maps to.
    Matrix range() const { return qr.householderQ() * Matrix::Identity(qr.rows(), rank); }
};

Eigen::Index rank_of(const Matrix& a, double tolerance)
{
    return a.size() == 0 ? 0 : Ranked(a, tolerance).rank;
}

/// Orthonormal columns that a maps to zero.
Matrix null_space(const Matrix& a, double tolerance)
{
    if (a.size() == 0)  // nothing to map, or to nothing
        return Matrix::Identity(a.cols(), a.cols());
    const Ranked transposed(a.transpose(), tolerance);
    const Matrix q = transposed.qr.householderQ();
    return q.rightCols(a.cols() - transposed.rank);
}

/// A map without its eigenvalue 1: on the range of A - 1, on that of the map there, and so on until nothing is left to take out.
struct Reduced
{
    Matrix less_one;  ///< the map on what is left, less 1
    Matrix basis;     ///< of what is left
    std::size_t steady = 0, drifting = 0;
};
Reduced reduce(const Matrix& map, double tolerance)
{
    const Eigen::Index n = map.rows();
    Reduced r{map - Matrix::Identity(n, n), Matrix::Identity(n, n)};
    for (bool first = true; r.less_one.rows() > 0; first = false)
    {
        const Ranked ranked(r.less_one, tolerance);
        const auto lost = static_cast<std::size_t>(r.less_one.rows() - ranked.rank);
        if (lost == 0)
            break;
        (first ? r.steady : r.drifting) += lost;
        const Matrix range = ranked.range();
        r.less_one = (range.transpose() * r.less_one * range).eval();
        r.basis = (r.basis * range).eval();
    }
    return r;
}

/// Rows and columns of a matrix by lists.
Matrix part(const Matrix& a, const std::vector<Eigen::Index>& rows, const std::vector<Eigen::Index>& columns)
{
    return a(rows, columns);
}

/// The motions of points as one body, orthonormal columns over their positions.
Matrix rigid_motions(const OneStepMap& map, const std::vector<Eigen::Index>& positions)
{
    Vec<2> centre{0, 0};
    for (const Eigen::Index n : positions)
        for (std::size_t k = 0; k < 2; ++k)
            centre[k] += map.unknowns[static_cast<std::size_t>(n)].place[k] / static_cast<double>(positions.size());
    Matrix rigid(positions.size(), 3);
    for (std::size_t n = 0; n < positions.size(); ++n)
    {
        const Unknown& u = map.unknowns[static_cast<std::size_t>(positions[n])];
        const bool is_x = u.component == 0;
        rigid.row(static_cast<Eigen::Index>(n)) << is_x, !is_x, is_x ? centre[1] - u.place[1] : u.place[0] - centre[0];
    }
    return Eigen::HouseholderQR<Matrix>(rigid).householderQ() * Matrix::Identity(rigid.rows(), 3);
}

/// The two checkerboards of the nodal velocities, columns of norm 1; none where the velocity does not live on nodes.
Matrix checkerboards(const OneStepMap& map, const std::vector<Eigen::Index>& velocities)
{
    if (velocities.empty() || !map.unknowns[static_cast<std::size_t>(velocities[0])].is_nodal)
        return Matrix(velocities.size(), 0);
    Matrix patterns = Matrix::Zero(static_cast<Eigen::Index>(velocities.size()), 2);
    for (std::size_t n = 0; n < velocities.size(); ++n)
    {
        const Unknown& u = map.unknowns[static_cast<std::size_t>(velocities[n])];
        patterns(static_cast<Eigen::Index>(n), u.component) = (u.node[0] + u.node[1]) % 2 == 0 ? 1 : -1;
    }
    patterns.colwise().normalize();
    return patterns;
}
}  // namespace

Spectrum spectrum(const Matrix& map, double tolerance)
{
    const Reduced reduced = reduce(map, tolerance);
    Spectrum out;
    out.steady = reduced.steady;
    out.drifting = reduced.drifting;
    out.radius = out.steady + out.drifting > 0 ? 1 : 0;
    if (reduced.less_one.rows() == 0)
        return out;
    const Eigen::EigenSolver<Matrix> solver(reduced.less_one);
    const auto values = solver.eigenvalues();
    const auto vectors = solver.eigenvectors();
    for (Eigen::Index k = 0; k < values.size(); ++k)
        if (std::abs(1.0 + values[k]) < forgotten)
            ++out.forgotten;
        else if (values[k].imag() >= 0)
            out.modes.push_back({1.0 + values[k], (reduced.basis.cast<std::complex<double>>() * vectors.col(k)).normalized()});
    std::stable_sort(out.modes.begin(), out.modes.end(), [](const Mode& a, const Mode& b) { return a.growth() > b.growth(); });
    if (!out.modes.empty())
        out.radius = std::max(out.radius, out.modes.front().growth());
    return out;
}

double spectral_radius(const Matrix& map, double tolerance)
{
    if (!map.allFinite())
        return std::numeric_limits<double>::infinity();
    const Reduced reduced = reduce(map, tolerance);
    const double least = reduced.steady + reduced.drifting > 0 ? 1 : 0;
    if (reduced.less_one.rows() == 0)
        return least;
    const Eigen::EigenSolver<Matrix> solver(reduced.less_one, false);
    return std::max(least, (solver.eigenvalues().array() + 1.0).abs().maxCoeff());
}

NullModes null_modes(const OneStepMap& map, double tolerance)
{
    using Kind = Unknown::Kind;
    const auto v = map.all(Kind::velocity), x = map.all(Kind::position), s = map.all(Kind::stress);
    const auto columns = static_cast<Eigen::Index>(v.size());
    const Matrix stress = part(map.matrix, s, v), motion = part(map.matrix, x, v), kept = part(map.matrix, v, v);
    NullModes out;

    Matrix seen(stress.rows() + motion.rows(), columns);
    seen << stress, motion;
    const Matrix unseen = null_space(seen, tolerance);
    out.unseen = static_cast<std::size_t>(unseen.cols());
    if (out.unseen > 0)
        out.unseen_kept = (kept * unseen).operatorNorm();

    Matrix felt(stress.rows() + columns, columns);
    felt << stress, kept - Matrix::Identity(columns, columns);
    const Matrix free = null_space(felt, tolerance);
    const Matrix moves = motion * free, rigid = rigid_motions(map, x);
    const Matrix deforms = moves - rigid * (rigid.transpose() * moves);
    const Eigen::Index moving = rank_of(moves, tolerance), deforming = rank_of(deforms, tolerance);
    out.rigid = static_cast<std::size_t>(moving - deforming);
    out.deforming = static_cast<std::size_t>(deforming);

    const Matrix patterns = checkerboards(map, v);
    std::vector<Eigen::VectorXd> hourglass;
    for (Eigen::Index k = 0; k < patterns.cols(); ++k)
        if ((free.transpose() * patterns.col(k)).norm() > 1 - tolerance)
            hourglass.push_back(patterns.col(k));
    out.hourglass = hourglass.size();

    // the others: orthogonal to these and to what moves the points as one body or not at all
    const Matrix undeformed = null_space(deforms, tolerance);
    Matrix known(free.cols(), undeformed.cols() + static_cast<Eigen::Index>(hourglass.size()));
    known.leftCols(undeformed.cols()) = undeformed;
    for (std::size_t h = 0; h < hourglass.size(); ++h)
        known.col(undeformed.cols() + static_cast<Eigen::Index>(h)) = free.transpose() * hourglass[h];
    const Matrix others = free * null_space(known.transpose(), tolerance);
    out.shapes = Matrix::Zero(map.matrix.rows(), static_cast<Eigen::Index>(hourglass.size()) + others.cols());
    for (std::size_t k = 0; k < v.size(); ++k)
    {
        for (std::size_t h = 0; h < hourglass.size(); ++h)
            out.shapes(v[k], static_cast<Eigen::Index>(h)) = hourglass[h][static_cast<Eigen::Index>(k)];
        out.shapes.row(v[k]).tail(others.cols()) = others.row(static_cast<Eigen::Index>(k));
    }
    return out;
}

std::optional<double> critical_step(const std::function<double(double)>& radius, double start, double tolerance)
{
    const auto holds = [&](double dt) { return radius(dt) <= 1 + tolerance; };
    constexpr double factor = 1.5;
    double low = start, high = start;
    if (holds(start))
        do
        {
            low = high;
            high *= factor;
            if (high > 64 * start)
                return std::nullopt;
        } while (holds(high));
    else
        do
        {
            high = low;
            low /= 2;
            if (low < start / 1024)
                return std::nullopt;
        } while (!holds(low));
    while (high - low > 1e-4 * low)
        (holds(0.5 * (low + high)) ? low : high) = 0.5 * (low + high);
    return low;
}
}  // namespace testbed
