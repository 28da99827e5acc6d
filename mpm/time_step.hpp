#pragma once
/// What limits the time step of MPM.
///
/// Small motions about points at rest: nodes have lumped mass M and the stiffness K of the points; what a mapping to points and back
/// leaves of nodal values is C = M^-1 M_C, with the consistent mass M_C, eigenvalues in [0, 1]. In the mode that changes its sign in each
/// step FLIP's share f of the past velocity makes that H = C / (1 + f + (1 - f) C), and
///     musl, usf:  dt^2 largest eigenvalue of 2 H M^-1 K = 4
///     usl:        dt^2 largest eigenvalue of 2 (I - H) M^-1 K = 4
/// Stress first and remapped velocities thus see forces smoothed twice; stress last strains with light nodes' own
/// acceleration, and its limit goes to zero with their mass, as 2 (L/c) sqrt(xi (1 - xi) / 2) for points at xi in a cell.

#include "core/run/element_system.hpp"
#include "core/run/time_step.hpp"
#include "mpm/options.hpp"
#include "mpm/transfer.hpp"

#include <cmath>

namespace testbed
{
/// f(p, at, lane) for the points of a bin: the shape functions at p are the lane of `at`.
template <class Shape, class F>
void for_each_point(const Lattice<2>& lattice, const Points<2>& q, const Bin<2>& bin, F&& f)
{
    const BinFrame frame(lattice, bin);
    for_each_pack(bin.begin, bin.end,
                  [&](std::size_t p, const auto& lanes)
                  {
                      const ShapeAt<Shape> at(frame.template corner<Shape>(q, p, lanes), frame.scale);
                      for (std::size_t lane = 0; lane < pack_size && p + lane < bin.end; ++lane)
                          f(p + lane, at, lane);
                  });
}

/// Of the largest eigenvalue of a with these masses, positive and symmetric: the 16th root of the trace of its 16th power.
template <std::size_t n>
double eigenvalue_bound(std::array<double, n * n> a, const std::array<double, n>& mass)
{
    std::array<double, n * n> square;
    double scale = 0;
    for (std::size_t k = 0; k < n; ++k)
        for (std::size_t l = 0; l < n; ++l)
        {
            double& e = a[k * n + l];
            e = mass[k] > 0 && mass[l] > 0 ? e / std::sqrt(mass[k] * mass[l]) : 0.0;
            scale = std::max(scale, e);
        }
    if (!(scale > 0))
        return 0;
    for (double& e : a)
        e /= scale;
    for (int power = 0; power < 4; ++power, a = square)
        for (std::size_t k = 0; k < n; ++k)
            for (std::size_t l = 0; l < n; ++l)
            {
                double s = 0;
                for (std::size_t i = 0; i < n; ++i)
                    s += a[k * n + i] * a[i * n + l];
                square[k * n + l] = s;
            }
    double trace = 0;
    for (std::size_t k = 0; k < n; ++k)
        trace += a[k * n + k];
    return scale * std::pow(trace, 1.0 / 16);
}

/// The largest eigenvalue of a bin's own stiffness with its own masses, for a scalar unknown: a bound, see content_limit().
template <class Shape>
double largest_eigenvalue_in_bin(const Lattice<2>& lattice, const Points<2>& q, const Bin<2>& bin, double kappa)
{
    constexpr std::size_t n = block_size<Shape::S, 2>;
    std::array<double, n> mass{};
    std::array<double, n * n> a{};
    const auto add = [&](std::size_t p, const ShapeAt<Shape>& at, std::size_t lane)
    {
        const double v = kappa * q.current_volume(p) * stiffness_ratio(q, p);
        std::array<Vec<2>, n> g;
        unrolled<n>(
            [&](auto k)
            {
                mass[k] += q.mass * at.template value<k>()[lane];
                const Vec<2, Pack> gradient = at.template gradient<k>();
                g[k] = {gradient[0][lane], gradient[1][lane]};
            });
        for (std::size_t k = 0; k < n; ++k)
            for (std::size_t l = 0; l < n; ++l)
                a[k * n + l] += v * (g[k][0] * g[l][0] + g[k][1] * g[l][1]);
    };
    for_each_point<Shape>(lattice, q, bin, add);
    return eigenvalue_bound<n>(a, mass);
}

/// Limit for stress last, whatever the neighbours: the largest eigenvalue of each bin's own stiffness with its own masses (Irons), doubled
/// for H = 0. In a bin eps : D : eps is at most kappa |grad u|^2, which leaves a scalar problem on its S x S nodes; its largest eigenvalue
/// is bounded by the 16th root of the trace of its 16th power, at most S^(1/8) too large.
template <class Shape>
double content_limit(const Lattice<2>& lattice, const std::vector<Body>& bodies)
{
    double largest = 0;
    for (const Body& body : bodies)
    {
        const double kappa = gradient_stiffness(moduli(body.material));
        const auto& bins = body.bins.list();
        const auto in_bin = [&](std::size_t b) { return largest_eigenvalue_in_bin<Shape>(lattice, body.points, bins[b], kappa); };
        largest = std::max(largest, parallel_max(bins.size(), in_bin));
    }
    return 2 / std::sqrt(2 * largest);
}

/// Shape functions of one point at its nodes, and the strain that their displacements give it.
template <class Shape>
struct PointOperator
{
    static constexpr std::size_t S = Shape::S, n = S * S;
    std::array<double, n> value;
    std::array<double, 2 * n> xx{}, yy{}, shear{};

