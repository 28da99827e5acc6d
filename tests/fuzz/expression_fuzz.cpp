/// Text of expressions: parsed or refused in words, and evaluated.

#include "core/scene/expression.hpp"
#include "tests/fuzz/fuzz.hpp"

using namespace testbed;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    const std::string text(reinterpret_cast<const char*>(data), size);
    const Constants constants{{"H", 4.0}, {"rho", 1000.0}, {"L", 0.5}};
    try
    {
        const Expression expression(text, constants);
        expression({1, 2, 3, 4, 5});
        holds_near(expression, 0.5, -0.5, 1e-6);
        refuse_other_variables(text, constants, "x, y");
        evaluate_constant(text, constants);
    }
    catch (const ExpressionError& e)
    {
        fuzz::check_message(e.what());
    }
    return 0;
}
