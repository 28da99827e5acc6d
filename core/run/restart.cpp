#include "core/run/restart.hpp"

#include <fmt/format.h>
#include <sstream>

namespace testbed
{
namespace
{
/// The scene that ran. Messages name the lines of the resolved scene, for these were read.
LoadedScene scene_of(const Restart& restart, const std::string& method = "", const std::vector<std::string>& overrides = {})
{
    LoadedScene loaded = load_scene_text(restart.scene_text, restart.path.string() + " (resolved scene)", method, overrides);
    loaded.scene.path = restart.scene_path;
    return loaded;
}

/// The scene without what may differ.
std::string what_must_agree(Scene scene)
{
    scene.time.end = 0;
    scene.time.wall_clock_limit.reset();
    scene.output = {};
    return resolved_toml(scene);
}

void check_agreement(const Restart& restart, const Scene& scene)
{
    const Scene old = scene_of(restart).scene;
    std::istringstream before(what_must_agree(old)), now(what_must_agree(scene));
    for (std::string a, b;;)
    {
        const bool more = static_cast<bool>(std::getline(before, a)), more_now = static_cast<bool>(std::getline(now, b));
        if (!more && !more_now)
            return;
        if (more != more_now || a != b)
            throw SceneError(
                fmt::format("restart file '{}': the scene differs from the one that ran: '{}' there, '{}' here; only time.end, "
                            "time.wall_clock_limit, [output] and the number of threads may differ",
                            restart.path.string(), more ? a : "nothing", more_now ? b : "nothing"));
    }
}
}  // namespace

std::filesystem::path restart_path(const std::filesystem::path& result)
{
    return std::filesystem::path(result).replace_extension(".restart.h5");
}

LoadedScene load_restarted_scene(const Restart& restart, const std::string& scene, const std::string& method,
                                 const std::vector<std::string>& overrides)
{
    LoadedScene loaded = scene.empty() ? scene_of(restart, method, overrides) : load_scene(scene, method, overrides);
    check_agreement(restart, loaded.scene);
    return loaded;
}
}  // namespace testbed
