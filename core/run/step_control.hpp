#pragma once
/// Which steps a run takes: of one length from 0 to the end, or as long as the method's limit lets them be (`time.dt = "auto"`).

#include "core/run/solver.hpp"

namespace testbed
{
class StepControl
{
public:
    /// @throws SceneError for more steps than a run can take
    StepControl(const Scene& scene, Solver& solver);

    double t() const { return t_; }    ///< [s]
    double dt() const { return dt_; }  ///< of the coming step [s]
    bool follows_limit() const { return follows_limit_; }
    double shortest() const { return shortest_; }
    double longest() const { return longest_; }
    double critical() const { return critical_; }  ///< the limit at the start [s]
    /// So, of the points as they stand, if the scene asks for it and the method knows it [s].
    const std::optional<double>& sharp() const { return sharp_; }
    bool is_at_end() const { return follows_limit_ ? t_ >= end_ : taken_ >= total_; }

    /// The steps so far and the present length of a step. One of equal steps is kept, and the end comes with the first that reaches it.
    /// @throws SceneError when reading a state beyond the end
    template <class Archive>
    void state(Archive& a)
    {
        a.value("taken", "-", taken_);
        a.value("t", "s", t_);
        a.value("dt", "s", dt_);
        a.value("shortest", "s", shortest_);
        a.value("longest", "s", longest_);
        if constexpr (Archive::reads)
            go_on();
    }
    /// After a step. @throws Diverged when the limit has fallen to a millionth of the first
    void next();

private:
    void follow();
    void go_on();
    std::int64_t steps_to_end() const;

    Solver& solver_;
    bool follows_limit_;
    std::optional<double> sharp_{};
    double end_, cfl_, critical_ = 0, t_ = 0, dt_ = 0, shortest_ = 0, longest_ = 0;
    std::int64_t taken_ = 0, total_ = 0;
};

/// Whether the scene's step is longer than the limit of its explicit method; the warning says by what. Empty if it is not.
std::string step_warning(const Scene& scene, Solver& solver);
}  // namespace testbed
