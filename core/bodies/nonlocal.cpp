#include "core/bodies/nonlocal.hpp"

#include "core/lattice/nodes.hpp"

namespace testbed
{
double nonlocal_weight(const NonlocalSpec& spec, double r)
{
    const double s = r / spec.internal_length;
    return (spec.weight == NonlocalSpec::Weight::gauss ? 1 : s) * std::exp(-s * s);
}

NonlocalStrain::NonlocalStrain(const Scene& scene, double cell_size)
{
    const NonlocalSpec* spec = nullptr;
    for (const BodySpec& body : scene.bodies)
    {
        const auto& softening = scene.material(body.material).softening;
        over_nonlocal_.push_back(softening && softening->nonlocal ? softening->nonlocal->over_nonlocal : 0);
    }
    for (const MaterialSpec& material : scene.materials)
        if (material.softening && material.softening->nonlocal)
            spec = &*material.softening->nonlocal;
    reach_ = static_cast<int>(std::ceil(3 * spec->internal_length / cell_size));  // the weight falls to 1e-4
    // a Gaussian is exp(-x^2/l^2) exp(-y^2/l^2)
    if (spec->weight == NonlocalSpec::Weight::gauss)
        for (int i = -reach_; i <= reach_; ++i)
            along_.push_back(nonlocal_weight(*spec, cell_size * std::abs(i)));
    else
        for (int j = -reach_; j <= reach_; ++j)
            for (int i = -reach_; i <= reach_; ++i)
                weight_.push_back(nonlocal_weight(*spec, cell_size * std::hypot(i, j)));
}

void NonlocalStrain::resize(std::size_t stride, std::size_t entities)
{
    stride_ = stride;
    filled_.clear();
    volume_.assign(entities + 2 * padding(), 0.0);
    strain_.assign(entities + 2 * padding(), 0.0);
    mean_.assign(entities, 0.0);
    if (along_.empty())
        return;
    row_volume_.assign(entities + 2 * padding(), 0.0);
    row_strain_.assign(entities + 2 * padding(), 0.0);
}

void NonlocalStrain::collect(const Gather& gather)
{
    const std::size_t offset = padding();
    for (const auto e : filled_)
        volume_[e + offset] = strain_[e + offset] = 0;
    filled_ = gather.active();
    gather.sum<2>(partial_,
                  [&](std::size_t e, const std::array<double, 2>& s)
                  {
                      volume_[e + offset] = s[0];
                      strain_[e + offset] = s[1];
                  });
}

void NonlocalStrain::average_by_directions(const std::vector<std::uint32_t>& active)
{
    const std::size_t offset = padding(), rows = mean_.size() / stride_, width = along_.size();
    const auto reach = static_cast<std::size_t>(reach_);
    parallel_for(
        rows,
        [&](std::size_t row) TESTBED_NOINLINE
        {
            std::vector<double> between(2 * (stride_ + 2 * reach) + pack_size, 0.0);  // zeros beyond the ends of the row
            double *volume = between.data() + reach, *strain = volume + stride_ + 2 * reach;
            std::copy_n(&volume_[offset + row * stride_], stride_, volume);
            std::copy_n(&strain_[offset + row * stride_], stride_, strain);
            for_each_pack(0, stride_,
                          [&](std::size_t c, const auto& lanes)
                          {
                              Pack v(0.0), s(0.0);
                              for (std::size_t i = 0; i < width; ++i)
                              {
                                  const Pack w(along_[i]);
                                  v += w * lanes.load(volume + c + i - reach);
                                  s += w * lanes.load(strain + c + i - reach);
                              }
                              lanes.store(&row_volume_[offset + row * stride_ + c], v);
                              lanes.store(&row_strain_[offset + row * stride_ + c], s);
                          });
        },
        8);
    for_each_run(runs_of(active, stride_),
                 [&](const Run& run) TESTBED_NOINLINE
                 {
                     for_each_pack(run.begin, run.begin + run.count,
                                   [&](std::size_t e, const auto& lanes)
                                   {
                                       Pack v(0.0), s(0.0);
                                       for (std::size_t j = 0; j < width; ++j)
                                       {
                                           const std::size_t other = e + offset + j * stride_ - reach * stride_;
                                           const Pack w(along_[j]);
                                           v += w * lanes.load(&row_volume_[other]);
                                           s += w * lanes.load(&row_strain_[other]);
                                       }
                                       Pack mean = s / v;
                                       stdx::where(!(v > Pack(0.0)), mean) = Pack(0.0);
                                       lanes.store(&mean_[e], mean);
                                   });
                 });
}

/// Entities are numbered row by row; a row of the weight stops at the ends of the lattice's row.
void NonlocalStrain::average_by_distance(const std::vector<std::uint32_t>& active)
{
    const int stride = static_cast<int>(stride_), width = 2 * reach_ + 1;
    const std::size_t offset = padding();
    parallel_for(active.size(),
                 [&](std::size_t a)
                 {
                     const std::size_t e = active[a];
                     const int column = static_cast<int>(e % stride_);
                     const int from = std::max(-reach_, -column), to = std::min(reach_, stride - 1 - column);
                     Pack volume(0.0), strain(0.0);
                     const auto count = static_cast<std::size_t>(to - from + 1);
                     for (int j = -reach_; j <= reach_; ++j)
                     {
                         const double* weight = &weight_[static_cast<std::size_t>((j + reach_) * width + reach_ + from)];
                         const auto other = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(e + offset) + j * stride + from);
                         for_each_pack(0, count,
                                       [&](std::size_t i, const auto& lanes)
                                       {
                                           const Pack w = lanes.keep(lanes.load(weight + i));
                                           volume += w * lanes.load(&volume_[other + i]);
                                           strain += w * lanes.load(&strain_[other + i]);
                                       });
                     }
                     const double total = sum(volume);
                     mean_[e] = total > 0 ? sum(strain) / total : 0;
                 });
}
}  // namespace testbed
