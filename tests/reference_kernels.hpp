#pragma once
/// Slow and obvious forms of LPFDM and MPM, written from the equations with plain loops over points, cells and nodes: the
/// oracles of the fast kernels. They share nothing with them but the input.

#include "core/types.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <vector>

namespace testbed::test
{
struct RefPoint
{
    double x, y, m, V, hx, hy, vx = 0, vy = 0;
    double E, nu;
    int rotation;  ///< 1 Jaumann, 2 exact
    SymTensor<> s{};
};

struct RefGrid
{
    double L, ox, oy;
};

using Key = std::pair<int, int>;

inline void ref_stress(RefPoint& p, const Gradient<>& d)
{
    const double w = d.rotation();
    if (p.rotation == 1)
    {
        const SymTensor<> s = p.s;
        p.s.xx += -2 * w * s.xy;
        p.s.yy += 2 * w * s.xy;
        p.s.xy += w * (s.xx - s.yy);
    }
    else
    {
        const double c = std::cos(w), n = std::sin(w);
        const SymTensor<> s = p.s;
        p.s = {c * c * s.xx + n * n * s.yy - 2 * c * n * s.xy, n * n * s.xx + c * c * s.yy + 2 * c * n * s.xy,
               c * n * (s.xx - s.yy) + (c * c - n * n) * s.xy};
    }
    const double lambda = p.E * p.nu / ((1 + p.nu) * (1 - 2 * p.nu)), mu = p.E / (2 * (1 + p.nu));
    p.s.xx += lambda * (d.xx + d.yy) + 2 * mu * d.xx;
    p.s.yy += lambda * (d.xx + d.yy) + 2 * mu * d.yy;
    p.s.xy += mu * (d.xy + d.yx);
}

/// LPFDM, eqs. (4)-(15).
struct RefLpfdm
{
    RefGrid grid;
    std::vector<RefPoint> points;
    bool domain, central;
    double hourglass_rate = 0;
    std::map<Key, Vec2> v{};  ///< velocity of the nodes that had mass in the step before
    std::map<Key, double> old_mass{};
    bool first = true;

    struct Cell
    {
        double M = 0;
        SymTensor<> s{};
        Gradient<> g{};
    };

