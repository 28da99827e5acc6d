#include "lpfdm/mesh/mesh.hpp"

#include <bit>
#include <fmt/format.h>
#include <limits>
#include <stdexcept>

namespace testbed
{
namespace
{
constexpr double tolerance = 1e-9;        // cells of the lattice
constexpr std::size_t most_corners = 64;  // weights are products of as many areas

double area_of(std::span<const Vec<2>> x)
{
    double twice = 0;
    for (std::size_t k = 2; k < x.size(); ++k)
        twice += twice_area(x[0], x[k - 1], x[k]);
    return 0.5 * twice;
}

void check(std::size_t cell, std::span<const Vec<2>> x)
{
    const std::size_t n = x.size();
    const auto is_left = [&](std::size_t k) { return twice_area(x[k], x[(k + 1) % n], x[(k + 2) % n]) > 0; };
    double turns = 0;  // a star is left of each of its sides, too, but goes round more than once
    for (std::size_t k = 0; k < n; ++k)
    {
        const Vec<2>&a = x[k], &b = x[(k + 1) % n], &c = x[(k + 2) % n];
        turns += std::atan2(twice_area(a, b, c), (b[0] - a[0]) * (c[0] - b[0]) + (b[1] - a[1]) * (c[1] - b[1]));
    }
    bool is_right = n >= 3 && n <= most_corners && turns < 7 && std::isfinite(area_of(x));
    for (std::size_t k = 0; k < n; ++k)
        is_right = is_right && is_left(k);
    if (!is_right)
        throw std::invalid_argument(
            fmt::format("cell {} with its first corner at ({:.6g}, {:.6g}) m: 3 to {} corners are asked that run anticlockwise around a "
                        "convex cell, none of them on the line between its neighbours",
                        cell, n ? x[0][0] : 0.0, n ? x[0][1] : 0.0, most_corners));
}

/// No two cells run along a side in the same direction: they would lie over each other.
void check_sides(const MeshCells& cells)
{
    std::vector<std::array<std::size_t, 3>> sides;  // from, to, cell
    for (std::size_t c = 0; c < cells.size(); ++c)
        for (std::size_t k = 0; k < cells[c].size(); ++k)
            sides.push_back({cells[c][k], cells[c][(k + 1) % cells[c].size()], c});
    std::sort(sides.begin(), sides.end());
    const auto twice =
        std::adjacent_find(sides.begin(), sides.end(), [](const auto& a, const auto& b) { return a[0] == b[0] && a[1] == b[1]; });
    if (twice != sides.end())
        throw std::invalid_argument(fmt::format("cells {} and {} lie over each other: both are to the left of their side from node to node",
                                                (*twice)[2], (*(twice + 1))[2]));
}

}  // namespace

Mesh::Mesh(std::vector<Vec<2>> nodes, const MeshCells& cells, const Lattice<2>& lattice)
    : place_(std::move(nodes)),
      lattice_(lattice),
      least_height_(std::numeric_limits<double>::infinity())
{
    std::vector<std::vector<Around>> around(place_.size());
    std::vector<std::vector<std::uint32_t>> in_square(static_cast<std::size_t>(lattice.size[0]) *
                                                      static_cast<std::size_t>(lattice.size[1]));
    for (std::uint32_t c = 0; c < cells.size(); ++c)
    {
        std::vector<Vec<2>> x;
        for (std::uint32_t k = 0; k < cells[c].size(); ++k)
        {
            x.push_back(place_[cells[c][k]]);
            around[cells[c][k]].push_back({c, k});
        }
        check(c, x);
        corners_.append(cells[c]);
        corner_place_.append(x);
        slopes_.append(polygon_slopes(x));
        area_.push_back(area_of(x));
        std::vector<Side> sides;
        for (std::size_t k = 0, n = x.size(); k < n; ++k)
        {
            sides.emplace_back(x[k], x[(k + 1) % n]);
            for (std::size_t j = 2; j < n; ++j)
                least_height_ = std::min(least_height_, sides.back().distance(x[(k + j) % n]));
        }
        sides_.append(sides);
        Index<2> low, high;
        for (std::size_t d = 0; d < 2; ++d)
        {
            const auto [least, most] = std::minmax_element(x.begin(), x.end(), [&](const auto& a, const auto& b) { return a[d] < b[d]; });
            const auto square = [&](double at)  // within the lattice and a ring around it, before it is an int
            { return static_cast<int>(std::clamp(std::floor((at - lattice.origin[d]) / lattice.cell_size), -1.0, 1.0 * lattice.size[d])); };
            low[d] = std::max(0, square((*least)[d] - tolerance * lattice.cell_size));
            high[d] = std::min(lattice.size[d] - 1, square((*most)[d] + tolerance * lattice.cell_size)) + 1;
        }
        for_each_index(low, high,
                       [&](const Index<2>& at) { in_square[static_cast<std::size_t>(at[1] * lattice.size[0] + at[0])].push_back(c); });
    }
    check_sides(cells);
    for (const auto& list : around)
        around_.append(list);
    for (const auto& list : in_square)
        in_square_.append(list);
}

std::span<const std::uint32_t> Mesh::in_square(const Index<2>& at) const
{
    return in_square_[static_cast<std::size_t>(at[1] * lattice_.size[0] + at[0])];
}

std::optional<Index<2>> Mesh::square_of(const Vec<2>& place) const
{
    Index<2> at;
    for (std::size_t d = 0; d < 2; ++d)
    {
        const double square = std::floor((place[d] - lattice_.origin[d]) / lattice_.cell_size);
        if (!(square >= 0 && square < lattice_.size[d]))  // NaN, too
            return std::nullopt;
        at[d] = static_cast<int>(square);
    }
    return at;
}

std::optional<std::uint32_t> Mesh::find(const Vec<2>& place) const
{
    const auto at = square_of(place);
    return at ? find(*at, place) : std::nullopt;
}

std::optional<std::uint32_t> Mesh::find(const Index<2>& at, const Vec<2>& place) const
{
    const double near = tolerance * lattice_.cell_size;
    std::optional<std::uint32_t> on_side;
    for (const auto c : in_square(at))
    {
        double distance = std::numeric_limits<double>::infinity();
        for (const Side& side : sides_[c])
            distance = std::min(distance, side.distance(place));
        if (distance > near || (distance >= -near && is_in_first_half(c, place)))
            return c;
        if (distance >= -near && !on_side)
            on_side = c;
    }
    return on_side;
}

bool Mesh::is_in_first_half(std::size_t cell, const Vec<2>& place) const
{
    const auto x = places(cell);
    const auto sides = sides_[cell];
    const auto nearest =
        std::min_element(sides.begin(), sides.end(), [&](const Side& a, const Side& b) { return a.distance(place) < b.distance(place); });
    const auto k = static_cast<std::size_t>(nearest - sides.begin());
    const auto square = [&](const Vec<2>& end) { return std::pow(place[0] - end[0], 2) + std::pow(place[1] - end[1], 2); };
    return square(x[k]) < square(x[(k + 1) % x.size()]);
}

std::optional<std::uint32_t> Mesh::over(std::size_t cell) const
{
    Vec<2> middle{0, 0};
    for (const Vec<2>& x : places(cell))
        for (std::size_t d = 0; d < 2; ++d)
            middle[d] += x[d] / static_cast<double>(places(cell).size());
    for (const Vec<2>& corner : places(cell))
        if (const auto other = another_at({0.5 * (middle[0] + corner[0]), 0.5 * (middle[1] + corner[1])}, cell))
            return other;
    return another_at(middle, cell);
}

std::optional<std::uint32_t> Mesh::another_at(const Vec<2>& x, std::size_t cell) const
{
    const auto at = square_of(x);
    if (!at)
        return std::nullopt;
    for (const auto other : in_square(*at))
        if (other != cell && std::all_of(sides_[other].begin(), sides_[other].end(),
                                         [&](const Side& side) { return side.distance(x) > tolerance * lattice_.cell_size; }))
            return other;
    return std::nullopt;
}

std::uint32_t Mesh::checksum() const
{
    std::uint64_t sum = 0xcbf29ce484222325;  // FNV-1a, of whole numbers
    const auto add = [&](std::uint64_t number) { sum = (sum ^ number) * 0x100000001b3; };
    for (std::size_t c = 0; c < cells(); ++c)
    {
        add(corners(c).size());
        for (const Vec<2>& x : places(c))
            for (const double number : x)
                add(std::bit_cast<std::uint64_t>(number));
    }
    return static_cast<std::uint32_t>(sum ^ sum >> 32);
}

std::size_t Mesh::bytes() const
{
    return (2 * place_.capacity() + area_.capacity()) * sizeof(double) + corners_.bytes() + corner_place_.bytes() + slopes_.bytes() +
           sides_.bytes() + around_.bytes() + in_square_.bytes();
}
}  // namespace testbed
