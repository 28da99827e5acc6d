#pragma once
/// Speed of the particle methods on this machine, in one process: particle-steps per second beside the bandwidth of the memory.

#include "core/run/run.hpp"

namespace testbed
{
struct BenchOptions
{
    std::vector<std::string> methods, laws;  ///< all when empty
    std::vector<double> points{1e4, 1e5, 1e6, 4e6};
    std::vector<int> threads;  ///< 1 and all when empty
    double seconds = 1;        ///< of each measurement, about
    std::string output;        ///< CSV file; none when empty
};

/// Prints a table and writes the CSV file as it goes, a row per measurement; a run that diverges is told. @throws SceneError, OutputError
void bench(const BenchOptions& options);
}  // namespace testbed