    /// Cells of a point with their weights.
    std::vector<std::pair<Key, double>> cells_of(const RefPoint& p) const
    {
        std::vector<std::pair<Key, double>> out;
        const double cx = (p.x - grid.ox) / grid.L, cy = (p.y - grid.oy) / grid.L;
        if (!domain)
            return {{{static_cast<int>(std::floor(cx)), static_cast<int>(std::floor(cy))}, 1.0}};
        const double hx = std::min(p.hx / grid.L, 0.5), hy = std::min(p.hy / grid.L, 0.5);
        for (int j = static_cast<int>(std::floor(cy - hy)); j <= static_cast<int>(std::floor(cy + hy)); ++j)
            for (int i = static_cast<int>(std::floor(cx - hx)); i <= static_cast<int>(std::floor(cx + hx)); ++i)
            {
                const double ox = std::min<double>(cx + hx, i + 1) - std::max<double>(cx - hx, i);
                const double oy = std::min<double>(cy + hy, j + 1) - std::max<double>(cy - hy, j);
                if (ox > 1e-9 && oy > 1e-9)
                    out.push_back({{i, j}, ox * oy / (4 * hx * hy)});
            }
        return out;
    }
    void gradients(std::map<Key, Cell>& cells, double dt)
    {
        for (auto& [k, c] : cells)
        {
            const auto [i, j] = k;
            const Vec2 a = v[{i, j}], b = v[{i + 1, j}], d = v[{i, j + 1}], e = v[{i + 1, j + 1}];
            const double f = dt / (2 * grid.L);
            c.g = {(b[0] + e[0] - a[0] - d[0]) * f, (d[1] + e[1] - a[1] - b[1]) * f, (d[0] + e[0] - a[0] - b[0]) * f,
                   (b[1] + e[1] - a[1] - d[1]) * f};
        }
    }
    /// @param initial (point, position of a node) -> velocity that the point's body gives the node
    void step(double dt, const Vec2& gravity, const std::function<Vec2(std::size_t, Vec2)>& initial)
    {
        std::map<Key, Cell> cells;
        const double L = grid.L;
        for (const RefPoint& p : points)
            for (const auto& [k, w] : cells_of(p))
            {
                Cell& c = cells[k];
                const double V = domain ? 4 * p.hx * p.hy : p.V;
                c.M += w * p.m;
                c.s.xx += w * V * p.s.xx / (L * L);
                c.s.yy += w * V * p.s.yy / (L * L);
                c.s.xy += w * V * p.s.xy / (L * L);
            }
        std::map<Key, double> m;
        std::map<Key, Vec2> F;
        const auto corners = [](const Key& k) {
            return std::vector<Key>{{k.first, k.second}, {k.first + 1, k.second}, {k.first, k.second + 1}, {k.first + 1, k.second + 1}};
        };
        for (const auto& [k, c] : cells)
        {
            const double sx[] = {1, -1, 1, -1}, sy[] = {1, 1, -1, -1};
            const auto node = corners(k);
            for (int n = 0; n < 4; ++n)
            {
                m[node[n]] += c.M / 4;
                F[node[n]][0] += L / 2 * (sx[n] * c.s.xx + sy[n] * c.s.xy);
                F[node[n]][1] += L / 2 * (sx[n] * c.s.xy + sy[n] * c.s.yy);
            }
        }
        if (first)
            for (std::size_t n = 0; n < points.size(); ++n)
                for (const auto& [k, w] : cells_of(points[n]))
                    for (const Key& node : corners(k))
                    {
                        const Vec2 given = initial(n, {grid.ox + node.first * L, grid.oy + node.second * L});
                        for (int d = 0; d < 2; ++d)
                            v[node][d] += w * points[n].m / 4 * given[d] / m[node];
                    }
        else
        {
            const std::map<Key, Vec2> before = v;
            std::map<Key, Vec2> now;
            for (const auto& [k, mass] : m)
            {
                if (before.count(k))
                {
                    now[k] = before.at(k);
                    continue;
                }
                double total = 0;
                Vec2 p{0, 0};
                for (int dj = -1; dj <= 1; ++dj)
                    for (int di = -1; di <= 1; ++di)
                        if (const Key n{k.first + di, k.second + dj}; before.count(n))
                        {
                            const double w = m.count(n) ? m.at(n) : old_mass.at(n);
                            total += w;
                            p[0] += w * before.at(n)[0];
                            p[1] += w * before.at(n)[1];
                        }
                now[k] = total > 0 ? Vec2{p[0] / total, p[1] / total} : Vec2{0, 0};
            }
            v = now;
            gradients(cells, dt);
            const std::map<Key, Vec2> u = v;
            for (auto& [k, w] : v)
            {
                const double cx = u.at(k)[0] * dt / L, cy = u.at(k)[1] * dt / L;
                Gradient<> g{};
                double total = 0;
                for (int dj = -1; dj <= 0; ++dj)
                    for (int di = -1; di <= 0; ++di)
                    {
                        const Key c{k.first + di, k.second + dj};
                        if (!cells.count(c))
                            continue;
                        double weight = cells[c].M * (di < 0 ? 1 + cx : 1 - cx) * (dj < 0 ? 1 + cy : 1 - cy);
                        if (!central)
                            weight = (di < 0) == (cx > 0) && (dj < 0) == (cy > 0);
                        const Gradient<>& q = cells[c].g;
                        g = {g.xx + weight * q.xx, g.yy + weight * q.yy, g.xy + weight * q.xy, g.yx + weight * q.yx};
                        total += weight;
                    }
                if (total <= 0)
                    continue;
                g = {g.xx / total, g.yy / total, g.xy / total, g.yx / total};
                const Vec2 before = u.at(k);
                for (int sweep = 0; sweep < (central ? 60 : 1); ++sweep)  // v' = v - G v', by repetition
                    w = {before[0] - w[0] * g.xx - w[1] * g.xy, before[1] - w[0] * g.yx - w[1] * g.yy};
            }
        }
        const double sign[] = {1, -1, -1, 1};
        for (const auto& [k, c] : cells)
        {
            const auto node = corners(k);
            Vec2 q{0, 0};
            for (int n = 0; n < 4; ++n)
                for (int d = 0; d < 2; ++d)
                    q[d] += sign[n] * v[node[n]][d];
            for (int n = 0; n < 4; ++n)
                for (int d = 0; d < 2; ++d)
                    F[node[n]][d] -= hourglass_rate * c.M / 4 * sign[n] * q[d];
        }
        for (auto& [k, w] : v)
            for (int d = 0; d < 2; ++d)
                w[d] += (F[k][d] / m[k] + gravity[d]) * (first ? 0.5 : 1.0) * dt;
        first = false;
        old_mass = m;
        gradients(cells, dt);
        for (RefPoint& p : points)
        {
            Gradient<> g{};
            for (const auto& [k, w] : cells_of(p))
            {
                const Gradient<>& q = cells[k].g;
                g = {g.xx + w * q.xx, g.yy + w * q.yy, g.xy + w * q.xy, g.yx + w * q.yx};
            }
            const double cx = (p.x - grid.ox) / L, cy = (p.y - grid.oy) / L;
            const int i = static_cast<int>(std::floor(cx)), j = static_cast<int>(std::floor(cy));
            const double a = cx - i, b = cy - j;
            for (int n = 0; n < 4; ++n)
            {
                const Vec2 w = v[{i + n % 2, j + n / 2}];
                const double N = (n % 2 ? a : 1 - a) * (n / 2 ? b : 1 - b);
                p.x += N * w[0] * dt;
                p.y += N * w[1] * dt;
            }
            ref_stress(p, g);
            p.V *= 1 + g.xx + g.yy;
            p.hx *= 1 + g.xx;
            p.hy *= 1 + g.yy;
        }
    }
};

/// MPM with the shape function given in one direction, value and slope at distance d of the point's centre from the node.
struct RefMpm
{
    RefGrid grid;
    std::vector<RefPoint> points;
    std::string shape;
    std::string scheme;
    double flip = 1;
    bool b_bar = false;
    bool first = true;
    int xpic = 0;                                                ///< order, 0 is FLIP
    double least = 0;                                            ///< mass of a node that counts
    std::map<Key, std::vector<std::pair<Key, double>>> given{};  ///< shares of the nodes that do not

