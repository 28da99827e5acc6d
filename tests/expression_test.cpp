#include "core/scene/expression.hpp"

#include <gtest/gtest.h>

using namespace testbed;

TEST(Expression, KnowsPlaceTimeAndConstants)
{
    const Expression e("a*X + 10*Y + 100*x + 1000*y + 10000*t + sin(pi)", {{"a", 2.0}});
    EXPECT_NEAR(e({1, 2, 3, 4, 5}), 2 + 20 + 300 + 4000 + 50000, 1e-9);
    EXPECT_DOUBLE_EQ(e({1, 0, 0, 0, 0}), 2 + e({0, 0, 0, 0, 0}));
}

TEST(Expression, SurvivesMoves)
{
    Expression a("X+1", {});
    const Expression b = std::move(a);
    EXPECT_DOUBLE_EQ(b({.X = 2}), 3);
}

TEST(Expression, SaysWhatIsWrong)
{
    for (const char* text : {"", "1+", "speed*2", "sin(", "1,2", "X Y"})
        EXPECT_THROW(Expression(text, {}), ExpressionError) << text;
    try
    {
        Expression("2*speed", {});
        FAIL();
    }
    catch (const ExpressionError& e)
    {
        EXPECT_NE(std::string(e.what()).find("speed"), std::string::npos);
    }
}

TEST(Expression, ConstantsMustBeFinite)
{
    EXPECT_DOUBLE_EQ(evaluate_constant("2*k", {{"k", 4.0}}), 8);
    EXPECT_THROW(evaluate_constant("1/0", {}), ExpressionError);
    EXPECT_THROW(evaluate_constant("X", {}), ExpressionError);  // no place in a constant
}

TEST(Expression, KnowsWhatItDependsOn)
{
    EXPECT_TRUE(depends_on("2*x + H", {{"H", 4.0}}, "x, y"));
    EXPECT_FALSE(depends_on("2*X + exp(t)", {}, "x, y"));
    EXPECT_FALSE(depends_on("max(1, 2)", {}, all_variables));
    EXPECT_NO_THROW(refuse_other_variables("x + y", {}, "x, y"));
    EXPECT_THROW(refuse_other_variables("x + t", {}, "x, y"), ExpressionError);
    EXPECT_THROW(Expression("y = 1", {}), ExpressionError);
}

/// A node at 3 * 0.1 = 0.30000000000000004 lies on x <= 0.3.
TEST(Expression, HoldsNearALine)
{
    const Expression line("x <= 0.3", {});
    EXPECT_EQ(line({.x = 3 * 0.1}), 0);
    EXPECT_TRUE(holds_near(line, 3 * 0.1, 0, 1e-7));
    EXPECT_FALSE(holds_near(line, 0.31, 0, 1e-7));
    EXPECT_TRUE(holds_near(Expression("y == 0.5", {}), 3, 0.5, 1e-7));
    EXPECT_THROW(holds_near(Expression("0/0", {}), 0, 0, 1e-7), ExpressionError);
}
