#include "core/scene.hpp"

#include "core/method_limits.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <set>
#include <toml++/toml.h>

namespace testbed
{
namespace
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

std::string suggestion(const std::string& word, const std::vector<std::string>& candidates)
{
    const auto near = nearest(word, candidates);
    return near ? fmt::format("; did you mean '{}'?", *near) : fmt::format("; known: {}", fmt::join(candidates, ", "));
}

std::string kind_of(const toml::node& node)
{
    static const std::map<toml::node_type, const char*> names{
        {toml::node_type::table, "table"},           {toml::node_type::array, "list"},
        {toml::node_type::string, "string"},         {toml::node_type::integer, "integer"},
        {toml::node_type::floating_point, "number"}, {toml::node_type::boolean, "boolean"}};
    const auto found = names.find(node.type());
    return found == names.end() ? "date or time" : found->second;
}

/// Reads one table strictly.
class Reader
{
public:
    Reader(const toml::table& table, std::string path, Problems& problems, Constants& constants)
        : table_(table),
          path_(std::move(path)),
          problems_(problems),
          constants_(constants)
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
            read(full(key), *node, value);
    }
    template <class T>
    void required(const char* key, T& value, const char* unit, const char* doc)
    {
        if (!find(key))
            problems_.add(full(key), fmt::format("missing ({})", doc));
        optional(key, value, unit, doc);
    }
    void choice(const char* key, std::string& value, const std::vector<std::string>& choices, const char* doc)
    {
        const bool has_default = !value.empty();
        if (has_default)
            optional(key, value, "", doc);
        else
            required(key, value, "", doc);
        if (!value.empty() && std::find(choices.begin(), choices.end(), value) == choices.end())
            problems_.add(full(key), fmt::format("'{}' is not a choice", value) + suggestion(value, choices));
    }
    void expression(const char* key, std::string& value, const char*, const char* doc)
    {
        const toml::node* node = find(key);
        if (!node)
            problems_.add(full(key), fmt::format("missing ({})", doc));
        else
            read_expression(full(key), *node, value);
    }
    void named_numbers(const char* key, Constants& values, const char*)
    {
        const toml::node* node = find(key);
        if (!node)
            return;
        const toml::table* table = node->as_table();
        if (!table)
            return problems_.add(full(key), "a table is asked, not a " + kind_of(*node));
        const bool defines_names = path_.empty();
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
                if (!number_of(*it->second, number, why))
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
            number_of(*value, number, why);
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
        for (std::size_t k = 0; k < array->size(); ++k)
            read_table(fmt::format("{}[{}]", full(key), k), (*array)[k], values.emplace_back());
    }
    template <class T>
    void tables(const char* key, std::map<std::string, T>& values, const std::vector<std::string>& names, const char*)
    {
        const toml::node* node = find(key);
        if (!node)
            return;
        const toml::table* table = node->as_table();
        if (!table)
            return problems_.add(full(key), "a table is asked, not a " + kind_of(*node));
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
    std::string full(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

    const toml::node* find(const char* key)
    {
        known_.emplace_back(key);
        const toml::node* node = table_.get(key);
        if (node)
            problems_.remember(full(key), *node);
        return node;
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

    bool number_of(const toml::node& node, double& value, std::string& why) const
    {
        if (const auto number = node.value_exact<double>())
            value = *number;
        else if (const auto integer = node.value_exact<std::int64_t>())
            value = static_cast<double>(*integer);
        else if (const auto text = node.value_exact<std::string>())
            try
            {
                value = evaluate_constant(*text, constants_);
            }
            catch (const ExpressionError& e)
            {
                why = e.what();
                return false;
            }
        else
        {
            why = "a number, or an expression of constants in quotes, is asked, not a " + kind_of(node);
            return false;
        }
        if (std::isfinite(value))
            return true;
        why = "a finite number is asked";
        return false;
    }
    void read(const std::string& path, const toml::node& node, double& value)
    {
        std::string why;
        if (!number_of(node, value, why))
            problems_.add(path, why);
    }
    void read(const std::string& path, const toml::node& node, int& value)
    {
        double number = 0;
        std::string why;
        if (!number_of(node, number, why))
            problems_.add(path, why);
        else if (number != std::floor(number) || std::abs(number) > 1e9)
            problems_.add(path, fmt::format("a whole number is asked, not {}", number));
        else
            value = static_cast<int>(number);
    }
    void read(const std::string& path, const toml::node& node, std::string& value)
    {
        if (const auto text = node.value_exact<std::string>())
            value = *text;
        else
            problems_.add(path, "a string is asked, not a " + kind_of(node));
    }
    template <class T>
    void read(const std::string& path, const toml::node& node, std::optional<T>& value)
    {
        read(path, node, value.emplace());
    }
    const toml::array* array_of(const std::string& path, const toml::node& node, std::size_t size)
    {
        const toml::array* array = node.as_array();
        if (array && (size == 0 || array->size() == size))
            return array;
        problems_.add(path, size == 0 ? "a list is asked, not a " + kind_of(node) : fmt::format("a list of {} is asked", size));
        return nullptr;
    }
    void read(const std::string& path, const toml::node& node, Vec2& value)
    {
        if (const toml::array* array = array_of(path, node, 2))
            for (std::size_t k = 0; k < 2; ++k)
                read(path, (*array)[k], value[k]);
    }
    template <class T>
    void read(const std::string& path, const toml::node& node, std::vector<T>& values)
    {
        if (const toml::array* array = array_of(path, node, 0))
            for (const toml::node& element : *array)
                read(path, element, values.emplace_back());
    }
    template <std::size_t N>
    void read(const std::string& path, const toml::node& node, std::array<std::string, N>& values)
    {
        if (const toml::array* array = array_of(path, node, N))
            for (std::size_t k = 0; k < N; ++k)
                read_expression(path, (*array)[k], values[k]);
    }
    void read_expression(const std::string& path, const toml::node& node, std::string& value)
    {
        if (const auto text = node.value_exact<std::string>())
            value = *text;
        else if (const auto number = node.value<double>())
            value = fmt::format("{}", *number);
        else
            return problems_.add(path, "a number or an expression in quotes is asked, not a " + kind_of(node));
        try
        {
            const Expression check(value, constants_);
        }
        catch (const ExpressionError& e)
        {
            problems_.add(path, e.what());
        }
    }

    const toml::table& table_;
    std::string path_;
    Problems& problems_;
    Constants& constants_;
    std::vector<std::string> known_;
};

std::string in_quotes(const std::string& text)
{
    std::string out = "\"";
    for (const char c : text)
        switch (c)
        {
        case '"': out += "\\\""; break;
        case '\\': out += "\\\\"; break;
        case '\n': out += "\\n"; break;
        case '\t': out += "\\t"; break;
        default: out += c;
        }
    return out + "\"";
}
std::string toml_text(double v)
{
    std::string text = fmt::format("{}", v);
    return text.find_first_of(".en") == std::string::npos ? text + ".0" : text;
}
std::string toml_text(int v)
{
    return std::to_string(v);
}
std::string toml_text(const std::string& v)
{
    return in_quotes(v);
}
std::string toml_text(const Vec2& v);
template <class Range>
std::string toml_list(const Range& values)
{
    std::vector<std::string> parts;
    for (const auto& v : values)
        parts.push_back(toml_text(v));
    return fmt::format("[{}]", fmt::join(parts, ", "));
}
std::string toml_text(const Vec2& v)
{
    return toml_list(v);
}
template <std::size_t N>
std::string toml_text(const std::array<std::string, N>& v)
{
    return toml_list(v);
}
template <class T>
std::string toml_text(const std::vector<T>& v)
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
    template <class T>
    void required(const char* key, T& value, const char* unit, const char* doc)
    {
        optional(key, value, unit, doc);
    }
    void choice(const char* key, std::string& value, const std::vector<std::string>&, const char* doc) { optional(key, value, "", doc); }
    void expression(const char* key, std::string& value, const char* unit, const char* doc) { optional(key, value, unit, doc); }
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
    template <class T>
    void required(const char* key, T&, const char* unit, const char* doc)
    {
        line(key, unit, doc, "required");
    }
    void choice(const char* key, std::string& value, const std::vector<std::string>& choices, const char* doc)
    {
        line(key, "", fmt::format("{}: {}", doc, fmt::join(choices, " | ")), value.empty() ? "required" : "default " + in_quotes(value));
    }
    void expression(const char* key, std::string&, const char* unit, const char* doc) { line(key, unit, doc, "required"); }
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

void set_override(toml::table& root, const std::string& assignment, Problems& problems)
{
    const auto equals = assignment.find('=');
    if (equals == std::string::npos || equals == 0)
        return problems.add("--set " + assignment, "write --set key.path=value");
    const std::string path = assignment.substr(0, equals), text = assignment.substr(equals + 1);
    toml::table value;
    try
    {
        value = toml::parse("v = " + text);
    }
    catch (const toml::parse_error&)
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

bool is_multiple(double length, double unit)
{
    const double n = length / unit;
    return std::round(n) >= 1 && std::abs(n - std::round(n)) < 1e-6;
}

template <class T>
void check_unique_names(const std::vector<T>& list, const std::string& key, Problems& problems)
{
    std::set<std::string> seen;
    for (std::size_t k = 0; k < list.size(); ++k)
        if (!seen.insert(list[k].name).second)
            problems.add(fmt::format("{}[{}].name", key, k), fmt::format("'{}' is used twice", list[k].name));
}

void check_body(const Scene& scene, const BodySpec& body, const std::string& key, Problems& problems)
{
    const GridSpec& grid = scene.grid;
    std::vector<std::string> names;
    for (const auto& m : scene.materials)
        names.push_back(m.name);
    if (std::find(names.begin(), names.end(), body.material) == names.end())
        problems.add(key + ".material", fmt::format("no material '{}'", body.material) + suggestion(body.material, names));
    if (body.points_per_cell < 1 || body.points_per_cell > 64)
        problems.add(key + ".points_per_cell", fmt::format("between 1 and 64 per direction is asked, not {}", body.points_per_cell));

    const auto refuse = [&](bool present, const char* name)
    {
        if (present)
            problems.add(key + "." + name, fmt::format("not used by shape '{}'", body.shape));
    };
    const auto ask = [&](bool present, const char* name)
    {
        if (!present)
            problems.add(key + "." + name, fmt::format("missing, shape '{}' needs it", body.shape));
        return present;
    };
    Vec2 low{0, 0}, high{0, 0};
    bool known = false;
    if (body.shape == "box")
    {
        const bool has_min = ask(body.min.has_value(), "min"), has_max = ask(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        refuse(!body.vertices.empty(), "vertices");
        if (has_min && has_max)
        {
            low = *body.min;
            high = *body.max;
            known = true;
            for (std::size_t k = 0; k < 2 && grid.cell_size > 0; ++k)
                if (high[k] <= low[k])
                    problems.add(key + ".max", "must lie above and to the right of min");
                else if (!is_multiple(high[k] - low[k], grid.cell_size))
                    problems.add(key + ".max", fmt::format("the extent {} m in {} is not a multiple of the cell size {} m",
                                                           high[k] - low[k], "xy"[k], grid.cell_size));
        }
    }
    else if (body.shape == "disk")
    {
        const bool has_center = ask(body.center.has_value(), "center"), has_radius = ask(body.radius.has_value(), "radius");
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(!body.vertices.empty(), "vertices");
        if (has_radius && *body.radius <= 0)
            problems.add(key + ".radius", "must be positive");
        if (has_center && has_radius)
        {
            low = {(*body.center)[0] - *body.radius, (*body.center)[1] - *body.radius};
            high = {(*body.center)[0] + *body.radius, (*body.center)[1] + *body.radius};
            known = true;
        }
    }
    else if (body.shape == "polygon")
    {
        refuse(body.min.has_value(), "min");
        refuse(body.max.has_value(), "max");
        refuse(body.center.has_value(), "center");
        refuse(body.radius.has_value(), "radius");
        if (body.vertices.size() < 3)
            problems.add(key + ".vertices", "at least three corners are asked");
        else
        {
            known = true;
            low = high = body.vertices[0];
            for (const Vec2& v : body.vertices)
                for (std::size_t k = 0; k < 2; ++k)
                {
                    low[k] = std::min(low[k], v[k]);
                    high[k] = std::max(high[k], v[k]);
                }
        }
    }
    const double slack = 1e-9 * grid.cell_size;
    for (std::size_t k = 0; known && k < 2; ++k)
        if (low[k] < grid.origin[k] - slack || high[k] > grid.origin[k] + grid.size[k] + slack)
        {
            problems.add(key, fmt::format("body '{}' spans {} = {} .. {} m, outside the lattice, {} .. {} m", body.name, "xy"[k], low[k],
                                          high[k], grid.origin[k], grid.origin[k] + grid.size[k]));
            break;
        }
}

void check(const Scene& scene, Problems& problems)
{
    const GridSpec& grid = scene.grid;
    const auto positive = [&](double v, const std::string& key)
    {
        if (!(v > 0))
            problems.add(key, fmt::format("must be positive, not {}", v));
    };
    positive(grid.cell_size, "grid.cell_size");
    for (std::size_t k = 0; k < 2 && grid.cell_size > 0; ++k)
        if (!is_multiple(grid.size[k], grid.cell_size))
            problems.add("grid.size", fmt::format("the extent {} m in {} is not a multiple of the cell size {} m", grid.size[k], "xy"[k],
                                                  grid.cell_size));
        else if (grid.size[k] / grid.cell_size > 1e6)
            problems.add("grid.size", fmt::format("{} cells in {} are more than 1e6", grid.size[k] / grid.cell_size, "xy"[k]));
    if (grid.cell_size > 0 && grid.size[0] / grid.cell_size * (grid.size[1] / grid.cell_size) > 2e9)
        problems.add("grid.size", "the lattice has more than 2e9 cells");
    positive(scene.time.end, "time.end");
    positive(scene.time.cfl, "time.cfl");
    if (scene.time.dt)
        positive(*scene.time.dt, "time.dt");
    if (scene.time.stop_unbalanced)
        positive(*scene.time.stop_unbalanced, "time.stop_unbalanced");
    if (scene.time.wall_clock_limit)
        positive(*scene.time.wall_clock_limit, "time.wall_clock_limit");
    if (scene.gravity && scene.gravity->ramp < 0)
        problems.add("gravity.ramp", "must not be negative");
    if (scene.damping && !(scene.damping->local >= 0 && scene.damping->local < 1))
        problems.add("damping.local", fmt::format("must lie in [0, 1), not {}", scene.damping->local));
    for (std::size_t k = 0; k < scene.materials.size(); ++k)
    {
        const MaterialSpec& m = scene.materials[k];
        const std::string key = fmt::format("material[{}]", k);
        positive(m.density, key + ".density");
        if (!(m.poissons_ratio > -1 && m.poissons_ratio < 0.5))
            problems.add(key + ".poissons_ratio",
                         fmt::format("must lie in (-1, 0.5), not {}: at 0.5 an explicit method has no stable time step", m.poissons_ratio));
        if (const char* end = m.youngs_modulus.c_str(); !m.youngs_modulus.empty())
        {
            char* stop = nullptr;
            const double value = std::strtod(end, &stop);
            if (*stop == '\0')
                positive(value, key + ".youngs_modulus");
        }
    }
    check_unique_names(scene.materials, "material", problems);
    if (scene.materials.empty())
        problems.add("material", "no [[material]] in the scene");
    if (scene.bodies.empty())
        problems.add("body", "no [[body]] in the scene");
    for (std::size_t k = 0; k < scene.bodies.size(); ++k)
        check_body(scene, scene.bodies[k], fmt::format("body[{}]", k), problems);
    check_unique_names(scene.bodies, "body", problems);
    check_unique_names(scene.boundaries, "boundary", problems);
    check_unique_names(scene.probes, "probe", problems);
    if (scene.output.history < 0)
        problems.add("output.history", "must not be negative");
    if (scene.output.snapshots < 0)
        problems.add("output.snapshots", "must not be negative");
    if (scene.lpfdm.hourglass < 0 || scene.lpfdm.hourglass > 1)
        problems.add("lpfdm.hourglass", fmt::format("must lie in [0, 1], not {}", scene.lpfdm.hourglass));
    if (scene.mpm.flip < 0 || scene.mpm.flip > 1)
        problems.add("mpm.flip", fmt::format("must lie in [0, 1], not {}", scene.mpm.flip));
    if (scene.mpm.strain == "b_bar" && scene.mpm.shape != "linear")
        problems.add("mpm.strain", "b_bar averages over a cell and needs shape = \"linear\"");
    if (scene.fem.degree != 1 && scene.fem.degree != 2)
        problems.add("fem.degree", fmt::format("1 or 2 is asked, not {}", scene.fem.degree));
    if (scene.fem.refinements < 0 || scene.fem.refinements > 10)
        problems.add("fem.refinements", "between 0 and 10 is asked");
}

/// Warnings need a scene that is right.
void check_limits(const Scene& scene, Problems& problems)
{
    const double critical = critical_time_step(scene);
    const double dt = time_step(scene);
    if (dt > critical * (1 + 1e-12))
        problems.warn(scene.time.dt ? "time.dt" : "time.cfl",
                      fmt::format("the time step {:.4g} s is above the critical one, {:.4g} s", dt, critical));
    const std::string family = find_variant(scene.method).family;
    const bool locks = (family == "mpm" && scene.mpm.strain == "four_point") || (family == "fem" && scene.fem.degree == 1);
    for (std::size_t k = 0; k < scene.materials.size() && locks; ++k)
        if (scene.materials[k].poissons_ratio > 0.45)
            problems.warn(fmt::format("material[{}].poissons_ratio", k),
                          fmt::format("{} locks when nearly incompressible (nu = {})", scene.method, scene.materials[k].poissons_ratio));
}
}  // namespace

const MaterialSpec& Scene::material(const std::string& name) const
{
    return *std::find_if(materials.begin(), materials.end(), [&](const auto& m) { return m.name == name; });
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
    Problems problems(path);
    const auto throw_if_any = [&]
    {
        if (!problems.errors().empty())
            throw SceneError(fmt::format("{}", fmt::join(problems.errors(), "\n")));
    };
    toml::table root;
    try
    {
        root = toml::parse_file(path);
    }
    catch (const toml::parse_error& e)
    {
        const auto at = e.source().begin;
        if (at.line == 0)
            throw SceneError(fmt::format("{}: {}", path, e.description()));
        throw SceneError(fmt::format("{}:{}:{}: not TOML: {}", path, at.line, at.column, e.description()));
    }
    for (const auto& assignment : overrides)
        set_override(root, assignment, problems);
    if (!method.empty())
        root.insert_or_assign("method", method);
    throw_if_any();

    LoadedScene loaded;
    Scene& scene = loaded.scene;
    scene.path = path;
    const std::string name = root["method"].value_or(scene.method);
    std::vector<std::string> names;
    for (const Variant& v : variants())
        names.push_back(v.name);
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
    check(scene, problems);
    throw_if_any();
    check_limits(scene, problems);
    throw_if_any();
    loaded.warnings = problems.warnings();
    return loaded;
}

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

const std::vector<Variant>& variants()
{
    static const std::vector<Variant> list{
        {"lpfdm-2000", "lpfdm", "as published: a point belongs to one cell, upwind convection, no hourglass control",
         [](Scene& s) {
             s.lpfdm = {"point", "upwind", "extrapolate", 0.0};
         }},
        {"lpfdm", "lpfdm", "each point has a domain, central convection, hourglass control", [](Scene& s) { s.lpfdm = LpfdmSpec{}; }},
        {"mpm-linear", "mpm", "linear shape functions, strain at each point, FLIP, MUSL",
         [](Scene& s) {
             s.mpm = {"linear", "musl", "four_point", 1.0};
         }},
        {"mpm-linear-bbar", "mpm", "linear shape functions, volumetric strain averaged over each cell, FLIP, MUSL",
         [](Scene& s) {
             s.mpm = {"linear", "musl", "b_bar", 1.0};
         }},
        {"mpm-cpgimp", "mpm", "contiguous-particle GIMP: each point's box stretches with it; FLIP, MUSL",
         [](Scene& s) {
             s.mpm = {"cpgimp", "musl", "four_point", 1.0};
         }},
        {"fem-q1", "fem", "small-strain reference, bilinear elements", [](Scene& s) { s.fem.degree = 1; }},
        {"fem-q2", "fem", "small-strain reference, biquadratic elements", [](Scene& s) { s.fem.degree = 2; }},
    };
    return list;
}

const Variant& find_variant(const std::string& name)
{
    for (const Variant& v : variants())
        if (v.name == name)
            return v;
    throw SceneError("no method '" + name + "'");
}

std::string variant_label(const Scene& scene)
{
    const Variant& variant = find_variant(scene.method);
    Scene preset;
    variant.apply(preset);
    const auto lines = [&](Scene s)
    {
        Writer writer;
        if (variant.family == "lpfdm")
            s.lpfdm.describe(writer);
        else if (variant.family == "mpm")
            s.mpm.describe(writer);
        else
            s.fem.describe(writer);
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
