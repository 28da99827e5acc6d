#pragma once
/// The result file (docs/file_formats.md). Written under a name ending in `.part`; commit() makes it whole.

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

namespace testbed
{
/// The file cannot be written: no place, no permission, disk full.
struct OutputError : std::runtime_error
{
    using std::runtime_error::runtime_error;
};

/// Writes a whole file or none. @throws OutputError
void write_text(const std::filesystem::path& path, const std::string& text);

class ResultFile
{
public:
    /// Creates path + ".part". @throws OutputError
    explicit ResultFile(const std::string& path);
    /// Removes the part file unless committed.
    ~ResultFile();
    ResultFile(ResultFile&&) noexcept;

    void attribute(const std::string& group, const std::string& name, const std::string& value);
    void attribute(const std::string& group, const std::string& name, double value);
    void attribute(const std::string& group, const std::string& name, std::int64_t value);
    void attribute(const std::string& group, const std::string& name, std::span<const double> values);
    /// A dataset of rows x columns (columns = 1: one-dimensional). Groups on the way are made.
    void dataset(const std::string& path, const std::string& unit, std::span<const double> values, std::size_t columns = 1);
    void dataset(const std::string& path, const std::string& unit, std::span<const std::uint32_t> values);
    /// Copies a group with all that it holds, if it is there.
    void copy(const ResultFile& from, const std::string& group);
    void copy(const std::filesystem::path& from, const std::string& group);
    void flush();
    /// Closes, syncs to disk and renames to the final name. @throws OutputError, and then nothing is left.
    void commit();

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};
}  // namespace testbed
