#pragma once
/// Wall clock time by named phase of a step.

#include <chrono>
#include <string_view>
#include <utility>
#include <vector>

namespace testbed
{
class PhaseTimer
{
public:
    using Clock = std::chrono::steady_clock;

    template <class F>
    void operator()(const char* phase, F&& f)
    {
        const auto start = Clock::now();
        f();
        const double seconds = std::chrono::duration<double>(Clock::now() - start).count();
        for (auto& [name, total] : phases_)
            if (std::string_view(name) == phase)
            {
                total += seconds;
                return;
            }
        phases_.emplace_back(phase, seconds);
    }
    double seconds(std::string_view phase) const
    {
        for (const auto& [name, total] : phases_)
            if (name == phase)
                return total;
        return 0;
    }
    const std::vector<std::pair<const char*, double>>& phases() const { return phases_; }

private:
    std::vector<std::pair<const char*, double>> phases_;
};

/// Seconds since construction.
class Stopwatch
{
public:
    double seconds() const { return std::chrono::duration<double>(PhaseTimer::Clock::now() - start_).count(); }

private:
    PhaseTimer::Clock::time_point start_ = PhaseTimer::Clock::now();
};
}  // namespace testbed
