#pragma once
/// What limits the time step of LPFDM.

#include "core/run/element_system.hpp"
#include "core/run/time_step.hpp"
#include "lpfdm/grid.hpp"

#include <cmath>

namespace testbed
{
/// What motion adds to the limits of a body at rest.
/// - stiffness in motion: the lattice sees waves of a moving body at other frequencies, and near its limit some grow.
/// - convection: the departure point lies in a cell around the node.
/// @param stiffness limit of the cell [s] @param L a cell's least width [m] @param speed of nodes, largest [m/s]
inline void add_limits_in_motion(std::vector<StepLimit>& limits, const std::vector<Body>& bodies, double stiffness, double L, double speed)
{
    constexpr double in_motion = 0.65, rest = 0.01;             // of L / c_p, measured: docs/methods.md; Courant number of what is at rest
    double crossing = std::numeric_limits<double>::infinity();  // L / c_p over the limit of the isolated cell
    for (const Body& body : bodies)
        crossing = std::min(crossing, std::sqrt(gradient_stiffness(moduli(body.material)) / moduli(body.material).constrained()));
    if (speed * stiffness > rest * L)
        limits.push_back({"stiffness in motion", in_motion * crossing * stiffness});
    if (const auto courant = courant_limit(L, speed))
        limits.push_back({"convection", *courant});
}

/// Limits of the present state, each of which holds wherever the points lie in their cells.
/// - stiffness: the isolated cell. Strain is that of the cell, or for a domain the mean of its cells by their shares w, so that the energy
///   is at most sum w V (eps_j : D : eps_j): Irons' theorem on cells of content sum w V with a quarter of their mass at each node.
/// - hourglass: the force takes the velocity of half a step before; a mode that decays at d = 4 rate turns unstable at d dt = 2. In a cell
///   the pattern has no stiffness, so that the two limits do not add.
/// @param hourglass_rate chi c_p / L, zero without [1/s] @param alpha of local damping
inline std::vector<StepLimit> lpfdm_step_limits(const LpfdmGrid<2>& grid, const std::vector<Body>& bodies, double hourglass_rate,
                                                double alpha)
{
    const double stiffness = isolated_cell_limit(bodies, grid.lattice.cell_size) * damping_factor(alpha);
    std::vector<StepLimit> limits{{"stiffness", stiffness}};
    if (hourglass_rate > 0)
        limits.push_back({"hourglass", 0.5 / (hourglass_rate * (1 + alpha))});
    const auto& active = grid.nodes.active();
    const double speed = parallel_max(active.size(), [&](std::size_t a)
                                      { return std::max(std::abs(grid.nodes.v[0][active[a]]), std::abs(grid.nodes.v[1][active[a]])); });
    add_limits_in_motion(limits, bodies, stiffness, grid.lattice.cell_size, speed);
    return limits;
}

/// The points of a bin with the (S+1)^2 nodes of its cells are an element.
template <class Support>
ElementSystem lpfdm_elements(const Lattice<2>& lattice, const std::vector<Body>& bodies, double hourglass_rate)
{
    constexpr int S = Support::S, N = S + 1;
    constexpr std::size_t n = N * N, m = 2 * n;
    ElementSystem system(n, lattice.nodes());
    const double slope = 1 / (2 * lattice.cell_size);
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
        const ElasticModuli& law = moduli(body.material);
        for (const Bin<2>& bin : body.bins.list())
        {
            std::array<std::uint32_t, n> node;
            for (int k = 0; k < N * N; ++k)
                node[static_cast<std::size_t>(k)] = static_cast<std::uint32_t>(lattice.node(bin.at + block_index<N, 2>(k)));
            system.add_element(node);
            const BinFrame frame(lattice, bin);
            for (std::size_t p = bin.begin; p < bin.end; ++p)
            {
                const SomeLanes one(1);
                const Corner<2> c = frame.template corner<Support>(q, p, one);
                const Weights<Support, 2> weights(c);
                std::array<double, m> xx{}, yy{}, shear{};
                for (int cell = 0; cell < S * S; ++cell)
                {
                    const double w = weights.along[0][cell % S][0] * weights.along[1][cell / S][0];
                    std::array<double, m> pattern_x{}, pattern_y{};
                    for (int k = 0; k < 4; ++k)
                    {
                        const auto a = static_cast<std::size_t>((cell / S + k / 2) * N + cell % S + k % 2);
                        const double sx = k % 2 == 0 ? -1 : 1, sy = k / 2 == 0 ? -1 : 1;
                        xx[2 * a] += w * slope * sx;
                        yy[2 * a + 1] += w * slope * sy;
                        shear[2 * a] += w * slope * sy;
                        shear[2 * a + 1] += w * slope * sx;
                        system.lumped_mass[node[a]] += 0.25 * w * q.mass;
                        pattern_x[2 * a] = pattern_y[2 * a + 1] = sx * sy;
                    }
                    for (std::size_t a = 0; a < m; ++a)
                        for (std::size_t b = 0; b < m; ++b)
                            system.viscosity()[a * m + b] +=
                                0.25 * hourglass_rate * w * q.mass * (pattern_x[a] * pattern_x[b] + pattern_y[a] * pattern_y[b]);
                }
                add_stiffness<m>(system, xx, yy, shear, law, std::min(q.current_volume(p), body.counted_volume) * stiffness_ratio(q, p));
            }
        }
    }
    return system;
}

/// Sharp limit of points as they stand, from dt^2 K + 2 dt C_hourglass = 4 M in the mode that goes first.
inline double lpfdm_sharp_limit(const ElementSystem& system, double alpha)
{
    const auto as_is = [](std::vector<double>&) {};
    std::vector<double> viscous;
    double dt = 2 / std::sqrt(largest_eigenvalue(
                        system, [&](const auto& in, auto& out) { system.apply_stiffness(in, out); }, as_is));
    for (int k = 0; k < 20; ++k)
    {
        const double largest = largest_eigenvalue(
            system,
            [&](const auto& in, auto& out)
            {
                system.apply_stiffness(in, out);
                system.apply_viscosity(in, viscous);
                for (std::size_t i = 0; i < out.size(); ++i)
                    out[i] = dt * dt * out[i] + 2 * dt * viscous[i];
            },
            as_is);
        const double change = std::sqrt(4 / ((1 + alpha) * largest));
        dt *= change;
        if (std::abs(change - 1) < 1e-4)
            break;
    }
    return dt;
}
}  // namespace testbed
