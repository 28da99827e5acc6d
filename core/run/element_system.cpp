#include "core/run/element_system.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

namespace testbed
{
ElementSystem::ElementSystem(std::size_t nodes_per_element, std::size_t nodes)
    : lumped_mass(nodes, 0.0),
      is_fixed(2 * nodes, 0),
      n_(nodes_per_element)
{
}

void ElementSystem::add_element(std::span<const std::uint32_t> nodes)
{
    node_.insert(node_.end(), nodes.begin(), nodes.end());
    for (auto* blocks : {&stiffness_, &viscosity_})
        blocks->resize(blocks->size() + 4 * n_ * n_, 0.0);
    consistent_.resize(consistent_.size() + n_ * n_, 0.0);
}

void ElementSystem::divide_by_mass(std::vector<double>& values) const
{
    for (std::size_t dof = 0; dof < values.size(); ++dof)
        values[dof] = is_fixed[dof] || !(lumped_mass[dof / 2] > 0) ? 0.0 : values[dof] / lumped_mass[dof / 2];
}

void ElementSystem::apply(const std::vector<double>& blocks, const std::vector<double>& in, std::vector<double>& out) const
{
    out.assign(in.size(), 0.0);
    const std::size_t m = 2 * n_;
    std::vector<std::size_t> dof(m);
    for (std::size_t e = 0; e * n_ < node_.size(); ++e)
    {
        for (std::size_t a = 0; a < m; ++a)
            dof[a] = 2 * std::size_t{node_[e * n_ + a / 2]} + a % 2;
        const double* block = &blocks[e * m * m];
        for (std::size_t a = 0; a < m; ++a)
        {
            double s = 0;
            for (std::size_t b = 0; b < m; ++b)
                s += block[a * m + b] * in[dof[b]];
            out[dof[a]] += s;
        }
    }
    for (std::size_t k = 0; k < out.size(); ++k)
        if (is_fixed[k])
            out[k] = 0;
}

void ElementSystem::apply_smoothing(const std::vector<double>& in, std::vector<double>& out) const
{
    out.assign(in.size(), 0.0);
    for (std::size_t e = 0; e * n_ < node_.size(); ++e)
        for (std::size_t a = 0; a < n_; ++a)
            for (std::size_t b = 0; b < n_; ++b)
                for (std::size_t k = 0; k < 2; ++k)
                    out[2 * node_[e * n_ + a] + k] += consistent_[(e * n_ + a) * n_ + b] * in[2 * node_[e * n_ + b] + k];
    divide_by_mass(out);
}

namespace
{
double dot(const std::vector<double>& a, const std::vector<double>& b)
{
    double s = 0;
    for (std::size_t k = 0; k < a.size(); ++k)
        s += a[k] * b[k];
    return s;
}

/// Numbers in (-1, 1) that no mode is orthogonal to.
std::vector<double> scattered(std::size_t n)
{
    std::vector<double> values(n);
    for (std::size_t k = 0; k < n; ++k)
    {
        std::uint64_t h = (k + 1) * 0x9E3779B97F4A7C15u;  // splitmix64
        h = (h ^ (h >> 30)) * 0xBF58476D1CE4E5B9u;
        h = (h ^ (h >> 27)) * 0x94D049BB133111EBu;
        values[k] = 2 * (static_cast<double>((h ^ (h >> 31)) >> 11) + 0.5) / 9007199254740992.0 - 1;
    }
    return values;
}
}  // namespace

double largest_eigenvalue(const ElementSystem& system,
                          const std::function<void(const std::vector<double>& in, std::vector<double>& out)>& energy,
                          const std::function<void(std::vector<double>&)>& smooth, double tolerance)
{
    constexpr int longest = 300;
    const std::size_t n = system.dofs();
    std::vector<double> v = scattered(n), w(n), force(n), last(n, 0.0), next_force(n);
    energy(v, force);
    // one step of the iteration takes out what carries no energy or does not move
    v = force;
    system.divide_by_mass(v);
    smooth(v);
    energy(v, force);
    double norm = std::sqrt(dot(v, force));
    if (!(norm > 0))
        return 0;
    std::vector<double> diagonal, side;
    double before = 0, value = 0;
    for (int k = 0; k < longest; ++k)
    {
        for (std::size_t i = 0; i < n; ++i)
        {
            v[i] /= norm;
            force[i] /= norm;
        }
        w = force;
        system.divide_by_mass(w);
        smooth(w);
        const double along = dot(w, force);
        diagonal.push_back(along);
        for (std::size_t i = 0; i < n; ++i)
            w[i] -= along * v[i] + (k > 0 ? norm * last[i] : 0.0);
        energy(w, next_force);
        norm = std::sqrt(std::max(dot(w, next_force), 0.0));
        if (k % 4 == 3 || !(norm > 1e-9 * diagonal[0]))
        {
            const auto size = static_cast<Eigen::Index>(diagonal.size());
            Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver;
            const Eigen::VectorXd main = Eigen::Map<const Eigen::VectorXd>(diagonal.data(), size);
            const Eigen::VectorXd off = Eigen::Map<const Eigen::VectorXd>(side.data(), size - 1);
            solver.computeFromTridiagonal(main, off, Eigen::EigenvaluesOnly);
            before = value;
            value = solver.eigenvalues()[size - 1];
            if (!(norm > 1e-9 * diagonal[0]) || (k > 10 && value - before < tolerance * value))
                break;
        }
        side.push_back(norm);
        last.swap(v);
        v.swap(w);
        force.swap(next_force);
    }
    return value;
}
}  // namespace testbed
