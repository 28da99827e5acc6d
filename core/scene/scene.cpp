#include "core/scene/scene.hpp"

#include "core/scene/reader.hpp"

#include <cctype>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <set>

namespace testbed
{
namespace
{
constexpr int deepest_key = 16;

/// The line of the first key with more parts than a scene can have, 0 if there is none: the parser makes a table of each part, and tables
/// in tables are taken down by recursion.
int line_of_deep_key(std::string_view text)
{
    int line = 1, dots = 0;
    for (std::size_t k = 0; k < text.size(); ++k)
    {
        const char c = text[k];
        if (c == '"' || c == '\'')
        {
            const bool multiline = text.substr(k, 3) == std::string(3, c);
            const std::string_view mark = multiline ? text.substr(k, 3) : text.substr(k, 1);
            for (k += mark.size(); k < text.size() && text.substr(k, mark.size()) != mark && (multiline || text[k] != '\n'); ++k)
            {
                line += text[k] == '\n';
                k += c == '"' && text[k] == '\\';
            }
            if (k < text.size() && text[k] == '\n')
                --k;
            else
                k += mark.size() - 1;
        }
        else if (c == '#')
            while (k + 1 < text.size() && text[k + 1] != '\n')
                ++k;
        else if (c == '.')
        {
            if (++dots > deepest_key)
                return line;
        }
        else if (std::string_view("\n=,[]{}").find(c) != std::string_view::npos)
            dots = 0;
        line += k < text.size() && text[k] == '\n';
    }
    return 0;
}

/// Whether a path is that of a constant which the scene does not have: set it would change nothing.
bool is_unknown_constant(const toml::table& root, const std::string& path, Problems& problems)
{
    const std::string table = "constants.";
    if (!path.starts_with(table))
        return false;
    const std::string name = path.substr(table.size());
    std::vector<std::string> names;
    if (const toml::table* constants = root["constants"].as_table())
        for (const auto& [key, value] : *constants)
            names.emplace_back(key.str());
    const bool is_unknown = std::find(names.begin(), names.end(), name) == names.end();
    if (is_unknown)
        problems.add("--set " + path, fmt::format("the scene has no constant '{}'", name) + suggestion(name, names));
    return is_unknown;
}

void set_override(toml::table& root, const std::string& assignment, Problems& problems)
{
    const auto equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0)
        return problems.add("--set " + assignment, "write --set key.path=value");
    const std::string path = assignment.substr(0, equals), text = assignment.substr(equals + 1);
    if (std::count(path.begin(), path.end(), '.') > deepest_key)
        return problems.add("--set " + path, fmt::format("a key of more than {} parts", deepest_key));
    if (is_unknown_constant(root, path, problems))
        return;
    toml::table value;
    try
    {
        value = parse_toml("v = " + text, "--set");
    }
    catch (const SceneError&)
    {
        value.insert_or_assign("v", text);  // a bare word is a string
    }
    // without a source position: messages then say that the value came by --set
    const auto insert = [&](toml::table& into, const std::string& key)
    { value.get("v")->visit([&](auto&& node) { into.insert_or_assign(key, node); }); };
    toml::table* table = &root;
    std::size_t begin = 0;
    while (true)
    {
        const auto dot = path.find('.', begin);
        const std::string key = path.substr(begin, dot - begin);
        if (dot == std::string::npos)
            return insert(*table, key);
        begin = dot + 1;
        toml::node* next = table->get(key);
        if (next && next->is_array())
        {
            const auto end = path.find('.', begin);
            const std::string which = path.substr(begin, end - begin);
            toml::table* chosen = nullptr;
            auto& array = *next->as_array();
            for (std::size_t k = 0; k < array.size(); ++k)
                if (toml::table* entry = array[k].as_table();
                    entry && (which == std::to_string(k) || (*entry)["name"].value<std::string>() == which))
                    chosen = entry;
            if (!chosen || end == std::string::npos)
                return problems.add("--set " + path, fmt::format("no entry '{}' in the list '{}'", which, key));
            table = chosen;
            begin = end + 1;
        }
        else
        {
            if (!next)
                next = &table->insert_or_assign(key, toml::table{}).first->second;
            if (!next->is_table())
                return problems.add("--set " + path, fmt::format("'{}' is not a table", key));
            table = next->as_table();
        }
    }
}
/// The words of all texts, in which constants may stand.
void collect_words(const toml::node& node, std::set<std::string, std::less<>>& words)
{
    const auto is_of_word = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
    if (const toml::table* table = node.as_table())
        for (const auto& [key, value] : *table)
            collect_words(value, words);
    else if (const toml::array* array = node.as_array())
        for (const toml::node& value : *array)
            collect_words(value, words);
    else if (const auto* text = node.as_string())
        for (auto begin = (*text)->begin(), end = begin; begin != (*text)->end(); begin = end)
        {
            begin = std::find_if(begin, (*text)->end(), is_of_word);
            end = std::find_if_not(begin, (*text)->end(), is_of_word);
            words.emplace(begin, end);
        }
}

/// Most often a typing error in the expression that was to use it.
void warn_of_unused_constants(const toml::table& root, Problems& problems)
{
    const toml::table* constants = root["constants"].as_table();
    if (!constants)
        return;
    std::set<std::string, std::less<>> words;
    collect_words(root, words);
    for (const auto& [name, value] : *constants)
        if (!words.contains(name.str()))
            problems.warn("constants." + std::string(name.str()), "no expression uses it");
}
}  // namespace

