#pragma once
/// Where a number comes from: the state of the sources and of the machine.

#include <string>

namespace testbed
{
struct Build
{
    const char *version, *commit, *compiler, *flags, *type;
};
/// Made by the build itself.
const Build& build();

std::string cpu_name();
double load_average();     ///< over one minute
int others_running();      ///< threads beside this one that run or wait for a core, now; -1 if not known
std::string time_stamp();  ///< now, ISO 8601, UTC
}  // namespace testbed
