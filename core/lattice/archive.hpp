#pragma once
/// The state of a solver, named once: a class lists what its next step depends on in `template <class Archive> void state(Archive&)`, in
/// the manner of the describe() of a scene, and the archives here write it to memory and read it back to the same bits. What follows from
/// the rest (sums, cells and nodes in use) is not listed but made again by who reads.

#include "core/base/field.hpp"
#include "core/lattice/lattice.hpp"

#include <fmt/format.h>
#include <functional>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>

namespace testbed
{
/// A state in memory: parts in the order in which they are listed. Integers are exact in a double.
struct State
{
    struct Part
    {
        std::string name, unit;  ///< name: with its groups, such as "body/sand/x"
        std::size_t begin, count;
    };
    std::vector<double> numbers;
    std::vector<Part> parts;

    /// Place of a part in `parts`, the same for all states of one solver; their number if there is none of that name.
    std::size_t find(std::string_view name) const
    {
        return static_cast<std::size_t>(std::find_if(parts.begin(), parts.end(), [&](const Part& p) { return p.name == name; }) -
                                        parts.begin());
    }
    std::span<double> of(std::size_t part) { return {numbers.data() + parts[part].begin, parts[part].count}; }
    std::span<const double> of(std::size_t part) const { return {numbers.data() + parts[part].begin, parts[part].count}; }
};

/// What can be listed. Derived::part(name, unit, count, get) takes the numbers get(0), ..., references, from the state or to it;
/// Derived::size(present) says how many a list has that may have another length in the state.
template <class Derived>
class Archive
{
public:
    /// What f() lists stands under this name.
    template <class F>
    void group(const std::string& name, F&& f)
    {
        const std::string outer = group_;
        group_ += name + "/";
        f();
        group_ = outer;
    }
    template <class T>
    void value(std::string_view name, std::string_view unit, T& value)
    {
        self().part(name, unit, 1, [&](std::size_t) -> T& { return value; });
    }
    template <std::size_t dim>
    void vector(std::string_view name, std::string_view unit, std::array<double, dim>& value)
    {
        self().part(name, unit, dim, [&](std::size_t k) -> double& { return value[k]; });
    }
    /// Its components under names that begin with i, j, k.
    template <int dim>
    void index(const std::string& ending, Index<dim>& value)
    {
        for (int d = 0; d < dim; ++d)
            this->value(index_names[d] + ending, "-", value[d]);
    }
    /// With a flag that says whether there is a value.
    template <class T>
    void optional(const std::string& name, std::string_view unit, std::optional<T>& value)
    {
        bool given = value.has_value();
        T held = value.value_or(T{});
        this->value(name + "_given", "-", given);
        if constexpr (std::is_arithmetic_v<T>)
            this->value(name, unit, held);
        else
            vector(name, unit, held);
        if constexpr (Derived::reads)
            value = given ? std::optional<T>(held) : std::nullopt;
    }
    /// A list, or one member of each of its entries.
    template <class T, class Member = std::identity>
    void column(std::string_view name, std::string_view unit, std::vector<T>& list, Member member = {})
    {
        list.resize(self().size(list.size()));
        self().part(
            name, unit, list.size(), [&](std::size_t k) -> auto& { return std::invoke(member, list[k]); });
    }
    /// A list of an Index for each entry: a column for each of its components.
    template <class T, class Member = std::identity>
    void indices(std::vector<T>& list, Member member = {})
    {
        for (std::size_t d = 0; d < std::invoke(member, T{}).size(); ++d)
            column(index_names[d], "-", list, [&](T& entry) -> int& { return std::invoke(member, entry)[d]; });
    }
    template <class T>
    void field(Field<T>& field, std::size_t count)
    {
        self().part(field.name(), field.unit(), count, [&](std::size_t k) -> T& { return field[k]; });
    }
    /// Values at some nodes.
    template <int dim>
    void nodal(std::string_view name, std::string_view unit, const Lattice<dim>& lattice, const std::vector<Index<dim>>& at,
               std::vector<double>& values)
    {
        self().part(name, unit, at.size(), [&](std::size_t k) -> double& { return values[lattice.node(at[k])]; });
    }

protected:
    const std::string& group_name() const { return group_; }

private:
    static constexpr std::array<const char*, 3> index_names{"i", "j", "k"};
    Derived& self() { return static_cast<Derived&>(*this); }
    std::string group_;
};

class StateWriter : public Archive<StateWriter>
{
public:
    static constexpr bool reads = false;
    explicit StateWriter(State& to) : to_(to) {}

    static std::size_t size(std::size_t present) { return present; }
    template <class Get>
    void part(std::string_view name, std::string_view unit, std::size_t count, Get&& get)
    {
        to_.parts.push_back({group_name() + std::string(name), std::string(unit), to_.numbers.size(), count});
        for (std::size_t k = 0; k < count; ++k)
            to_.numbers.push_back(static_cast<double>(get(k)));
    }

private:
    State& to_;
};

/// @throws std::logic_error for a state of another solver
class StateReader : public Archive<StateReader>
{
public:
    static constexpr bool reads = true;
    explicit StateReader(const State& from) : from_(from) {}

    std::size_t size(std::size_t) const { return next_ < from_.parts.size() ? from_.parts[next_].count : 0; }
    template <class Get>
    void part(std::string_view name, std::string_view, std::size_t count, Get&& get)
    {
        if (next_ == from_.parts.size() || from_.parts[next_].name != group_name() + std::string(name) || from_.parts[next_].count != count)
            throw std::logic_error(
                fmt::format("a state of another solver: '{}{}' with {} numbers is not its part {}", group_name(), name, count, next_));
        const std::span<const double> values = from_.of(next_++);
        for (std::size_t k = 0; k < count; ++k)
            get(k) = static_cast<std::remove_reference_t<decltype(get(k))>>(values[k]);
    }

    /// @throws std::logic_error if parts are left
    void end() const
    {
        if (next_ < from_.parts.size())
            throw std::logic_error(fmt::format("a state of another solver: nothing asks for its part '{}'", from_.parts[next_].name));
    }
    /// The parts that come next whose names begin with the present group, as many as there are; their names go without it.
    std::vector<State::Part> coming() const
    {
        std::vector<State::Part> parts;
        for (std::size_t n = next_; n < from_.parts.size() && from_.parts[n].name.starts_with(group_name()); ++n)
        {
            parts.push_back(from_.parts[n]);
            parts.back().name.erase(0, group_name().size());
        }
        return parts;
    }

private:
    const State& from_;
    std::size_t next_ = 0;
};
}  // namespace testbed
