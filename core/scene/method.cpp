#include "core/scene/method.hpp"

#include "core/scene/scene.hpp"

#include <algorithm>

namespace testbed
{
std::vector<std::string> variant_names()
{
    std::vector<std::string> names;
    for (const Method& method : methods())
        for (const Variant& variant : method.variants)
            names.push_back(variant.name);
    return names;
}

const Method& find_method(const std::string& variant)
{
    for (const Method& method : methods())
        if (std::any_of(method.variants.begin(), method.variants.end(), [&](const Variant& v) { return v.name == variant; }))
            return method;
    throw SceneError("no method '" + variant + "'");
}

const Variant& find_variant(const std::string& name)
{
    const auto& all = find_method(name).variants;
    return *std::find_if(all.begin(), all.end(), [&](const Variant& v) { return v.name == name; });
}

const Method& method_of(const Scene& scene)
{
    return find_method(scene.method);
}

Traits traits_of(const Scene& scene)
{
    return method_of(scene).traits(scene);
}
}  // namespace testbed
