#pragma once
/// What `testbed bench` runs: scenes from their cases' files, scaled to a number of points.

#include <optional>
#include <span>
#include <string>
#include <vector>

namespace testbed
{
struct BenchScene
{
    const char *name, *file, *law;  ///< the file under benchmarks/
    /// Settings for about so many points with so many per cell in each direction.
    std::vector<std::string> (*settings)(double points, int points_per_cell);
    double begin = 0;  ///< steps up to here are not measured: what flows does so from then on [s]
    /// As its study runs it; none for scenes of any size.
    struct Own
    {
        double points;
        int points_per_cell;
    };
    std::optional<Own> own;
};

std::span<const BenchScene> bench_scenes();
std::vector<std::string> bench_scene_names();
}  // namespace testbed
