/// Runs a fuzz target over files and folders of them, without a fuzzer: as they are, cut short, and with single bytes changed. Any compiler
/// builds it, so that the corpus is a test like any other.

#include "tests/fuzz/fuzz.hpp"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

namespace
{
void run(const std::string& input)
{
    LLVMFuzzerTestOneInput(reinterpret_cast<const std::uint8_t*>(input.data()), input.size());
}

/// As it is; cut at `variants` places; with as many bytes changed, by a counter: the same ones every time.
std::size_t run_variants(const std::string& input, std::size_t variants)
{
    run(input);
    std::uint64_t state = input.size();
    for (std::size_t n = 0; n < variants && !input.empty(); ++n)
    {
        run(input.substr(0, input.size() * n / variants));
        state = state * 6364136223846793005u + 1442695040888963407u;
        std::string changed = input;
        changed[(state >> 33) % input.size()] = static_cast<char>(state >> 24);
        run(changed);
    }
    return 1 + 2 * variants;
}
}  // namespace

int main(int argc, char** argv)
{
    std::vector<std::string> files;
    for (int k = 1; k < argc; ++k)
        if (std::filesystem::is_directory(argv[k]))
            for (const auto& entry : std::filesystem::directory_iterator(argv[k]))
                files.push_back(entry.path());
        else
            files.emplace_back(argv[k]);
    std::size_t runs = 0;
    for (const std::string& path : files)
    {
        std::ifstream file(path, std::ios::binary);
        if (!file)
            return std::fprintf(stderr, "%s: cannot be read\n", path.c_str()), 1;
        runs += run_variants({std::istreambuf_iterator<char>(file), {}}, 40);
    }
    std::printf("%zu files, %zu runs\n", files.size(), runs);
    return runs > 0 ? 0 : 1;
}
