#pragma once
/// One step of LPFDM, a function for each group of equations of Konagai & Johansson (2000).

#include "core/bin_sums.hpp"
#include "lpfdm/grid.hpp"

#include <atomic>

namespace testbed
{
/// What the points of one bin give to its S x S cells: mass and, times volume, the stress beyond the confining pressure.
template <class Support>
class CellSums
{
public:
    static constexpr int S = Support::S;
    static constexpr std::size_t quantities = 4, numbers = S * S * quantities;

    TESTBED_INLINE CellSums(const Lattice&, const Bin&) { set_zero(total_); }

    /// Points [p, p + lanes) of the body, with their support at c.
    template <class Lanes>
    TESTBED_INLINE void add(const Body& body, std::size_t p, const Lanes& lanes, const Corner& c)
    {
        const Points& q = body.points;
        const Weights<Support> weights(c);
        Pack v = lanes.keep(volume<Support>(q, p, lanes));
        if constexpr (S == 1)
            v = min(v, Pack(body.counted_volume));
        const Pack pressure(body.confinement);
        const Pack xx = v * (lanes.load(&q.sxx[p]) + pressure), yy = v * (lanes.load(&q.syy[p]) + pressure), xy = v * lanes.load(&q.sxy[p]);
        for (int j = 0; j < S; ++j)
            for (int i = 0; i < S; ++i)
            {
                Pack* to = &total_[static_cast<std::size_t>(j * S + i) * quantities];
                if constexpr (S == 1)
                {
                    to[1] += xx;
                    to[2] += yy;
                    to[3] += xy;
                }
                else
                {
                    const Pack w = weights.x[i] * weights.y[j];
                    to[0] += lanes.keep(w);
                    to[1] += w * xx;
                    to[2] += w * yy;
                    to[3] += w * xy;
                }
            }
    }
    TESTBED_INLINE void write(const Body& body, const Bin& bin, double* to)
    {
        if constexpr (S > 1)
            for (std::size_t k = 0; k < S * S; ++k)
                total_[k * quantities] *= Pack(body.points.mass);
        sum(total_, to);
        if constexpr (S == 1)
            to[0] = body.points.mass * static_cast<double>(bin.end - bin.begin);
    }

private:
    std::array<Pack, numbers> total_;
};

template <class Support>
using LpfdmSums = BinSums<Support, CellSums<Support>>;

/// Eqs. (7), (8): mass and smeared stress of each cell, from the sums of the bins.
inline void cell_averages(LpfdmGrid& grid, const std::vector<double>& sums)
{
    const double scale = 1 / (grid.lattice.cell_size * grid.lattice.cell_size);
    grid.gather.sum<4>(sums,
                       [&](std::size_t c, const std::array<double, 4>& s)
                       {
                           grid.cells.mass[c] = s[0];
                           grid.cells.sxx[c] = s[1] * scale;
                           grid.cells.syy[c] = s[2] * scale;
                           grid.cells.sxy[c] = s[3] * scale;
                       });
}

/// Eqs. (9), (10): a quarter of the mass of the cells around a node, and their forces. Empty cells add nothing.
inline void nodal_forces(LpfdmGrid& grid)
{
    const double half_side = 0.5 * grid.lattice.cell_size;
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            Pack mass(0.0), fx(0.0), fy(0.0);
            for (int k = 0; k < 4; ++k)
            {
                const std::size_t c = grid.around(first_cell, k);
                const auto f = square_force(k, grid.cells.stress(c, lanes), half_side);
                mass += lanes.load(&grid.cells.mass[c]);
                fx += f[0];
                fy += f[1];
            }
            lanes.store(&grid.nodes.mass[n], Pack(0.25) * mass);
            lanes.store(&grid.nodes.fx[n], fx);
            lanes.store(&grid.nodes.fy[n], fy);
        });
}

/// Eqs. (5a)-(5d): gradient of the increment over dt in each cell.
inline void cell_gradients(LpfdmGrid& grid, double dt)
{
    const Pack scale(dt / (2 * grid.lattice.cell_size));
    grid.for_each_cell(
        [&](std::size_t c, std::size_t n, const auto& lanes)
        {
            const auto g = square_gradient(grid.at_corners(grid.nodes.vx, n, lanes), grid.at_corners(grid.nodes.vy, n, lanes), scale);
            lanes.store(&grid.cells.xx[c], g.xx);
            lanes.store(&grid.cells.yy[c], g.yy);
            lanes.store(&grid.cells.xy[c], g.xy);
            lanes.store(&grid.cells.yx[c], g.yx);
        });
}

