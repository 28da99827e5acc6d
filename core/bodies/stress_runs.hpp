#pragma once
/// Stress of the points of consecutive bins, which lie behind each other, in whole packs: a bin of four points fills half a pack of eight,
/// and what a law does costs the same for one lane as for all.

#include "core/base/parallel.hpp"
#include "core/bodies/body.hpp"

namespace testbed
{
/// Displacement gradient increments of the points of a run, by component.
class Increments
{
public:
    /// Starts a run of so many points.
    void begin(std::size_t points)
    {
        stride_ = points + pack_size;
        if (4 * stride_ > near_.size())
            far_.resize(4 * stride_);
        values_ = 4 * stride_ > near_.size() ? far_.data() : near_.data();
    }
    template <class Lanes>
    TESTBED_INLINE void store(std::size_t k, const Lanes& lanes, const Gradient<2, typename Lanes::Pack>& d)
    {
        double* to = values_ + k;
        lanes.store(to, d.xx);
        lanes.store(to + stride_, d.yy);
        lanes.store(to + 2 * stride_, d.xy);
        lanes.store(to + 3 * stride_, d.yx);
    }
    template <class Lanes>
    TESTBED_INLINE Gradient<2, Pack> load(std::size_t k, const Lanes& lanes) const
    {
        const double* from = values_ + k;
        return {lanes.load(from), lanes.load(from + stride_), lanes.load(from + 2 * stride_), lanes.load(from + 3 * stride_)};
    }

private:
    std::array<double, 4 * 160> near_;
    std::vector<double> far_;  ///< of a bin with more points than that
    double* values_ = nullptr;
    std::size_t stride_ = 0;
};

/// Stress of the points [begin, end) of a body by its law, from their increments.
void update_stress(Body& body, std::size_t begin, std::size_t end, const Increments& increments);

/// For the bins of a body: strain(b, keep), which gives the increments of all its points to keep(p, lanes, d); then the stress of a run of
/// bins; then finish(b) for each. The runs do not depend on the number of threads.
template <class Strain, class Finish>
void update_stress_in_runs(Body& body, Strain&& strain, Finish&& finish)
{
    constexpr std::size_t bins_together = 16, points_together = 128;
    const auto& bins = body.bins.list();
    parallel_for((bins.size() + bins_together - 1) / bins_together,
                 [&](std::size_t r) TESTBED_FLATTEN
                 {
                     Increments increments;
                     const std::size_t last = std::min(bins.size(), (r + 1) * bins_together);
                     for (std::size_t first = r * bins_together, end; first < last; first = end)
                     {
                         const std::size_t begin = bins[first].begin;
                         for (end = first + 1; end < last && bins[end].end - begin <= points_together;)
                             ++end;
                         increments.begin(bins[end - 1].end - begin);
                         for (std::size_t b = first; b < end; ++b)
                             strain(b, [&](std::size_t p, const auto& lanes, const auto& d) TESTBED_INLINE
                                    { increments.store(p - begin, lanes, d); });
                         update_stress(body, begin, bins[end - 1].end, increments);
                         for (std::size_t b = first; b < end; ++b)
                             finish(b);
                     }
                 },
                 16);
}

/// The same, in one pass by a law that is cheap beside the rest of it, else in runs, which are compiled once for all other laws.
template <class Strain, class Finish>
void update_stress(Body& body, Strain&& strain, Finish&& finish)
{
    const auto in_one_pass = [&](const auto& law)
    {
        parallel_for(body.bins.list().size(),
                     [&](std::size_t b) TESTBED_FLATTEN
                     {
                         strain(b, [&](std::size_t p, const auto& lanes, const auto& d) TESTBED_INLINE
                                { law.update(body.points, p, lanes, d); });
                         finish(b);
                     });
    };
    const bool is_done = std::visit(
        [&](const auto& law)
        {
            constexpr bool is_cheap = std::decay_t<decltype(law)>::is_cheap;
            if constexpr (is_cheap)
                in_one_pass(law);
            return is_cheap;
        },
        body.material);
    if (!is_done)
        update_stress_in_runs(body, strain, finish);
}
}  // namespace testbed
