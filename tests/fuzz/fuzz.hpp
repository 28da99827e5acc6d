#pragma once
/// What the fuzz targets share.

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>

namespace testbed::fuzz
{
/// Ends the program as a crash does: the fuzzer keeps the input.
[[noreturn]] inline void finding(const char* what, const std::string& detail)
{
    std::fprintf(stderr, "finding: %s: %s\n", what, detail.substr(0, 2000).c_str());
    std::abort();
}

/// An error is told in words, on a screen or two.
inline void check_message(const std::string& message)
{
    if (message.empty() || message.size() > 60000)
        finding("length of a message", std::to_string(message.size()) + " bytes: " + message);
}
}  // namespace testbed::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
