#pragma once
/// Text expressions of scenes, evaluated by muParser. They know X, Y (initial position), x, y (current position), t and the
/// scene's constants; what a scene may use of these where is said in its describe(). Not for use by several threads at once.

#include "core/base/types.hpp"

#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace testbed
{
using Constants = std::vector<std::pair<std::string, double>>;  ///< in order of definition

struct ExpressionError : std::runtime_error
{
    using std::runtime_error::runtime_error;
};

/// Where and when an expression is evaluated.
struct Place
{
    double X = 0, Y = 0, x = 0, y = 0, t = 0;
};

class Expression
{
public:
    /// @throws ExpressionError for text that does not parse or names something unknown.
    Expression(const std::string& text, const Constants& constants);
    ~Expression();
    Expression(Expression&&) noexcept;
    Expression& operator=(Expression&&) noexcept;

    double operator()(const Place& place) const;
    /// The value. @throws ExpressionError if it is not finite
    double finite(const Place& place) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

using Expr2 = std::array<std::string, 2>;

/// A vector of two expressions: a velocity, a force, a traction, an exact displacement.
struct VectorExpression
{
    Expression x, y;

    VectorExpression(const Expr2& text, const Constants& constants) : x(text[0], constants), y(text[1], constants) {}
    /// @throws ExpressionError if it is not finite
    Vec<2> operator()(const Place& place) const { return {x.finite(place), y.finite(place)}; }
};

/// Whether a condition holds at a place or within `reach` of it [m]: a node at 0.30000000000000004 is on the line x <= 0.3.
/// @throws ExpressionError where it is not a number
bool holds_near(const Expression& condition, double x, double y, double reach);

/// Every variable that expressions know.
inline constexpr const char* all_variables = "X, Y, x, y, t";

/// Whether an expression depends on one of the variables. @param variables such as "x, y" @throws ExpressionError
bool depends_on(const std::string& text, const Constants& constants, std::string_view variables);
/// @throws ExpressionError that names the first variable on which the expression depends beyond `allowed`, such as "x, y"
void refuse_other_variables(const std::string& text, const Constants& constants, std::string_view allowed);

/// Value of an expression of constants alone. @throws ExpressionError
double evaluate_constant(const std::string& text, const Constants& constants);
}  // namespace testbed