/// Viscous force against the pattern (+1, -1, -1, +1), which no gradient sees and no linear field contains.
/// The pattern decays at four times the rate. Returns the power that it takes from the motion [W/m].
/// @param rate chi c_p / L [1/s] @param x, y one force per cell of the lattice
inline double resist_hourglass(LpfdmGrid& grid, double rate, std::vector<double>& x, std::vector<double>& y)
{
    const auto pattern = [](const std::array<Pack, 4>& v) { return v[0] - v[1] - v[2] + v[3]; };
    const double power = grid.sum_over_cells(
        [&](std::size_t c, std::size_t n, const auto& lanes)
        {
            const Pack f = Pack(-0.25 * rate) * lanes.load(&grid.cells.mass[c]);
            const Pack hx = pattern(grid.at_corners(grid.nodes.vx, n, lanes)), hy = pattern(grid.at_corners(grid.nodes.vy, n, lanes));
            lanes.store(&x[c], f * hx);
            lanes.store(&y[c], f * hy);
            return -f * (hx * hx + hy * hy);
        });
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            const auto around = [&](const std::vector<double>& v, int k) { return lanes.load(&v[grid.around(first_cell, k)]); };
            const auto add = [&](std::vector<double>& f, const std::vector<double>& v)
            { lanes.store(&f[n], lanes.load(&f[n]) + around(v, 0) - around(v, 1) - around(v, 2) + around(v, 3)); };
            add(grid.nodes.fx, x);
            add(grid.nodes.fy, y);
        });
    return power;
}

/// Where the middle node of a bin meets its points when a share theta of the step has passed: K on the way x + alpha y of points, which the
/// displacement to first order about the node takes to A (x + alpha y - K), and likewise across. There the nodal velocity, whose gradient
/// jumps at lattice lines, moves and strains them: at the start of the step the jumps would act half a step late, and an
/// oscillation move points against their boxes, first order in dt.
struct MidStep
{
    Vec2 stretch{1, 1}, slope{0, 0}, middle{1, 1};  ///< A, alpha, K in x and y

    MidStep() = default;
    /// @param g gradient of the step's displacement @param u displacement of the middle node [cells]
    TESTBED_INLINE MidStep(double theta, const Gradient<>& g, const Vec2& u) : stretch{1 + theta * g.xx, 1 + theta * g.yy}
    {
        const auto inverse = [](double e) { return 1 - e * (1 - e); };  // a division for each bin would cost a twentieth of a step
        const double x = theta * inverse(theta * g.xx), y = theta * inverse(theta * g.yy);
        slope = {x * g.xy, y * g.yx};
        middle = {1 + slope[0] - x * u[0], 1 + slope[1] - y * u[1]};
    }
};

/// What is constant in a bin: the gradient of the increment averaged over a box, and the velocity of its (S+1) x (S+1) nodes, where it
/// lies: copies would take registers that the loop over the points has no more.
template <class Support>
struct BinMotion
{
    static constexpr int S = Support::S;
    std::array<Gradient<>, S * S> coefficients;  ///< of 1, a, b and a b, with the shares a and b of a box in the next cells
    const double *vx, *vy;                       ///< of the bin's first node
    std::size_t stride;
    MidStep mid;  ///< for points with a box; others are moved from where they are

