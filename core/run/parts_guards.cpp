#include "core/run/parts_guards.hpp"

#include <algorithm>
#include <fmt/format.h>

namespace testbed
{
namespace
{
bool has_strength(const Scene& scene, const BodySpec& body)
{
    return scene.material(body.material).has_strength();
}

/// An elastic body that is in more parts than at the start was torn by the lattice, not by its law.
class SeparationGuard final : public Remembering<SeparationGuard>
{
public:
    explicit SeparationGuard(const Scene& scene) : reach_(traits_of(scene).reach)
    {
        for (const BodySpec& body : scene.bodies)
            bodies_.push_back({body.name, has_strength(scene, body)});
    }
    void watch(const GuardSample& s, const Solver& solver) override
    {
        if (!s.is_fresh)
            return;
        for (std::size_t b = 0; b < bodies_.size(); ++b)
        {
            Parts& own = bodies_[b];
            own.now = connected_parts(solver.bodies()[b].bins.list(), reach_);
            own.at_start = started_ ? own.at_start : own.now;
            own.most = std::max(own.most, own.now);
        }
        started_ = true;
    }
    std::optional<Finding> finding(bool) const override
    {
        for (const Parts& b : bodies_)
            if (!b.may_break && b.most > b.at_start)
                return Finding{"separated", fmt::format("body '{}' came apart: {} parts between which no force passes, {} at the start",
                                                        b.name, b.most, b.at_start)};
        return std::nullopt;
    }
    std::string note() const override
    {
        std::size_t off = 0;
        for (const Parts& b : bodies_)
            off += b.may_break && b.now > b.at_start ? b.now - b.at_start : 0;
        return off ? fmt::format("parts that came off: {}", off) : "";
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("started", "-", started_);
        a.column("at_start", "-", bodies_, &Parts::at_start);
        a.column("now", "-", bodies_, &Parts::now);
        a.column("most", "-", bodies_, &Parts::most);
    }

private:
    struct Parts
    {
        std::string name;
        bool may_break;
        std::size_t at_start = 0, now = 0, most = 0;
    };
    int reach_;
    bool started_ = false;
    std::vector<Parts> bodies_;
};

/// Bodies on one lattice that touch are bonded; elastic ones have no reason to come off each other.
class ContactGuard final : public Remembering<ContactGuard>
{
public:
    explicit ContactGuard(const Scene& scene) : reach_(traits_of(scene).reach)
    {
        for (const BodySpec& body : scene.bodies)
            names_.push_back(body.name);
        for (std::size_t a = 0; a < scene.bodies.size(); ++a)
            for (std::size_t b = a + 1; b < scene.bodies.size(); ++b)
                if (!has_strength(scene, scene.bodies[a]) && !has_strength(scene, scene.bodies[b]))
                    bonds_.push_back({a, b});
    }
    void watch(const GuardSample& s, const Solver& solver) override
    {
        if (!s.is_fresh)
            return;
        const auto touch = [&](const Bond& bond)
        { return in_contact(solver.bodies()[bond.a].bins.list(), solver.bodies()[bond.b].bins.list(), reach_); };
        if (!started_)
            std::erase_if(bonds_, [&](const Bond& bond) { return !touch(bond); });
        started_ = true;
        for (const Bond& bond : bonds_)
            if (!lost_ && !touch(bond))
                lost_ = bond;
    }
    std::optional<Finding> finding(bool) const override
    {
        if (lost_)
            return Finding{"contact_lost",
                           fmt::format("bodies '{}' and '{}' were bonded and came off each other", names_[lost_->a], names_[lost_->b])};
        return std::nullopt;
    }

    template <class Archive>
    void state(Archive& a)
    {
        a.value("started", "-", started_);
        a.column("a", "-", bonds_, &Bond::a);
        a.column("b", "-", bonds_, &Bond::b);
        std::size_t first = lost_ ? lost_->a : 0, second = lost_ ? lost_->b : 0;  // a body has no bond with itself
        a.value("lost_a", "-", first);
        a.value("lost_b", "-", second);
        if constexpr (Archive::reads)
            lost_ = first == second ? std::nullopt : std::optional(Bond{first, second});
    }

private:
    struct Bond
    {
        std::size_t a, b;
    };
    int reach_;
    bool started_ = false;
    std::vector<Bond> bonds_;
    std::optional<Bond> lost_;
    std::vector<std::string> names_;  ///< of the bodies
};

using Key = std::pair<int, int>;

std::vector<Key> places(const std::vector<Bin<2>>& bins)
{
    std::vector<Key> keys;
    keys.reserve(bins.size());
    for (const Bin<2>& bin : bins)
        keys.emplace_back(bin.at[1], bin.at[0]);
    std::sort(keys.begin(), keys.end());
    return keys;
}

/// f(number) for the keys within reach of one.
template <class F>
void for_each_near(const std::vector<Key>& keys, const Key& at, int reach, F&& f)
{
    for (int j = at.first - reach; j <= at.first + reach; ++j)
        for (auto k = std::lower_bound(keys.begin(), keys.end(), Key{j, at.second - reach});
             k != keys.end() && k->first == j && k->second <= at.second + reach; ++k)
            f(static_cast<std::size_t>(k - keys.begin()));
}
}  // namespace

std::size_t connected_parts(const std::vector<Bin<2>>& bins, int reach)
{
    const std::vector<Key> keys = places(bins);
    std::vector<bool> seen(keys.size());
    std::vector<std::size_t> open;
    std::size_t parts = 0;
    for (std::size_t start = 0; start < keys.size(); ++start)
    {
        if (seen[start])
            continue;
        ++parts;
        seen[start] = true;
        open.assign(1, start);
        while (!open.empty())
        {
            const Key at = keys[open.back()];
            open.pop_back();
            for_each_near(keys, at, reach,
                          [&](std::size_t k)
                          {
                              if (!seen[k])
                                  open.push_back(k);
                              seen[k] = true;
                          });
        }
    }
    return parts;
}

bool in_contact(const std::vector<Bin<2>>& a, const std::vector<Bin<2>>& b, int reach)
{
    const std::vector<Key> keys = places(b);
    bool touch = false;
    for (const Bin<2>& bin : a)
        for_each_near(keys, {bin.at[1], bin.at[0]}, reach, [&](std::size_t) { touch = true; });
    return touch;
}

std::vector<std::unique_ptr<Guard>> parts_guards(const Scene& scene)
{
    std::vector<std::unique_ptr<Guard>> guards;
    guards.push_back(std::make_unique<ContactGuard>(scene));
    guards.push_back(std::make_unique<SeparationGuard>(scene));
    return guards;
}
}  // namespace testbed
