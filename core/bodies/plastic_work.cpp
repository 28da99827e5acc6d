#include "core/bodies/plastic_work.hpp"

namespace testbed
{
double plastic_work_per_shear(const Body& body, std::size_t p)
{
    return std::visit(
        [&](const auto& law)
        {
            if constexpr (requires { law.plastic_work_per_shear(body.points, p); })
                return law.plastic_work_per_shear(body.points, p);
            else
                return 0.0;
        },
        body.material);
}

double PlasticWork::add(const std::vector<Body>& bodies)
{
    for (const Body& body : bodies)
    {
        const Points<2>& q = body.points;
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
