#pragma once
/// One step of LPFDM, a function for each group of equations of Konagai & Johansson (2000).

#include "core/bodies/bin_sums.hpp"
#include "core/bodies/stress_runs.hpp"
#include "lpfdm/grid.hpp"

namespace testbed
{
/// What the points of one bin give to its S x S cells: mass and, times volume, the stress beyond the confining pressure.
template <class Support, AnyPack Pack = testbed::Pack>
class CellSums
{
public:
    template <AnyPack Other>
    using In = CellSums<Support, Other>;
    static constexpr int S = Support::S, dim = Body::dim;
    static constexpr std::size_t blocks = block_size<S, dim>, stresses = symmetric_components<dim>, quantities = 1 + stresses,
                                 numbers = blocks * quantities;

    TESTBED_INLINE CellSums(const Lattice<dim>&, const Bin<dim>&) { set_zero(total_); }

    /// Points [p, p + lanes) of the body, with their support at c.
    template <class Lanes>
    TESTBED_INLINE void add(const Body& body, std::size_t p, const Lanes& lanes, const Corner<dim, Pack>& c)
    {
        const Weights<Support, dim, Pack> weights(c);
        Pack v = lanes.keep(volume<Support>(body.points, p, lanes));
        if constexpr (S == 1)
            v = min(v, Pack(body.counted_volume));
        const SymTensor<dim, Pack> s = total_stress(body, p, lanes);
        std::array<Pack, stresses> force;
        unrolled<stresses>([&](auto n) TESTBED_INLINE { force[n] = v * component<n>(s); });
        if constexpr (S == 1)
            unrolled<stresses>([&](auto n) TESTBED_INLINE { total_[1 + n] += force[n]; });
        else
            unrolled<blocks>(
                [&](auto k) TESTBED_INLINE
                {
                    const Pack w = weights.template of<k>();
                    total_[k * quantities] += lanes.keep(w);
                    unrolled<stresses>([&](auto n) TESTBED_INLINE { total_[k * quantities + 1 + n] += w * force[n]; });
                });
    }
    TESTBED_INLINE void write(const Body& body, const Bin<dim>& bin, double* to)
    {
        if constexpr (S > 1)
            unrolled<blocks>([&](auto k) TESTBED_INLINE { total_[k * quantities] *= Pack(body.points.mass); });
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
template <int dim>
void cell_averages(LpfdmGrid<dim>& grid, const std::vector<double>& sums)
{
    constexpr std::size_t stresses = symmetric_components<dim>;
    const double scale = 1 / power<dim>(grid.lattice.cell_size);
    grid.gather.template sum<1 + stresses>(sums,
                                           [&](std::size_t c, const std::array<double, 1 + stresses>& s)
                                           {
                                               grid.cells.mass[c] = s[0];
                                               for (std::size_t k = 0; k < stresses; ++k)
                                                   grid.cells.stress[k][c] = s[1 + k] * scale;
                                           });
}

/// Eqs. (9), (10): an equal part of the mass of the cells around a node, and their forces. Empty cells add nothing.
template <int dim>
void nodal_forces(LpfdmGrid<dim>& grid)
{
    constexpr std::size_t corners = LpfdmGrid<dim>::corners;
    const double share = power<dim - 1>(0.5 * grid.lattice.cell_size);
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            Pack mass(0.0);
            Vec<dim, Pack> force;
            set_zero(force);
            unrolled<corners>(
                [&](auto k) TESTBED_INLINE
                {
                    const std::size_t c = grid.around(first_cell, k);
                    const auto f = corner_force<k>(grid.cells.stress_at(c, lanes), share);
                    mass += lanes.load(&grid.cells.mass[c]);
                    unrolled<dim>([&](auto d) TESTBED_INLINE { force[d] += f[d]; });
                });
            lanes.store(&grid.nodes.mass[n], Pack(1.0 / corners) * mass);
            store(grid.nodes.f, n, lanes, force);
        });
}

/// Eqs. (5a)-(5d): gradient of the increment over dt in each cell.
template <int dim>
void cell_gradients(LpfdmGrid<dim>& grid, double dt)
{
    const Pack scale(dt / ((1 << (dim - 1)) * grid.lattice.cell_size));
    grid.for_each_cell(
        [&](std::size_t c, std::size_t n, const auto& lanes)
        {
            std::array<std::array<Pack, LpfdmGrid<dim>::corners>, dim> v;
            unrolled<dim>([&](auto d) TESTBED_INLINE { v[d] = grid.at_corners(grid.nodes.v[d], n, lanes); });
            const Gradient<dim, Pack> g = cell_gradient(v, scale);
            unrolled<dim * dim>([&](auto k) TESTBED_INLINE { lanes.store(&grid.cells.gradient[k][c], component<k>(g)); });
        });
}

/// Viscous force against the pattern (+1, -1, -1, +1) of a square, which no gradient sees and no linear field contains.
/// The pattern decays at four times the rate. Returns the power that it takes from the motion [W/m].
/// @param rate chi c_p / L [1/s] @param force one per cell of the lattice
inline double resist_hourglass(LpfdmGrid<2>& grid, double rate, VectorField<2>& force)
{
    const auto pattern = [](const std::array<Pack, 4>& v) { return v[0] - v[1] - v[2] + v[3]; };
    const double power = grid.sum_over_cells(
        [&](std::size_t c, std::size_t n, const auto& lanes)
        {
            const Pack f = Pack(-0.25 * rate) * lanes.load(&grid.cells.mass[c]);
            Vec<2, Pack> h;
            unrolled<2>(
                [&](auto d)
                {
                    h[d] = pattern(grid.at_corners(grid.nodes.v[d], n, lanes));
                    lanes.store(&force[d][c], f * h[d]);
                });
            return -f * total<2>([&](auto d) { return h[d] * h[d]; });
        });
    grid.for_each_node(
        [&](std::size_t n, std::size_t first_cell, const auto& lanes)
        {
            const auto around = [&](std::size_t d, std::size_t k) { return lanes.load(&force[d][grid.around(first_cell, k)]); };
            unrolled<2>(
                [&](auto d) {
                    lanes.store(&grid.nodes.f[d][n],
                                lanes.load(&grid.nodes.f[d][n]) + around(d, 0) - around(d, 1) - around(d, 2) + around(d, 3));
                });
        });
    return power;
}

/// The displacement about the middle node of a bin when a share theta of the step has passed, to first order: it takes a point at x to
/// A (x - c + alpha (y - d)) from the node, and likewise across; (c, d) is where the point is that then reaches the node. There the nodal
/// velocity, whose gradient jumps at lattice lines, moves and strains the points: at the start of the step the jumps would act half a step
/// late, and an oscillation move points against their boxes, first order in dt.
struct MidStep
{
    Vec<2> stretch{1, 1}, slope{0, 0}, from{0, 0};  ///< A, alpha in x and y; (c, d) from the node [cells]
};

/// Of all nodes, as all bins need it: found bin by bin, each bin's points would wait for it.
class MidSteps
{
public:
    void resize(std::size_t nodes)
    {
        for (auto* vector : {&stretch_, &slope_, &from_})
            for (auto& values : *vector)
                values.resize(nodes);
    }
    /// From the gradients of the step's displacement, which the cells hold, and the velocity of the nodes.
    void find(const LpfdmGrid<2>& grid, double theta, double dt)
    {
        const Pack one(1.0), scale(theta * dt / grid.lattice.cell_size);
        const auto inverse = [&](Pack e) { return one - e * (one - e); };  // good to the second order, as the rest is
        grid.for_each_node(
            [&](std::size_t n, std::size_t first_cell, const auto& lanes)
            {
                const auto sum = total<4>([&](auto k) { return grid.cells.gradient_at(grid.around(first_cell, k), lanes); });
                const Gradient<2, Pack> g = Pack(0.25 * theta) * sum;
                Vec<2, Pack> slope, u;
                unrolled<2>(
                    [&](auto d)
                    {
                        const Pack shrink = inverse(component<d, d>(g));
                        slope[d] = shrink * component<d, 1 - d>(g);
                        u[d] = shrink * scale * lanes.load(&grid.nodes.v[d][n]);
                        lanes.store(&stretch_[d][n], one + component<d, d>(g));
                    });
                const Pack turn = inverse(-slope[0] * slope[1]);
                store(slope_, n, lanes, slope);
                unrolled<2>([&](auto d) { lanes.store(&from_[d][n], turn * (slope[d] * u[1 - d] - u[d])); });
            });
    }
    MidStep at(std::size_t n) const { return {testbed::at(stretch_, n), testbed::at(slope_, n), testbed::at(from_, n)}; }
    std::size_t bytes() const { return 6 * stretch_[0].capacity() * sizeof(double); }

private:
    VectorField<2> stretch_, slope_, from_;
};

/// What is constant in a bin: the gradient of the increment averaged over a box, and the velocity of its (S+1) x (S+1) nodes, where it
/// lies: copies would take registers that the loop over the points has no more.
template <class Support>
struct BinMotion
{
    static constexpr int S = Support::S;
    std::array<Gradient<2>, S * S> coefficients;  ///< of 1, a, b and a b, with the shares a and b of a box in the next cells
    std::array<const double*, 2> v;               ///< of the bin's first node
    std::size_t stride;
    MidStep mid;  ///< for points with a box; others are moved from where they are

