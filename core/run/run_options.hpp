#pragma once
/// Command lines of the programs that run scenes: `testbed run` hands its own on to `testbed-fem` unchanged.

#include "core/run/run.hpp"

#include <CLI/CLI.hpp>

namespace testbed
{
/// The settings of a scene.
inline void add_settings(CLI::App& command, RunOptions& options)
{
    command.add_option("--method", options.method, "method variant, see `testbed list`");
    command.add_option("--set", options.overrides, "override a key: path.to.key=value; list entries by number or name")
        ->allow_extra_args(false);
    command.add_flag("--strict", options.strict, "warnings are errors, and a run that is not sound exits with 5");
}

/// Which scene, with which settings.
inline void add_scene_options(CLI::App& command, RunOptions& options)
{
    command.add_option("scene", options.scene, "scene file (TOML)")->required();
    add_settings(command, options);
}

inline void add_run_options(CLI::App& command, RunOptions& options)
{
    CLI::Option* scene = command.add_option("scene", options.scene, "scene file (TOML)");
    command.add_option("--restart", options.restart, "go on from this restart file; end, output and threads may be others than before");
    command.callback(
        [scene, &options]
        {
            if (scene->empty() && options.restart.empty())
                throw CLI::RequiredError("scene, or --restart FILE,");
        });
    add_settings(command, options);
    command.add_option("-o,--output", options.output, "result file (default CASE_METHOD.h5)");
    command.add_option("--threads", options.threads, "OpenMP threads; the result does not depend on it")->check(CLI::Range(1, 1024));
    command.add_flag("--quiet", options.quiet, "no progress, no summary");
    command.add_flag("--diagnose", options.diagnose, "run a failed or suspect scene once more with the remedy, to see whether it holds");
}
}  // namespace testbed
