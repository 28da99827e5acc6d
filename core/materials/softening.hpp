#pragma once
/// Share of the cohesion that is left after a plastic shear strain: max(residual, 1 - slope strain). A drop at first yield is
/// an infinite slope, no softening a slope of zero.

#include "core/base/simd.hpp"
#include "core/materials/strength_spec.hpp"

#include <algorithm>
#include <cmath>

namespace testbed
{
class Softening
{
public:
    Softening() = default;
    static Softening drop(double residual) { return {residual, 1e300}; }
    /// @param strain plastic shear strain at which the residual is reached; crack-band scaling divides it by L / t_sb
    static Softening linear(double residual, double strain) { return {residual, (1 - residual) / strain}; }
    /// @param cell_size L [m]
    static Softening of(const SofteningSpec& spec, double cell_size)
    {
        if (spec.kind == SofteningSpec::Kind::drop)
            return drop(spec.residual);
        const double scaling = spec.band_thickness ? cell_size / *spec.band_thickness : 1;
        return linear(spec.residual, *spec.strain / scaling);
    }

    /// NaN of NaN.
    template <class T>
    TESTBED_INLINE T share(const T& strain) const
    {
        const T fallen = T(1.0) - T(slope_) * strain;
        return select(fallen < T(residual_), T(residual_), fallen);
    }

    /// Finds the share at which excess(share) = share - share(strain that the return with it leads to) vanishes, and leaves
    /// excess() called with it last. `strain` is the one at the start. Linear but for changes of the region of the yield
    /// surface: regula falsi (Illinois), a few returns.
    template <class Excess>
    void solve(Excess&& excess, double strain) const
    {
        double low = residual_, high = share(strain);
        double f_low = excess(low);
        if (f_low >= 0 || high <= low)
            return;
        double f_high = excess(high);
        int stuck = 0;
        for (int k = 0; k < 100 && f_high > 0; ++k)
        {
            const double next = high - f_high * (high - low) / (f_high - f_low), f = excess(next);
            if (std::abs(f) < 1e-14 || high - low < 1e-15)
                return;
            if (f > 0)
            {
                high = next;
                f_high = f;
                f_low *= stuck == 1 ? 0.5 : 1;
                stuck = 1;
            }
            else
            {
                low = next;
                f_low = f;
                f_high *= stuck == -1 ? 0.5 : 1;
                stuck = -1;
            }
        }
    }

    /// The same for the lanes of a pack: excess(share, open) gives the excess, and keeps in the open lanes alone what
    /// belongs to it; in the others the shares are of no meaning.
    template <class Excess>
    void solve(Excess&& excess, Pack strain, Mask lanes) const
    {
        Pack low(residual_), high = share(strain), f_low = excess(low, lanes);
        Mask open = lanes && !(f_low >= Pack(0.0) || high <= low);
        if (!stdx::any_of(open))
            return;
        const Pack one(1.0), half(0.5);
        Pack f_high = excess(high, open), stuck(0.0);
        for (int k = 0; k < 100; ++k)
        {
            open = open && f_high > Pack(0.0);
            if (!stdx::any_of(open))
                return;
            const Pack next = high - f_high * (high - low) / (f_high - f_low), f = excess(next, open);
            open = open && !(max(f, -f) < Pack(1e-14) || high - low < Pack(1e-15));
            const Mask above = f > Pack(0.0);
            f_low = select(above, f_low * select(stuck == one, half, one), f);
            f_high = select(above, f, f_high * select(stuck == -one, half, one));
            high = select(above, next, high);
            low = select(above, low, next);
            stuck = select(above, one, -one);
        }
    }

private:
    Softening(double residual, double slope) : residual_(residual), slope_(slope) {}

    double residual_ = 1, slope_ = 0;
};
}  // namespace testbed
