#pragma once
/// Tractions on faces of boxes. Each point of the outermost row carries the force of its part of the initial face, and passes it
/// on where its surface is: to the nodes around that place, bilinearly. Built only where a scene
/// has them.

#include "core/bodies/body.hpp"
#include "core/lattice/nodes.hpp"
#include "core/scene/geometry.hpp"

namespace testbed
{
class Tractions
{
public:
    explicit Tractions(const Scene& scene)
    {
        const Constants constants = scene.expression_constants();
        std::uint32_t first_id = 0;
        for (std::size_t b = 0; b < scene.bodies.size(); ++b)
        {
            const BodySpec& body = scene.bodies[b];
            const std::vector<Vec<2>> initial = fill(scene, body);
            for (const TractionSpec& spec : scene.tractions)
                if (spec.body == body.name)
                    loads_.push_back(make_load(scene, spec, b, initial, first_id, constants));
            first_id += static_cast<std::uint32_t>(initial.size());
        }
    }

    /// Adds the forces to nodes that carry mass.
    void apply(const Lattice<2>& lattice, const std::vector<Body>& bodies, Nodes<2>& nodes, double t) const
    {
        for (const Load& load : loads_)
        {
            const Points<2>& q = bodies[load.body].points;
            for (std::size_t p = 0; p < q.count; ++p)
            {
                const Vec<2>& X = load.initial[q.id[p] - load.first_id];
                if (X[load.normal] < load.from || X[load.normal] > load.to)
                    continue;
                Vec<2> surface{q.x[0][p], q.x[1][p]};
                const double half = q.half_width[0].active() ? q.half_width[load.normal][p] : 0.5 * load.width;
                surface[load.normal] += load.outward * half;
                const Vec<2> traction = load.traction({X[0], X[1], q.x[0][p], q.x[1][p], t});
                give(lattice, surface, {load.width * traction[0], load.width * traction[1]}, nodes);
            }
        }
    }

private:
    struct Load
    {
        std::size_t body, normal;
        double outward, from, to;  ///< initial coordinates of the row of points
        double width;              ///< of the face that each point stands for [m]
        std::uint32_t first_id;
        std::vector<Vec<2>> initial;  ///< of all points of the body, by id
        VectorExpression traction;
    };

    static Load make_load(const Scene& scene, const TractionSpec& spec, std::size_t b, const std::vector<Vec<2>>& initial,
                          std::uint32_t first_id, const Constants& constants)
    {
        const BodySpec& body = scene.bodies[b];
        const bool low = is_low(spec.face);
        const std::size_t normal = normal_of(spec.face);
        const double h = spacing(body, scene.grid), face = (low ? *body.min : *body.max)[normal];
        return {b, normal,   low ? -1.0 : 1.0, low ? face : face - h,     low ? face + h : face,
                h, first_id, initial,          {spec.traction, constants}};
    }

    /// Bilinear, over the nodes that carry mass: a surface that has just entered a cell has not reached its far nodes.
    static void give(const Lattice<2>& lattice, const Vec<2>& place, const Vec<2>& force, Nodes<2>& nodes)
    {
        const double cx = (place[0] - lattice.origin[0]) / lattice.cell_size, cy = (place[1] - lattice.origin[1]) / lattice.cell_size;
        if (!(cx >= -1 && cx < lattice.size[0] + 1 && cy >= -1 && cy < lattice.size[1] + 1))
            return;  // the point itself will be told to have left
        const int i = static_cast<int>(std::floor(cx)), j = static_cast<int>(std::floor(cy));
        const double a = cx - i, b = cy - j;
        std::array<std::size_t, 4> node{};
        std::array<double, 4> weight{};
        double total = 0;
        for (int k = 0; k < 4; ++k)
        {
            if (!lattice.has_node({i + (k & 1), j + (k >> 1)}))
                continue;
            node[k] = lattice.node({i + (k & 1), j + (k >> 1)});
            weight[k] = nodes.mass[node[k]] > 0 ? ((k & 1) ? a : 1 - a) * ((k >> 1) ? b : 1 - b) : 0;
            total += weight[k];
        }
        for (int k = 0; k < 4 && total > 0; ++k)
        {
            nodes.f[0][node[k]] += force[0] * weight[k] / total;
            nodes.f[1][node[k]] += force[1] * weight[k] / total;
        }
    }

    std::vector<Load> loads_;
};
}  // namespace testbed
