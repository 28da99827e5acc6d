/// Path files of `testbed point`: refused in words, or driven to an answer of finite numbers.

#include "core/run/point_driver.hpp"
#include "core/scene/scene.hpp"
#include "tests/fuzz/fuzz.hpp"

using namespace testbed;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::string text(reinterpret_cast<const char*>(data), size);
    try
    {
        const PointPathSpec spec = read_point_path(text, "path.toml");
        int steps = 0;
        for (const SegmentSpec& segment : spec.segments)
            steps += segment.steps;
        if (steps > 40)
            return 0;  // right, and takes its time
        const std::string answer = drive_point(spec, "path.toml");
        const std::string numbers = answer.substr(answer.find('\n'));
        if (numbers.find("nan") != std::string::npos || numbers.find("inf") != std::string::npos)
            fuzz::finding("a number that is none", numbers);
    }
    catch (const SceneError& e)
    {
        fuzz::check_message(e.what());
    }
    return 0;
}
