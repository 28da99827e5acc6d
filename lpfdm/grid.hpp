#pragma once
/// The lattice of LPFDM with what lives on it: averages of cells, unknowns of nodes.

#include "core/lattice/gather.hpp"
#include "core/lattice/kinematics.hpp"
#include "core/lattice/nodes.hpp"

namespace testbed
{
template <int dim>
struct Cells
{
    std::vector<double> mass;                       ///< M_j, eq. (7) [kg/m]; zero marks a cell without points
    VectorField<symmetric_components<dim>> stress;  ///< <sigma>_j, eq. (8) [Pa]
    VectorField<std::size_t{dim * dim}> gradient;   ///< eq. (5), of the increment over a step [-]

    explicit Cells(std::size_t n) : mass(n)
    {
        for_each_component([&](auto& values) { values.resize(n); });
    }
    Gradient<dim> gradient_at(std::size_t c) const { return tensor_of<Gradient<dim>>(at(gradient, c)); }
    template <class Lanes>
    TESTBED_INLINE Gradient<dim, Pack> gradient_at(std::size_t c, const Lanes& lanes) const
    {
        return tensor_of<Gradient<dim, Pack>>(load(gradient, c, lanes));
    }
    template <class Lanes>
    TESTBED_INLINE SymTensor<dim, Pack> stress_at(std::size_t c, const Lanes& lanes) const
    {
        return tensor_of<SymTensor<dim, Pack>>(load(stress, c, lanes));
    }
    void clear(std::size_t c)
    {
        mass[c] = 0;
        for_each_component([&](auto& values) { values[c] = 0; });
    }
    std::size_t bytes() const { return (1 + stress.size() + gradient.size()) * mass.size() * sizeof(double); }

private:
    template <class F>
    void for_each_component(F&& f)
    {
        std::for_each(stress.begin(), stress.end(), f);
        std::for_each(gradient.begin(), gradient.end(), f);
    }
};

template <int dim>
struct LpfdmGrid
{
    static constexpr std::size_t corners = 1 << dim;

    Lattice<dim> lattice;
    Cells<dim> cells;
    Nodes<dim> nodes;
    Gather gather;  ///< from points to cells

    explicit LpfdmGrid(const Lattice<dim>& l) : lattice(l), cells(l.cells()), nodes(l.nodes()), gather(l.cells()) {}

    /// Takes the nodes to the numbers of another lattice; the cells are empty until the next rebuild().
    void renumber(const Lattice<dim>& to)
    {
        nodes.renumber(lattice, to);
        cells = Cells<dim>(to.cells());
        gather = Gather(to.cells());
        lattice = to;
    }

    /// Corner k = 0, 1, ..., nodes [1], [2], ..., of the cell whose corner [1] is `first`.
    std::size_t corner(std::size_t first, std::size_t k) const
    {
        for (int d = 0; d < dim; ++d)
            if (is_upper(k, d))
                first += lattice.node_stride(d);
        return first;
    }
    /// The cell of which a node is corner k, from the cell of which it is corner [1].
    std::size_t around(std::size_t first, std::size_t k) const
    {
        for (int d = 0; d < dim; ++d)
            if (is_upper(k, d))
                first -= lattice.cell_stride(d);
        return first;
    }
    std::size_t first_node(std::size_t cell) const { return lattice.node(lattice.cell_index(cell)); }
    std::size_t first_cell(std::size_t node) const { return lattice.cell(lattice.node_index(node)); }

    /// Cells and nodes in use, from bins that were sorted anew. Returns the nodes that are no longer in use.
    template <int S>
    std::vector<std::uint32_t> rebuild(std::span<const Bins<dim>* const> bins)
    {
        for (const auto c : gather.active())
            cells.clear(c);
        gather.rebuild<S>(bins, [&](const Index<dim>& at) { return lattice.cell(at); });
        std::vector<std::uint32_t> used;
        for (const auto c : gather.active())
            used.push_back(static_cast<std::uint32_t>(first_node(c)));
        for (int d = 0; d < dim; ++d)
            used = joined(used, used, lattice.node_stride(d));
        used.shrink_to_fit();
        std::vector<std::uint32_t> left;
        std::set_difference(nodes.active().begin(), nodes.active().end(), used.begin(), used.end(), std::back_inserter(left));
        nodes.set_active(std::move(used));
        node_runs_ = runs_of(nodes.active(), lattice.node_stride());
        cell_runs_ = runs_of(gather.active(), lattice.cell_stride());
        return left;
    }

    /// kernel(c, n, lanes) for the cells [c, c + lanes) in use, with their first nodes [n, n + lanes).
    template <class Kernel>
    void for_each_cell(Kernel&& kernel) const
    {
        for_each_run(cell_runs_,
                     [&](const Run& run) TESTBED_FLATTEN
                     {
                         const std::size_t n = first_node(run.begin);
                         for_each_pack(0, run.count, [&](std::size_t k, const auto& lanes) { kernel(run.begin + k, n + k, lanes); });
                     });
    }
    /// The same for a kernel that returns a pack: its sum over all cells, in a fixed order.
    template <class Kernel>
    double sum_over_cells(Kernel&& kernel) const
    {
        return ordered_sum<1>(
            cell_runs_.size(),
            [&](std::size_t r) TESTBED_FLATTEN
            {
                const Run& run = cell_runs_[r];
                const std::size_t n = first_node(run.begin);
                Pack total(0.0);
                for_each_pack(0, run.count,
                              [&](std::size_t k, const auto& lanes) { total += lanes.keep(kernel(run.begin + k, n + k, lanes)); });
                return std::array{sum(total)};
            },
            4)[0];
    }
    /// kernel(n, c, lanes) for the nodes [n, n + lanes) in use, with their first cells [c, c + lanes).
    template <class Kernel>
    void for_each_node(Kernel&& kernel) const
    {
        for_each_run(node_runs_,
                     [&](const Run& run) TESTBED_FLATTEN
                     {
                         const std::size_t c = first_cell(run.begin);
                         for_each_pack(0, run.count, [&](std::size_t k, const auto& lanes) { kernel(run.begin + k, c + k, lanes); });
                     });
    }
    /// Nodal values at the corners of the cells whose first nodes are [n, n + lanes).
    template <class Lanes>
    TESTBED_INLINE std::array<Pack, corners> at_corners(const std::vector<double>& values, std::size_t n, const Lanes& lanes) const
    {
        std::array<Pack, corners> v;
        unrolled<corners>([&](auto k) TESTBED_INLINE { v[k] = lanes.load(&values[corner(n, k)]); });
        return v;
    }
    std::size_t bytes() const
    {
        return cells.bytes() + nodes.bytes() + gather.bytes() + (node_runs_.capacity() + cell_runs_.capacity()) * sizeof(Run);
    }

private:
    std::vector<Run> node_runs_, cell_runs_;
};
}  // namespace testbed
