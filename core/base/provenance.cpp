#include "core/base/provenance.hpp"

#include <chrono>
#include <cstdlib>
#include <fmt/chrono.h>
#include <fstream>

namespace testbed
{
std::string cpu_name()
{
    std::ifstream info("/proc/cpuinfo");
    for (std::string line; std::getline(info, line);)
        if (line.rfind("model name", 0) == 0)
            return line.substr(line.find(':') + 2);
    return "unknown";
}

double load_average()
{
    double load[1] = {0};
    return getloadavg(load, 1) == 1 ? load[0] : 0;
}

int others_running()
{
    std::ifstream file("/proc/loadavg");
    double minutes = 0;
    int running = 0;
    for (int k = 0; k < 3; ++k)
        file >> minutes;
    return file >> running ? running - 1 : -1;
}

std::string time_stamp()
{
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}
}  // namespace testbed
