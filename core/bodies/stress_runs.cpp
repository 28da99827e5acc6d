#include "core/bodies/stress_runs.hpp"

namespace testbed
{
namespace
{
template <class Law>
TESTBED_FLATTEN void update(const Law& law, Points<2>& q, std::size_t begin, std::size_t end, const Increments& increments)
{
    for_each_pack(begin, end,
                  [&](std::size_t p, const auto& lanes) TESTBED_INLINE { law.update(q, p, lanes, increments.load(p - begin, lanes)); });
}
}  // namespace

void update_stress(Body& body, std::size_t begin, std::size_t end, const Increments& increments)
{
    std::visit([&](const auto& law) { update(law, body.points, begin, end, increments); }, body.material);
}
}  // namespace testbed
