#include "core/node_ops.hpp"

#include <fmt/format.h>

namespace testbed
{
NodeOps make_node_ops(const Scene& scene, const Lattice& lattice)
{
    NodeOps ops;
    if (scene.gravity)
        ops.forces.push_back(Gravity{scene.gravity->acceleration, scene.gravity->ramp});
    if (scene.damping && scene.damping->local > 0)
        ops.forces.push_back(LocalDamping{scene.damping->local});
    for (const BoundarySpec& spec : scene.boundaries)
    {
        const Expression where(spec.where, scene.expression_constants());
        Fixity fixity;
        for (std::size_t n = 0; n < lattice.nodes(); ++n)
        {
            const Vec2 x = lattice.node_position(n);
            if (!holds_near(where, x[0], x[1], 1e-6 * lattice.cell_size))
                continue;
            if (spec.fix != "y")
                fixity.x.push_back(static_cast<std::uint32_t>(n));
            if (spec.fix != "x")
                fixity.y.push_back(static_cast<std::uint32_t>(n));
        }
        if (fixity.x.empty() && fixity.y.empty())
            throw SceneError(
                fmt::format("{}: boundary '{}': where = \"{}\" holds at no node of the lattice", scene.path, spec.name, spec.where));
        ops.fixities.push_back(std::move(fixity));
    }
    return ops;
}
}  // namespace testbed
