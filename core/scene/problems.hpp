#pragma once
/// What is wrong with a scene, and where it stands in the file.

#include "core/base/shown.hpp"
#include "core/scene/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <functional>

// in a header-only build with assertions the parser would abort at a key that begins with no letter, where it goes on to say so
#ifndef TOML_ASSERT
#define TOML_ASSERT(expression) static_cast<void>(0)
#endif
#include <toml++/toml.h>

namespace testbed
{
/// Collects problems, and remembers where each key stands.
class Problems
{
public:
    explicit Problems(std::string file) : file_(std::move(file)) {}

    void remember(const std::string& key, const toml::node& node) { position_[key] = node.source().begin; }
    void add(const std::string& key, const std::string& message)
    {
        ++count_;
        if (errors_.size() < most)
            errors_.push_back(format(key, message));
    }
    void warn(const std::string& key, const std::string& message) { warnings_.push_back(format(key, message)); }
    const std::vector<std::string>& errors() const { return errors_; }
    /// All errors, each on a line of its own; of many the first.
    std::string text() const
    {
        return fmt::format("{}{}", fmt::join(errors_, "\n"),
                           count_ > errors_.size() ? fmt::format("\nand {} more", count_ - errors_.size()) : "");
    }
    const std::vector<std::string>& warnings() const { return warnings_; }

private:
    static constexpr std::size_t most = 50;

    std::string format(const std::string& whole_key, const std::string& whole_message) const
    {
        const std::string key = shown(whole_key), message = shown(whole_message, 800);
        for (std::string known = whole_key; !known.empty(); known = parent(known))
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
    std::size_t count_ = 0;  ///< of errors, told or not
};

/// "; did you mean ...?", or the list of what is known.
inline std::string suggestion(const std::string& word, const std::vector<std::string>& candidates)
{
    const auto near = nearest(word, candidates);
    return near ? fmt::format("; did you mean '{}'?", *near) : fmt::format("; known: {}", fmt::join(candidates, ", "));
}

/// Checks what one key cannot tell: ranges, names, geometry. Warnings need a scene that is right. Defined in check.cpp.
void check_scene(const Scene& scene, const SceneBounds& bounds, Problems& problems);
/// The part that concerns materials, in check_materials.cpp. @param key (k) -> what the file calls material number k
void check_materials(const Scene& scene, Problems& problems, const std::function<std::string(std::size_t)>& key);
/// What no computer holds, or no double can: the number of points and steps, and what follows from the numbers of a scene that is right in
/// every single one. Defined in bounds.cpp.
void check_bounds(const Scene& scene, Problems& problems);
void check_limits(const Scene& scene, Problems& problems);
/// For methods that do, from their warn().
void warn_of_locking(const Scene& scene, Problems& problems);
}  // namespace testbed
