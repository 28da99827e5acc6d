#pragma once
/// Closed choices: an enum with one table of names, which parser, documentation, lists and messages share. What is done for each is
/// decided by a switch, which the compiler checks.
///
///     enum class Scheme { usl, usf };
///     constexpr auto names(Scheme) { return choice_names<Scheme>({{Scheme::usl, "usl"}, {Scheme::usf, "usf"}}); }

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace testbed
{
/// The table of an enum's names, found with the enum.
template <class E, std::size_t N>
constexpr std::array<std::pair<E, const char*>, N> choice_names(const std::pair<E, const char*> (&names)[N])
{
    return std::to_array(names);
}

template <class E>
concept Choice = std::is_enum_v<E> && requires(E e)
{
    names(e);
};

template <Choice E>
std::string name_of(E value)
{
    for (const auto& [other, name] : names(value))
        if (other == value)
            return name;
    return "";
}
template <Choice E>
std::vector<std::string> names_of()
{
    std::vector<std::string> all;
    for (const auto& [value, name] : names(E{}))
        all.emplace_back(name);
    return all;
}
template <Choice E>
std::optional<E> find_choice(std::string_view text)
{
    for (const auto& [value, name] : names(E{}))
        if (text == name)
            return value;
    return std::nullopt;
}
}  // namespace testbed