    struct Node
    {
        double m = 0;
        Vec2 p{0, 0}, f{0, 0}, v{0, 0}, dv{0, 0};
    };
    struct Shape
    {
        Key node;
        double N, gx, gy;
    };
    static double integral(double x)  ///< of the hat function from -infinity
    {
        if (x <= -1)
            return 0;
        if (x <= 0)
            return 0.5 * (1 + x) * (1 + x);
        return x >= 1 ? 1 : 1 - 0.5 * (1 - x) * (1 - x);
    }
    static double hat(double x) { return std::max(0.0, 1 - std::abs(x)); }

    /// With the shape functions of small nodes given to their neighbours.
    std::vector<Shape> shapes(const RefPoint& p) const
    {
        std::vector<Shape> out;
        for (const Shape& s : own_shapes(p))
        {
            const auto found = given.find(s.node);
            if (found == given.end())
                out.push_back(s);
            else
                for (const auto& [master, share] : found->second)
                    out.push_back({master, share * s.N, share * s.gx, share * s.gy});
        }
        return out;
    }
    void find_small_nodes()
    {
        given.clear();
        std::map<Key, double> mass;
        for (const RefPoint& p : points)
            for (const Shape& s : own_shapes(p))
                mass[s.node] += p.m * s.N;
        for (const auto& [k, m] : mass)
        {
            if (m > least)
                continue;
            std::vector<std::pair<Key, double>> masters;
            double total = 0;
            for (int dj = -1; dj <= 1; ++dj)
                for (int di = -1; di <= 1; ++di)
                    if (const Key other{k.first + di, k.second + dj}; mass.count(other) && mass[other] > least)
                    {
                        masters.push_back({other, mass[other]});
                        total += mass[other];
                    }
            for (auto& [master, share] : masters)
                share /= total;
            if (!masters.empty())
                given[k] = masters;
        }
    }
    /// S S+ of a velocity of the points.
    std::vector<Vec2> smoothed(const std::vector<Vec2>& v) const
    {
        std::map<Key, double> mass;
        std::map<Key, Vec2> momentum;
        for (std::size_t n = 0; n < points.size(); ++n)
            for (const Shape& s : shapes(points[n]))
            {
                mass[s.node] += points[n].m * s.N;
                for (int d = 0; d < 2; ++d)
                    momentum[s.node][d] += points[n].m * s.N * v[n][d];
            }
        std::vector<Vec2> out(points.size(), Vec2{0, 0});
        for (std::size_t n = 0; n < points.size(); ++n)
            for (const Shape& s : shapes(points[n]))
                for (int d = 0; d < 2; ++d)
                    if (mass[s.node] > 0)
                        out[n][d] += s.N * momentum[s.node][d] / mass[s.node];
        return out;
    }
    /// (1 - S S+)^m of the velocity of the points: what XPIC(m) takes.
    std::vector<Vec2> taken_by_xpic() const
    {
        std::vector<Vec2> v;
        for (const RefPoint& p : points)
            v.push_back({p.vx, p.vy});
        for (int k = 0; k < xpic; ++k)
        {
            const std::vector<Vec2> u = smoothed(v);
            for (std::size_t n = 0; n < v.size(); ++n)
                v[n] = {v[n][0] - u[n][0], v[n][1] - u[n][1]};
        }
        return v;
    }