    TESTBED_INLINE BinMotion(const LpfdmGrid& grid, const Bin& bin, double theta, double dt)
        : vx(&grid.nodes.vx[grid.lattice.node(bin.i, bin.j)]),
          vy(&grid.nodes.vy[grid.lattice.node(bin.i, bin.j)]),
          stride(grid.lattice.node_stride())
    {
        const auto cell = [&](int i, int j) { return grid.cells.gradient(grid.lattice.cell(bin.i + i, bin.j + j)); };
        coefficients[0] = cell(0, 0);
        if constexpr (S == 2)
        {
            coefficients[1] = cell(1, 0) - cell(0, 0);
            coefficients[2] = cell(0, 1) - cell(0, 0);
            coefficients[3] = cell(1, 1) - cell(1, 0) - coefficients[2];
            const double scale = dt / grid.lattice.cell_size;
            mid = MidStep(theta, coefficients[0] + 0.5 * (coefficients[1] + coefficients[2]) + 0.25 * coefficients[3],
                          {scale * vx[stride + 1], scale * vy[stride + 1]});
        }
    }
    /// Displacement gradient and displacement of the points with these boxes over the step.
    TESTBED_INLINE Gradient<Pack> operator()(const Box& box, double dt, Pack& x, Pack& y) const
    {
        Gradient<Pack> d = Pack(1.0) * coefficients[0];
        if constexpr (S == 1)
            displace({Pack(1.0) - box.x, box.x}, {Pack(1.0) - box.y, box.y}, dt, x, y);
        else
        {
            const Pack beyond_x = box.x + Pack(mid.slope[0]) * box.y - Pack(mid.middle[0]);
            const Pack beyond_y = box.y + Pack(mid.slope[1]) * box.x - Pack(mid.middle[1]);
            const Pack inverse = Pack(0.5) / (box.hx * box.hy);
            const Pack a = share(beyond_x, box.hx, inverse * box.hy), b = share(beyond_y, box.hy, inverse * box.hx);
            d = d + a * coefficients[1] + b * coefficients[2] + (a * b) * coefficients[3];
            displace(hat(Pack(mid.stretch[0]) * beyond_x), hat(Pack(mid.stretch[1]) * beyond_y), dt, x, y);
        }
        return d;
    }

private:
    /// Of a box in the next cell, with its middle this far beyond the line; at mid-step it may lie in either.
    TESTBED_INLINE static Pack share(Pack beyond, Pack half, Pack inverse)
    {
        return min(max(beyond + half, Pack(0.0)) * inverse, Pack(1.0));
    }
    /// Bilinear weights of three nodes, this far beyond the middle one [cells].
    TESTBED_INLINE static std::array<Pack, 3> hat(Pack beyond)
    {
        const Pack low = max(-beyond, Pack(0.0)), high = max(beyond, Pack(0.0));
        return {low, Pack(1.0) - low - high, high};
    }
    TESTBED_INLINE void displace(const std::array<Pack, S + 1>& wx, std::array<Pack, S + 1> wy, double dt, Pack& x, Pack& y) const
    {
        for (Pack& w : wy)
            w *= Pack(dt);
        for (int j = 0; j <= S; ++j)
        {
            Pack rx(0.0), ry(0.0);
            for (int i = 0; i <= S; ++i)
            {
                rx += wx[i] * Pack(vx[j * stride + i]);
                ry += wx[i] * Pack(vy[j * stride + i]);
            }
            x += wy[j] * rx;
            y += wy[j] * ry;
        }
    }
};

/// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6), for the points of one body; and, while they are at hand, the
/// sums of its bins (`sums`, from the body's first on) for the next step. Returns whether a point left its bin: its sums are then no longer
/// right.
template <class Support, class Law>
bool move_points(const LpfdmGrid& grid, Body& body, const Law& law, const StrainIncrement& increment, double dt, double* sums)
{
    Points& q = body.points;
    Bins& sorted = body.bins;
    const auto& bins = sorted.list();
    std::atomic<bool> moved{false};
    parallel_for(bins.size(),
                 [&](std::size_t b) TESTBED_FLATTEN
                 {
                     const BinFrame frame(grid.lattice, bins[b]);
                     const BinMotion<Support> motion(grid, bins[b], increment.theta, dt);
                     for_each_pack(bins[b].begin, bins[b].end,
                                   [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                   {
                                       Pack x = lanes.load(&q.x[p]), y = lanes.load(&q.y[p]);
                                       const Gradient<Pack> d = motion(frame.box<Support>(q, p, lanes, x, y), dt, x, y);
                                       law.update(q, p, lanes, d);
                                       stretch<Support>(q, p, lanes, increment, d);
                                       lanes.store(&q.x[p], x);
                                       lanes.store(&q.y[p], y);
                                   });
                     if (sum_bin<Support, CellSums<Support>>(grid.lattice, body, bins[b], sums + b * CellSums<Support>::numbers))
                     {
                         sorted.mark(b);
                         moved.store(true, std::memory_order_relaxed);
                     }
                 });
    return moved;
}
}  // namespace testbed
