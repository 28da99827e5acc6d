#include "core/bodies/plastic_work.hpp"

#include <algorithm>
#include <cmath>

namespace testbed
{
namespace
{
double sin_psi(const Material& material)
{
    return std::visit(
        [](const auto& law)
        {
            if constexpr (std::is_base_of_v<MohrCoulomb, std::remove_cvref_t<decltype(law)>>)
                return law.back.sin_psi();
            else
                return 0.0;
        },
        material);
}
}  // namespace

double plastic_work_per_shear(const Body& body, std::size_t p)
{
    const Points& q = body.points;
    const double mean = 0.5 * (q.sxx[p] + q.syy[p]), radius = std::hypot(0.5 * (q.sxx[p] - q.syy[p]), q.sxy[p]);
    const double szz = out_of_plane_stress(moduli(body.material), q, p);
    const double major = std::max(mean + radius, szz), minor = std::min(mean - radius, szz), sine = sin_psi(body.material);
    return 0.5 * (major * (1 + sine) - minor * (1 - sine));
}

double PlasticWork::add(const std::vector<Body>& bodies)
{
    for (const Body& body : bodies)
    {
        const Points& q = body.points;
        if (!q.plastic_shear.active())
            continue;
        for (std::size_t p = 0; p < q.count; ++p)
        {
            if (q.id[p] >= last_.size())
                last_.resize(q.id[p] + 1);
            Last& last = last_[q.id[p]];
            const Last now{q.plastic_shear[p], plastic_work_per_shear(body, p)};
            // the points are no longer in the order of the sample before, but each sum is the same for any number of threads
            total_ += 0.5 * (last.per_shear + now.per_shear) * (now.shear - last.shear) * q.current_volume(p);
            last = now;
        }
    }
    return total_;
}
}  // namespace testbed
