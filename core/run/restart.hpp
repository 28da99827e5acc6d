#pragma once
/// The restart file: the state of a run between two steps, with the scene and what was written so far (docs/file_formats.md).

#include "core/lattice/archive.hpp"
#include "core/run/results.hpp"
#include "core/scene/scene.hpp"

namespace testbed
{
/// Where the restart file of a result stands: RESULT.restart.h5.
std::filesystem::path restart_path(const std::filesystem::path& result);

/// What a restart file holds, but for the snapshots.
struct Restart
{
    std::filesystem::path path;
    std::string scene_path, scene_text;  ///< of the scene that ran: its file, and the resolved scene
    State state;
};
/// Writes the file whole or not at all. @param result whose snapshots so far go with it @throws OutputError
void write_restart(const Restart& restart, const ResultFile& result);
/// @throws SceneError for a file that cannot be read, is damaged, is no restart file or is one of another version
Restart read_restart(const std::filesystem::path& path);

/// The scene of the restart file, with other settings, or if one is named the scene that it must agree with in all but end, wall clock
/// limit and output. @throws SceneError with the first line in which they differ
LoadedScene load_restarted_scene(const Restart& restart, const std::string& scene, const std::string& method,
                                 const std::vector<std::string>& overrides);
}  // namespace testbed
