/// Text of scenes: refused in words, or right: then its expressions are tried, its bodies and its supports made, and the resolved scene
/// is TOML.

#include "core/bodies/body.hpp"
#include "core/loads/node_ops.hpp"
#include "core/scene/reader.hpp"
#include "core/scene/trial.hpp"
#include "tests/fuzz/fuzz.hpp"

using namespace testbed;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::string text(reinterpret_cast<const char*>(data), size);
    try
    {
        const Scene scene = load_scene_text(text, "scene.toml", "", {}, {.points = 2000, .cells = 2000}).scene;
        const std::string resolved = resolved_toml(scene);
        try
        {
            parse_toml(resolved, "resolved");
        }
        catch (const SceneError& e)
        {
            fuzz::finding("the resolved scene is not TOML", std::string(e.what()) + "\n" + resolved);
        }
        variant_label(scene);
        try_expressions(scene);
        const Lattice<2> lattice = make_lattice(scene.grid);
        make_bodies(scene, lattice, {.box = true, .velocity = true});
        NodeOps(scene, lattice).begin_step({0, 1e-3, 1e-3});
    }
    catch (const SceneError& e)
    {
        fuzz::check_message(e.what());
    }
    catch (const ExpressionError& e)
    {
        fuzz::check_message(e.what());
    }
    catch (const Diverged& e)
    {
        fuzz::check_message(e.what());
    }
    return 0;
}
