#pragma once
/// The steps of a run from where its clock stands to the end, what is recorded on the way, and restart files.

#include "core/run/guards.hpp"
#include "core/run/outcome.hpp"

namespace testbed
{
/// Ctrl-C and termination finish the step; a full disk or file limit is an error of write(), not a signal.
void catch_signals();
/// Whether one of these came.
bool is_interrupted();

class RunLoop
{
public:
    /// @param restart where restart files go @param file of the result, for the snapshots
    RunLoop(const Scene& scene, Solver& solver, StepControl& clock, Observer& observer, ResultFile& file,
            const std::filesystem::path& restart, bool quiet);

    /// Steps to the end, or until something stops the run.
    Outcome run();
    /// Goes on from this state of a run of the same scene. @throws SceneError for a state of another program
    void restore(const State& state);

private:
    class Progress;

    template <class Archive>
    void state(Archive& a);
    /// Of the method: without output, and without the forcing of a manufactured solution.
    double solve_seconds() const;
    double forcing_seconds() const;
    void write_checkpoint();
    /// The state before the step, if it is time for it. @param stops whether the run ends here before its time
    void checkpoint_if_due(bool stops, bool ends);
    void step_through();
    void record(bool last);
    void sample(bool last);
    bool is_at_rest();
    void stop(const char* status, ExitCode code, const std::string& reason);

    const Scene& scene_;
    Solver& solver_;
    StepControl& clock_;
    Observer& observer_;
    ResultFile& file_;
    std::filesystem::path restart_;
    bool quiet_;
    Guards guards_;
    Outcome out_;
    Stopwatch watch_;
    double history_interval_, snapshot_interval_;
    double next_sample_ = 0, next_snapshot_ = 0, next_checkpoint_;
    double solve_seconds_before_ = 0, forcing_seconds_before_ = 0;  ///< of the run that this one continues
    double output_seconds_ = 0;                                     ///< of this one
    std::int64_t looked_at_ = 0;                                    ///< step in which the points were looked at last
};
}  // namespace testbed
