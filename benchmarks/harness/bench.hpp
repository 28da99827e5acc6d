#pragma once
/// Speed of the particle methods on this machine, in one process: particle-steps per second beside the bandwidth of the memory.

#include "core/run/run.hpp"

namespace testbed
{
struct BenchOptions
{
    std::vector<std::string> methods, scenes, laws;  ///< all when empty
    std::vector<double> points;                      ///< 300 to 1e6 when empty, or as the scene's study has it
    std::vector<int> points_per_cell;                ///< in each direction; 4 and 2 when empty, or as the scene's study has it
    std::vector<int> threads;                        ///< 1 and all when empty
    double seconds = 1;                              ///< of each measurement, about
    std::string output;                              ///< CSV file; none when empty
};

/// Prints a table and writes the CSV file as it goes, a row per measurement; a run that diverges is told. @throws SceneError, OutputError
void bench(const BenchOptions& options);
}  // namespace testbed
