#pragma once
/// The fixed lattice of squares or cubes. Cell (i, j) has its nodes [1] (i, j), [2] (i+1, j), [3] (i, j+1), [4] (i+1, j+1); (i, j, k)
/// the same again at k+1.

#include "core/base/types.hpp"

#include <algorithm>
#include <array>
#include <compare>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace testbed
{
/// A cell or node by its place in each direction, whatever its number; ordered as they are numbered, row by row.
template <int dim>
struct Index : std::array<int, dim>
{
    friend bool operator==(const Index&, const Index&) = default;
    friend auto operator<=>(const Index& a, const Index& b)
    {
        return std::lexicographical_compare_three_way(a.rbegin(), a.rend(), b.rbegin(), b.rend());
    }
    friend Index operator+(Index a, const Index& b)
    {
        for (int d = 0; d < dim; ++d)
            a[d] += b[d];
        return a;
    }
};

/// The same number in each direction.
template <int dim>
Index<dim> all(int n)
{
    Index<dim> index;
    index.fill(n);
    return index;
}

/// Number k of the S^dim indices from zero on, row by row.
template <int S, int dim>
TESTBED_INLINE constexpr Index<dim> block_index(int k)
{
    Index<dim> index{};
    for (int d = 0; d < dim; ++d, k /= S)
        index[d] = k % S;
    return index;
}
template <int S, int dim>
inline constexpr int block_size = S* block_size<S, dim - 1>;
template <int S>
inline constexpr int block_size<S, 0> = 1;

/// f(index) for low <= index < high in each direction, row by row.
template <int dim, class F>
void for_each_index(const Index<dim>& low, const Index<dim>& high, F&& f)
{
    for (int d = 0; d < dim; ++d)
        if (low[d] >= high[d])
            return;
    for (Index<dim> at = low;;)
    {
        f(at);
        int d = 0;
        for (; d < dim && ++at[d] == high[d]; ++d)
            at[d] = low[d];
        if (d == dim)
            return;
    }
}

/// Cells low <= index < high in each direction.
template <int dim>
struct CellBox
{
    Index<dim> low, high;

    bool operator==(const CellBox&) const = default;
    void extend(const CellBox& other)
    {
        for (int d = 0; d < dim; ++d)
        {
            low[d] = std::min(low[d], other.low[d]);
            high[d] = std::max(high[d], other.high[d]);
        }
    }
    static CellBox none() { return {all<dim>(std::numeric_limits<int>::max()), all<dim>(std::numeric_limits<int>::min())}; }
};

/// Numbers go to the cells and nodes of a part of the lattice, row by row; the arrays of a method have room for no others. One ring of
/// cells around that part takes what a point's box spreads over the edge of the lattice, and a second, always empty one lets every node of
/// the first look at all cells around it.
template <int dim>
struct Lattice
{
    Vec<dim> origin;
    double cell_size;         ///< L [m]
    double cells_per_length;  ///< 1/L, without a division for each bin [1/m]
    Index<dim> size;          ///< cells
    CellBox<dim> numbered;    ///< without the rings

    /// All of it is numbered.
    Lattice(const Vec<dim>& corner, double L, const Index<dim>& cells)
        : origin(corner),
          cell_size(L),
          cells_per_length(1 / L),
          size(cells),
          numbered{all<dim>(0), cells}
    {
    }
    /// Which part is numbered.
    template <class Archive>
    void state(Archive& a)
    {
        a.group("numbered",
                [&]
                {
                    a.index("0", numbered.low);
                    a.index("1", numbered.high);
                });
    }
    /// From a cell, or node, to the next one in direction d.
    std::size_t cell_stride(int d = 1) const { return stride<4>(d); }
    std::size_t node_stride(int d = 1) const { return stride<3>(d); }
    std::size_t cell(const Index<dim>& at) const { return number<4, 2>(at); }
    std::size_t node(const Index<dim>& at) const { return number<3, 1>(at); }
    std::size_t cells() const { return stride<4>(dim); }
    std::size_t nodes() const { return stride<3>(dim); }
    bool has_node(const Index<dim>& at) const { return has<1>(at); }
    bool has_cell(const Index<dim>& at) const { return has<2>(at); }
    Index<dim> cell_index(std::size_t c) const { return index<4, 2>(c); }
    Index<dim> node_index(std::size_t n) const { return index<3, 1>(n); }
    Vec<dim> node_position(const Index<dim>& n) const
    {
        Vec<dim> x;
        for (int d = 0; d < dim; ++d)
            x[d] = origin[d] + n[d] * cell_size;
        return x;
    }
    Vec<dim> node_position(std::size_t n) const { return node_position(node_index(n)); }

private:
    /// @tparam more entities in a direction than cells are numbered @tparam ring of them below the first of these
    template <int more>
    std::size_t extent(int d) const
    {
        return static_cast<std::size_t>(numbered.high[d] - numbered.low[d]) + more;
    }
    template <int more>
    std::size_t stride(int d) const
    {
        std::size_t n = 1;
        for (int k = 0; k < d; ++k)
            n *= extent<more>(k);
        return n;
    }
    template <int more, int ring>
    std::size_t number(const Index<dim>& at) const
    {
        std::size_t n = static_cast<std::size_t>(at[dim - 1] - numbered.low[dim - 1] + ring);
        for (int d = dim - 2; d >= 0; --d)
            n = n * extent<more>(d) + static_cast<std::size_t>(at[d] - numbered.low[d] + ring);
        return n;
    }
    template <int more, int ring>
    Index<dim> index(std::size_t n) const
    {
        Index<dim> at;
        for (int d = 0; d < dim; ++d)
        {
            const std::size_t count = d < dim - 1 ? extent<more>(d) : n + 1;
            at[d] = static_cast<int>(n % count) - ring + numbered.low[d];
            n /= count;
        }
        return at;
    }
    template <int ring>
    bool has(const Index<dim>& at) const
    {
        for (int d = 0; d < dim; ++d)
            if (at[d] < numbered.low[d] - ring || at[d] > numbered.high[d] + 1)
                return false;
        return true;
    }
};

/// Nothing but the rings around no cells has a number.
template <int dim>
Lattice<dim> without_numbers(Lattice<dim> lattice)
{
    lattice.numbered = {all<dim>(0), all<dim>(0)};
    return lattice;
}

/// The lattice with numbers for a box, which may reach over its edges as far as supports do. The same one if it has them already; else for
/// a margin around the box, too, so that points may go some way before it changes again: arrays take no room where the lattice is empty.
template <int dim>
Lattice<dim> with_numbers_for(const Lattice<dim>& lattice, CellBox<dim> reach)
{
    constexpr int margin = 16;
    const CellBox<dim>& has = lattice.numbered;
    bool has_all = true;
    Lattice<dim> other = lattice;
    for (int d = 0; d < dim; ++d)
    {
        reach.high[d] = std::min(reach.high[d], lattice.size[d] + 1);  // nodes have one line more than cells have columns
        has_all =
            has_all && has.low[d] < has.high[d] && reach.low[d] >= has.low[d] - 1 && reach.high[d] <= has.high[d] + 1;  // the first ring
        other.numbered.low[d] = std::max(reach.low[d] - margin, 0);
        other.numbered.high[d] = std::min(reach.high[d] + margin, lattice.size[d]);
    }
    return has_all ? lattice : other;
}

/// Takes nodal values to other numbers: those of the nodes that both lattices number; the other nodes have zero.
template <int dim>
void renumber(std::vector<double>& values, const Lattice<dim>& from, const Lattice<dim>& to)
{
    Index<dim> low, high;
    for (int d = 0; d < dim; ++d)
    {
        low[d] = std::max(from.numbered.low[d], to.numbered.low[d]) - 1;
        high[d] = std::min(from.numbered.high[d], to.numbered.high[d]) + 2;
    }
    std::vector<double> moved(to.nodes(), 0.0);
    const int count = high[0] - low[0];
    if (count > 0)
    {
        high[0] = low[0] + 1;
        for_each_index(low, high, [&](const Index<dim>& row) { std::copy_n(&values[from.node(row)], count, &moved[to.node(row)]); });
    }
    values.swap(moved);
}
}  // namespace testbed
