#pragma once
/// Handles and checks of HDF5, and the checksum that ends a file, for what writes and reads its files.

#include "core/run/results.hpp"

#include <cerrno>
#include <cstring>
#include <fmt/format.h>
#include <hdf5.h>
#include <unistd.h>
#include <zlib.h>

namespace testbed
{
inline constexpr const char* failed = "writing the result file failed (disk full?); nothing was kept";

/// An HDF5 handle with the function that closes it.
class Handle
{
public:
    Handle(hid_t id, herr_t (*close)(hid_t)) : id_(id), close_(close)
    {
        if (id < 0)
            throw OutputError(failed);
    }
    ~Handle() { close_(id_); }
    Handle(const Handle&) = delete;
    Handle& operator=(const Handle&) = delete;
    operator hid_t() const { return id_; }

private:
    hid_t id_;
    herr_t (*close_)(hid_t);
};

inline void check(herr_t status)
{
    if (status < 0)
        throw OutputError(failed);
}

/// The CRC-32 of the first `size` bytes of a file, by its descriptor.
inline unsigned long crc_of(int file, std::uint64_t size)
{
    unsigned long crc = ::crc32(0, nullptr, 0);
    std::vector<unsigned char> part(1 << 20);
    for (std::uint64_t at = 0; at < size;)
    {
        const ssize_t n = ::pread(file, part.data(), std::min<std::uint64_t>(part.size(), size - at), static_cast<off_t>(at));
        if (n <= 0)
            throw OutputError(fmt::format("the result file cannot be read back: {}", n < 0 ? std::strerror(errno) : "it ends early"));
        crc = ::crc32(crc, part.data(), static_cast<unsigned>(n));
        at += static_cast<std::uint64_t>(n);
    }
    return crc;
}
}  // namespace testbed
