#include "core/scene/method.hpp"
#include "fem_reference/method.hpp"
#include "lpfdm/lpfdm.hpp"
#include "mpm/mpm.hpp"

namespace testbed
{
/// A row for each method.
const std::vector<Method>& methods()
{
    static const std::vector<Method> rows{lpfdm_method(make_lpfdm), mpm_method(make_mpm), fem_method()};
    return rows;
}
}  // namespace testbed
