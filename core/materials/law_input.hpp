#pragma once
/// What a law is made of.

namespace testbed
{
class ElasticModuli
{
public:
    ElasticModuli() = default;
    /// @param youngs_modulus [Pa] @param poissons_ratio in (-1, 1/2)
    ElasticModuli(double youngs_modulus, double poissons_ratio)
        : youngs_modulus_(youngs_modulus),
          poissons_ratio_(poissons_ratio),
          shear_(youngs_modulus / (2 * (1 + poissons_ratio))),
          lame_(2 * shear_ * poissons_ratio / (1 - 2 * poissons_ratio))
    {
    }
    double youngs_modulus() const { return youngs_modulus_; }
    double poissons_ratio() const { return poissons_ratio_; }
    double shear() const { return shear_; }                    ///< G, mu
    double lame() const { return lame_; }                      ///< lambda
    double constrained() const { return lame_ + 2 * shear_; }  ///< M

private:
    double youngs_modulus_ = 0, poissons_ratio_ = 0, shear_ = 0, lame_ = 0;
};

/// Strength of one point. T is double or a pack.
template <class T = double>
struct Strength
{
    T cohesion;  ///< before softening [Pa]
    T sin_phi;
};

/// What differs from point to point in a body.
struct Varying
{
    bool stiffness = false, strength = false;
};

/// Of a law that reads nothing of a material but density, Young's modulus and Poisson's ratio.
struct NoKeys
{
    template <class V>
    void describe(V&)
    {
    }
};

struct LawInput
{
    ElasticModuli moduli;  ///< of the stiffest point
    Strength<> strength;   ///< of all points, or anything if it varies
    double cell_size = 0;  ///< L [m], for crack-band scaling
    Varying varying;
};
}  // namespace testbed
