#pragma once
/// The writing archives of the scene's describe() functions: the resolved scene, and the documentation of all keys.

#include "core/scene/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

namespace testbed
{
inline std::string in_quotes(const std::string& text)
{
    std::string out = "\"";
    for (const char c : text)
        switch (c)
        {
        case '"': out += "\\\""; break;
        case '\\': out += "\\\\"; break;
        case '\n': out += "\\n"; break;
        case '\t': out += "\\t"; break;
        default: out += static_cast<unsigned char>(c) < 32 ? fmt::format("\\u{:04x}", static_cast<int>(c)) : std::string(1, c);
        }
    return out + "\"";
}
inline std::string toml_text(double v)
{
    std::string text = fmt::format("{}", v);
    return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}
inline std::string toml_text(bool v)
{
    return v ? "true" : "false";
}
inline std::string toml_text(int v)
{
    return std::to_string(v);
}
inline std::string toml_text(const std::string& v)
{
    return in_quotes(v);
}
inline std::string toml_text(const Vec<2>& v);
template <class Range>
std::string toml_list(const Range& values)
{
    std::vector<std::string> parts;
    for (const auto& v : values)
        parts.push_back(toml_text(v));
    return fmt::format("[{}]", fmt::join(parts, ", "));
}
inline std::string toml_text(const Vec<2>& v)
{
    return toml_list(v);
}
template <std::size_t N>
inline std::string toml_text(const std::array<std::string, N>& v)
{
    return toml_list(v);
}
template <class T>
inline std::string toml_text(const std::vector<T>& v)
{
    return toml_list(v);
}

/// Writes a scene with all its defaults. Keys of a table come before its sub-tables.
class Writer
{
public:
    explicit Writer(std::string path = "") : path_(std::move(path)) {}

    std::string text() const { return keys_ + tables_; }

    template <class T>
    void optional(const char* key, T& value, const char*, const char*)
    {
        keys_ += fmt::format("{} = {}\n", key, toml_text(value));
    }
    template <class T>
    void optional(const char* key, std::optional<T>& value, const char* unit, const char* doc)
    {
        if (value)
            optional(key, *value, unit, doc);
    }
    template <class T>
    void optional(const char* key, std::vector<T>& value, const char*, const char*)
    {
        if (!value.empty())
            keys_ += fmt::format("{} = {}\n", key, toml_text(value));
    }
    void number_or(const char* key, std::optional<double>& value, const char* word, bool& is_word, const char* unit, const char* doc)
    {
        if (is_word)
            keys_ += fmt::format("{} = {}\n", key, in_quotes(word));
        else
            optional(key, value, unit, doc);
    }
    template <class T>
    void required(const char* key, T& value, const char* unit, const char* doc)
    {
        optional(key, value, unit, doc);
    }
    template <Choice E>
    void choice(const char* key, E& value, const char*)
    {
        keys_ += fmt::format("{} = {}\n", key, in_quotes(name_of(value)));
    }
    template <Choice E>
    void required_choice(const char* key, E& value, const char* doc)
    {
        choice(key, value, doc);
    }
    template <class T>
    void expression(const char* key, T& value, const char*, const char* unit, const char* doc)
    {
        optional(key, value, unit, doc);
    }
    void named_numbers(const char* key, Constants& values, const char*)
    {
        if (values.empty())
            return;
        tables_ += fmt::format("\n[{}]\n", full(key));
        for (const auto& [name, value] : values)
            tables_ += fmt::format("{} = {}\n", name, toml_text(value));
    }
    template <class T>
    void table(const char* key, T& value, const char*)
    {
        write_table(fmt::format("[{}]", full(key)), full(key), value);
    }
    template <class T>
    void table(const char* key, std::optional<T>& value, const char* doc)
    {
        if (value)
            table(key, *value, doc);
    }
    template <class T>
    void list(const char* key, std::vector<T>& values, const char*)
    {
        for (T& value : values)
            write_table(fmt::format("[[{}]]", full(key)), full(key), value);
    }
    template <class T>
    void tables(const char* key, std::map<std::string, T>& values, const std::vector<std::string>&, const char*)
    {
        for (auto& [name, value] : values)
            write_table(fmt::format("[{}.{}]", full(key), name), full(key) + "." + name, value);
    }

private:
    std::string full(const char* key) const { return path_.empty() ? key : path_ + "." + key; }
    template <class T>
    void write_table(const std::string& header, const std::string& path, T& value)
    {
        Writer inner(path);
        value.describe(inner);
        tables_ += "\n" + header + "\n" + inner.text();
    }

