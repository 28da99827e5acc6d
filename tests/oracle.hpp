#pragma once
/// Compares a solver with its oracle, point by point.

#include "core/run/solver.hpp"
#include "core/scene/geometry.hpp"
#include "tests/reference_kernels.hpp"
#include "tests/scenes.hpp"

#include <gtest/gtest.h>

namespace testbed::test
{
/// The points of test::two_bodies() for an oracle, in the order of their ids.
inline std::vector<RefPoint> reference_points(const Scene& scene)
{
    std::vector<RefPoint> points;
    for (const BodySpec& body : scene.bodies)
    {
        const MaterialSpec& m = scene.material(body.material);
        const Expression E(m.youngs_modulus, scene.expression_constants());
        const VectorExpression v(*body.velocity, scene.expression_constants());
        const double h = spacing(body, scene.grid);
        for (const Vec<2>& X : fill(scene, body))
        {
            const Place at{X[0], X[1], X[0], X[1], 0};
            points.push_back({X[0], X[1], m.density * h * h, h * h, h / 2, h / 2, v(at)[0], v(at)[1], E(at), m.poissons_ratio,
                              m.law == Laws::place_of<HypoelasticJaumann>() ? 1 : 2});
        }
    }
    return points;
}

inline void expect_same(const Solver& solver, const std::vector<RefPoint>& reference, double tolerance)
{
    for (const Body& body : solver.bodies())
    {
        const Points<2>& q = body.points;
        const double E = moduli(body.material).youngs_modulus();
        for (std::size_t p = 0; p < q.count; ++p)
        {
            const RefPoint& r = reference[q.id[p]];
            ASSERT_NEAR(q.x[0][p], r.x, tolerance) << body.name << " " << q.id[p];
            ASSERT_NEAR(q.x[1][p], r.y, tolerance) << body.name << " " << q.id[p];
            ASSERT_NEAR(q.stress[0][p], r.s.xx, tolerance * E) << body.name << " " << q.id[p];
            ASSERT_NEAR(q.stress[1][p], r.s.yy, tolerance * E) << body.name << " " << q.id[p];
            ASSERT_NEAR(q.stress[2][p], r.s.xy, tolerance * E) << body.name << " " << q.id[p];
            const double V = q.half_width[0].active() ? 4 * r.hx * r.hy : r.V;
            ASSERT_NEAR(q.current_volume(p) / V, 1, 10 * tolerance) << body.name << " " << q.id[p];
        }
    }
}
}  // namespace testbed::test
