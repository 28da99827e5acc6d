#pragma once
/// What is wrong with a scene, and where it stands in the file.

#include "core/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>
#include <toml++/toml.h>

namespace testbed
{
/// Collects problems, and remembers where each key stands.
class Problems
{
public:
    explicit Problems(std::string file) : file_(std::move(file)) {}

    void remember(const std::string& key, const toml::node& node) { position_[key] = node.source().begin; }
    void add(const std::string& key, const std::string& message) { errors_.push_back(format(key, message)); }
    void warn(const std::string& key, const std::string& message) { warnings_.push_back(format(key, message)); }
    const std::vector<std::string>& errors() const { return errors_; }
    const std::vector<std::string>& warnings() const { return warnings_; }

private:
    std::string format(const std::string& key, const std::string& message) const
    {
        for (std::string known = key; !known.empty(); known = parent(known))
            if (const auto found = position_.find(known); found != position_.end())
            {
                if (found->second.line == 0)
                    return fmt::format("{} (by --set): {}: {}", file_, key, message);
                return fmt::format("{}:{}:{}: {}: {}", file_, found->second.line, found->second.column, key, message);
            }
        return fmt::format("{}: {}: {}", file_, key, message);
    }
    static std::string parent(const std::string& key)
    {
        const auto dot = key.find_last_of(".[");
        return dot == std::string::npos ? "" : key.substr(0, dot);
    }

    std::string file_;
    std::map<std::string, toml::source_position> position_;
    std::vector<std::string> errors_, warnings_;
};

/// "; did you mean ...?", or the list of what is known.
inline std::string suggestion(const std::string& word, const std::vector<std::string>& candidates)
{
    const auto near = nearest(word, candidates);
    return near ? fmt::format("; did you mean '{}'?", *near) : fmt::format("; known: {}", fmt::join(candidates, ", "));
}

/// Checks what one key cannot tell: ranges, names, geometry. Warnings need a scene that is right. Defined in scene_check.cpp.
void check_scene(const Scene& scene, Problems& problems);
/// The part that concerns materials. @param key (k) -> what the file calls material number k
void check_materials(const Scene& scene, Problems& problems, const std::function<std::string(std::size_t)>& key);
void check_limits(const Scene& scene, Problems& problems);
}  // namespace testbed