    std::vector<Shape> own_shapes(const RefPoint& p) const
    {
        std::vector<Shape> out;
        const double L = grid.L, cx = (p.x - grid.ox) / L, cy = (p.y - grid.oy) / L;
        const int i0 = static_cast<int>(std::floor(cx)), j0 = static_cast<int>(std::floor(cy));
        const auto one = [&](double c, int i, double h, double& N, double& g)
        {
            if (shape != "linear")
            {
                h = shape == "bspline" ? 0.5 : std::min(h / L, 0.5);  // a quadratic B-spline is the mean of a hat over a cell
                N = (integral(c + h - i) - integral(c - h - i)) / (2 * h);
                g = (hat(c + h - i) - hat(c - h - i)) / (2 * h) / L;
            }
            else
            {
                N = hat(c - i);
                g = (c < i ? 1 : -1) / L;
            }
        };
        const int wide = shape == "linear" ? 0 : 1;
        for (int j = j0 - wide; j <= j0 + 1 + wide; ++j)
            for (int i = i0 - wide; i <= i0 + 1 + wide; ++i)
            {
                double Nx, gx, Ny, gy;
                one(cx, i, p.hx, Nx, gx);
                one(cy, j, p.hy, Ny, gy);
                out.push_back({{i, j}, Nx * Ny, gx * Ny, Nx * gy});
            }
        return out;
    }
    double volume(const RefPoint& p) const { return shape == "cpgimp" ? 4 * p.hx * p.hy : p.V; }

