#pragma once
/// One step of LPFDM, a function for each group of equations of Konagai & Johansson (2000).

#include "core/bodies/bin_sums.hpp"
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
        const SymTensor<Pack> s = total_stress(body, p, lanes);
        const Pack xx = v * s.xx, yy = v * s.yy, xy = v * s.xy;
        if constexpr (S == 1)
        {
            total_[1] += xx;
            total_[2] += yy;
            total_[3] += xy;
        }
        else
            unrolled<S * S>(
                [&](auto k) TESTBED_INLINE
                {
                    const Pack w = weights.x[k % S] * weights.y[k / S];
                    total_[k * quantities] += lanes.keep(w);
                    total_[k * quantities + 1] += w * xx;
                    total_[k * quantities + 2] += w * yy;
                    total_[k * quantities + 3] += w * xy;
                });
    }
    TESTBED_INLINE void write(const Body& body, const Bin& bin, double* to)
    {
        if constexpr (S > 1)
            unrolled<S * S>([&](auto k) TESTBED_INLINE { total_[k * quantities] *= Pack(body.points.mass); });
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

/// The displacement about the middle node of a bin when a share theta of the step has passed, to first order: it takes a point at x to
/// A (x - c + alpha (y - d)) from the node, and likewise across; (c, d) is where the point is that then reaches the node. There the nodal
/// velocity, whose gradient jumps at lattice lines, moves and strains the points: at the start of the step the jumps would act half a step
/// late, and an oscillation move points against their boxes, first order in dt.
struct MidStep
{
    Vec2 stretch{1, 1}, slope{0, 0}, from{0, 0};  ///< A, alpha in x and y; (c, d) from the node [cells]
};

/// Of all nodes, as all bins need it: found bin by bin, each bin's points would wait for it.
class MidSteps
{
public:
    void resize(std::size_t nodes)
    {
        for (auto* values : {&stretch_x_, &stretch_y_, &slope_x_, &slope_y_, &from_x_, &from_y_})
            values->resize(nodes);
    }
    /// From the gradients of the step's displacement, which the cells hold, and the velocity of the nodes.
    void find(const LpfdmGrid& grid, double theta, double dt)
    {
        const Pack one(1.0), scale(theta * dt / grid.lattice.cell_size);
        const auto inverse = [&](Pack e) { return one - e * (one - e); };  // good to the second order, as the rest is
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                Gradient<Pack> sum = grid.cells.gradient(first_cell, lanes);
                for (int k = 1; k < 4; ++k)
                    sum = sum + grid.cells.gradient(grid.around(first_cell, k), lanes);
                const Gradient<Pack> g = Pack(0.25 * theta) * sum;
                const Pack x = inverse(g.xx), y = inverse(g.yy), slope_x = x * g.xy, slope_y = y * g.yx;
                const Pack ux = x * scale * lanes.load(&grid.nodes.vx[n]), uy = y * scale * lanes.load(&grid.nodes.vy[n]);
                const Pack turn = inverse(-slope_x * slope_y);
                lanes.store(&stretch_x_[n], one + g.xx);
                lanes.store(&stretch_y_[n], one + g.yy);
                lanes.store(&slope_x_[n], slope_x);
                lanes.store(&slope_y_[n], slope_y);
                lanes.store(&from_x_[n], turn * (slope_x * uy - ux));
                lanes.store(&from_y_[n], turn * (slope_y * ux - uy));
            });
    }
    MidStep at(std::size_t n) const { return {{stretch_x_[n], stretch_y_[n]}, {slope_x_[n], slope_y_[n]}, {from_x_[n], from_y_[n]}}; }
    std::size_t bytes() const { return 6 * stretch_x_.capacity() * sizeof(double); }

private:
    std::vector<double> stretch_x_, stretch_y_, slope_x_, slope_y_, from_x_, from_y_;
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

    /// @param mid_steps not read for points without a box
    TESTBED_INLINE BinMotion(const LpfdmGrid& grid, const Bin& bin, const MidSteps& mid_steps)
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
            mid = mid_steps.at(grid.lattice.node(bin.i + 1, bin.j + 1));
        }
    }
    /// From where the operator takes boxes: from the bin's corner, in which a point is without a box, or its middle node.
    TESTBED_INLINE Vec2 origin() const
    {
        if constexpr (S == 1)
            return {0, 0};
        else
            return {1 + mid.from[0], 1 + mid.from[1]};
    }
    /// Displacement gradient of the points with these boxes over the step; their displacement is added to x and y.
    TESTBED_INLINE Gradient<Pack> operator()(const Box& box, double dt, Pack& x, Pack& y) const
    {
        Gradient<Pack> d = Pack(1.0) * coefficients[0];
        if constexpr (S == 1)
            displace({Pack(1.0) - box.x, box.x}, {Pack(1.0) - box.y, box.y}, dt, x, y);
        else
        {
            const Pack beyond_x = box.x + Pack(mid.slope[0]) * box.y, beyond_y = box.y + Pack(mid.slope[1]) * box.x;
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
        const Pack high = max(beyond, Pack(0.0)), low = high - beyond;
        return {low, Pack(1.0) - low - high, high};
    }
    TESTBED_INLINE void displace(const std::array<Pack, S + 1>& wx, const std::array<Pack, S + 1>& wy, double dt, Pack& x, Pack& y) const
    {
        Pack ux(0.0), uy(0.0);
        for (int j = 0; j <= S; ++j)
        {
            Pack rx(0.0), ry(0.0);
            for (int i = 0; i <= S; ++i)
            {
                rx += wx[i] * Pack(vx[j * stride + i]);
                ry += wx[i] * Pack(vy[j * stride + i]);
            }
            ux += wy[j] * rx;
            uy += wy[j] * ry;
        }
        x += Pack(dt) * ux;
        y += Pack(dt) * uy;
    }
};

/// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6), for the points of one body; and, while they are at hand, the
/// sums of its bins (`sums`, from the body's first on) for the next step. Marks bins that a point left: their sums are then not right.
template <class Support, class Law>
void move_points(const LpfdmGrid& grid, const MidSteps& mid_steps, Body& body, const Law& law, const StrainIncrement& increment, double dt,
                 double* sums)
{
    Points& q = body.points;
    const auto& bins = body.bins.list();
    parallel_for(bins.size(),
                 [&](std::size_t b) TESTBED_FLATTEN
                 {
                     const BinMotion<Support> motion(grid, bins[b], mid_steps);
                     const BinFrame frame(grid.lattice, bins[b], motion.origin());
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
                         body.bins.mark(b);
                 });
}
}  // namespace testbed
