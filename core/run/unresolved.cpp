#include "core/run/unresolved.hpp"

#include "core/bodies/point_sums.hpp"

#include <algorithm>
#include <cmath>

namespace testbed
{
namespace
{
/// Values at the nodes that a body's points touch, on the smallest box of cells around them.
class NodeAverage
{
public:
    NodeAverage(const Points<2>& q, const Vec<2>& origin, double cell_size) : q_(q), origin_(origin), cell_size_(cell_size)
    {
        Vec<2> low{q.x[0][0], q.x[1][0]}, high = low;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            low = {std::min(low[0], q.x[0][p]), std::min(low[1], q.x[1][p])};
            high = {std::max(high[0], q.x[0][p]), std::max(high[1], q.x[1][p])};
        }
        const double room = ((high[0] - low[0]) / cell_size + 2) * ((high[1] - low[1]) / cell_size + 2);
        const double far = std::max({std::abs(low[0]), std::abs(low[1]), std::abs(high[0]), std::abs(high[1])}) / cell_size;
        is_compact_ = room < 64.0 * static_cast<double>(q.count + 1024) && far < 1e9;
        if (!is_compact_)
            return;
        i0_ = static_cast<int>(std::floor((low[0] - origin[0]) / cell_size));
        j0_ = static_cast<int>(std::floor((low[1] - origin[1]) / cell_size));
        stride_ = static_cast<std::size_t>((high[0] - low[0]) / cell_size) + 3;
        nodes_ = stride_ * (static_cast<std::size_t>((high[1] - low[1]) / cell_size) + 3);
    }
    /// A body in parts far from each other is not worth the memory of all between them.
    bool is_compact() const { return is_compact_; }

    /// Each point's own value less the average about it. @param value (point)
    template <class Value>
    std::vector<double> difference(Value&& value) const
    {
        std::vector<double> sum(nodes_, 0.0), volume(nodes_, 0.0), rest(q_.count);
        for (std::size_t p = 0; p < q_.count; ++p)
            at_corners(p,
                       [&](std::size_t n, double weight)
                       {
                           sum[n] += weight * q_.current_volume(p) * value(p);
                           volume[n] += weight * q_.current_volume(p);
                       });
        for (std::size_t p = 0; p < q_.count; ++p)
        {
            rest[p] = value(p);
            at_corners(p, [&](std::size_t n, double weight) { rest[p] -= volume[n] > 0 ? weight * sum[n] / volume[n] : 0; });
        }
        return rest;
    }

private:
    std::pair<int, int> cell(std::size_t p) const
    {
        return {static_cast<int>(std::floor((q_.x[0][p] - origin_[0]) / cell_size_)),
                static_cast<int>(std::floor((q_.x[1][p] - origin_[1]) / cell_size_))};
    }
    template <class F>
    void at_corners(std::size_t p, F&& f) const
    {
        const auto [i, j] = cell(p);
        const double a = (q_.x[0][p] - origin_[0]) / cell_size_ - i, b = (q_.x[1][p] - origin_[1]) / cell_size_ - j;
        const std::size_t n = static_cast<std::size_t>(i - i0_) + static_cast<std::size_t>(j - j0_) * stride_;
        f(n, (1 - a) * (1 - b));
        f(n + 1, a * (1 - b));
        f(n + stride_, (1 - a) * b);
        f(n + stride_ + 1, a * b);
    }

    const Points<2>& q_;
    Vec<2> origin_;
    double cell_size_;
    int i0_ = 0, j0_ = 0;
    std::size_t stride_ = 0, nodes_ = 0;
    bool is_compact_ = true;
};

/// f(body, point, its stress less the average about it).
template <class F>
void for_each_unresolved(const std::vector<Body>& bodies, const Lattice<2>& lattice, double cell_size, F&& f)
{
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
        const NodeAverage average(q, lattice.origin, cell_size);
        if (!average.is_compact())
            continue;
        const auto rest = [&](const Field<double>& s) { return average.difference([&](std::size_t p) { return s[p]; }); };
        const auto sxx = rest(q.stress[0]), syy = rest(q.stress[1]), sxy = rest(q.stress[2]);
        for (std::size_t p = 0; p < q.count; ++p)
            f(body, p, SymTensor<2>{sxx[p], syy[p], sxy[p]});
    }
}
/// The part of a change of stress that follows from those in the plane.
double elastic_szz(const Body& body, const SymTensor<2>& r)
{
    return std::visit([&](const auto& law) { return law.elastic_out_of_plane_stress(r); }, body.material);
}
}  // namespace

double stress_error(const std::vector<Body>& bodies, const Lattice<2>& lattice, double cell_size)
{
    const auto square = [](double xx, double yy, double zz, double xy) { return xx * xx + yy * yy + zz * zz + 2 * xy * xy; };
    double all = 0, rest = 0;
    for_each_unresolved(bodies, lattice, cell_size,
                        [&](const Body& body, std::size_t p, const SymTensor<2>& r)
                        {
                            const Points<2>& q = body.points;
                            const double V = q.current_volume(p);
                            all += V * square(q.stress[0][p], q.stress[1][p], out_of_plane_stress(body.material, q, p), q.stress[2][p]);
                            rest += V * square(r.xx, r.yy, elastic_szz(body, r), r.xy);
                        });
    return all > 0 ? std::sqrt(rest / all) : 0;
}

double unresolved_energy(const std::vector<Body>& bodies, const Lattice<2>& lattice, double cell_size,
                         const std::function<Vec<2>(std::size_t, std::size_t)>& velocity)
{
    double total = 0;
    for_each_unresolved(bodies, lattice, cell_size,
                        [&](const Body& body, std::size_t p, const SymTensor<2>& r)
                        {
                            const double density = std::visit(
                                [&](const auto& law) { return law.energy_density(r, law.elastic_out_of_plane_stress(r)); }, body.material);
                            total += body.points.current_volume(p) * density / stiffness_ratio(body.points, p);
                        });
    for (std::size_t b = 0; b < bodies.size(); ++b)
        if (const NodeAverage average(bodies[b].points, lattice.origin, cell_size); average.is_compact())
            for (const std::size_t k : {0, 1})
                for (const double rest : average.difference([&](std::size_t p) { return velocity(b, p)[k]; }))
                    total += 0.5 * bodies[b].points.mass * rest * rest;
    return total;
}
}  // namespace testbed
