#pragma once
/// From text to the instructions of a Formula.

#include "core/scene/formula.hpp"

#include <cctype>
#include <charconv>
#include <map>
#include <numbers>

namespace testbed
{
/// What a text holds that only muParser knows.
struct NotKnown
{
};

/// The grammar of muParser, by recursive descent: each rule returns the number of the instruction that gives its value.
class Compiler
{
public:
    Compiler(Formula& formula, const Constants& constants) : formula_(formula)
    {
        names_["pi"] = constant(std::numbers::pi);
        for (const auto& [name, value] : constants)
            names_[name] = constant(value);
        for (const std::size_t k : {0, 1, 2, 3, 4})
            names_[std::string(1, "XYxyt"[k])] = add({Op::variable, {static_cast<std::uint32_t>(k), 0, 0}, 0, k < 4});
    }
    /// @throws NotKnown
    std::uint32_t compile(std::string_view text)
    {
        text_ = text;
        at_ = 0;
        const std::uint32_t value = conditional();
        if (skip(); at_ != text_.size())
            throw NotKnown{};
        return value;
    }

private:
    using Op = Formula::Op;
    using Instruction = Formula::Instruction;

    std::uint32_t constant(double value) { return add({Op::constant, {0, 0, 0}, value}); }
    /// The instruction, or the same one if there already is one.
    std::uint32_t add(const Instruction& instruction)
    {
        const auto next = static_cast<std::uint32_t>(formula_.program_.size());
        const auto [found, is_new] = known_.try_emplace(instruction.key(), next);
        if (is_new)
            formula_.program_.push_back(instruction);
        return found->second;
    }
    std::uint32_t make(Op op, std::uint32_t a, std::uint32_t b = 0, std::uint32_t c = 0)
    {
        const auto& program = formula_.program_;
        const int operands = op == Op::select ? 3 : is_binary(op) ? 2 : 1;
        const std::array<std::uint32_t, 3> from{a, operands > 1 ? b : a, operands > 2 ? c : a};
        bool is_constant = true, varies = false;
        for (const std::uint32_t f : from)
        {
            is_constant &= program[f].op == Op::constant;
            varies |= program[f].varies;
        }
        if (is_constant && (op == Op::both || op == Op::either))
            throw NotKnown{};  // muParser takes whole numbers for these
        if (is_constant)
            return constant(Formula::apply(op, program[from[0]].value, program[from[1]].value, program[from[2]].value));
        return add({op, from, 0, varies});
    }
    static bool is_binary(Op op) { return (op >= Op::add && op <= Op::either && op != Op::negate) || op >= Op::minimum; }

    void skip()
    {
        while (at_ < text_.size() && std::string_view(" \t\n\r").find(text_[at_]) != std::string_view::npos)
            ++at_;
    }
    bool take(std::string_view token)
    {
        skip();
        if (!text_.substr(at_).starts_with(token))
            return false;
        at_ += token.size();
        return true;
    }
    void expect(std::string_view token)
    {
        if (!take(token))
            throw NotKnown{};
    }

    std::uint32_t conditional()
    {
        constexpr int deepest = 200;
        if (++depth_ > deepest)
            throw NotKnown{};
        std::uint32_t value = binary(0);
        if (take("?"))
        {
            const std::uint32_t yes = conditional();
            expect(":");
            value = make(Op::select, value, yes, conditional());
        }
        --depth_;
        return value;
    }
    /// Operators of one rank, which are taken from the left.
    std::uint32_t binary(std::size_t rank)
    {
        using Row = std::vector<std::pair<const char*, Op>>;
        static const std::array<Row, 5> ranks{Row{{"||", Op::either}},
                                              {{"&&", Op::both}},
                                              {{"<=", Op::less_equal},
                                               {">=", Op::greater_equal},
                                               {"!=", Op::not_equal},
                                               {"==", Op::equal},
                                               {"<", Op::less},
                                               {">", Op::greater}},
                                              {{"+", Op::add}, {"-", Op::subtract}},
                                              {{"*", Op::multiply}, {"/", Op::divide}}};
        if (rank == ranks.size())
            return sign();
        std::uint32_t value = binary(rank + 1);
        for (bool more = true; more;)
        {
            more = false;
            for (const auto& [token, op] : ranks[rank])
                if (!more && take(token))
                {
                    value = make(op, value, binary(rank + 1));
                    more = true;
                }
        }
        return value;
    }
    std::uint32_t sign()
    {
        if (take("-"))
            return make(Op::negate, sign());
        if (take("+"))
            return sign();
        return power();
    }
    /// From the right, and before a sign on its left: -2^2 is -4.
    std::uint32_t power()
    {
        const std::uint32_t base = primary();
        if (!take("^"))
            return base;
        skip();
        const bool negative = take("-");
        std::uint32_t exponent = power();
        if (negative)
            exponent = make(Op::negate, exponent);
        const Instruction e = formula_.program_[exponent];  // a copy: make() moves the program
        if (e.op == Op::constant && (e.value == 2 || e.value == 3 || e.value == 4) && formula_.program_[base].op != Op::constant)
        {
            const std::uint32_t square = make(Op::multiply, base, base);
            return e.value == 2 ? square : make(Op::multiply, square, e.value == 3 ? base : square);
        }
        return make(Op::power, base, exponent);
    }
    std::uint32_t primary()
    {
        if (take("("))
        {
            const std::uint32_t value = conditional();
            expect(")");
            return value;
        }
        skip();
        const std::string_view rest = text_.substr(at_);
        if (rest.empty())
            throw NotKnown{};
        if ((rest[0] >= '0' && rest[0] <= '9') || rest[0] == '.')
            return number(rest);
        std::size_t length = 0;
        while (length < rest.size() && (std::isalnum(static_cast<unsigned char>(rest[length])) || rest[length] == '_'))
            ++length;
        const std::string name(rest.substr(0, length));
        at_ += length;
        if (length > 0 && take("("))
            return call(name);
        if (const auto found = names_.find(name); found != names_.end())
            return found->second;
        throw NotKnown{};
    }
    std::uint32_t number(std::string_view rest)
    {
        double value = 0;
        const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
        if (error != std::errc{} || (rest.size() > 1 && rest[0] == '0' && (rest[1] == 'x' || rest[1] == 'X')))
            throw NotKnown{};
        at_ += static_cast<std::size_t>(end - rest.data());
        return constant(value);
    }
    std::uint32_t call(const std::string& name)
    {
        static const std::map<std::string, Op, std::less<>> functions{
            {"sin", Op::sin},   {"cos", Op::cos},     {"tan", Op::tan},   {"asin", Op::asin}, {"acos", Op::acos},   {"atan", Op::atan},
            {"sinh", Op::sinh}, {"cosh", Op::cosh},   {"tanh", Op::tanh}, {"exp", Op::exp},   {"ln", Op::log},      {"log", Op::log},
            {"log2", Op::log2}, {"log10", Op::log10}, {"sqrt", Op::sqrt}, {"abs", Op::abs},   {"min", Op::minimum}, {"max", Op::maximum}};
        const auto found = functions.find(name);
        if (found == functions.end())
            throw NotKnown{};
        std::uint32_t value = conditional();
        if (is_binary(found->second))
            while (take(","))
                value = make(found->second, value, conditional());
        else
            value = make(found->second, value);
        expect(")");
        return value;
    }

    Formula& formula_;
    std::string_view text_;
    std::size_t at_ = 0;
    int depth_ = 0;
    std::map<std::string, std::uint32_t> names_;
    std::map<decltype(Instruction{}.key()), std::uint32_t> known_;
};
}  // namespace testbed
