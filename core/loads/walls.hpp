#pragma once
/// Moving walls (section 2.2 of the paper): all nodes lined up at the wall get its displacement increments; after one cell of
/// travel the next line does. And a smooth variant, which prescribes the velocity at the wall's faces, wherever they lie.

#include "core/base/step.hpp"
#include "core/loads/restraint.hpp"
#include "core/scene/wall_path.hpp"

namespace testbed
{
class Wall
{
public:
    Wall(const WallSpec& spec, const Scene& scene, const Lattice<2>& lattice);

    /// Sets the restraint to the nodes that the wall covers at the start of the step, and to its velocity in its middle. Returns
    /// whether they are others than before.
    /// @throws Diverged if the wall has left the lattice
    bool begin_step(const Step& step, Restraint& restraint);
    void end_step(const Step& step);

    /// @param restraint of this wall, which gets the nodes back that it had
    template <class Archive>
    void state(Archive& a, Restraint& restraint)
    {
        a.vector("travel", "m", travel_);
        bool has_nodes = taken_.has_value();
        Region region = taken_.value_or(Region{});
        a.value("has_nodes", "-", has_nodes);
        a.vector("min", "m", region.min);
        a.vector("max", "m", region.max);
        a.value("door_open", "-", region.door_open);
        if constexpr (Archive::reads)
        {
            taken_.reset();
            if (has_nodes)
                take(region, restraint);
        }
    }

    /// Since the start [m].
    const Vec<2>& displacement() const { return travel_; }
    /// Nodes that the last begin_step() added; not those of the start.
    const std::vector<Index<2>>& new_nodes() const { return new_nodes_; }

private:
    struct Region
    {
        Vec<2> min{0, 0}, max{0, 0};
        bool door_open = false;
        bool operator==(const Region&) const = default;
    };
    Region region(double t) const;
    bool is_open_at(const Region& region, const Vec<2>& place) const;
    void take(const Region& region, Restraint& restraint);
    void take_nodes(const Region& region, Restraint& restraint);
    void take_faces(const Region& region, Restraint& restraint) const;
    void check_on_lattice(const Region& region, double t) const;

    WallSpec spec_;
    Lattice<2> lattice_;
    double reach_;  ///< of the soil beyond the nodes that its mass reaches [cells]
    std::optional<VectorExpression> velocity_;
    Vec<2> travel_{0, 0}, travel_rate_{0, 0};
    std::optional<Region> taken_;
    std::vector<Index<2>> covered_, new_nodes_;
};
}  // namespace testbed