    /// @param mid_steps not read for points without a box
    TESTBED_INLINE BinMotion(const LpfdmGrid<2>& grid, const Bin<2>& bin, const MidSteps& mid_steps) : stride(grid.lattice.node_stride())
    {
        const std::size_t first = grid.lattice.node(bin.at);
        for (std::size_t d = 0; d < 2; ++d)
            v[d] = &grid.nodes.v[d][first];
        const auto cell = [&](int i, int j) { return grid.cells.gradient_at(grid.lattice.cell(bin.at + Index<2>{i, j})); };
        coefficients[0] = cell(0, 0);
        if constexpr (S == 2)
        {
            coefficients[1] = cell(1, 0) - cell(0, 0);
            coefficients[2] = cell(0, 1) - cell(0, 0);
            coefficients[3] = cell(1, 1) - cell(1, 0) - coefficients[2];
            mid = mid_steps.at(grid.lattice.node(bin.at + all<2>(1)));
        }
    }
    /// From where the operator takes boxes: from the bin's corner, in which a point is without a box, or its middle node.
    TESTBED_INLINE Vec<2> origin() const
    {
        if constexpr (S == 1)
            return {0, 0};
        else
            return {1 + mid.from[0], 1 + mid.from[1]};
    }
    /// Displacement gradient of the points with these boxes over the step; their displacement is added to x.
    template <AnyPack Pack>
    TESTBED_INLINE Gradient<2, Pack> operator()(const Box<2, Pack>& box, double dt, Vec<2, Pack>& x) const
    {
        Gradient<2, Pack> g = Pack(1.0) * coefficients[0];
        std::array<std::array<Pack, S + 1>, 2> weights;
        if constexpr (S == 1)
            unrolled<2>([&](auto d) TESTBED_INLINE { weights[d] = {Pack(1.0) - box.x[d], box.x[d]}; });
        else
        {
            const Pack inverse = Pack(0.5) / (box.half[0] * box.half[1]);
            Vec<2, Pack> shares;
            unrolled<2>(
                [&](auto d) TESTBED_INLINE
                {
                    const Pack beyond = box.x[d] + Pack(mid.slope[d]) * box.x[1 - d];
                    shares[d] = share(beyond, box.half[d], inverse * box.half[1 - d]);
                    weights[d] = hat(Pack(mid.stretch[d]) * beyond);
                });
            const auto& [a, b] = shares;
            g = g + a * coefficients[1] + b * coefficients[2] + (a * b) * coefficients[3];
        }
        displace(weights, dt, x);
        return g;
    }

private:
    /// Of a box in the next cell, with its middle this far beyond the line; at mid-step it may lie in either.
    template <AnyPack Pack>
    TESTBED_INLINE static Pack share(const Pack& beyond, const Pack& half, const Pack& inverse)
    {
        return min(max(beyond + half, Pack(0.0)) * inverse, Pack(1.0));
    }
    /// Bilinear weights of three nodes, this far beyond the middle one [cells].
    template <AnyPack Pack>
    TESTBED_INLINE static std::array<Pack, 3> hat(const Pack& beyond)
    {
        const Pack high = max(beyond, Pack(0.0)), low = high - beyond;
        return {low, Pack(1.0) - low - high, high};
    }
    template <AnyPack Pack>
    TESTBED_INLINE void displace(const std::array<std::array<Pack, S + 1>, 2>& weights, double dt, Vec<2, Pack>& x) const
    {
        Vec<2, Pack> u;
        set_zero(u);
        for (int j = 0; j <= S; ++j)
        {
            Vec<2, Pack> row;
            set_zero(row);
            for (int i = 0; i <= S; ++i)
                unrolled<2>([&](auto d) TESTBED_INLINE { row[d] += weights[0][i] * Pack(v[d][j * stride + i]); });
            unrolled<2>([&](auto d) TESTBED_INLINE { u[d] += weights[1][j] * row[d]; });
        }
        unrolled<2>([&](auto d) TESTBED_INLINE { x[d] += Pack(dt) * u[d]; });
    }
};

/// Strain and rotation (5e), (5f), stress, volume, and position by eq. (6), for the points of one body; and, while they are at hand, the
/// sums of its bins (`sums`, from the body's first on) for the next step. Marks bins that a point left: their sums are then not right.
template <class Support>
void move_points(const LpfdmGrid<2>& grid, const MidSteps& mid_steps, Body& body, const StrainIncrement& increment, double dt, double* sums)
{
    Points<2>& q = body.points;
    const auto& bins = body.bins.list();
    update_stress(
        body,
        [&](std::size_t b, auto&& keep) TESTBED_INLINE
        {
            const BinMotion<Support> motion(grid, bins[b], mid_steps);
            const BinFrame<2> frame(grid.lattice, bins[b], motion.origin());
            with_packs_for(bins[b].end - bins[b].begin,
                           [&]<AnyPack P>(const P&) TESTBED_INLINE
                           {
                               for_each_pack<P>(bins[b].begin, bins[b].end,
                                                [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                                {
                                                    auto x = load(q.x, p, lanes);
                                                    const auto g = motion(frame.template box<Support>(q, p, lanes, x), dt, x);
                                                    keep(p, lanes, g);
                                                    stretch<Support>(q, p, lanes, increment, g);
                                                    store(q.x, p, lanes, x);
                                                });
                           });
        },
        [&](std::size_t b) TESTBED_INLINE
        {
            if (sum_bin<Support, CellSums<Support>>(grid.lattice, body, bins[b], sums + b * CellSums<Support>::numbers))
                body.bins.mark(b);
        });
}
}  // namespace testbed
