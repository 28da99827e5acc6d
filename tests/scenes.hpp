#pragma once
/// Scenes made in tests, written to a file and loaded as a user's would be.

#include "core/scene/scene.hpp"

#include <atomic>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <gtest/gtest.h>
#include <unistd.h>

namespace testbed::test
{
class SceneFile
{
public:
    explicit SceneFile(const std::string& text)
    {
        static std::atomic<int> count{0};
        folder_ = std::filesystem::temp_directory_path() / ("testbed_" + std::to_string(::getpid()) + "_" + std::to_string(count++));
        std::filesystem::create_directory(folder_);
        std::ofstream(path()) << text;
    }
    ~SceneFile() { std::filesystem::remove_all(folder_); }
    std::string path() const { return (folder_ / "scene.toml").string(); }

private:
    std::filesystem::path folder_;
};

inline Scene load(const std::string& text, const std::string& method = "", const std::vector<std::string>& overrides = {})
{
    const SceneFile file(text);
    return load_scene(file.path(), method, overrides).scene;
}

/// Loading the scene fails with a message that holds `message`.
inline void expect_problem(const std::string& text, const std::vector<std::string>& overrides, const std::string& message)
{
    try
    {
        load(text, "", overrides);
        ADD_FAILURE() << "accepted, expected: " << message;
    }
    catch (const SceneError& e)
    {
        EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what();
    }
}

inline const std::string strength = "[material.strength]\ncohesion = 9800.0\nfriction_angle = 0.5\n";

/// A box of soil on a lattice of 4 x 4 m with L = 0.5 m, over 1 s: elastic, or Mohr-Coulomb with the tables `strength`.
inline std::string soil_block(const Vec<2>& min, const Vec<2>& max, const std::string& strength = "")
{
    const auto pair = [](const Vec<2>& v) { return fmt::format("[{}, {}]", v[0], v[1]); };
    return R"toml(
[grid]
size = [4.0, 4.0]
cell_size = 0.5
[time]
end = 1.0
[[material]]
name = "soil"
density = 1000.0
youngs_modulus = 1e6
poissons_ratio = 0.2
law = )toml" +
           std::string(strength.empty() ? "\"linear_elastic\"\n" : "\"mohr_coulomb\"\n") + strength + R"toml(
[[body]]
name = "soil"
material = "soil"
shape = "box"
min = )toml" +
           pair(min) + "\nmax = " + pair(max) + "\n";
}

/// Two bodies with random-looking velocities and no constraint; the lattice has room around them.
inline std::string two_bodies(double cell_size = 0.5, int points_per_cell = 3)
{
    return R"toml(
[grid]
origin = [-1.0, -1.0]
size = [4.0, 4.0]
cell_size = )toml" +
           std::to_string(cell_size) + R"toml(
[time]
end = 1.0
[[material]]
name = "soft"
law = "hypoelastic_jaumann"
density = 1000.0
youngs_modulus = 1e4
poissons_ratio = 0.3
[[material]]
name = "stiff"
law = "hypoelastic_exact_rotation"
density = 1500.0
youngs_modulus = "3e4*(1+X^2)"
poissons_ratio = 0.2
[[body]]
name = "one"
material = "soft"
shape = "box"
min = [-0.37, -0.21]
max = [0.63, 0.79]
points_per_cell = )toml" +
           std::to_string(points_per_cell) + R"toml(
velocity = ["0.6*sin(5*X+Y)", "0.5*cos(7*Y-3*X)"]
[[body]]
name = "two"
material = "stiff"
shape = "disk"
center = [1.25, 0.3]
radius = 0.6
points_per_cell = )toml" +
           std::to_string(points_per_cell) + R"toml(
velocity = ["-0.3*Y", "0.4*X"]
)toml";
}
}  // namespace testbed::test
