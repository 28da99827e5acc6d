#include "core/bodies/point_sums.hpp"

#include <cmath>

namespace testbed
{
double work_over_energy(double volume_ratio)
{
    const double z = (volume_ratio - 1) / (volume_ratio + 1);
    if (std::abs(z) < 0.05)
    {
        const double a = z * (2 + z * z * (2.0 / 3));  // ln to z^5
        return 1 - a / 3 * (1 - a / 4 * (1 - a / 5 * (1 - a / 6)));
    }
    if (!(volume_ratio > 0 && std::isfinite(volume_ratio)))
        return 1;
    const double a = std::log(volume_ratio);
    return 2 * (a - 1 + 1 / volume_ratio) / (a * a);
}

double strain_energy(const std::vector<Body>& bodies)
{
    double total = 0;
    for (const Body& body : bodies)
        total += std::visit(
            [&](const auto& law)
            { return ordered_sum<1>(body.points.count, [&](std::size_t p) { return std::array{strain_energy(law, body.points, p)}; })[0]; },
            body.material);
    return total;
}

PointSums point_sums(const std::vector<Body>& bodies, const Lattice<2>& lattice)
{
    PointSums total;
    const Vec<2> low = lattice.origin, high{low[0] + lattice.size[0] * lattice.cell_size, low[1] + lattice.size[1] * lattice.cell_size};
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
        const double initial = 1 / q.initial_volume, mass = q.mass * q.weight_share;
        const auto of_point = [&](const auto& law, std::size_t p)
        {
            const double volume = q.current_volume(p), energy = strain_energy(law, q, p);
            const bool inside = q.x[0][p] >= low[0] && q.x[0][p] <= high[0] && q.x[1][p] >= low[1] && q.x[1][p] <= high[1];
            return std::array<double, 6>{
                energy, energy * work_over_energy(volume * initial), volume, mass * q.x[0][p], mass * q.x[1][p], inside ? 0.0 : 1.0};
        };
        const auto s = std::visit([&](const auto& law) { return ordered_sum<6>(q.count, [&](std::size_t p) { return of_point(law, p); }); },
                                  body.material);
        total.strain_energy += s[0];
        total.elastic_work += s[1];
        total.volume += s[2];
        total.mass += mass * static_cast<double>(q.count);
        total.moment[0] += s[3];
        total.moment[1] += s[4];
        total.outside += s[5];
        const auto largest = [&](auto&& f) { return parallel_max(q.count, f); };
        total.max_stress = std::max(total.max_stress,
                                    largest(
                                        [&](std::size_t p) {
                                            return std::max({std::abs(q.stress[0][p]), std::abs(q.stress[1][p]), std::abs(q.stress[2][p])});
                                        }));
        total.largest = std::max(total.largest, initial * largest([&](std::size_t p) { return q.current_volume(p); }));
        const double denser = largest([&](std::size_t p) { return 1 / q.current_volume(p); });
        total.smallest = std::min(total.smallest, initial / denser);
    }
    return total;
}
}  // namespace testbed
