#pragma once
/// Work at the nodes, kept up in every step by passes that have the forces and velocities at hand anyway: the part of the energy ledger
/// (ledger.hpp) that cannot be had from states some steps apart.

#include "core/lattice/nodes.hpp"

namespace testbed
{
/// Work since the start, per metre of thickness [J/m].
struct NodalWork
{
    double kick = 0;        ///< of all forces together: what eqs. (12), (14) add to the nodal kinetic energy
    double gravity = 0;     ///< on the nodes' masses
    double restraints = 0;  ///< of supports and walls on the soil
    double loads = 0;       ///< of tractions and body forces
    double damping = 0;     ///< taken away by damping
    double hourglass = 0;   ///< taken away by hourglass control
    bool of_strain = true;  ///< strain is that of the velocities before and after the kicks, so that internal() is the stresses' work

    template <class Archive>
    void state(Archive& a)
    {
        a.value("kick", "J/m", kick);
        a.value("gravity", "J/m", gravity);
        a.value("restraints", "J/m", restraints);
        a.value("loads", "J/m", loads);
        a.value("damping", "J/m", damping);
        a.value("hourglass", "J/m", hourglass);
    }

    /// Motion that kinetic damping took, which no force did [J/m].
    void note_stopped(double energy)
    {
        damping += energy;
        kick -= energy;
    }
    /// Work done against the stresses: what the other forces do not give to the motion.
    double internal() const { return gravity + restraints + loads - damping - hourglass - kick; }
};

/// What a kick did.
struct Kick
{
    double work = 0;         ///< sum of f . (v before + v after) / 2 dt: exactly the change of the kinetic energy [J/m]
    Vec<2> transport{0, 0};  ///< sum of m (v before + v after) / 2 dt: mass times way [kg]
    double damping = 0;      ///< what damping took [J/m]
};

/// Sums K packs over the nodes in use, in a fixed order: term(i, lanes), zero in the lanes that are not in use.
template <std::size_t K, int dim, class Term>
std::array<double, K> sum_over_nodes(const Nodes<dim>& nodes, Term&& term)
{
    const auto& runs = nodes.runs();
    return ordered_sum<K>(
        runs.size(),
        [&](std::size_t r) TESTBED_FLATTEN
        {
            std::array<Pack, K> total;
            set_zero(total);
            for_each_pack(runs[r].begin, runs[r].begin + runs[r].count,
                          [&](std::size_t i, const auto& lanes)
                          {
                              const std::array<Pack, K> t = term(i, lanes);
                              for (std::size_t k = 0; k < K; ++k)
                                  total[k] += lanes.keep(t[k]);
                          });
            std::array<double, K> s;
            sum(total, s.data());
            return s;
        },
        4);
}

/// Kinetic energy of the nodes [J/m].
template <int dim>
double kinetic_energy(const Nodes<dim>& nodes)
{
    const auto energy = [&](std::size_t i, const auto& lanes)
    {
        const auto v = load(nodes.v, i, lanes);
        return std::array{Pack(0.5) * lanes.load(&nodes.mass[i]) * total<dim>([&](auto d) { return v[d] * v[d]; })};
    };
    return sum_over_nodes<1>(nodes, energy)[0];
}

/// Power of the nodal forces at the velocity before the kick [W/m].
template <int dim>
double nodal_power(const Nodes<dim>& nodes)
{
    return sum_over_nodes<1>(
        nodes, [&](std::size_t i, const auto& lanes)
        { return std::array{total<dim>([&](auto d) { return lanes.load(&nodes.f[d][i]) * lanes.load(&nodes.v[d][i]); })}; })[0];
}
}  // namespace testbed
