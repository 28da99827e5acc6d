#pragma once
/// Slow and obvious forms of LPFDM and MPM, written from the equations with plain loops over points, cells and nodes: the
/// oracles of the fast kernels. They share nothing with them but the input.

#include "core/base/types.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <vector>

namespace testbed::test
{
struct RefPoint
{
    double x, y, m, V, hx, hy, vx = 0, vy = 0;
    double E, nu;
    int rotation;  ///< 1 Jaumann, 2 exact
    SymTensor<2> s{};
};

struct RefGrid
{
    double L, ox, oy;
};

using Key = std::pair<int, int>;

inline void ref_stress(RefPoint& p, const Gradient<2>& d)
{
    const double w = d.rotation();
    if (p.rotation == 1)
    {
        const SymTensor<2> s = p.s;
        p.s.xx += -2 * w * s.xy;
        p.s.yy += 2 * w * s.xy;
        p.s.xy += w * (s.xx - s.yy);
    }
    else
    {
        const double c = std::cos(w), n = std::sin(w);
        const SymTensor<2> s = p.s;
        p.s = {c * c * s.xx + n * n * s.yy - 2 * c * n * s.xy, n * n * s.xx + c * c * s.yy + 2 * c * n * s.xy,
               c * n * (s.xx - s.yy) + (c * c - n * n) * s.xy};
    }
    const double lambda = p.E * p.nu / ((1 + p.nu) * (1 - 2 * p.nu)), mu = p.E / (2 * (1 + p.nu));
    p.s.xx += lambda * (d.xx + d.yy) + 2 * mu * d.xx;
    p.s.yy += lambda * (d.xx + d.yy) + 2 * mu * d.yy;
    p.s.xy += mu * (d.xy + d.yx);
}

/// 1 / (1 + e) as far as the square of e: so far do the methods take it for the strain of one step.
inline double ref_inverse(double e)
{
    return 1 - e + e * e;
}

/// Gradient of the displacement over the middle of the step, G (I + G/2)^-1, from the one over its start.
inline Gradient<2> ref_midpoint(const Gradient<2>& g)
{
    const double a = 1 + g.xx / 2, b = g.xy / 2, c = g.yx / 2, d = 1 + g.yy / 2, inverse = ref_inverse(a * d - b * c - 1);
    return {(g.xx * d - g.xy * c) * inverse, (g.yy * a - g.yx * b) * inverse, (g.xy * a - g.xx * b) * inverse,
            (g.yx * d - g.yy * c) * inverse};
}

/// New over old length for a strain over the middle of the step, (1 + d/2) / (1 - d/2) as far as the square of d.
inline double ref_ratio(double d)
{
    return 1 + d + d * d / 2;
}

/// v of (I + G) v = u, by repetition.
inline Vec<2> ref_departed(const Vec<2>& u, const Gradient<2>& g)
{
    Vec<2> v = u;
    for (int sweep = 0; sweep < 60; ++sweep)
        v = {u[0] - v[0] * g.xx - v[1] * g.xy, u[1] - v[0] * g.yx - v[1] * g.yy};
    return v;
}

/// LPFDM, eqs. (4)-(15).
struct RefLpfdm
{
    RefGrid grid;
    std::vector<RefPoint> points;
    bool domain, central;
    bool two_sided = false, arrival = false;
    double hourglass_rate = 0;
    std::map<Key, Vec<2>> v{};      ///< velocity of the nodes that had mass in the step before
    std::map<Key, Vec<2>> ahead{};  ///< of nodes without mass that belong to a point's 2 x 2 cells
    std::map<Key, double> old_mass{};
    std::set<Key> faces{};
    double sliver_mass = 0;  ///< below which a node counts as a sliver
    double last_dt = 0;
    bool first = true;

