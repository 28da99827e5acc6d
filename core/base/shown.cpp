#include "core/base/shown.hpp"

#include <fmt/format.h>

namespace testbed
{
namespace
{
bool begins_character(char c)
{
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
}
}  // namespace

std::string shown(std::string_view text, std::size_t most)
{
    std::string out;
    const auto append = [&](std::string_view part)
    {
        for (const char c : part)
            if (const auto byte = static_cast<unsigned char>(c); byte < 32 || byte == 127)
                out += fmt::format("\\x{:02x}", byte);
            else
                out += c;
    };
    if (text.size() <= most)
    {
        append(text);
        return out;
    }
    std::size_t head = most * 2 / 3, tail = text.size() - most / 3;
    while (head > 0 && !begins_character(text[head]))
        --head;
    while (tail < text.size() && !begins_character(text[tail]))
        ++tail;
    append(text.substr(0, head));
    out += fmt::format(" ... {} bytes ... ", tail - head);
    append(text.substr(tail));
    return out;
}
}  // namespace testbed
