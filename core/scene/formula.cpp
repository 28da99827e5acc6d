#include "core/scene/formula.hpp"

#include "core/base/parallel.hpp"
#include "core/base/simd.hpp"
#include "core/scene/formula_compiler.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <xsimd/xsimd.hpp>

namespace testbed
{
namespace
{
using Batch = xsimd::batch<double>;
constexpr std::size_t block = 64;  ///< points of an instruction: its cost is shared, and its values stay in the first cache
static_assert(block % Batch::size == 0);

double choose(bool which, double yes, double no)
{
    return which ? yes : no;
}
Batch choose(const xsimd::batch_bool<double>& which, const Batch& yes, const Batch& no)
{
    return xsimd::select(which, yes, no);
}

/// Whether it counts as true: not a number does.
bool is_true(double a)
{
    return !(a == 0.0);
}
xsimd::batch_bool<double> is_true(const Batch& a)
{
    return !(a == Batch(0.0));
}

/// Vector functions are right for ordinary arguments; where a batch holds others, each is left to the scalar one.
template <class Vector, class Scalar>
Batch ordinary_or(const Batch& a, const Batch& b, Vector&& vector, Scalar&& scalar)
{
    if (xsimd::all(a >= Batch(std::numeric_limits<double>::min())) && xsimd::all(a <= Batch(std::numeric_limits<double>::max())) &&
        xsimd::all(xsimd::abs(b) <= Batch(std::numeric_limits<double>::max())))
        return vector(a, b);
    std::array<double, Batch::size> x, y;
    a.store_unaligned(x.data());
    b.store_unaligned(y.data());
    for (std::size_t k = 0; k < x.size(); ++k)
        x[k] = scalar(x[k], y[k]);
    return Batch::load_unaligned(x.data());
}
double power(double a, double b)
{
    return std::pow(a, b);
}
Batch power(const Batch& a, const Batch& b)
{
    return ordinary_or(
        a, b, [](const Batch& x, const Batch& y) { return xsimd::pow(x, y); }, [](double x, double y) { return std::pow(x, y); });
}
double logarithm(double a)
{
    return std::log(a);
}
Batch logarithm(const Batch& a)
{
    return ordinary_or(
        a, Batch(0.0), [](const Batch& x, const Batch&) { return xsimd::log(x); }, [](double x, double) { return std::log(x); });
}

/// One operation, for doubles and for batches of them, whose functions are found beside their type.
template <class Op, class T>
TESTBED_INLINE inline T value_of(Op op, const T& a, const T& b, const T& c)
{
    using namespace std;
    const T one(1.0), zero(0.0);
    switch (op)
    {
    case Op::constant:
    case Op::variable: return a;
    case Op::add: return a + b;
    case Op::subtract: return a - b;
    case Op::multiply: return a * b;
    case Op::divide: return a / b;
    case Op::power: return power(a, b);
    case Op::negate: return -a;
    case Op::less: return choose(a < b, one, zero);
    case Op::less_equal: return choose(a <= b, one, zero);
    case Op::greater: return choose(a > b, one, zero);
    case Op::greater_equal: return choose(a >= b, one, zero);
    case Op::equal: return choose(a == b, one, zero);
    case Op::not_equal: return choose(a == b, zero, one);
    case Op::both: return choose(is_true(a), choose(is_true(b), one, zero), zero);
    case Op::either: return choose(is_true(a), one, choose(is_true(b), one, zero));
    case Op::select: return choose(is_true(a), b, c);
    case Op::sin: return sin(a);
    case Op::cos: return cos(a);
    case Op::tan: return tan(a);
    case Op::asin: return asin(a);
    case Op::acos: return acos(a);
    case Op::atan: return atan(a);
    case Op::sinh: return sinh(a);
    case Op::cosh: return cosh(a);
    case Op::tanh: return tanh(a);
    case Op::exp: return exp(a);
    case Op::log: return logarithm(a);
    case Op::log2: return logarithm(a) * T(std::numbers::log2e);
    case Op::log10: return logarithm(a) * T(std::numbers::log10e);
    case Op::sqrt: return sqrt(a);
    case Op::abs: return abs(a);
    case Op::minimum: return choose(b < a, b, a);
    case Op::maximum: return choose(b > a, b, a);
    }
    return a;
}

/// The same for a block of points.
template <auto op>
void apply_to_block(const double* a, const double* b, const double* c, double* to)
{
    for (std::size_t k = 0; k < block; k += Batch::size)
        value_of(op, Batch::load_unaligned(a + k), Batch::load_unaligned(b + k), Batch::load_unaligned(c + k)).store_unaligned(to + k);
}
template <class Op, std::size_t... n>
constexpr auto table_of(std::index_sequence<n...>)
{
    return std::array{&apply_to_block<static_cast<Op>(n)>...};
}
}  // namespace

double Formula::apply(Op op, double a, double b, double c)
{
    return value_of(op, a, b, c);
}

Formula::Formula(std::span<const std::string> texts, const Constants& constants)
{
    for (const std::string& text : texts)
        expressions_.emplace_back(text, constants);  // says what is wrong
    try
    {
        Compiler compiler(*this, constants);
        for (const std::string& text : texts)
            results_.push_back(compiler.compile(text));
        compiled_ = true;
    }
    catch (const NotKnown&)
    {
        program_.clear();
        results_.clear();
    }
    std::vector<bool> used(program_.size(), false);
    for (const std::uint32_t r : results_)
        used[r] = true;
    for (std::size_t n = program_.size(); n-- > 0;)
        if (used[n] && program_[n].op > Op::variable)
            for (const std::uint32_t f : program_[n].from)
                used[f] = true;
    for (std::size_t n = 0; n < program_.size(); ++n)
        if (used[n])
            program_[n].slot = program_[n].varies && program_[n].op > Op::variable ? 1 + varying_++ : 0;
        else
            program_[n].op = Op::constant;
}

void Formula::evaluate_block(const Columns& at, std::size_t first, std::size_t count, const double* uniform, double* slots,
                             std::span<double* const> results) const
{
    static constexpr auto blocks = table_of<Op>(std::make_index_sequence<static_cast<std::size_t>(Op::maximum) + 1>());
    std::array<const double*, 4> columns{at.X + first, at.Y + first, at.x + first, at.y + first};
    if (count < block)
        for (std::size_t k = 0; k < 4; ++k)
        {
            double* const padded = slots + (varying_ + k) * block;
            for (std::size_t p = 0; p < block; ++p)
                padded[p] = columns[k][std::min(p, count - 1)];
            columns[k] = padded;
        }
    const auto values = [&](std::uint32_t number) -> const double*
    {
        const Instruction& from = program_[number];
        return from.slot > 0 ? slots + (from.slot - 1) * block : from.varies ? columns[from.from[0]] : uniform + number * block;
    };
    for (const Instruction& i : program_)
        if (i.slot > 0)
            blocks[static_cast<std::size_t>(i.op)](values(i.from[0]), values(i.from[1]), values(i.from[2]), slots + (i.slot - 1) * block);
    for (std::size_t r = 0; r < results_.size(); ++r)
        std::copy_n(values(results_[r]), count, results[r] + first);
}

std::vector<double> Formula::uniform_values(double t) const
{
    std::vector<double> spread(program_.size() * block);
    for (std::size_t k = 0; k < program_.size(); ++k)
    {
        const Instruction& i = program_[k];
        if (i.varies)
            continue;
        const auto of = [&](std::size_t n) { return spread[i.from[n] * block]; };
        const double value = i.op == Op::constant ? i.value : i.op == Op::variable ? t : apply(i.op, of(0), of(1), of(2));
        std::fill_n(&spread[k * block], block, value);
    }
    return spread;
}

void Formula::evaluate(const Columns& at, std::size_t n, std::span<double* const> results) const
{
    if (compiled_)
    {
        const std::vector<double> uniform = uniform_values(at.t);
        constexpr std::size_t share = 16 * block;  // of a thread at a time
        parallel_for((n + share - 1) / share,
                     [&](std::size_t s)
                     {
                         std::vector<double> slots((varying_ + 4) * block);
                         for (std::size_t first = s * share; first < std::min(n, (s + 1) * share); first += block)
                             evaluate_block(at, first, std::min(block, n - first), uniform.data(), slots.data(), results);
                     },
                     4);
    }
    for (std::size_t r = 0; r < expressions_.size(); ++r)
        for (std::size_t p = 0; p < n; ++p)
            if (!compiled_ || !std::isfinite(results[r][p]))  // muParser has the last word, and the words for it
                results[r][p] = expressions_[r].finite({at.X[p], at.Y[p], at.x[p], at.y[p], at.t});
}
}  // namespace testbed