    struct Cell
    {
        double M = 0;
        SymTensor<2> s{};
        Gradient<2> g{};
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
            const Vec<2> a = v[{i, j}], b = v[{i + 1, j}], d = v[{i, j + 1}], e = v[{i + 1, j + 1}];
            const double f = dt / (2 * grid.L);
            c.g = {(b[0] + e[0] - a[0] - d[0]) * f, (d[1] + e[1] - a[1] - b[1]) * f, (d[0] + e[0] - a[0] - b[0]) * f,
                   (b[1] + e[1] - a[1] - d[1]) * f};
        }
    }
    static double mass_of(const std::map<Key, Cell>& cells, int i, int j)
    {
        const auto found = cells.find({i, j});
        return found == cells.end() ? 0 : found->second.M;
    }
    /// Share of a side that is missing: 0 while the lighter side has half of the heavier one or more.
    static double missing(double a, double b) { return a == b ? 0 : std::max(0.0, 1 - 2 * std::min(a, b) / std::max(a, b)); }
    void find_faces(const std::map<Key, Cell>& cells, const std::map<Key, double>& m)
    {
        faces.clear();
        for (const auto& [k, mass] : m)
        {
            const auto [i, j] = k;
            const double a = mass_of(cells, i - 1, j - 1), b = mass_of(cells, i, j - 1), c = mass_of(cells, i - 1, j),
                         d = mass_of(cells, i, j);
            if ((missing(a + c, b + d) > 0 && v[k][0] != 0) || (missing(a + b, c + d) > 0 && v[k][1] != 0) || mass < sliver_mass)
                faces.insert(k);
        }
    }
    /// v(x) <- v(x - v dt/2), with what arrives at the nodes that won mass.
    void convect_half(std::map<Key, Cell>& cells, const std::map<Key, double>& m, double dt, bool mass_arrives)
    {
        const double h = dt / 2, L = grid.L;
        gradients(cells, dt);
        const std::map<Key, Vec<2>> u = v;
        std::map<Key, Gradient<2>> rate;  // velocity gradient at nodes: mean of the cells, at half of the way that is gone in dt/2
        for (const auto& [k, mass] : m)
        {
            double total = 0;
            for (int dj = -1; dj <= 0; ++dj)
                for (int di = -1; di <= 0; ++di)
                {
                    const auto found = cells.find({k.first + di, k.second + dj});
                    if (found == cells.end())
                        continue;
                    const double x = std::clamp(u.at(k)[0] * h / L, -1.0, 1.0), y = std::clamp(u.at(k)[1] * h / L, -1.0, 1.0);
                    const double w = found->second.M * (di < 0 ? 1 + x : 1 - x) * (dj < 0 ? 1 + y : 1 - y);
                    rate[k] = rate[k] + (w / dt) * found->second.g;
                    total += w;
                }
            rate[k] = (1 / total) * rate[k];
        }
        // what the neighbours say of a node: mean velocity, and what their gradients add on the way to it
        const auto neighbours = [&](const Key& k, const std::map<Key, Vec<2>>& velocity, bool with_mass_before)
        {
            double total = 0;
            Vec<2> mean{0, 0}, beyond{0, 0};
            for (const auto& [other, mass] : m)
            {
                const int di = k.first - other.first, dj = k.second - other.second;
                if (other == k || std::abs(di) > 1 || std::abs(dj) > 1 || (with_mass_before && !old_mass.count(other)))
                    continue;
                const double w = with_mass_before ? std::min(mass, old_mass.at(other)) : mass;
                const Gradient<2>& g = rate.at(other);
                total += w;
                for (int d = 0; d < 2; ++d)
                    mean[d] += w * velocity.at(other)[d];
                beyond[0] += w * L * (g.xx * di + g.xy * dj);
                beyond[1] += w * L * (g.yx * di + g.yy * dj);
            }
            if (total > 0)
                for (int d = 0; d < 2; ++d)
                {
                    mean[d] /= total;
                    beyond[d] /= total;
                }
            return std::pair{mean, beyond};
        };
        for (const auto& [k, mass] : m)
        {
            const auto [i, j] = k;
            Vec<2> w = u.at(k);
            Gradient<2> g = h * rate.at(k);
            if (faces.count(k))
            {
                const Vec<2> moves = w;
                const double before = old_mass.count(k) ? old_mass.at(k) : 0;
                const double share = std::max({0.0, mass_arrives ? 1 - before / mass : 0.0, 1 - mass / sliver_mass});
                if (share > 0)
                {
                    const auto [mean, beyond] = neighbours(k, u, mass_arrives);
                    const double own = std::hypot(w[0] - mean[0], w[1] - mean[1]), far = std::hypot(beyond[0], beyond[1]);
                    const double limit = far > own ? own / far : 1, factor = share + (1 - share) * limit;
                    for (int d = 0; d < 2; ++d)
                        w[d] = (1 - share) * w[d] + share * (mean[d] + factor * beyond[d]);
                }
                // derivatives across a face: from the two cells one further inside
                const auto pair = [&](const Key& a, const Key& b)
                {
                    double M = 0;
                    Gradient<2> mean{};
                    for (const Key& c : {a, b})
                        if (cells.count(c))
                        {
                            M += cells.at(c).M;
                            mean = mean + (cells.at(c).M / dt) * cells.at(c).g;
                        }
                    return std::pair{M, M > 0 ? (1 / M) * mean : mean};
                };
                const double left = mass_of(cells, i - 1, j - 1) + mass_of(cells, i - 1, j),
                             right = mass_of(cells, i, j - 1) + mass_of(cells, i, j);
                const double down = mass_of(cells, i - 1, j - 1) + mass_of(cells, i, j - 1),
                             up = mass_of(cells, i - 1, j) + mass_of(cells, i, j);
                // where the face leads, the part of its own derivative that damps
                const auto across = [&](const Vec<2>& own, const Vec<2>& strain, const Vec<2>& next, bool leads)
                {
                    const Vec<2> apart{own[0] - next[0], own[1] - next[1]};
                    const double square = apart[0] * apart[0] + apart[1] * apart[1];
                    if (!leads || square == 0)
                        return next;
                    const double along = 2 * (strain[0] * apart[0] + strain[1] * apart[1]) / square;
                    const double own_part = (1 - std::max(0.0, share)) * std::min(1.0, std::max(0.0, along));
                    return Vec<2>{next[0] + own_part * apart[0], next[1] + own_part * apart[1]};
                };
                const Gradient<2> own = g;
                if (const double part = missing(left, right); part > 0)
                {
                    const int next = right > left ? i + 1 : i - 2;
                    const auto [M, inner] = pair({next, j - 1}, {next, j});
                    const double take = h * std::min(1.0, M / std::max(left, right));
                    const Vec<2> d = across({own.xx, own.yx}, {own.xx, (own.xy + own.yx) / 2}, {take * inner.xx, take * inner.yx},
                                            (left - right) * moves[0] > 0);
                    g.xx = (1 - part) * own.xx + part * d[0];
                    g.yx = (1 - part) * own.yx + part * d[1];
                }
                if (const double part = missing(down, up); part > 0)
                {
                    const int next = up > down ? j + 1 : j - 2;
                    const auto [M, inner] = pair({i - 1, next}, {i, next});
                    const double take = h * std::min(1.0, M / std::max(down, up));
                    const Vec<2> d = across({own.xy, own.yy}, {(own.xy + own.yx) / 2, own.yy}, {take * inner.xy, take * inner.yy},
                                            (down - up) * moves[1] > 0);
                    g.xy = (1 - part) * own.xy + part * d[0];
                    g.yy = (1 - part) * own.yy + part * d[1];
                }
            }
            v[k] = ref_departed(w, g);
        }
        ahead.clear();
        for (const RefPoint& p : points)
        {
            const Key bin = bin_of(p);
            for (int b = 0; b <= 2 && domain; ++b)
                for (int a = 0; a <= 2; ++a)
                    if (const Key k{bin.first + a, bin.second + b}; !m.count(k) && !ahead.count(k))
                    {
                        const auto [mean, beyond] = neighbours(k, v, false);
                        ahead[k] = {mean[0] + beyond[0], mean[1] + beyond[1]};
                    }
        }
    }
    /// First of the 2 x 2 cells that a box can reach.
    Key bin_of(const RefPoint& p) const
    {
        return {static_cast<int>(std::floor((p.x - grid.ox) / grid.L - std::min(p.hx / grid.L, 0.5) + 1e-9)),
                static_cast<int>(std::floor((p.y - grid.oy) / grid.L - std::min(p.hy / grid.L, 0.5) + 1e-9))};
    }
    Vec<2> velocity_of(const Key& k) const
    {
        if (const auto found = v.find(k); found != v.end())
            return found->second;
        const auto found = ahead.find(k);
        return found == ahead.end() ? Vec<2>{0, 0} : found->second;
    }
    /// Moves and strains a box with the velocity that it meets in the middle of the step. It gets there with the mean gradient of its 2 x 2
    /// cells about their middle node.
    void move_from_mid_step(RefPoint& p, double dt)
    {
        const double L = grid.L, hx = std::min(p.hx / L, 0.5), hy = std::min(p.hy / L, 0.5);
        const Key bin = bin_of(p);
        Gradient<2> cell[2][2], mean{};
        for (int j = 0; j < 2; ++j)
            for (int i = 0; i < 2; ++i)
            {
                const auto at = [&](int a, int b) { return velocity_of({bin.first + i + a, bin.second + j + b}); };
                const Vec<2> a = at(0, 0), b = at(1, 0), c = at(0, 1), d = at(1, 1);
                const double f = dt / (2 * L);
                cell[j][i] = {f * (b[0] + d[0] - a[0] - c[0]), f * (c[1] + d[1] - a[1] - b[1]), f * (c[0] + d[0] - a[0] - b[0]),
                              f * (b[1] + d[1] - a[1] - c[1])};
                mean = mean + 0.25 * cell[j][i];
            }
        const Vec<2> u = velocity_of({bin.first + 1, bin.second + 1});
        const double x = (p.x - grid.ox) / L - bin.first - 1, y = (p.y - grid.oy) / L - bin.second - 1;  // from the middle node
        // how far beyond the lattice lines it is then, in lengths of the start
        const double bx = x + (mean.xy * y + u[0] * dt / L) / 2 * ref_inverse(mean.xx / 2);
        const double by = y + (mean.yx * x + u[1] * dt / L) / 2 * ref_inverse(mean.yy / 2);
        const double a = std::clamp((bx + hx) / (2 * hx), 0.0, 1.0), b = std::clamp((by + hy) / (2 * hy), 0.0, 1.0);
        const Gradient<2> g = (1 - a) * (1 - b) * cell[0][0] + a * (1 - b) * cell[0][1] + (1 - a) * b * cell[1][0] + a * b * cell[1][1];
        const double X = bx * (1 + mean.xx / 2), Y = by * (1 + mean.yy / 2);
        const double nx[] = {std::max(0.0, -X), 1 - std::abs(X), std::max(0.0, X)},
                     ny[] = {std::max(0.0, -Y), 1 - std::abs(Y), std::max(0.0, Y)};
        for (int j = 0; j < 3; ++j)
            for (int i = 0; i < 3; ++i)
            {
                const Vec<2> w = velocity_of({bin.first + i, bin.second + j});
                p.x += nx[i] * ny[j] * w[0] * dt;
                p.y += nx[i] * ny[j] * w[1] * dt;
            }
        ref_stress(p, g);
        p.hx *= ref_ratio(g.xx);
        p.hy *= ref_ratio(g.yy);
    }
    /// @param initial (point, position of a node) -> velocity that the point's body gives the node
    void step(double dt, const Vec<2>& gravity, const std::function<Vec<2>(std::size_t, Vec<2>)>& initial)
    {
        std::map<Key, Cell> cells;
        const double L = grid.L;
        if (first)
        {
            sliver_mass = 1e-3 * L * L * points[0].m / points[0].V;
            for (const RefPoint& p : points)
                sliver_mass = std::min(sliver_mass, 1e-3 * L * L * p.m / p.V);
        }
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
        std::map<Key, Vec<2>> F;
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
                        const Vec<2> given = initial(n, {grid.ox + node.first * L, grid.oy + node.second * L});
                        for (int d = 0; d < 2; ++d)
                            v[node][d] += w * points[n].m / 4 * given[d] / m[node];
                    }
        else
        {
            const std::map<Key, Vec<2>> before = v;
            std::map<Key, Vec<2>> now;
            for (const auto& [k, mass] : m)
            {
                if (before.count(k))
                {
                    now[k] = before.at(k);
                    continue;
                }
                double total = 0;
                Vec<2> p{0, 0};
                for (int dj = -1; dj <= 1; ++dj)
                    for (int di = -1; di <= 1; ++di)
                        if (const Key n{k.first + di, k.second + dj}; before.count(n))
                        {
                            const double w = m.count(n) ? m.at(n) : old_mass.at(n);
                            total += w;
                            p[0] += w * before.at(n)[0];
                            p[1] += w * before.at(n)[1];
                        }
                now[k] = total > 0 ? Vec<2>{p[0] / total, p[1] / total} : Vec<2>{0, 0};
            }
            v = now;
            gradients(cells, last_dt);
            const std::map<Key, Vec<2>> u = v;
            if (two_sided)
            {
                find_faces(cells, m);
                convect_half(cells, m, last_dt, arrival);
            }
            for (auto& [k, w] : v)
            {
                if (two_sided)
                    break;
                const double cx = u.at(k)[0] * last_dt / L, cy = u.at(k)[1] * last_dt / L;
                Gradient<2> g{};
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
                        const Gradient<2>& q = cells[c].g;
                        g = {g.xx + weight * q.xx, g.yy + weight * q.yy, g.xy + weight * q.xy, g.yx + weight * q.yx};
                        total += weight;
                    }
                if (total <= 0)
                    continue;
                g = {g.xx / total, g.yy / total, g.xy / total, g.yx / total};
                const Vec<2> before = u.at(k);
                for (int sweep = 0; sweep < (central ? 60 : 1); ++sweep)  // v' = v - G v', by repetition
                    w = {before[0] - w[0] * g.xx - w[1] * g.xy, before[1] - w[0] * g.yx - w[1] * g.yy};
            }
        }
        const double sign[] = {1, -1, -1, 1};
        for (const auto& [k, c] : cells)
        {
            const auto node = corners(k);
            Vec<2> q{0, 0};
            for (int n = 0; n < 4; ++n)
                for (int d = 0; d < 2; ++d)
                    q[d] += sign[n] * v[node[n]][d];
            for (int n = 0; n < 4; ++n)
                for (int d = 0; d < 2; ++d)
                    F[node[n]][d] -= hourglass_rate * c.M / 4 * sign[n] * q[d];
        }
        for (auto& [k, w] : v)
            for (int d = 0; d < 2; ++d)
                w[d] += (F[k][d] / m[k] + gravity[d]) * 0.5 * (last_dt + dt);
        if (two_sided)
        {
            if (first)
                find_faces(cells, m);
            convect_half(cells, m, dt, false);
        }
        first = false;
        last_dt = dt;
        old_mass = m;
        gradients(cells, dt);
        for (RefPoint& p : points)
        {
            if (two_sided && domain)
            {
                move_from_mid_step(p, dt);
                continue;
            }
            Gradient<2> g{};
            for (const auto& [k, w] : cells_of(p))
            {
                const Gradient<2>& q = cells[k].g;
                g = {g.xx + w * q.xx, g.yy + w * q.yy, g.xy + w * q.xy, g.yx + w * q.yx};
            }
            const double cx = (p.x - grid.ox) / L, cy = (p.y - grid.oy) / L;
            const int i = static_cast<int>(std::floor(cx)), j = static_cast<int>(std::floor(cy));
            const double a = cx - i, b = cy - j;
            for (int n = 0; n < 4; ++n)
            {
                const Vec<2> w = v[{i + n % 2, j + n / 2}];
                const double N = (n % 2 ? a : 1 - a) * (n / 2 ? b : 1 - b);
                p.x += N * w[0] * dt;
                p.y += N * w[1] * dt;
            }
            ref_stress(p, g);
            p.V *= two_sided ? ref_ratio(g.xx + g.yy) : 1 + g.xx + g.yy;
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
    bool midpoint = true;
    bool first = true;
    int xpic = 0;                                                ///< order, 0 is FLIP
    double least = 0;                                            ///< mass of a node that counts
    std::map<Key, std::vector<std::pair<Key, double>>> given{};  ///< shares of the nodes that do not

    struct Node
    {
        double m = 0;
        Vec<2> p{0, 0}, f{0, 0}, v{0, 0}, dv{0, 0};
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
    std::vector<Vec<2>> smoothed(const std::vector<Vec<2>>& v) const
    {
        std::map<Key, double> mass;
        std::map<Key, Vec<2>> momentum;
        for (std::size_t n = 0; n < points.size(); ++n)
            for (const Shape& s : shapes(points[n]))
            {
                mass[s.node] += points[n].m * s.N;
                for (int d = 0; d < 2; ++d)
                    momentum[s.node][d] += points[n].m * s.N * v[n][d];
            }
        std::vector<Vec<2>> out(points.size(), Vec<2>{0, 0});
        for (std::size_t n = 0; n < points.size(); ++n)
            for (const Shape& s : shapes(points[n]))
                for (int d = 0; d < 2; ++d)
                    if (mass[s.node] > 0)
                        out[n][d] += s.N * momentum[s.node][d] / mass[s.node];
        return out;
    }
    /// (1 - S S+)^m of the velocity of the points: what XPIC(m) takes.
    std::vector<Vec<2>> taken_by_xpic() const
    {
        std::vector<Vec<2>> v;
        for (const RefPoint& p : points)
            v.push_back({p.vx, p.vy});
        for (int k = 0; k < xpic; ++k)
        {
            const std::vector<Vec<2>> u = smoothed(v);
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
    std::vector<Vec<2>> dilatation(std::size_t n) const
    {
        const auto own = shapes(points[n]);
        std::vector<Vec<2>> out;
        for (const Shape& s : own)
            out.push_back({s.gx, s.gy});
        if (!b_bar)
            return out;
        const auto cell = [&](const RefPoint& p) {
            return Key{static_cast<int>(std::floor((p.x - grid.ox) / grid.L)), static_cast<int>(std::floor((p.y - grid.oy) / grid.L))};
        };
        std::vector<Vec<2>> mean(own.size(), Vec<2>{0, 0});
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
        for (Vec<2>& g : mean)
            g = {g[0] / total, g[1] / total};
        return mean;
    }
    Gradient<2> gradient(std::size_t n, const std::map<Key, Node>& nodes, double dt) const
    {
        const auto own = shapes(points[n]);
        const auto b = dilatation(n);
        Gradient<2> g{};
        double volumetric = 0;
        for (std::size_t k = 0; k < own.size(); ++k)
        {
            const Vec<2> v = nodes.at(own[k].node).v;
            g.xx += own[k].gx * v[0] * dt;
            g.yy += own[k].gy * v[1] * dt;
            g.xy += own[k].gy * v[0] * dt;
            g.yx += own[k].gx * v[1] * dt;
            volumetric += (b[k][0] * v[0] + b[k][1] * v[1]) * dt;
        }
        const double c = 0.5 * (volumetric - g.xx - g.yy);
        g = {g.xx + c, g.yy + c, g.xy, g.yx};
        return midpoint ? ref_midpoint(g) : g;
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
            n.v = n.m > 0 ? Vec<2>{n.p[0] / n.m, n.p[1] / n.m} : Vec<2>{0, 0};
    }
    void step(double dt, const Vec<2>& gravity)
    {
        std::map<Key, Node> nodes;
        if (least > 0)
            find_small_nodes();
        map_momentum(nodes);
        const std::vector<Vec<2>> taken = xpic ? taken_by_xpic() : std::vector<Vec<2>>(points.size(), Vec<2>{0, 0});
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
                Vec<2>& f = nodes[own[k].node].f;
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
            Vec<2> dv{-taken[n][0], -taken[n][1]}, v{0, 0};
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
        std::vector<Gradient<2>> g;
        std::vector<Vec<2>> move;
        for (std::size_t n = 0; n < points.size(); ++n)
        {
            g.push_back(gradient(n, nodes, dt));
            Vec<2> u{0, 0};
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
            const auto ratio = [&](double d) { return midpoint ? ref_ratio(d) : 1 + d; };
            p.V *= ratio(g[n].xx + g[n].yy);
            p.hx *= ratio(g[n].xx);
            p.hy *= ratio(g[n].yy);
            p.x += move[n][0] - 0.5 * dt * taken[n][0];
            p.y += move[n][1] - 0.5 * dt * taken[n][1];
        }
    }
};
}  // namespace testbed::test
