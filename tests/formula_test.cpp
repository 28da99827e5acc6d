#include "core/scene/formula.hpp"

#include "tests/random.hpp"

#include <cmath>
#include <fmt/format.h>
#include <functional>
#include <gtest/gtest.h>
#include <limits>

using namespace testbed;
using test::Random;

namespace
{
constexpr std::size_t n = 150;  // two blocks and a part of one

struct Places
{
    std::vector<double> X, Y, x, y;
    Places()
    {
        Random random(1);
        for (auto* column : {&X, &Y, &x, &y})
            for (std::size_t p = 0; p < n; ++p)
                column->push_back(random(-3, 3));
    }
    Formula::Columns at(double t) const { return {X.data(), Y.data(), x.data(), y.data(), t}; }
};

/// Values of one expression at all points, beside those of muParser.
void expect_same(const std::string& text, const Constants& constants = {{"a", 2.5}, {"L", 0.1}})
{
    const Places points;
    const std::vector<std::string> texts{text};
    const Formula formula(texts, constants);
    const Expression one(text, constants);
    EXPECT_TRUE(formula.is_compiled()) << text;
    std::vector<double> values(n);
    double* const result = values.data();
    formula.evaluate(points.at(0.7), n, {&result, 1});
    for (std::size_t p = 0; p < n; ++p)
    {
        const double exact = one({points.X[p], points.Y[p], points.x[p], points.y[p], 0.7});
        ASSERT_NEAR(values[p], exact, 1e-14 * (1 + std::abs(exact))) << text << " at " << p;
    }
}
}  // namespace

TEST(Formula, AgreesWithMuParser)
{
    for (const char* text : {"a*X + 10*Y - 100*x/7 + y*t",
                             "-X^2",
                             "2^-1*X",
                             "X^2^2",
                             "(-X)^3",
                             "-2^2",
                             "X - Y - t",
                             "X/3/a",
                             "1e-3*X + .5 + 2.*Y",
                             "a",
                             "t",
                             "X",
                             "sin(pi*X)*cos(a*Y)",
                             "tan(X/9)",
                             "asin(X/4) + acos(Y/4) + atan(x)",
                             "sinh(X) + cosh(Y) - tanh(x)",
                             "exp(X)*ln(4+Y) - log(5+x)",
                             "log2(4+X) + log10(4+Y)",
                             "sqrt(4+X) + abs(y)",
                             "min(X, Y, x) - max(Y, t)",
                             "abs(X)^1.5 + 2^Y",
                             "X < Y",
                             "X <= Y && x > y || t == 0.7",
                             "X >= 0 ? Y : x < 0 ? 1 : 2",
                             "(X != Y) + (x == x)",
                             "1 < 2",

                             "+X",
                             "2*-X",
                             "X*X + X*X*a + (X*X)"})
        expect_same(text);
}

TEST(Formula, AgreesOnRandomExpressions)
{
    Random random(7);
    const auto pick = [&](auto&... texts) -> std::string
    {
        const std::vector<std::string> list{texts...};
        return list[static_cast<std::size_t>(random(0, 0.999) * static_cast<double>(list.size()))];
    };
    const std::function<std::string(int)> make = [&](int depth) -> std::string
    {
        if (depth == 0 || random(0, 1) < 0.2)
            return pick("X", "Y", "x", "y", "t", "a", "L", "2", "0.3");
        switch (static_cast<int>(random(0, 5.999)))
        {
        case 0: return "(" + make(depth - 1) + pick("+", "-", "*") + make(depth - 1) + ")";
        case 1: return make(depth - 1) + pick("+", "-", "*") + make(depth - 1);
        case 2: return pick("sin", "cos", "tanh", "abs", "atan") + "(" + make(depth - 1) + ")";
        case 3: return make(depth - 1) + "/(1+abs(" + make(depth - 1) + "))";
        case 4: return "(" + make(depth - 1) + pick("<", ">") + make(depth - 1) + "?" + make(depth - 1) + ":" + make(depth - 1) + ")";
        default: return "(-" + make(depth - 1) + "^2)";
        }
    };
    for (int k = 0; k < 300; ++k)
    {
        const std::string text = make(3);
        // where values of different rounding are compared, or grow, nothing can be asked
        if (text.find('<') == std::string::npos && text.find('>') == std::string::npos)
        {
            const Places points;
            const std::vector<std::string> texts{text};
            const Formula formula(texts, {{"a", 2.5}, {"L", 0.1}});
            const Expression one(text, {{"a", 2.5}, {"L", 0.1}});
            std::vector<double> values(n);
            double* const result = values.data();
            formula.evaluate(points.at(0.7), n, {&result, 1});
            for (std::size_t p = 0; p < n; p += 37)
            {
                const double exact = one({points.X[p], points.Y[p], points.x[p], points.y[p], 0.7});
                ASSERT_NEAR(values[p], exact, 1e-9 * (1 + std::abs(exact))) << text;
            }
        }
    }
}

