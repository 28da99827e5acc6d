#include "core/scene/expression.hpp"

#include "core/base/shown.hpp"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <muParser.h>
#include <numbers>

namespace testbed
{
namespace
{
constexpr std::size_t longest = 5000;  // bytes of an expression

/// Whether the text assigns, as in `y = 0`: a comparison that lost a sign, which would hold nowhere or everywhere.
bool assigns(const std::string& text)
{
    for (std::size_t k = 0; k < text.size(); ++k)
        if (text[k] == '=' && (k == 0 || std::string_view("<>=!").find(text[k - 1]) == std::string_view::npos) &&
            (k + 1 == text.size() || text[k + 1] != '='))
            return true;
    return false;
}

[[noreturn]] void fail(const std::string& text, const std::string& why)
{
    throw ExpressionError("expression '" + shown(text) + "': " + why);
}

mu::Parser parser_with(const std::string& text, const Constants& constants)
{
    if (text.size() > longest)
        fail(text, "longer than " + std::to_string(longest) + " bytes");
    if (text.find('\0') != std::string::npos)
        fail(text, "holds a zero byte");
    if (assigns(text))
        fail(text, "'=' assigns; to compare, write '=='");
    mu::Parser parser;
    parser.DefineConst("pi", std::numbers::pi);
    for (const auto& [name, value] : constants)
        parser.DefineConst(name, value);
    parser.SetExpr(text);
    return parser;
}

[[noreturn]] void rethrow(const std::string& text, const mu::Parser::exception_type& e)
{
    std::string message = e.GetMsg();
    while (!message.empty() && (message.back() == '\n' || message.back() == '.'))
        message.pop_back();
    fail(text, shown(message, 300));
}

/// Names of the variables that an expression depends on. @throws ExpressionError
std::vector<std::string> variables_of(const std::string& text, const Constants& constants)
{
    try
    {
        const mu::Parser parser = parser_with(text, constants);
        std::vector<std::string> names;
        for (const auto& [name, address] : parser.GetUsedVar())
            names.push_back(name);
        return names;
    }
    catch (const mu::Parser::exception_type& e)
    {
        rethrow(text, e);
    }
}

bool is_one_of(const std::string& name, std::string_view variables)
{
    return name.size() == 1 && variables.find(name) != std::string_view::npos;
}
}  // namespace

struct Expression::Impl
{
    mu::Parser parser;
    Place place;
    std::string text;
};

Expression::Expression(const std::string& text, const Constants& constants)
{
    try
    {
        impl_ = std::make_unique<Impl>(Impl{parser_with(text, constants), {}, text});
        impl_->parser.DefineVar("X", &impl_->place.X);
        impl_->parser.DefineVar("Y", &impl_->place.Y);
        impl_->parser.DefineVar("x", &impl_->place.x);
        impl_->parser.DefineVar("y", &impl_->place.y);
        impl_->parser.DefineVar("t", &impl_->place.t);
        impl_->parser.Eval();  // compiles
        if (impl_->parser.GetNumResults() != 1)
            fail(text, "one value is asked, not a list");
    }
    catch (const mu::Parser::exception_type& e)
    {
        rethrow(text, e);
    }
}
Expression::~Expression() = default;
Expression::Expression(Expression&&) noexcept = default;
Expression& Expression::operator=(Expression&&) noexcept = default;

double Expression::operator()(const Place& place) const
{
    impl_->place = place;
    return impl_->parser.Eval();
}

double Expression::finite(const Place& place) const
{
    const double value = (*this)(place);
    if (!std::isfinite(value))
        throw ExpressionError(fmt::format("expression '{}' is not finite at x = {:.6g} m, y = {:.6g} m, t = {:.6g} s", shown(impl_->text),
                                          place.x, place.y, place.t));
    return value;
}

bool holds_near(const Expression& condition, double x, double y, double reach)
{
    const Vec<2> offsets[] = {{0, 0}, {-reach, -reach}, {reach, -reach}, {-reach, reach}, {reach, reach}};
    for (const auto& [dx, dy] : offsets)
    {
        if (condition.finite({.X = x + dx, .Y = y + dy, .x = x + dx, .y = y + dy}) != 0)
            return true;
    }
    return false;
}

bool depends_on(const std::string& text, const Constants& constants, std::string_view variables)
{
    const auto names = variables_of(text, constants);
    return std::any_of(names.begin(), names.end(), [&](const std::string& name) { return is_one_of(name, variables); });
}

void refuse_other_variables(const std::string& text, const Constants& constants, std::string_view allowed)
{
    for (const std::string& name : variables_of(text, constants))
        if (is_one_of(name, all_variables) && !is_one_of(name, allowed))
            fail(text, fmt::format("'{}' is not known here, only {} and constants", name, allowed));
}

double evaluate_constant(const std::string& text, const Constants& constants)
{
    try
    {
        const mu::Parser parser = parser_with(text, constants);
        const double value = parser.Eval();
        if (parser.GetNumResults() != 1)
            fail(text, "one value is asked, not a list (a decimal point is '.')");
        if (!std::isfinite(value))
            fail(text, "the value is not finite");
        return value;
    }
    catch (const mu::Parser::exception_type& e)
    {
        rethrow(text, e);
    }
}
}  // namespace testbed
