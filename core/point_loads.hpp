#pragma once
/// Loads on points, spread like mass: a body force given as an expression, and tractions on the faces of boxes, which the
/// outermost row of points carries. Built only for scenes that have one.

#include "core/gather.hpp"
#include "core/geometry.hpp"
#include "core/support.hpp"

namespace testbed
{
inline bool has_point_loads(const Scene& scene)
{
    return scene.body_force || !scene.tractions.empty();
}

class PointLoads
{
public:
    explicit PointLoads(const Scene& scene)
    {
        const Constants constants = scene.expression_constants();
        if (scene.body_force)
            acceleration_.emplace(scene.body_force->acceleration, constants);
        for (const TractionSpec& spec : scene.tractions)
        {
            const BodySpec& body = scene.body(spec.body);
            const std::size_t normal = spec.face == "left" || spec.face == "right" ? 0 : 1;
            const bool low = spec.face == "left" || spec.face == "bottom";
            const double h = spacing(body, scene.grid), face = (low ? *body.min : *body.max)[normal];
            tractions_.push_back({spec.body, normal, low ? face : face - h, low ? face + h : face, h, {spec.traction, constants}});
        }
    }

    /// Adds the force of all bodies: sink(entity, {F_x, F_y}) for each active cell or node of `gather`.
    template <class Support, class Sink>
    void apply(const Lattice& lattice, const std::vector<Body>& bodies, const Gather& gather, double t, Sink&& sink)
    {
        partial_.resize(gather.blocks() * 2);
        std::size_t first_bin = 0;
        for (const Body& body : bodies)
        {
            load(body, t);
            spread<Support, 2>(lattice, body, first_bin, partial_,
                               [&](std::size_t p, const auto& lanes) {
                                   return std::array<Pack, 2>{lanes.load(&bx_[p]), lanes.load(&by_[p])};
                               });
            first_bin += body.bins.list().size();
        }
        gather.sum<2>(partial_, sink);
    }
    std::size_t bytes() const { return bx_.bytes() + by_.bytes() + partial_.capacity() * sizeof(double); }

private:
    struct Traction
    {
        std::string body;
        std::size_t normal;
        double from, to;  ///< initial coordinates of the row of points
        double width;     ///< of the face that each point stands for [m]
        VectorExpression traction;
    };

    /// The force on each point of a body.
    void load(const Body& body, double t)
    {
        const Points& q = body.points;
        bx_.activate(q.count);
        by_.activate(q.count);
        const auto add = [&](std::size_t p, const VectorExpression& density, double size)
        {
            const Vec2 b = density({q.X[p], q.Y[p], q.x[p], q.y[p], t});
            bx_[p] += size * b[0];
            by_[p] += size * b[1];
        };
        if (acceleration_)
            for (std::size_t p = 0; p < q.count; ++p)
                add(p, *acceleration_, q.mass);
        for (const Traction& load : tractions_)
            if (load.body == body.name)
                for (std::size_t p = 0; p < q.count; ++p)
                    if (const double X = (load.normal == 0 ? q.X : q.Y)[p]; X > load.from && X < load.to)
                        add(p, load.traction, load.width);
    }

    std::optional<VectorExpression> acceleration_;
    std::vector<Traction> tractions_;
    Field<double> bx_{"load_x", "N/m"}, by_{"load_y", "N/m"};
    std::vector<double> partial_;
};
}  // namespace testbed