/// Where vector functions and comparisons would go their own ways.
TEST(Formula, AgreesAtTheEdges)
{
    const std::vector<double> x{0.0, -0.0, 1.0, -1.0, 0.5, 1e-310, -1e-310, 1e308, std::numeric_limits<double>::infinity(), 2.0};
    for (const char* text :
         {"x^0", "0^x", "abs(x)^0.5", "(x-x)^(x-x)", "1/(1 + x^0)", "ln(abs(x)+1e-310)", "log10(1e-310+abs(x))", "log2(abs(x)+1e-310)",
          "ln(x) ? 1 : 2", "ln(-1-x*x) != ln(-1-x*x)", "ln(x) && 1", "ln(x) || 0", "x^3", "x^2.5 > 0"})
    {
        const Formula formula(std::vector<std::string>{text}, {});
        const Expression one(text, {});
        EXPECT_TRUE(formula.is_compiled()) << text;
        for (const double v : x)
        {
            const double exact = one({v, v, v, v, 0});
            double value = 0;
            double* const result = &value;
            if (!std::isfinite(exact))
                EXPECT_THROW(formula.evaluate({&v, &v, &v, &v, 0}, 1, {&result, 1}), ExpressionError) << text << " at " << v;
            else
            {
                ASSERT_NO_THROW(formula.evaluate({&v, &v, &v, &v, 0}, 1, {&result, 1})) << text << " at " << v;
                EXPECT_NEAR(value, exact, 1e-14 * (1 + std::abs(exact))) << text << " at " << v;
            }
        }
    }
    EXPECT_FALSE(Formula(std::vector<std::string>{"0.5 && 0.5 ? x : 1"}, {}).is_compiled());
}

TEST(Formula, SharesWhatIsTheSame)
{
    const std::vector<std::string> texts{"a*2*sin(pi*X)*sin(t)", "1 + sin(pi*X)*L*t^2", "sin(pi*X)"};
    EXPECT_EQ(Formula(texts, {{"a", 2.0}, {"L", 0.1}}).instructions(), 7U);  // pi X, its sine; two products; two and a sum; nothing new
}

/// What only muParser knows is left to it.
TEST(Formula, FallsBack)
{
    const Places points;
    const std::vector<std::string> texts{"X + Y", "rint(X) + sum(X, Y)"};
    const Formula formula(texts, {});
    EXPECT_FALSE(formula.is_compiled());
    std::vector<double> first(n), second(n);
    const std::array<double*, 2> results{first.data(), second.data()};
    formula.evaluate(points.at(0), n, results);
    for (std::size_t p = 0; p < n; ++p)
    {
        EXPECT_EQ(first[p], points.X[p] + points.Y[p]);
        EXPECT_EQ(second[p], std::rint(points.X[p]) + points.X[p] + points.Y[p]);
    }
    const std::string deep = std::string(1000, '(') + "X" + std::string(1000, ')');
    EXPECT_FALSE(Formula(std::vector{deep}, {}).is_compiled());
}

TEST(Formula, SaysWhereItIsNotFinite)
{
    const Places points;
    const std::vector<std::string> texts{"ln(X)"};
    const Formula formula(texts, {});
    std::vector<double> values(n);
    double* const result = values.data();
    try
    {
        formula.evaluate(points.at(0.5), n, {&result, 1});
        FAIL();
    }
    catch (const ExpressionError& e)
    {
        EXPECT_NE(std::string(e.what()).find("not finite"), std::string::npos) << e.what();
        EXPECT_NE(std::string(e.what()).find("t = 0.5"), std::string::npos) << e.what();
    }
    EXPECT_THROW(Formula(std::vector<std::string>{"2*speed"}, {}), ExpressionError);
}

/// Bit for bit, by chunks.
TEST(Formula, DoesNotDependOnThreads)
{
    std::vector<double> x(10000);
    for (std::size_t p = 0; p < x.size(); ++p)
        x[p] = 1e-3 * static_cast<double>(p * p % 7919);
    const Formula formula(std::vector<std::string>{"sin(x)*exp(-x) + cos(40*x)"}, {});
    std::vector<double> one(x.size()), two(x.size());
    for (auto* values : {&one, &two})
    {
        set_threads(values == &one ? 1 : 2);
        double* const result = values->data();
        formula.evaluate({x.data(), x.data(), x.data(), x.data(), 0}, x.size(), {&result, 1});
    }
    set_threads(1);
    EXPECT_EQ(one, two);
}
