#pragma once
/// The fixed square lattice. Cell (i, j) has its nodes [1] (i, j), [2] (i+1, j), [3] (i, j+1), [4] (i+1, j+1).
/// One ring of cells around the lattice takes what a point's box spreads over its edge, and a second, always empty one lets
/// every node of the first look at four cells: cells count from -2 and nodes from -1.

#include "core/parallel.hpp"
#include "core/simd.hpp"
#include "core/types.hpp"

#include <cstddef>
#include <cstdint>
#include <tuple>
#include <vector>

namespace testbed
{
/// A node by its column and line, whatever its number; ordered as nodes are numbered, line by line.
struct NodeIndex
{
    int i, j;
    bool operator==(const NodeIndex&) const = default;
    friend auto operator<=>(const NodeIndex& a, const NodeIndex& b) { return std::tie(a.j, a.i) <=> std::tie(b.j, b.i); }
};

struct Lattice
{
    Vec2 origin{0, 0};
    double cell_size = 1;  ///< L [m]
    int nx = 0, ny = 0;    ///< cells

    std::size_t cell_stride() const { return static_cast<std::size_t>(nx) + 4; }
    std::size_t node_stride() const { return static_cast<std::size_t>(nx) + 3; }
    std::size_t cell(int i, int j) const { return static_cast<std::size_t>(i + 2) + static_cast<std::size_t>(j + 2) * cell_stride(); }
    std::size_t node(int i, int j) const { return static_cast<std::size_t>(i + 1) + static_cast<std::size_t>(j + 1) * node_stride(); }
    std::size_t cells() const { return cell_stride() * (static_cast<std::size_t>(ny) + 4); }
    std::size_t nodes() const { return node_stride() * (static_cast<std::size_t>(ny) + 3); }
    int cell_i(std::size_t c) const { return static_cast<int>(c % cell_stride()) - 2; }
    int cell_j(std::size_t c) const { return static_cast<int>(c / cell_stride()) - 2; }
    int node_i(std::size_t n) const { return static_cast<int>(n % node_stride()) - 1; }
    int node_j(std::size_t n) const { return static_cast<int>(n / node_stride()) - 1; }
    Vec2 node_position(const NodeIndex& n) const { return {origin[0] + n.i * cell_size, origin[1] + n.j * cell_size}; }
    Vec2 node_position(std::size_t n) const { return node_position(NodeIndex{node_i(n), node_j(n)}); }
};

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

/// Nodal unknowns, and which nodes are in use at present.
class Nodes
{
public:
    std::vector<double> mass, vx, vy, fx, fy;  ///< kg/m, m/s, N/m

    explicit Nodes(std::size_t n) : mass(n), vx(n), vy(n), fx(n), fy(n) {}
    const std::vector<std::uint32_t>& active() const { return active_; }  ///< ascending
    const std::vector<Run>& runs() const { return runs_; }                ///< the same
    std::size_t version() const { return version_; }                      ///< grows with each set_active()
    void set_active(std::vector<std::uint32_t> ascending)
    {
        active_ = std::move(ascending);
        runs_ = runs_of(active_, mass.size() + 1);
        ++version_;
    }
    /// kernel(i, lanes) for the active nodes [i, i + lanes).
    template <class Kernel>
    void for_each(Kernel&& kernel) const
    {
        for_each_run(runs_, [&](const Run& run) TESTBED_FLATTEN { for_each_pack(run.begin, run.begin + run.count, kernel); });
    }
    std::size_t bytes() const
    {
        return 5 * mass.capacity() * sizeof(double) + active_.capacity() * sizeof(active_[0]) + runs_.capacity() * sizeof(Run);
    }

private:
    std::vector<std::uint32_t> active_;
    std::vector<Run> runs_;
    std::size_t version_ = 0;
};

/// 1/m, and zero for nodes that carry no mass.
template <class Lanes>
Pack inverse_mass(const Nodes& nodes, std::size_t i, const Lanes& lanes)
{
    const Pack m = lanes.load(&nodes.mass[i]);
    Pack inverse = Pack(1.0) / m;
    stdx::where(!(m > Pack(0.0)), inverse) = Pack(0.0);
    return inverse;
}
inline double inverse_mass(const Nodes& nodes, std::size_t i)
{
    return nodes.mass[i] > 0 ? 1 / nodes.mass[i] : 0;
}
}  // namespace testbed
