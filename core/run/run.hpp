#pragma once
/// The run of one scene: load, step, watch, write.

#include "core/run/solver.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace testbed
{
/// Exit codes of the programs.
enum class ExitCode
{
    completed = 0,
    bad_scene = 1,
    diverged = 2,
    time_limit = 3,
    internal = 4,
    suspect = 5,  ///< completed, but not sound; with RunOptions::strict only
    interrupted = 130
};

struct RunOptions
{
    std::string scene, method, output;
    std::string restart;  ///< file to go on from; the scene is then its own, unless one is named
    std::vector<std::string> overrides;
    int threads = 1;
    bool quiet = false;
    bool strict = false;    ///< warnings are errors, and so is a suspect run
    bool diagnose = false;  ///< a failed or suspect run is run once more with the remedy that was found
};

/// The scene that the options mean. @throws SceneError
LoadedScene load(const RunOptions& options);
/// Loads the scene, says its warnings on stderr. @throws SceneError, also for a warning if strict
Scene load_and_warn(const RunOptions& options);

/// What is found out after loading: on stderr. @throws SceneError if strict
void warn(const RunOptions& options, const std::string& warning);

/// Runs the scene and writes the result file and its XDMF. Talk goes to stderr.
/// @throws SceneError before anything is written, OutputError
ExitCode run_scene(const RunOptions& options, const MakeSolver& make_solver);

/// Runs a program's body; what it throws becomes a message on stderr and an exit code.
int guarded_main(const std::function<int()>& body);

/// Name of the result file if none is given: CASE_VARIANT.h5 in the working directory.
std::string default_output(const Scene& scene);
}  // namespace testbed
