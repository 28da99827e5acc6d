#pragma once
/// How a run ended, and what its result file says about that.

#include "core/run/diagnosis.hpp"
#include "core/run/observer.hpp"
#include "core/run/run.hpp"
#include "core/run/step_control.hpp"

namespace testbed
{
struct Outcome
{
    std::string status = "completed", reason;
    ExitCode code = ExitCode::completed;
    std::int64_t steps = 0;
    double solve_seconds = 0, forcing_seconds = 0, output_seconds = 0, guard_seconds = 0;
    std::vector<Finding> findings;
    std::string note;
    Diagnosis diagnosis;
    bool remedy_was_run = false;  ///< and held, if there still is one

    bool completed() const { return status == "completed"; }
    bool sound() const { return status != "diverged" && findings.empty(); }
};

/// Points of all bodies.
std::size_t number_of_points(const Solver& solver);
/// Share of the random strengths of a material that were truncated, over its bodies by their points.
double truncated_share(const Scene& scene, const Solver& solver, const MaterialSpec& material);

void write_header(ResultFile& file, const Scene& scene, const Solver& solver);
void write_verdict(ResultFile& file, const Outcome& out);
void write_performance(ResultFile& file, Solver& solver, const StepControl& clock, const Observer& observer, const Outcome& out,
                       double setup_seconds);

/// The closing lines of a run, on stderr: what was run and how it ended; the findings if it is not sound, and what would help.
void tell_ending(const Scene& scene, const Solver& solver, const StepControl& clock, const Outcome& out, const std::string& output);
void tell_findings(const Outcome& out);
}  // namespace testbed
