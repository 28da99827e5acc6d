#pragma once
/// The reading archive of the scene's describe() functions.

#include "core/scene/value_reader.hpp"

#include <algorithm>
#include <set>

namespace testbed
{
/// The text of a scene or a path file. @throws SceneError if it cannot be read, or is larger than any such file
std::string read_text(const std::string& path);
/// @param path what messages call the text @throws SceneError with the place where it is not TOML
toml::table parse_toml(const std::string& text, const std::string& path);

inline bool is_identifier(std::string_view name)
{
    const auto letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; };
    return !name.empty() && letter(name[0]) &&
           std::all_of(name.begin(), name.end(), [&](char c) { return letter(c) || (c >= '0' && c <= '9'); });
}

/// Reads one table strictly.
class Reader
{
public:
    Reader(const toml::table& table, std::string path, Problems& problems, Constants& constants)
        : table_(table),
          path_(std::move(path)),
          problems_(problems),
          constants_(constants),
          values_(problems, constants)
    {
    }
    Reader(const Reader&) = delete;
    Reader& operator=(const Reader&) = delete;
    ~Reader()
    {
        for (const auto& [key, node] : table_)
        {
            const std::string name(key.str());
            if (std::find(known_.begin(), known_.end(), name) != known_.end())
                continue;
            problems_.remember(full(name), node);
            problems_.add(full(name), "unknown key" + suggestion(name, known_));
        }
    }

