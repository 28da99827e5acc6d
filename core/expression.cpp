#include "core/expression.hpp"

#include <cmath>
#include <muParser.h>
#include <numbers>

namespace testbed
{
namespace
{
mu::Parser parser_with(const std::string& text, const Constants& constants)
{
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
    throw ExpressionError("expression '" + text + "': " + message);
}
}  // namespace

struct Expression::Impl
{
    mu::Parser parser;
    Place place;
};

Expression::Expression(const std::string& text, const Constants& constants)
{
    try
    {
        impl_ = std::make_unique<Impl>(Impl{parser_with(text, constants), {}});
        impl_->parser.DefineVar("X", &impl_->place.X);
        impl_->parser.DefineVar("Y", &impl_->place.Y);
        impl_->parser.DefineVar("x", &impl_->place.x);
        impl_->parser.DefineVar("y", &impl_->place.y);
        impl_->parser.DefineVar("t", &impl_->place.t);
        impl_->parser.Eval();  // compiles
        if (impl_->parser.GetNumResults() != 1)
            throw ExpressionError("expression '" + text + "': one value is asked, not a list");
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
        throw ExpressionError("expression '" + impl_->parser.GetExpr() + "' is not finite at x = " + std::to_string(place.x) +
                              " m, y = " + std::to_string(place.y) + " m");
    return value;
}

bool holds_near(const Expression& condition, double x, double y, double reach)
{
    const Vec2 offsets[] = {{0, 0}, {-reach, -reach}, {reach, -reach}, {-reach, reach}, {reach, reach}};
    for (const auto& [dx, dy] : offsets)
    {
        if (condition.finite({.X = x + dx, .Y = y + dy, .x = x + dx, .y = y + dy}) != 0)
            return true;
    }
    return false;
}

std::string place_named_in(const std::string& text, const Constants& constants)
{
    try
    {
        const mu::Parser parser = parser_with(text, constants);
        for (const auto& [name, address] : parser.GetUsedVar())
            if (name == "X" || name == "Y" || name == "x" || name == "y")
                return name;
        return "";
    }
    catch (const mu::Parser::exception_type& e)
    {
        rethrow(text, e);
    }
}

double evaluate_constant(const std::string& text, const Constants& constants)
{
    try
    {
        const mu::Parser parser = parser_with(text, constants);
        const double value = parser.Eval();
        if (parser.GetNumResults() != 1)
            throw ExpressionError("expression '" + text + "': one value is asked, not a list (a decimal point is '.')");
        if (!std::isfinite(value))
            throw ExpressionError("expression '" + text + "': the value is not finite");
        return value;
    }
    catch (const mu::Parser::exception_type& e)
    {
        rethrow(text, e);
    }
}
}  // namespace testbed
