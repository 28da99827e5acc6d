#include "core/run/point_driver.hpp"
#include "core/scene/scene.hpp"
#include "tests/scenes.hpp"

#include <cmath>
#include <gtest/gtest.h>
#include <sstream>

using namespace testbed;

namespace
{
const std::string law = R"(
initial_stress = [-2e4, -2e4, -2e4, 0.0]
[material]
name = "soil"
law = "mohr_coulomb"
density = 1700.0
youngs_modulus = 5e7
poissons_ratio = 0.47
[material.strength]
cohesion = 9800.0
friction_angle = 0.5
)";
const std::string compression = "[[segment]]\nsteps = 200\ngradient = [0.0, -4e-3, 0.0, 0.0]\nstress_xx = -2e4\n";

std::vector<std::vector<double>> rows_of(const std::string& text)
{
    const test::SceneFile file(text);
    std::stringstream out(drive_point(file.path()));
    std::vector<std::vector<double>> rows;
    std::string line, word;
    std::getline(out, line);
    EXPECT_EQ(line, "step,strain_xx,strain_yy,shear_xy,stress_xx,stress_yy,stress_zz,stress_xy,plastic_shear_strain,work");
    while (std::getline(out, line))
    {
        rows.emplace_back();
        for (std::stringstream words(line); std::getline(words, word, ',');)
            rows.back().push_back(std::stod(word));
    }
    return rows;
}
}  // namespace

/// Plane-strain compression under lateral stress: slope and strength in closed form.
TEST(PointDriver, ConfinedCompression)
{
    const auto rows = rows_of(law + compression);
    ASSERT_EQ(rows.size(), 201u);
    const double slope = (rows[5][5] - rows[0][5]) / rows[5][2],
                 strength = (2e4 + 9800 / std::tan(0.5)) * 2 * std::sin(0.5) / (1 - std::sin(0.5));
    EXPECT_NEAR(slope, 5e7 / (1 - 0.47 * 0.47), 1);
    EXPECT_NEAR(-rows.back()[5] - 2e4, strength, 1e-6 * strength);
    for (const auto& row : rows)
        EXPECT_NEAR(row[4], -2e4, 1e-6);
    EXPECT_GT(rows.back()[8], 0);
}

/// In a step the stress is that in its middle: the work of elastic steps is their energy.
TEST(PointDriver, WorkOfElasticSteps)
{
    std::string elastic = law;
    elastic.replace(elastic.find("-2e4, -2e4, -2e4"), 16, "0.0, 0.0, 0.0");
    const auto rows = rows_of(elastic + "[[segment]]\nsteps = 1\ngradient = [2e-6, -1e-6, 0.0, 0.0]\n");
    const auto& end = rows.back();
    EXPECT_NEAR(end[9], 0.5 * (end[4] * 2e-6 - end[5] * 1e-6), 1e-12);
    EXPECT_GT(end[9], 0);
}

TEST(PointDriver, RefusesWhatHasNoAnswer)
{
    const auto told = [](const std::string& text)
    {
        try
        {
            drive_point(read_point_path(text, "path.toml"), "path.toml");
        }
        catch (const SceneError& e)
        {
            return std::string(e.what());
        }
        return std::string();
    };
    EXPECT_NE(told(law + "[[segment]]\nsteps = 1000000000\ngradient = [0, 1e-3, 0, 0]\n").find("steps in all are more than"),
              std::string::npos);
    std::string huge = law;
    huge.replace(huge.find("5e7"), 3, "1e308");
    EXPECT_NE(told(huge + "[[segment]]\nsteps = 2\ngradient = [0, 1, 0, 0]\n"), "");
    EXPECT_EQ(told(law + "[[segment]]\nsteps = 2\ngradient = [0, 1e-3, 0, 0]\n"), "");
}

TEST(PointDriver, EveryLawAndUnloading)
{
    for (const std::string name : {"linear_elastic", "hypoelastic_jaumann", "hypoelastic_exact_rotation"})
    {
        std::string text = law.substr(0, law.find("[material.strength]"));
        text.replace(text.find("mohr_coulomb"), 12, name);
        const auto rows = rows_of(text + "[[segment]]\nsteps = 10\ngradient = [1e-3, -2e-3, 5e-4, 0.0]\n[[segment]]\nsteps = 10\ngradient "
                                         "= [-1e-3, 2e-3, -5e-4, 0.0]\n");
        EXPECT_NEAR(rows.back()[5], -2e4, name == "linear_elastic" ? 1e-9 : 50);  // rotation of the stress on the way
        EXPECT_NEAR(rows[10][3], 5e-4, 1e-15);
    }
}

TEST(PointDriver, SaysWhatIsWrong)
{
    const auto expect = [](const std::string& text, const std::string& message)
    {
        const test::SceneFile file(text);
        try
        {
            drive_point(file.path());
            ADD_FAILURE() << "accepted";
        }
        catch (const SceneError& e)
        {
            EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what();
        }
    };
    expect(law, "no [[segment]]");
    expect(law + "[[segment]]\ngradient = [0.0, 1.0]\n", "four numbers");
    expect(law + "[[segment]]\ngradient = [0.0, 1.0, 0.0, 0.0]\nsteps = 0\n", "at least one step");
    expect(law + "colour = 1\n" + compression, "unknown key");
    expect(law + "[[segment]]\nsteps = 10\ngradient = [0.0, -4e-3, 0.0, 0.0]\nstress_xx = 1e6\n",
           "segment[0], step 1: stress_xx = 82000 Pa cannot be reached");
    expect(law + "[[segment]]\nsteps = 10\ngradient = [0.0, -1e100, 0.0, 0.0]\n", "strain above 1 per step");
    expect("initial_stress = [1.0]\n" + law.substr(law.find("[material]")) + compression, "xx, yy, zz, xy");
    expect(law + "[material.random]\nseed = 1\n" + compression, "no random field");
}
