#pragma once
/// What lives on the lattice: vectors by cell or node, and the unknowns of nodes.

#include "core/base/field.hpp"
#include "core/lattice/lattice.hpp"

namespace testbed
{
/// Consecutive numbers of cells or nodes, for loops without an index per entity.
struct Run
{
    std::uint32_t begin, count;
};

/// Runs of an ascending list, none across a multiple of `stride`, short enough to be shared out between threads.
inline std::vector<Run> runs_of(const std::vector<std::uint32_t>& ascending, std::size_t stride)
{
    constexpr std::uint32_t longest = 128;
    std::vector<Run> runs;
    for (const auto n : ascending)
        if (!runs.empty() && runs.back().begin + runs.back().count == n && runs.back().count < longest && n % stride != 0)
            ++runs.back().count;
        else
            runs.push_back({n, 1});
    return runs;
}

/// f(run) for all runs.
template <class F>
void for_each_run(const std::vector<Run>& runs, F&& f)
{
    parallel_for(
        runs.size(), [&](std::size_t r) { f(runs[r]); }, 16);
}

/// A number in each direction for each cell or node.
template <std::size_t dim>
using VectorField = std::array<std::vector<double>, dim>;

/// Nodal unknowns, and which nodes are in use at present.
template <int dim>
class Nodes
{
public:
    std::vector<double> mass;  ///< kg/m
    VectorField<dim> v, f;     ///< m/s, N/m

    explicit Nodes(std::size_t n) : mass(n)
    {
        for_each_vector([&](auto& values) { values.resize(n); });
    }
    const std::vector<std::uint32_t>& active() const { return active_; }  ///< ascending
    const std::vector<Run>& runs() const { return runs_; }                ///< the same
    std::size_t version() const { return version_; }                      ///< grows with each set_active()
    void set_active(std::vector<std::uint32_t> ascending)
    {
        active_ = std::move(ascending);
        runs_ = runs_of(active_, mass.size() + 1);
        ++version_;
    }
    /// Takes all values to other numbers; nodes without one are no longer active.
    void renumber(const Lattice<dim>& from, const Lattice<dim>& to)
    {
        testbed::renumber(mass, from, to);
        for_each_vector([&](auto& values) { testbed::renumber(values, from, to); });
        std::vector<std::uint32_t> active;
        for (const auto n : active_)
            if (const Index<dim> at = from.node_index(n); to.has_node(at))
                active.push_back(static_cast<std::uint32_t>(to.node(at)));
        set_active(std::move(active));
    }
    /// kernel(i, lanes) for the active nodes [i, i + lanes).
    template <class Kernel>
    void for_each(Kernel&& kernel) const
    {
        for_each_run(runs_, [&](const Run& run) TESTBED_FLATTEN { for_each_pack(run.begin, run.begin + run.count, kernel); });
    }
    /// Zero at a node that goes out of use.
    void clear(std::size_t i)
    {
        mass[i] = 0;
        for_each_vector([&](auto& values) { values[i] = 0; });
    }
    /// Zero everywhere: for other values to be read.
    void clear()
    {
        std::fill(mass.begin(), mass.end(), 0.0);
        for_each_vector([&](auto& values) { std::fill(values.begin(), values.end(), 0.0); });
    }
    std::size_t bytes() const
    {
        return (1 + 2 * dim) * mass.capacity() * sizeof(double) + active_.capacity() * sizeof(active_[0]) + runs_.capacity() * sizeof(Run);
    }

private:
    template <class F>
    void for_each_vector(F&& f)
    {
        for (auto* vector : {&v, &this->f})
            for (auto& values : *vector)
                f(values);
    }

    std::vector<std::uint32_t> active_;
    std::vector<Run> runs_;
    std::size_t version_ = 0;
};

/// 1/m, and zero for nodes that carry no mass.
template <int dim, class Lanes>
Pack inverse_mass(const Nodes<dim>& nodes, std::size_t i, const Lanes& lanes)
{
    const Pack m = lanes.load(&nodes.mass[i]);
    Pack inverse = Pack(1.0) / m;
    stdx::where(!(m > Pack(0.0)), inverse) = Pack(0.0);
    return inverse;
}
template <int dim>
double inverse_mass(const Nodes<dim>& nodes, std::size_t i)
{
    return nodes.mass[i] > 0 ? 1 / nodes.mass[i] : 0;
}
}  // namespace testbed