    template <class Strain>
    PointOperator(const Lattice<2>& lattice, const Bin<2>& bin, const ShapeAt<Shape>& at, std::size_t lane, const Strain& strain)
    {
        std::array<std::array<double, S>, 2> w, g;
        for (std::size_t d = 0; d < 2; ++d)
        {
            for (std::size_t k = 0; k < S; ++k)
            {
                w[d][k] = at.weights[d][k][lane];
                g[d][k] = at.slopes[d][k][lane];
            }
            fold(w[d], bin.at[d], lattice.size[d]);
            fold(g[d], bin.at[d], lattice.size[d]);
        }
        for (std::size_t k = 0; k < n; ++k)
        {
            value[k] = w[0][k % S] * w[1][k / S];
            const double x = g[0][k % S] * w[1][k / S], y = w[0][k % S] * g[1][k / S];
            xx[2 * k] = x;
            yy[2 * k + 1] = y;
            shear[2 * k] = y;
            shear[2 * k + 1] = x;
            if constexpr (requires { strain.mean; })
            {
                const double dx = 0.5 * (strain.mean[k][0] - x), dy = 0.5 * (strain.mean[k][1] - y);
                xx[2 * k] += dx;
                yy[2 * k] += dx;
                xx[2 * k + 1] += dy;
                yy[2 * k + 1] += dy;
            }
        }
    }

private:
    /// At the edges of the lattice, as LatticeEdges does.
    static void fold(std::array<double, S>& w, int first, int last)
    {
        if constexpr (Shape::reaches_beyond)
        {
            const auto give = [&](std::size_t outer, std::size_t edge, std::size_t inner)
            {
                w[edge] += 2 * w[outer];
                w[inner] -= w[outer];
                w[outer] = 0;
            };
            if (first < 0)
                give(0, 1, 2);
            if (first + 2 > last)
                give(2, 1, 0);
        }
    }
};

/// Of the isolated cell's limit. Of 135 drops of elastic blocks (2 to 4 points, nu 0 to 0.47, offsets from the lattice) none wins more
/// than 1.6 % of the work of gravity at 0.6 of that limit, 1 does at 0.7, 8 at 0.8, 24 at 0.9, 80 at 1.05; of 405 others one wins 2.1 % at
/// 0.6.
inline constexpr double crossing_share = 0.6;

/// Limits of the present state.
/// - stiffness: for musl and usf the isolated cell of LPFDM, since H M^-1 K with FLIP is at most M^-1 K / 2: below the sharp limit by
///   a factor of 1.5 to 2.5 where cells hold 2 x 2 points or more, wherever these lie; with one point to a cell and linear shapes the sum
///   over points that sit on nodes asks for a factor of 1/sqrt(2). PIC's share asks for sqrt((1 + f) / 2).
/// - crossing, for linear shapes: stress jumps to other nodes where a point crosses a line of nodes, and steps near the limit of
///   stiffness pump energy with that. XPIC takes it out.
/// - cell content, for usl: see content_limit().
/// - motion: a point crosses at most one cell in a step.
template <class Shape>
std::vector<StepLimit> mpm_step_limits(const Lattice<2>& lattice, const std::vector<Body>& bodies, const MpmSpec& options, double alpha)
{
    const double factor = damping_factor(alpha) * std::sqrt(0.5 * (1 + options.flip));
    std::vector<StepLimit> limits;
    if (options.scheme == MpmSpec::Scheme::usl)
        limits.push_back({"cell content", content_limit<Shape>(lattice, bodies) * factor, "mpm.scheme = \"musl\""});
    else
    {
        const double cell = lattice.cell_size * lattice.cell_size;
        const bool sparse = std::any_of(bodies.begin(), bodies.end(), [&](const Body& b) { return b.points.initial_volume > 0.9 * cell; });
        const double on_nodes = sparse && !Shape::is_smooth ? std::sqrt(0.5) : 1.0;
        const double isolated = isolated_cell_limit(bodies, lattice.cell_size) * factor;
        limits.push_back({"stiffness", isolated * on_nodes});
        if (!Shape::is_smooth && options.transfer != MpmSpec::Transfer::xpic)
            limits.push_back({"crossing", isolated * crossing_share});
    }
    double speed = 0;
    for (const Body& body : bodies)
        speed = std::max(speed, parallel_max(body.points.count, [&](std::size_t p)
                                             { return std::max(std::abs(body.points.v[0][p]), std::abs(body.points.v[1][p])); }));
    if (const auto courant = courant_limit(lattice.cell_size, speed))
        limits.push_back({"motion", *courant});
    return limits;
}

/// The points of a bin with its S x S nodes are an element.
template <class Shape, class Strain>
ElementSystem mpm_elements(const Lattice<2>& lattice, const std::vector<Body>& bodies)
{
    constexpr int S = Shape::S;
    constexpr std::size_t n = S * S;
    ElementSystem system(n, lattice.nodes());
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
        for (const Bin<2>& bin : body.bins.list())
        {
            std::array<std::uint32_t, n> node;
            for (int k = 0; k < S * S; ++k)
                node[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(lattice.node(bin.at + block_index<S, 2>(k)));
            system.add_element(node);
            const typename Strain::template InBin<Shape> strain(lattice, q, bin);
            for_each_point<Shape>(lattice, q, bin,
                                  [&](std::size_t p, const ShapeAt<Shape>& at, std::size_t lane)
                                  {
                                      const PointOperator<Shape> point(lattice, bin, at, lane, strain);
                                      add_stiffness<2 * n>(system, point.xx, point.yy, point.shear, moduli(body.material),
                                                           q.current_volume(p) * stiffness_ratio(q, p));
                                      for (std::size_t k = 0; k < n; ++k)
                                      {
                                          system.lumped_mass[node[k]] += q.mass * point.value[k];
                                          for (std::size_t l = 0; l < n; ++l)
                                              system.consistent_mass()[k * n + l] += q.mass * point.value[k] * point.value[l];
                                      }
                                  });
        }
    }
    return system;
}

/// Sharp limit of points as they stand [s].
double mpm_sharp_limit(const ElementSystem& system, const MpmSpec& options, double alpha);
}  // namespace testbed