    template <class T>
    void optional(const char* key, T& value, const char*, const char*)
    {
        if (const toml::node* node = find(key))
            values_.read(full(key), *node, value);
    }
    /// A number, or one word that stands for something else.
    void number_or(const char* key, std::optional<double>& value, const char* word, bool& is_word, const char* unit, const char* doc)
    {
        const toml::node* node = find(key);
        is_word = node && node->value_exact<std::string>() == word;
        if (!is_word)
            optional(key, value, unit, doc);
    }
    template <class T>
    void required(const char* key, T& value, const char* unit, const char* doc)
    {
        if (!find(key))
            problems_.add(full(key), fmt::format("missing ({})", doc));
        optional(key, value, unit, doc);
    }
    template <Choice E>
    void choice(const char* key, E& value, const char*)
    {
        const toml::node* node = find(key);
        if (!node)
            return;
        const auto text = node->value_exact<std::string>();
        if (!text)
            return problems_.add(full(key), "a string is asked, not a " + kind_of(*node));
        if (const auto found = find_choice<E>(*text))
            value = *found;
        else
            problems_.add(full(key), fmt::format("'{}' is not a choice", *text) + suggestion(*text, names_of<E>()));
    }
    template <Choice E>
    void required_choice(const char* key, E& value, const char* doc)
    {
        if (!find(key))
            problems_.add(full(key), fmt::format("missing ({})", doc));
        choice(key, value, doc);
    }
    /// An expression or a list of them. @param variables that they may depend on
    template <class T>
    void expression(const char* key, T& value, const char* variables, const char*, const char* doc)
    {
        if (const toml::node* node = find(key))
            values_.read_expressions(full(key), *node, value, variables);
        else
            problems_.add(full(key), fmt::format("missing ({})", doc));
    }
    template <class T>
    void expression(const char* key, std::optional<T>& value, const char* variables, const char*, const char*)
    {
        if (const toml::node* node = find(key))
            values_.read_expressions(full(key), *node, value.emplace(), variables);
    }
    void named_numbers(const char* key, Constants& values, const char*)
    {
        const toml::table* table = find_table(key);
        if (!table)
            return;
        const bool defines_names = path_.empty();
        if (table->size() > most_names)  // each expression is made with all of them
            return problems_.add(full(key), fmt::format("{} names are more than {}", table->size(), most_names));
        for (const auto& [name, value] : *table)
            if (!is_identifier(name.str()))
            {
                problems_.remember(full(key) + "." + std::string(name.str()), value);
                return problems_.add(full(key) + "." + std::string(name.str()),
                                     "a name is letters, digits and '_', and begins with no digit");
            }
        // in any order: what depends on another name waits until that one is known
        std::vector<std::pair<std::string, const toml::node*>> waiting;
        for (const auto& [name, value] : *table)
            waiting.emplace_back(name.str(), &value);
        std::stable_sort(waiting.begin(), waiting.end(),
                         [](const auto& a, const auto& b) { return a.second->source().begin.line < b.second->source().begin.line; });
        for (bool progress = true; progress && !waiting.empty();)
        {
            progress = false;
            for (auto it = waiting.begin(); it != waiting.end();)
            {
                double number = 0;
                std::string why;
                if (!values_.number_of(*it->second, number, why))
                {
                    ++it;
                    continue;
                }
                values.emplace_back(it->first, number);
                if (defines_names)
                    constants_.emplace_back(it->first, number);
                progress = true;
                it = waiting.erase(it);
            }
        }
        for (const auto& [name, value] : waiting)
        {
            double number = 0;
            std::string why;
            values_.number_of(*value, number, why);
            problems_.remember(full(key) + "." + name, *value);
            problems_.add(full(key) + "." + name, why);
        }
        if (defines_names)
            for (const auto& [name, value] : values)
                if (static const std::set<std::string> taken{"X", "Y", "x", "y", "t", "L", "pi"}; taken.count(name))
                    problems_.add(full(key) + "." + name, "this name is taken by expressions; choose another");
    }
    template <class T>
    void table(const char* key, T& value, const char* doc)
    {
        if (const toml::node* node = find(key))
            read_table(full(key), *node, value);
        else
        {
            static const toml::table empty;
            const std::size_t before = problems_.errors().size();
            Reader reader(empty, full(key), problems_, constants_);
            value.describe(reader);
            if (problems_.errors().size() > before)
                problems_.add(full(key), fmt::format("this table is missing ({})", doc));
        }
    }
    template <class T>
    void table(const char* key, std::optional<T>& value, const char*)
    {
        if (const toml::node* node = find(key))
            read_table(full(key), *node, value.emplace());
    }
    template <class T>
    void list(const char* key, std::vector<T>& values, const char*)
    {
        const toml::node* node = find(key);
        if (!node)
            return;
        const toml::array* array = node->as_array();
        if (!array)
            return problems_.add(full(key), fmt::format("a list of tables is asked: write [[{}]]", key));
        if (array->size() > most_tables)
            return problems_.add(full(key), fmt::format("{} tables are more than {}", array->size(), most_tables));
        for (std::size_t k = 0; k < array->size(); ++k)
            read_table(fmt::format("{}[{}]", full(key), k), (*array)[k], values.emplace_back());
    }
    template <class T>
    void tables(const char* key, std::map<std::string, T>& values, const std::vector<std::string>& names, const char*)
    {
        const toml::table* table = find_table(key);
        if (!table)
            return;
        for (const auto& [name, value] : *table)
        {
            const std::string path = full(key) + "." + std::string(name.str());
            if (std::find(names.begin(), names.end(), name.str()) == names.end())
            {
                problems_.remember(path, value);
                problems_.add(path, "unknown key" + suggestion(std::string(name.str()), names));
            }
            else
                read_table(path, value, values[std::string(name.str())]);
        }
    }

private:
    static constexpr std::size_t most_names = 256, most_tables = 10000;

    std::string full(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

    const toml::node* find(const char* key)
    {
        if (std::find(known_.begin(), known_.end(), key) == known_.end())
            known_.emplace_back(key);
        const toml::node* node = table_.get(key);
        if (node)
            problems_.remember(full(key), *node);
        return node;
    }

    const toml::table* find_table(const char* key)
    {
        const toml::node* node = find(key);
        if (node && !node->is_table())
            problems_.add(full(key), "a table is asked, not a " + kind_of(*node));
        return node ? node->as_table() : nullptr;
    }

    template <class T>
    void read_table(const std::string& path, const toml::node& node, T& value)
    {
        problems_.remember(path, node);
        const toml::table* table = node.as_table();
        if (!table)
            return problems_.add(path, "a table is asked, not a " + kind_of(node));
        Reader reader(*table, path, problems_, constants_);
        value.describe(reader);
    }

    const toml::table& table_;
    std::string path_;
    Problems& problems_;
    Constants& constants_;
    ValueReader values_;
    std::vector<std::string> known_;
};
}  // namespace testbed