    std::string path_, keys_, tables_;
};

/// Prints what each key means.
class Documentation
{
public:
    Documentation(std::string only, std::string path = "") : only_(std::move(only)), path_(std::move(path)) {}

    std::string text;
    std::vector<std::string> names;

    template <class T>
    void optional(const char* key, T& value, const char* unit, const char* doc)
    {
        line(key, unit, doc, "default " + toml_text(value));
    }
    template <class T>
    void optional(const char* key, std::optional<T>&, const char* unit, const char* doc)
    {
        line(key, unit, doc, "may be absent");
    }
    void number_or(const char* key, std::optional<double>&, const char* word, bool&, const char* unit, const char* doc)
    {
        line(key, unit, doc, fmt::format("may be absent, or {}", in_quotes(word)));
    }
    template <class T>
    void required(const char* key, T&, const char* unit, const char* doc)
    {
        line(key, unit, doc, "required");
    }
    template <Choice E>
    void choice(const char* key, E& value, const char* doc)
    {
        line(key, "", fmt::format("{}: {}", doc, fmt::join(names_of<E>(), " | ")), "default " + in_quotes(name_of(value)));
    }
    template <Choice E>
    void required_choice(const char* key, E&, const char* doc)
    {
        line(key, "", fmt::format("{}: {}", doc, fmt::join(names_of<E>(), " | ")), "required");
    }
    template <class T>
    void expression(const char* key, T&, const char* variables, const char* unit, const char* doc)
    {
        line(key, unit, fmt::format("{}; of {}", doc, variables), "required");
    }
    template <class T>
    void expression(const char* key, std::optional<T>&, const char* variables, const char* unit, const char* doc)
    {
        line(key, unit, fmt::format("{}; of {}", doc, variables), "may be absent");
    }
    void named_numbers(const char* key, Constants&, const char* doc) { heading(fmt::format("[{}]", full(key)), full(key), doc); }
    template <class T>
    void table(const char* key, T& value, const char* doc)
    {
        inner(fmt::format("[{}]", full(key)), full(key), doc, value);
    }
    template <class T>
    void table(const char* key, std::optional<T>&, const char* doc)
    {
        T value;
        inner(fmt::format("[{}] (may be absent)", full(key)), full(key), doc, value);
    }
    template <class T>
    void list(const char* key, std::vector<T>&, const char* doc)
    {
        T value;
        inner(fmt::format("[[{}]]", full(key)), full(key), doc, value);
    }
    template <class T>
    void tables(const char* key, std::map<std::string, T>&, const std::vector<std::string>& choices, const char* doc)
    {
        T value;
        inner(fmt::format("[{}.<{}>]", full(key), fmt::join(choices, "|")), full(key), doc, value);
    }

private:
    std::string full(const char* key) const { return path_.empty() ? key : path_ + "." + key; }
    bool wanted(const std::string& name) const { return only_.empty() || name == only_ || name.rfind(only_ + ".", 0) == 0; }
    void line(const char* key, const char* unit, const std::string& doc, const std::string& presence)
    {
        if (wanted(path_))
            text += fmt::format("  {:<18} {:<7} {} ({})\n", key, *unit ? fmt::format("[{}]", unit) : "", doc, presence);
    }
    void heading(const std::string& title, const std::string& name, const char* doc)
    {
        names.push_back(name);
        if (wanted(name))
            text += fmt::format("{}{}  # {}\n", text.empty() ? "" : "\n", title, doc);
    }
    template <class T>
    void inner(const std::string& title, const std::string& name, const char* doc, T& value)
    {
        heading(title, name, doc);
        Documentation nested(only_, name);
        value.describe(nested);
        text += nested.text;
        names.insert(names.end(), nested.names.begin(), nested.names.end());
    }

    std::string only_, path_;
};
}  // namespace testbed
