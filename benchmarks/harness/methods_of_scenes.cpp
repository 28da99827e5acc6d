#include "fem_reference/method.hpp"
#include "lpfdm/lpfdm.hpp"
#include "mpm/mpm.hpp"

namespace testbed
{
/// All methods as scenes know them, for programs that run none of them.
const std::vector<Method>& methods()
{
    static const std::vector<Method> rows{lpfdm_method(), mpm_method(), fem_method()};
    return rows;
}
}  // namespace testbed
