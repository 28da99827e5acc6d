#pragma once
/// Expressions for many points at a time: what muParser understands one by one (expression.hpp), as a list of instructions for arrays.
/// Constants are folded, what several expressions or parts of them share is computed once, what depends on t alone once per call, and
/// functions are vector ones: values differ from those of Expression by rounding.

#include "core/scene/expression.hpp"

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <tuple>

namespace testbed
{
class Formula
{
public:
    /// @throws ExpressionError as Expression
    Formula(std::span<const std::string> texts, const Constants& constants);

    /// Arrays of the variables, one number for each point [m]; t [s].
    struct Columns
    {
        const double *X, *Y, *x, *y;
        double t;
    };
    /// Values of each expression at n points. The result does not depend on the number of threads.
    /// @param results as many arrays as expressions @throws ExpressionError where one is not finite
    void evaluate(const Columns& at, std::size_t n, std::span<double* const> results) const;

    /// Instructions that are carried out for each point; none for an expression that is left to muParser.
    std::size_t instructions() const { return varying_; }
    bool is_compiled() const { return compiled_; }

private:
    friend class Compiler;
    enum class Op : std::uint8_t
    {
        constant,
        variable,
        add,
        subtract,
        multiply,
        divide,
        power,
        negate,
        less,
        less_equal,
        greater,
        greater_equal,
        equal,
        not_equal,
        both,
        either,
        select,
        sin,
        cos,
        tan,
        asin,
        acos,
        atan,
        sinh,
        cosh,
        tanh,
        exp,
        log,
        log2,
        log10,
        sqrt,
        abs,
        minimum,
        maximum
    };
    /// One value, from those of earlier instructions.
    struct Instruction
    {
        Op op;
        std::array<std::uint32_t, 3> from{0, 0, 0};
        double value = 0;        ///< of a constant
        bool varies = false;     ///< from point to point; else from time to time at most
        std::uint32_t slot = 0;  ///< of the values of a block of points
        auto key() const { return std::tuple(op, from, std::bit_cast<std::uint64_t>(value)); }
    };
    static double apply(Op op, double a, double b, double c);
    /// What does not vary, each value as often as there are points in a block.
    std::vector<double> uniform_values(double t) const;
    /// @param slots room for the varying values of a block, and for its four columns where the block is not full
    void evaluate_block(const Columns& at, std::size_t first, std::size_t count, const double* uniform, double* slots,
                        std::span<double* const> results) const;

    std::vector<Expression> expressions_;
    std::vector<Instruction> program_;
    std::vector<std::uint32_t> results_;  ///< instructions
    std::uint32_t varying_ = 0;
    bool compiled_ = false;
};
}  // namespace testbed
