#pragma once
/// What a law offers, and what follows from a list of them: names, keys of a material, the closed set that kernels visit, and how the
/// law of a scene's material is made.

#include "core/base/choice.hpp"
#include "core/materials/elastic.hpp"

#include <array>
#include <concepts>
#include <tuple>
#include <variant>

namespace testbed
{
/// What a law must offer: a pure point function (which a quadrature point or a triangle can call, too), its batch form, and what only
/// the law knows of itself: energy, wave speed, out-of-plane stress, kinematics.
template <class Law>
concept MaterialLaw = requires(const Law law, typename Law::template State<double> state, Points<2> points, Gradient<2> d,
                               Gradient<2, Pack> packs)
{
    {
        law.moduli
        } -> std::convertible_to<ElasticModuli>;
    {
        Law::kinematics
        } -> std::convertible_to<Kinematics>;
    {
        Law::is_cheap  // beside moving a point: it is then updated in the same pass
        } -> std::convertible_to<bool>;
    {
        law.wave_speed(points)
        } -> std::same_as<double>;
    {
        law.energy_density(SymTensor<2>{}, 0.0)
        } -> std::same_as<double>;
    {
        law.out_of_plane_stress(points, std::size_t{})
        } -> std::same_as<double>;
    {
        law.elastic_out_of_plane_stress(SymTensor<2>{})
        } -> std::same_as<double>;
    law.allocate(points);
    law.update(state, d);
    law.update(points, std::size_t{}, AllLanes{}, packs);
};

/// What a row of the list is: the plain form of a law, its name, the keys of a material that it reads, the forms that it takes on the
/// points of a body and what chooses among them.
template <class L>
concept LawFamily = MaterialLaw<L> && requires(const typename L::Keys keys, const LawInput input)
{
    {
        L::name
        } -> std::convertible_to<const char*>;
    {
        L::has_strength
        } -> std::convertible_to<bool>;
    {
        L::make(keys, input)
        } -> std::same_as<typename L::Forms>;
};

namespace detail
{
template <class... Forms>
struct Joined;
template <class... Form>
struct Joined<std::variant<Form...>>
{
    static_assert((MaterialLaw<Form> && ...));
    using type = std::variant<Form...>;
};
template <class... A, class... B, class... Rest>
struct Joined<std::variant<A...>, std::variant<B...>, Rest...> : Joined<std::variant<A..., B...>, Rest...>
{
};

template <class Found, class... More>
struct Distinct;
template <class... Found>
struct Distinct<std::tuple<Found...>>
{
    /// Keys of a material, those that laws share once.
    struct Keys : Found...
    {
        template <class V>
        void describe(V& v)
        {
            (Found::describe(v), ...);
        }
    };
};
template <class... Found, class Next, class... More>
struct Distinct<std::tuple<Found...>, Next, More...>
    : Distinct<std::conditional_t<(std::same_as<Found, Next> || ...), std::tuple<Found...>, std::tuple<Found..., Next>>, More...>
{
};
}  // namespace detail

/// A law by its place in the list.
enum class Law : std::size_t
{
};

template <LawFamily... L>
struct LawList
{
    using Material = typename detail::Joined<typename L::Forms...>::type;
    using Keys = typename detail::Distinct<std::tuple<>, typename L::Keys...>::Keys;

    static constexpr auto names()
    {
        std::size_t k = 0;
        return std::array{std::pair<Law, const char*>{Law{k++}, L::name}...};
    }
    template <class Wanted>
    static constexpr Law place_of()
    {
        std::size_t k = 0;
        ((std::same_as<L, Wanted> || (++k, false)) || ...);
        return Law{k};
    }
    static constexpr bool has_strength(Law law) { return std::array{L::has_strength...}.at(static_cast<std::size_t>(law)); }
    static Material make(Law law, const Keys& keys, const LawInput& input)
    {
        using Maker = Material (*)(const Keys&, const LawInput&);
        constexpr std::array<Maker, sizeof...(L)> makers{
            [](const Keys& k, const LawInput& i) { return std::visit([](const auto& form) { return Material(form); }, L::make(k, i)); }...};
        return makers.at(static_cast<std::size_t>(law))(keys, input);
    }
};
}  // namespace testbed
