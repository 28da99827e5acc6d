#pragma once
/// How messages show what a user wrote.

#include <string>
#include <string_view>

namespace testbed
{
/// A text without control characters, on one line, with its middle left out where it has more than `most` bytes: what stands in a file is
/// not to fill a screen, nor to command the terminal. Multi-byte characters are kept whole.
std::string shown(std::string_view text, std::size_t most = 200);
}  // namespace testbed
