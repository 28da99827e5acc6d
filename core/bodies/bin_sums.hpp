#pragma once
/// The sums of points by bin that go to cells or nodes, kept from one step to the next: the pass that moves the points adds them up
/// while they are at hand, and only bins that points left or entered are summed again.

#include "core/bodies/support.hpp"

namespace testbed
{
/// Sums of the points of one bin, where they are now, and whether one of them left it: the sums are then not right. A loop of its own: with
/// the sums of several cells or nodes beside what else a pass computes, the registers would not do, and the points of a bin are still in
/// the nearest cache.
template <class Support, class Sums, int dim>
TESTBED_INLINE inline bool sum_bin(const Lattice<dim>& lattice, const Body& body, const Bin<dim>& bin, double* to)
{
    return with_packs_for(bin.end - bin.begin,
                          [&]<AnyPack P>(const P&) TESTBED_INLINE
                          {
                              const BinFrame<dim> frame(lattice, bin);
                              typename Sums::template In<P> sums(lattice, bin);
                              typename P::mask_type left(false);
                              for_each_pack<P>(bin.begin, bin.end,
                                               [&](std::size_t p, const auto& lanes) TESTBED_INLINE
                                               {
                                                   const auto c = frame.template corner<Support>(body.points, p, lanes);
                                                   left |= frame.template left<Support>(body.points, p, lanes, c);
                                                   sums.add(body, p, lanes, c);
                                               });
                              sums.write(body, bin, to);
                              return stdx::any_of(left);
                          });
}

/// @tparam Sums of one bin: Sums::numbers, and by packs P Sums::In<P>(lattice, bin), add(body, p, lanes, corner), write(body, bin, to)
template <class Support, class Sums>
class BinSums
{
public:
    static constexpr std::size_t numbers = Sums::numbers;

    double* of(std::size_t bin) { return &sums_[bin * numbers]; }
    const std::vector<double>& all() const { return sums_; }

    /// Sums bins that points left or entered.
    void update_changed(const Lattice<Body::dim>& lattice, const std::vector<Body>& bodies)
    {
        std::size_t first = 0;
        for (const Body& body : bodies)
        {
            const auto& changed = body.bins.changed();
            parallel_for(
                changed.size(),
                [&](std::size_t k) TESTBED_FLATTEN
                { sum_bin<Support, Sums>(lattice, body, body.bins.list()[changed[k]], of(first + changed[k])); },
                64);
            first += body.bins.list().size();
        }
    }
    /// The same if the lists of bins are others than before: takes over the sums of bins that kept their points; none the first time.
    void update(const Lattice<Body::dim>& lattice, const std::vector<Body>& bodies)
    {
        std::size_t bins = 0;
        for (const Body& body : bodies)
            bins += body.bins.list().size();
        before_.swap(sums_);
        sums_.resize(bins * numbers);
        std::size_t first = 0, first_before = 0;
        for (const Body& body : bodies)
        {
            parallel_for(body.bins.list().size(),
                         [&](std::size_t b) TESTBED_FLATTEN
                         {
                             if (const auto old = body.bins.unchanged(b); old && !before_.empty())
                                 std::copy_n(&before_[(first_before + *old) * numbers], numbers, of(first + b));
                             else
                                 sum_bin<Support, Sums>(lattice, body, body.bins.list()[b], of(first + b));
                         });
            first += body.bins.list().size();
            first_before += body.bins.size_before();
        }
    }
    std::size_t bytes() const { return (sums_.capacity() + before_.capacity()) * sizeof(double); }

private:
    std::vector<double> sums_, before_;
};
}  // namespace testbed
