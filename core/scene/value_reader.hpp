#pragma once
/// The values of a scene as their keys ask for them.

#include "core/scene/geometry.hpp"
#include "core/scene/problems.hpp"

#include <cmath>

namespace testbed
{
inline std::string kind_of(const toml::node& node)
{
    static const std::map<toml::node_type, const char*> names{
        {toml::node_type::table, "table"},           {toml::node_type::array, "list"},
        {toml::node_type::string, "string"},         {toml::node_type::integer, "integer"},
        {toml::node_type::floating_point, "number"}, {toml::node_type::boolean, "boolean"}};
    const auto found = names.find(node.type());
    return found == names.end() ? "date or time" : found->second;
}

/// Reads single values, and says where they are not of the kind that is asked.
class ValueReader
{
public:
    /// @param constants that expressions may use, with those defined later
    ValueReader(Problems& problems, const Constants& constants) : problems_(problems), constants_(constants) {}

    /// A number, or an expression of constants. Returns whether it is one; @param why not
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
    void read(const std::string& path, const toml::node& node, bool& value)
    {
        if (const auto boolean = node.value_exact<bool>())
            value = *boolean;
        else
            problems_.add(path, "true or false is asked, not a " + kind_of(node));
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
    void read(const std::string& path, const toml::node& node, Vec<2>& value)
    {
        if (const toml::array* array = array_of(path, node, 2))
            for (std::size_t k = 0; k < 2; ++k)
                read(path, (*array)[k], value[k]);
    }
    template <class T>
    void read(const std::string& path, const toml::node& node, std::vector<T>& values)
    {
        if (const toml::array* array = array_of(path, node, 0))
        {
            values.clear();
            for (const toml::node& element : *array)
                read(path, element, values.emplace_back());
        }
    }
    void read_expressions(const std::string& path, const toml::node& node, std::string& value, const char* variables)
    {
        read_expression(path, node, value, variables);
        evaluate_if_constant(value);
    }
    template <std::size_t N>
    void read_expressions(const std::string& path, const toml::node& node, std::array<std::string, N>& values, const char* variables)
    {
        if (const toml::array* array = array_of(path, node, N))
            for (std::size_t k = 0; k < N; ++k)
                read_expression(path, (*array)[k], values[k], variables);
    }

private:
    const toml::array* array_of(const std::string& path, const toml::node& node, std::size_t size)
    {
        const toml::array* array = node.as_array();
        if (array && (size == 0 || array->size() == size))
            return array;
        problems_.add(path, size == 0 ? "a list is asked, not a " + kind_of(node) : fmt::format("a list of {} is asked", size));
        return nullptr;
    }
    void read_expression(const std::string& path, const toml::node& node, std::string& value, const char* variables)
    {
        if (const auto text = node.value_exact<std::string>())
            value = *text;
        else if (node.is_number())
        {
            double number = 0;
            read(path, node, number);
            value = fmt::format("{}", number);
            return;
        }
        else
            return problems_.add(path, "a number or an expression in quotes is asked, not a " + kind_of(node));
        try
        {
            const Expression check(value, constants_);
            refuse_other_variables(value, constants_, variables);
        }
        catch (const ExpressionError& e)
        {
            problems_.add(path, e.what());
        }
    }

    /// An expression of constants alone is a number: what it stands for then needs no field.
    void evaluate_if_constant(std::string& value) const
    {
        if (is_number(value))
            return;
        try
        {
            if (const double number = evaluate_constant(value, constants_); std::isfinite(number))
                value = fmt::format("{}", number);
        }
        catch (const ExpressionError&)  // it depends on the place, or was told before
        {
        }
    }

    Problems& problems_;
    const Constants& constants_;
};
}  // namespace testbed
