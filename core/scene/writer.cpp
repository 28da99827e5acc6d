#include "core/scene/writer.hpp"

#include "core/scene/problems.hpp"

#include <algorithm>

namespace testbed
{
std::string resolved_toml(const Scene& scene)
{
    Scene copy = scene;
    Writer writer;
    copy.describe(writer);
    return writer.text();
}

std::string scene_documentation(const std::string& table)
{
    Scene scene;
    Documentation documentation(table);
    scene.describe(documentation);
    if (documentation.text.empty())
        throw SceneError(fmt::format("no table '{}' in a scene", table) + suggestion(table, documentation.names));
    return documentation.text;
}

std::string variant_label(const Scene& scene)
{
    const Variant& variant = find_variant(scene.method);
    const auto number = static_cast<std::size_t>(&method_of(scene) - methods().data());
    Scene preset;
    variant.apply(preset);
    const auto lines = [&](Scene s)
    {
        Writer writer;
        s.method_options[number].describe(writer);
        std::vector<std::string> out;
        const std::string text = writer.text();
        for (std::size_t begin = 0; begin < text.size();)
        {
            const auto end = text.find('\n', begin);
            out.push_back(text.substr(begin, end - begin));
            begin = end + 1;
        }
        return out;
    };
    const auto asked = lines(scene), given = lines(preset);
    std::vector<std::string> changed;
    for (std::size_t k = 0; k < asked.size(); ++k)
        if (asked[k] != given[k])
        {
            std::string change = asked[k];
            change.erase(std::remove_if(change.begin(), change.end(), [](char c) { return c == ' ' || c == '"'; }), change.end());
            changed.push_back(change);
        }
    return changed.empty() ? variant.name : fmt::format("{}[{}]", variant.name, fmt::join(changed, ";"));
}
}  // namespace testbed
