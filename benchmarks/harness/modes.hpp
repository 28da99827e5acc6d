#pragma once
/// `testbed modes`: what small disturbances of a state do in the steps that a method really makes.

#include "core/run/run.hpp"

#include <optional>

namespace testbed
{
struct ModesOptions
{
    RunOptions scene;                 ///< scene, method, overrides, output (.h5, .csv or .png), strict
    double at = 0;                    ///< time of the state; at least one step is made, so that the leap-frog is started [s]
    int steps = 1;                    ///< of the map
    int top = 6;                      ///< modes that are shown of each sort
    std::optional<double> frequency;  ///< of a mode that is sought, the exact one [Hz]
    double tolerance = 1e-6;          ///< growth in the map that is not yet called unstable
    bool leave_out_critical = false;
    bool json = false;
};

/// Prints the modes, writes them to a file if one is asked for. Returns the pair (file of modes, picture to be drawn) if that is a .png.
/// @throws SceneError, also for a state of too many unknowns
std::optional<std::pair<std::string, std::string>> modes(const ModesOptions& options);
}  // namespace testbed