std::string read_text(const std::string& path)
{
    constexpr std::size_t largest = 16 << 20;
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored))
        throw SceneError(fmt::format("{}: is a folder, not a file", path));
    std::ifstream file(path, std::ios::binary);
    if (!file)
        throw SceneError(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
    std::string text;
    for (std::array<char, 65536> part; text.size() <= largest && (file.read(part.data(), part.size()), file.gcount() > 0);)
        text.append(part.data(), static_cast<std::size_t>(file.gcount()));
    if (file.bad())
        throw SceneError(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
    if (text.size() > largest)
        throw SceneError(fmt::format("{}: is larger than 16 MB: no scene", path));
    return text;
}

toml::table parse_toml(const std::string& text, const std::string& path)
{
    if (const int line = line_of_deep_key(text); line > 0)
        throw SceneError(fmt::format("{}:{}: a key of more than {} parts", path, line, deepest_key));
    try
    {
        return toml::parse(text, path);
    }
    catch (const toml::parse_error& e)
    {
        const auto at = e.source().begin;
        throw SceneError(fmt::format("{}:{}:{}: not TOML: {}", path, at.line, at.column, shown(e.description(), 500)));
    }
}

Scene::Scene()
{
    for (const Method& m : methods())
        method_options.push_back(m.options);
}

const MaterialSpec& Scene::material(const std::string& name) const
{
    return *std::find_if(materials.begin(), materials.end(), [&](const auto& m) { return m.name == name; });
}

const BodySpec& Scene::body(const std::string& name) const
{
    return *std::find_if(bodies.begin(), bodies.end(), [&](const auto& b) { return b.name == name; });
}

bool Scene::may_flow() const
{
    return std::any_of(bodies.begin(), bodies.end(), [&](const BodySpec& body) { return material(body.material).has_strength(); });
}

std::string Scene::case_name() const
{
    const auto file = std::filesystem::absolute(path).lexically_normal();
    const std::string folder = file.parent_path().filename().string(), own = file.stem().string();
    return own == "scene" ? folder : folder + "-" + own;
}

Constants Scene::expression_constants() const
{
    Constants all = constants;
    all.emplace_back("L", grid.cell_size);
    return all;
}

std::optional<std::string> nearest(const std::string& word, const std::vector<std::string>& candidates)
{
    const auto distance = [](const std::string& a, const std::string& b)
    {
        std::vector<std::size_t> row(b.size() + 1);
        for (std::size_t j = 0; j <= b.size(); ++j)
            row[j] = j;
        for (std::size_t i = 1; i <= a.size(); ++i)
        {
            std::size_t diagonal = row[0];
            row[0] = i;
            for (std::size_t j = 1; j <= b.size(); ++j)
            {
                const std::size_t above = row[j];
                row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
                diagonal = above;
            }
        }
        return row[b.size()];
    };
    std::optional<std::string> best;
    if (word.size() > 100)
        return best;
    std::size_t least = std::max<std::size_t>(2, word.size() / 3) + 1;
    for (const auto& c : candidates)
        if (const std::size_t d = distance(word, c); d < least)
        {
            least = d;
            best = c;
        }
    return best;
}

LoadedScene load_scene(const std::string& path, const std::string& method, const std::vector<std::string>& overrides)
{
    return load_scene_text(read_text(path), path, method, overrides);
}

LoadedScene load_scene_text(const std::string& text, const std::string& path, const std::string& method,
                            const std::vector<std::string>& overrides, const SceneBounds& bounds)
{
    Problems problems(path);
    const auto throw_if_any = [&]
    {
        if (!problems.errors().empty())
            throw SceneError(problems.text());
    };
    toml::table root = parse_toml(text, path);
    for (const auto& assignment : overrides)
        set_override(root, assignment, problems);
    if (!method.empty())
        root.insert_or_assign("method", method);
    throw_if_any();

    LoadedScene loaded;
    Scene& scene = loaded.scene;
    scene.path = path;
    const std::string name = root["method"].value_or(scene.method);
    const std::vector<std::string> names = variant_names();
    if (const toml::node* node = root.get("method"))
        problems.remember("method", *node);
    if (std::find(names.begin(), names.end(), name) == names.end())
        problems.add("method", fmt::format("no method '{}'", name) + suggestion(name, names));
    else
        find_variant(name).apply(scene);

    Constants constants;
    const auto cell_size = root["grid"]["cell_size"].value<double>();
    if (cell_size)
        constants.emplace_back("L", *cell_size);
    {
        Reader reader(root, "", problems, constants);
        scene.describe(reader);
    }
    throw_if_any();
    check_scene(scene, bounds, problems);
    throw_if_any();
    check_bounds(scene, problems);
    throw_if_any();
    for (BodySpec& body : scene.bodies)
        if (!body.inside.empty())
            body.points_per_cell = scene.body(body.inside).points_per_cell;
    check_limits(scene, problems);
    warn_of_unused_constants(root, problems);
    throw_if_any();
    loaded.warnings = problems.warnings();
    return loaded;
}
}  // namespace testbed
