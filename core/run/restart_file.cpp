#include "core/run/restart.hpp"

#include "core/run/hdf5.hpp"

#include <charconv>
#include <fcntl.h>
#include <sstream>

namespace testbed
{
namespace
{
constexpr std::int64_t version = 1;
constexpr const char* format = "testbed-restart";

[[noreturn]] void refuse(const std::filesystem::path& path, const std::string& why)
{
    throw SceneError(fmt::format("restart file '{}': {}", path.string(), why));
}

/// The parts of a state, a line each: name, unit, count.
std::string as_text(const std::vector<State::Part>& parts)
{
    std::string text;
    for (const State::Part& part : parts)
        text += fmt::format("{}\t{}\t{}\n", part.name, part.unit, part.count);
    return text;
}

State with_parts(const std::string& text, std::vector<double> numbers, const std::filesystem::path& path)
{
    State state;
    state.numbers = std::move(numbers);
    std::size_t begin = 0;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
    {
        const auto first = line.find('\t'), second = line.find('\t', first + 1);
        if (first == std::string::npos || second == std::string::npos)
            refuse(path, "its list of parts cannot be read");
        std::size_t count = 0;
        if (std::from_chars(line.data() + second + 1, line.data() + line.size(), count).ec != std::errc{} ||
            count > state.numbers.size() - begin)
            refuse(path, "its list of parts cannot be read");
        state.parts.push_back({line.substr(0, first), line.substr(first + 1, second - first - 1), begin, count});
        begin += count;
    }
    if (begin != state.numbers.size())
        refuse(path, "its list of parts does not fit its numbers");
    return state;
}

/// That the file ends with the checksum of all before it: what is whole is as it was written, and needs no more suspicion.
void check_sum(const std::filesystem::path& path)
{
    constexpr std::int64_t length = 40;  // "testbed-crc32 xxxxxxxx xxxxxxxxxxxxxxxx\n"
    const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    if (file < 0)
        refuse(path, fmt::format("cannot be read: {}", std::strerror(errno)));
    struct Closer
    {
        int file;
        ~Closer() { ::close(file); }
    } closer{file};
    const off_t size = ::lseek(file, 0, SEEK_END);
    std::string line(length, ' ');
    if (size <= length || ::pread(file, line.data(), line.size(), size - length) != length || !line.starts_with("testbed-crc32 "))
        refuse(path, "is no restart file, or was cut off: it does not end with a checksum");
    const auto whole = static_cast<std::uint64_t>(size - length);
    if (line != fmt::format("testbed-crc32 {:08x} {:016x}\n", crc_of(file, whole), whole))
        refuse(path, "is damaged: its checksum is another one");
}

std::string text_attribute(hid_t file, const char* group, const char* name)
{
    const Handle attribute(H5Aopen_by_name(file, group, name, H5P_DEFAULT, H5P_DEFAULT), H5Aclose), type(H5Aget_type(attribute), H5Tclose),
        space(H5Aget_space(attribute), H5Sclose);
    if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) <= 0 || H5Sget_simple_extent_npoints(space) != 1)
        throw OutputError("no text");
    char* text = nullptr;
    check(H5Aread(attribute, type, &text));
    const std::string copy = text ? text : "";
    H5free_memory(text);
    return copy;
}

std::vector<double> numbers_of(hid_t file, const char* name)
{
    const Handle set(H5Dopen2(file, name, H5P_DEFAULT), H5Dclose), space(H5Dget_space(set), H5Sclose);
    std::vector<double> numbers(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space)));
    check(H5Dread(set, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, numbers.data()));
    return numbers;
}

}  // namespace

void write_restart(const Restart& restart, const ResultFile& result)
{
    ResultFile file(restart.path.string());
    file.attribute("/", "format", std::string(format));
    file.attribute("/", "format_version", version);
    file.attribute("/scene", "path", restart.scene_path);
    file.attribute("/scene", "resolved", restart.scene_text);
    file.attribute("/state", "parts", as_text(restart.state.parts));
    file.dataset("/state/numbers", "-", restart.state.numbers);
    file.copy(result, "/snapshots");
    file.commit();
}

Restart read_restart(const std::filesystem::path& path)
{
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(path, ignored))
        refuse(path, std::filesystem::exists(path, ignored) ? "is no file" : "there is none of that name");
    check_sum(path);
    H5dont_atexit();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    try
    {
        const Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
        if (const std::string is = text_attribute(file, "/", "format"); is != format)
            refuse(path, fmt::format("is a {} file, not one of format {}", is, format));
        const Handle attribute(H5Aopen_by_name(file, "/", "format_version", H5P_DEFAULT, H5P_DEFAULT), H5Aclose),
            space(H5Aget_space(attribute), H5Sclose);
        std::int64_t has = 0;
        if (H5Sget_simple_extent_npoints(space) != 1)
            throw OutputError("no number");
        check(H5Aread(attribute, H5T_NATIVE_INT64, &has));
        if (has != version)
            refuse(path, fmt::format("has version {}, this program reads {}", has, version));
        return {path, text_attribute(file, "/scene", "path"), text_attribute(file, "/scene", "resolved"),
                with_parts(text_attribute(file, "/state", "parts"), numbers_of(file, "/state/numbers"), path)};
    }
    catch (const OutputError&)
    {
        refuse(path, "is no restart file");
    }
}
}  // namespace testbed