    /// Slopes that make the dilatation: of the point, or averaged over its cell with volume as weight.
    std::vector<Vec2> dilatation(std::size_t n) const
    {
        const auto own = shapes(points[n]);
        std::vector<Vec2> out;
        for (const Shape& s : own)
            out.push_back({s.gx, s.gy});
        if (!b_bar)
            return out;
        const auto cell = [&](const RefPoint& p) {
            return Key{static_cast<int>(std::floor((p.x - grid.ox) / grid.L)), static_cast<int>(std::floor((p.y - grid.oy) / grid.L))};
        };
        std::vector<Vec2> mean(own.size(), Vec2{0, 0});
        double total = 0;
        for (const RefPoint& q : points)
            if (q.E == points[n].E && cell(q) == cell(points[n]))
            {
                const auto other = shapes(q);
                total += volume(q);
                for (std::size_t k = 0; k < other.size(); ++k)
                {
                    mean[k][0] += volume(q) * other[k].gx;
                    mean[k][1] += volume(q) * other[k].gy;
                }
            }
        for (Vec2& g : mean)
            g = {g[0] / total, g[1] / total};
        return mean;
    }
    Gradient<> gradient(std::size_t n, const std::map<Key, Node>& nodes, double dt) const
    {
        const auto own = shapes(points[n]);
        const auto b = dilatation(n);
        Gradient<> g{};
        double volumetric = 0;
        for (std::size_t k = 0; k < own.size(); ++k)
        {
            const Vec2 v = nodes.at(own[k].node).v;
            g.xx += own[k].gx * v[0] * dt;
            g.yy += own[k].gy * v[1] * dt;
            g.xy += own[k].gy * v[0] * dt;
            g.yx += own[k].gx * v[1] * dt;
            volumetric += (b[k][0] * v[0] + b[k][1] * v[1]) * dt;
        }
        const double c = 0.5 * (volumetric - g.xx - g.yy);
        return {g.xx + c, g.yy + c, g.xy, g.yx};
    }
    void map_momentum(std::map<Key, Node>& nodes) const
    {
        for (auto& [k, n] : nodes)
            n.m = n.p[0] = n.p[1] = 0;
        for (const RefPoint& p : points)
            for (const Shape& s : shapes(p))
            {
                Node& n = nodes[s.node];
                n.m += p.m * s.N;
                n.p[0] += p.m * p.vx * s.N;
                n.p[1] += p.m * p.vy * s.N;
            }
        for (auto& [k, n] : nodes)
            n.v = n.m > 0 ? Vec2{n.p[0] / n.m, n.p[1] / n.m} : Vec2{0, 0};
    }
    void step(double dt, const Vec2& gravity)
    {
        std::map<Key, Node> nodes;
        if (least > 0)
            find_small_nodes();
        map_momentum(nodes);
        const std::vector<Vec2> taken = xpic ? taken_by_xpic() : std::vector<Vec2>(points.size(), Vec2{0, 0});
        if (scheme == "usf" && !first)
            for (std::size_t n = 0; n < points.size(); ++n)
                ref_stress(points[n], gradient(n, nodes, dt));
        for (std::size_t n = 0; n < points.size(); ++n)
        {
            const RefPoint& p = points[n];
            const auto own = shapes(p);
            const auto b = dilatation(n);
            const double V = volume(p), mean = 0.5 * (p.s.xx + p.s.yy);
            for (std::size_t k = 0; k < own.size(); ++k)
            {
                Vec2& f = nodes[own[k].node].f;
                f[0] -= V * ((p.s.xx - mean) * own[k].gx + p.s.xy * own[k].gy + mean * b[k][0]);
                f[1] -= V * (p.s.xy * own[k].gx + (p.s.yy - mean) * own[k].gy + mean * b[k][1]);
            }
        }
        for (auto& [k, n] : nodes)
            for (int d = 0; d < 2; ++d)
            {
                n.dv[d] = n.m > 0 ? (n.f[d] / n.m + gravity[d]) * (first ? 0.5 : 1.0) * dt : 0;
                n.v[d] += n.dv[d];
            }
        first = false;
        for (std::size_t n = 0; n < points.size(); ++n)
        {
            RefPoint& p = points[n];
            Vec2 dv{-taken[n][0], -taken[n][1]}, v{0, 0};
            for (const Shape& s : shapes(p))
                for (int d = 0; d < 2; ++d)
                {
                    dv[d] += s.N * nodes[s.node].dv[d];
                    v[d] += s.N * nodes[s.node].v[d];
                }
            p.vx = flip * (p.vx + dv[0]) + (1 - flip) * v[0];
            p.vy = flip * (p.vy + dv[1]) + (1 - flip) * v[1];
        }
        const std::map<Key, Node> carrier = nodes;
        if (scheme == "musl")
            map_momentum(nodes);
        std::vector<Gradient<>> g;
        std::vector<Vec2> move;
        for (std::size_t n = 0; n < points.size(); ++n)
        {
            g.push_back(gradient(n, nodes, dt));
            Vec2 u{0, 0};
            for (const Shape& s : shapes(points[n]))
                for (int d = 0; d < 2; ++d)
                    u[d] += s.N * carrier.at(s.node).v[d] * dt;
            move.push_back(u);
        }
        for (std::size_t n = 0; n < points.size(); ++n)
        {
            RefPoint& p = points[n];
            if (scheme != "usf")
                ref_stress(p, g[n]);
            p.V *= 1 + g[n].xx + g[n].yy;
            p.hx *= 1 + g[n].xx;
            p.hy *= 1 + g[n].yy;
            p.x += move[n][0] - 0.5 * dt * taken[n][0];
            p.y += move[n][1] - 0.5 * dt * taken[n][1];
        }
    }
};
}  // namespace testbed::test
