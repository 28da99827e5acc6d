#pragma once
/// Included before everything else in the build that has all slips in: is(n) switches one of them on. Where a folder is named in the
/// variable TESTBED_SLIP_REACHED, the numbers that a process came by are left there.

#include <cstdio>
#include <cstdlib>
#include <string>
#include <unistd.h>

namespace slip
{
class Reached
{
public:
    Reached() = default;
    ~Reached()
    {
        if (!folder_)
            return;
        if (std::FILE* file = std::fopen((std::string(folder_) + "/" + std::to_string(getpid())).c_str(), "a"))
        {
            for (int n = 0; n < most; ++n)
                if (seen_[n])
                    std::fprintf(file, "%d\n", n);
            std::fclose(file);
        }
    }
    Reached(const Reached&) = delete;
    void note(int n)
    {
        if (folder_)
            seen_[n] = 1;
    }

private:
    static constexpr int most = 2000;
    const char* folder_ = std::getenv("TESTBED_SLIP_REACHED");
    char seen_[most]{};
};

inline Reached reached;
inline const int on = std::getenv("TESTBED_SLIP") ? std::atoi(std::getenv("TESTBED_SLIP")) : 0;

inline bool is(int n)
{
    reached.note(n);
    return n == on;
}
}  // namespace slip
