#include "core/run/results.hpp"

#include "core/run/hdf5.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

namespace testbed
{
namespace
{
/// Ends a file with its checksum: HDF5 lets bytes follow its own (docs/file_formats.md).
void append_checksum(int file)
{
    const off_t size = ::lseek(file, 0, SEEK_END);
    if (size < 0)
        throw OutputError(fmt::format("the result file cannot be read back: {}", std::strerror(errno)));
    const std::string line =
        fmt::format("testbed-crc32 {:08x} {:016x}\n", crc_of(file, static_cast<std::uint64_t>(size)), static_cast<std::uint64_t>(size));
    if (::write(file, line.data(), line.size()) != static_cast<ssize_t>(line.size()))
        throw OutputError(fmt::format("writing the result file failed: {}", std::strerror(errno)));
}

bool is_absent_or_file(const std::filesystem::path& path)
{
    std::error_code ignored;
    return !std::filesystem::exists(path, ignored) || std::filesystem::is_regular_file(path, ignored);
}
}  // namespace

struct ResultFile::Impl
{
    std::string path, part;
    hid_t file = -1;
    int lock = -1;  ///< held as long as the part file is ours

    ~Impl()
    {
        if (lock >= 0)
            ::close(lock);
    }

    Handle group(const std::string& name) const
    {
        if (name == "/" || H5Lexists(file, name.c_str(), H5P_DEFAULT) > 0)
            return {H5Gopen2(file, name.c_str(), H5P_DEFAULT), H5Gclose};
        const auto slash = name.rfind('/');
        if (slash != 0 && slash != std::string::npos)
            group(name.substr(0, slash));
        return {H5Gcreate2(file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose};
    }
    static void write_attribute(hid_t owner, const std::string& name, hid_t type, hid_t space, const void* data)
    {
        if (H5Aexists(owner, name.c_str()) > 0)
            check(H5Adelete(owner, name.c_str()));
        const Handle attribute(H5Acreate2(owner, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
        check(H5Awrite(attribute, type, data));
    }
    static void write_text(hid_t owner, const std::string& name, const std::string& value)
    {
        const Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
        check(H5Tset_size(type, H5T_VARIABLE));
        check(H5Tset_cset(type, H5T_CSET_UTF8));
        const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
        const char* text = value.c_str();
        write_attribute(owner, name, type, space, &text);
    }
    void write_dataset(const std::string& name, const std::string& unit, hid_t type, const void* data, std::size_t rows,
                       std::size_t columns) const
    {
        group(name.substr(0, name.rfind('/')));
        const hsize_t size[2] = {rows, columns};
        const Handle space(H5Screate_simple(columns > 1 ? 2 : 1, size, nullptr), H5Sclose);
        const Handle set(H5Dcreate2(file, name.c_str(), type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
        check(H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data));
        write_text(set, "unit", unit);
    }
    void close()
    {
        if (file < 0)
            return;
        const bool flushed = H5Fflush(file, H5F_SCOPE_GLOBAL) >= 0;
        const bool closed = H5Fclose(file) >= 0;
        file = -1;
        if (!flushed || !closed)
            throw OutputError(failed);
    }
};

ResultFile::ResultFile(const std::string& path) : impl_(std::make_unique<Impl>())
{
    if (!is_absent_or_file(path))
        throw OutputError(fmt::format("cannot write '{}': it exists and is no file", path));
    impl_->path = path;
    impl_->part = path + ".part";
    H5dont_atexit();  // its clean-up crashes after a write that failed; every file is closed here
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    // the plain call first: it tells why, and HDF5 does not; nothing is truncated before the lock is held
    impl_->lock = ::open(impl_->part.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NONBLOCK | O_NOFOLLOW, 0666);
    if (impl_->lock < 0)
        throw OutputError(fmt::format("cannot write '{}': {}", impl_->part, std::strerror(errno)));
    struct flock whole
    {
    };
    whole.l_type = F_WRLCK;
    struct stat status
    {
    };
    if (::fstat(impl_->lock, &status) != 0 || !S_ISREG(status.st_mode))
        throw OutputError(fmt::format("cannot write '{}': it exists and is no file", impl_->part));
    if (::fcntl(impl_->lock, F_OFD_SETLK, &whole) != 0)
        throw OutputError(fmt::format("cannot write '{}': another run is writing it", impl_->part));
    impl_->file = H5Fcreate(impl_->part.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    if (impl_->file < 0)
    {
        std::filesystem::remove(impl_->part);
        throw OutputError(fmt::format("cannot write '{}'", impl_->part));
    }
}

ResultFile::ResultFile(ResultFile&&) noexcept = default;

ResultFile::~ResultFile()
{
    if (!impl_)
        return;
    try
    {
        impl_->close();
    }
    catch (const OutputError&)
    {
    }
    std::error_code ignored;
    std::filesystem::remove(impl_->part, ignored);
}

void ResultFile::attribute(const std::string& group, const std::string& name, const std::string& value)
{
    Impl::write_text(impl_->group(group), name, value);
}
void ResultFile::attribute(const std::string& group, const std::string& name, double value)
{
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    Impl::write_attribute(impl_->group(group), name, H5T_NATIVE_DOUBLE, space, &value);
}
void ResultFile::attribute(const std::string& group, const std::string& name, std::int64_t value)
{
    const Handle space(H5Screate(H5S_SCALAR), H5Sclose);
    Impl::write_attribute(impl_->group(group), name, H5T_NATIVE_INT64, space, &value);
}
void ResultFile::attribute(const std::string& group, const std::string& name, std::span<const double> values)
{
    const hsize_t size = values.size();
    const Handle space(H5Screate_simple(1, &size, nullptr), H5Sclose);
    Impl::write_attribute(impl_->group(group), name, H5T_NATIVE_DOUBLE, space, values.data());
}
void ResultFile::dataset(const std::string& path, const std::string& unit, std::span<const double> values, std::size_t columns)
{
    impl_->write_dataset(path, unit, H5T_NATIVE_DOUBLE, values.data(), values.size() / columns, columns);
}
void ResultFile::dataset(const std::string& path, const std::string& unit, std::span<const std::uint32_t> values)
{
    impl_->write_dataset(path, unit, H5T_NATIVE_UINT32, values.data(), values.size(), 1);
}
void ResultFile::copy(const ResultFile& from, const std::string& group)
{
    if (H5Lexists(from.impl_->file, group.c_str(), H5P_DEFAULT) > 0)
        check(H5Ocopy(from.impl_->file, group.c_str(), impl_->file, group.c_str(), H5P_DEFAULT, H5P_DEFAULT));
}
void ResultFile::copy(const std::filesystem::path& from, const std::string& group)
{
    const Handle file(H5Fopen(from.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (H5Lexists(file, group.c_str(), H5P_DEFAULT) > 0)
        check(H5Ocopy(file, group.c_str(), impl_->file, group.c_str(), H5P_DEFAULT, H5P_DEFAULT));
}
void ResultFile::flush()
{
    check(H5Fflush(impl_->file, H5F_SCOPE_GLOBAL));
}

void write_text(const std::filesystem::path& path, const std::string& text)
{
    const bool replaces = is_absent_or_file(path);  // a pipe or a device is written to
    const std::filesystem::path part = replaces ? path.string() + ".part" : path.string();
    std::ofstream file(part);
    file << text;
    file.close();
    std::error_code error;
    if (file && replaces)
        std::filesystem::rename(part, path, error);
    if (!file || error)
    {
        const int reason = errno;
        std::error_code ignored;
        if (replaces)
            std::filesystem::remove(part, ignored);
        throw OutputError(fmt::format("cannot write '{}': {}", path.string(), error ? error.message() : std::strerror(reason)));
    }
}

void ResultFile::commit()
{
    attribute("/", "checksum", std::string("crc32 at the end of the file"));
    impl_->close();
    append_checksum(impl_->lock);
    if (::fsync(impl_->lock) != 0)
        throw OutputError(fmt::format("cannot write '{}': {}", impl_->part, std::strerror(errno)));
    std::error_code error;
    std::filesystem::rename(impl_->part, impl_->path, error);
    if (error)
        throw OutputError(fmt::format("cannot write '{}': {}", impl_->path, error.message()));
}
}  // namespace testbed
