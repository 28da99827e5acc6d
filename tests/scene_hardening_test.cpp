/// Scenes that nobody would write: each is refused in words that name the key, before anything is computed.

#include "core/base/shown.hpp"
#include "core/scene/scene.hpp"
#include "core/scene/trial.hpp"
#include "tests/scenes.hpp"

#include <algorithm>
#include <gtest/gtest.h>

using namespace testbed;

namespace
{
const std::string block = test::soil_block({1, 0}, {3, 2});

std::string problems_of(const std::string& text, const std::vector<std::string>& overrides = {})
{
    try
    {
        try_expressions(load_scene_text(text, "scene.toml", "", overrides).scene);
    }
    catch (const SceneError& e)
    {
        return e.what();
    }
    return "";
}

void expect(const std::string& more, const std::string& told, const std::vector<std::string>& overrides = {})
{
    const std::string message = problems_of(block + more, overrides);
    EXPECT_NE(message.find(told), std::string::npos) << more << "\ngot: " << message;
}

std::string repeated(const std::string& part, std::size_t n)
{
    std::string text;
    for (std::size_t k = 0; k < n; ++k)
        text += part;
    return text;
}
}  // namespace

TEST(Hardening, TheBlockItselfIsRight)
{
    EXPECT_EQ(problems_of(block), "");
}

/// What an expression may depend on is another thing at every key, and the rest is refused by name.
TEST(Hardening, VariablesOfExpressions)
{
    const std::string boundary = "[[boundary]]\nname = \"b\"\nfix = \"y\"\nwhere = ", probe = "[[probe]]\nname = \"p\"\nwhere = ";
    const std::string wall = "[[wall]]\nname = \"w\"\nmin = [0.0, 2.0]\nmax = [4.0, 2.0]\nvelocity = ";
    EXPECT_EQ(problems_of(block + boundary + "\"y <= 0 && x < 3\"\n" + probe + "\"Y > 1 && X < 2\"\n" + wall + "[\"0\", \"0.1*sin(t)\"]\n"),
              "");
    expect(boundary + "\"y <= 3 && t < 0.1\"\n",
           "boundary[0].where: expression 'y <= 3 && t < 0.1': 't' is not known here, only x, y and constants");
    expect(boundary + "\"Y <= 0\"\n", "'Y' is not known here");
    expect(probe + "\"x > 1\"\n", "probe[0].where: expression 'x > 1': 'x' is not known here, only X, Y");
    expect(wall + "[\"0\", \"x\"]\n", "wall[0].velocity: expression 'x': 'x' is not known here, only t");
    expect("", "body[0].velocity: expression 't': 't' is not known here", {"body.soil.velocity=[\"t\", 0]"});
    expect("", "body[0].initial_stress", {"body.soil.initial_stress=[\"x\", 0, 0, 0]"});
    expect("", "material[0].youngs_modulus: expression '1e6+t': 't' is not known here", {"material.soil.youngs_modulus=\"1e6+t\""});
    expect("[body_force]\nacceleration = [\"x*t\", \"X+z\"]\n", "z");
    EXPECT_EQ(problems_of(block + "[body_force]\nacceleration = [\"x*t\", \"X+y\"]\n"), "");
}

/// One '=' is a comparison that lost a sign: it would hold everywhere or nowhere.
TEST(Hardening, AssignmentsAreRefused)
{
    const std::string boundary = "[[boundary]]\nname = \"b\"\nfix = \"y\"\nwhere = ";
    for (const char* text : {"\"y = 0\"", "\"y = 1\"", "\"x >= 0 && y = 2\"", "\"y =\""})
        expect(boundary + text + "\n", "to compare, write '=='");
    EXPECT_EQ(problems_of(block + boundary + "\"y == 0 || x != 2 || x >= 3 || x <= 1\"\n"), "");
}

/// `check` finds what would stop a run: at the first point, or at the end.
TEST(Hardening, ExpressionsAreTriedWhereARunAsksForThem)
{
    expect("[[probe]]\nname = \"p\"\nwhere = \"Y > 99\"\n", "probe 'p': where = \"Y > 99\" holds at no point");
    expect("[[probe]]\nname = \"p\"\nwhere = \"sqrt(X - 2)\"\n", "probe 'p'");
    expect("", "body 'soil': velocity: expression '1/(X-1.0625)' is not finite", {"body.soil.velocity=[\"1/(X-1.0625)\", 0]"});
    expect("", "body 'soil': initial_stress", {"body.soil.initial_stress=[0, \"log(1-X)\", 0, 0]"});
    expect("[body_force]\nacceleration = [\"1/t\", \"0\"]\n", "body_force.acceleration");
    expect("[body_force]\nacceleration = [\"sqrt(0.5 - t)\", \"0\"]\n", "not finite at x = 1.0625 m, y = 0.0625 m, t = 1 s");
    expect("[[traction]]\nname = \"top\"\nbody = \"soil\"\nface = \"top\"\ntraction = [\"0\", \"1/(1-t)\"]\n", "traction 'top'");
    EXPECT_EQ(
        problems_of(block + "[[traction]]\nname = \"top\"\nbody = \"soil\"\nface = \"top\"\ntraction = [\"0\", \"1/(Y - 0.0625)\"]\n"), "");
    expect("[exact.hypoelastic]\ndisplacement = [\"0\", \"log(Y - 1)\"]\n", "exact.hypoelastic.displacement");
}

TEST(Hardening, NumbersThatNoDoubleHolds)
{
    expect("", "density", {"material.soil.density=0"});
    expect("", "material[0].youngs_modulus", {"material.soil.youngs_modulus=1e300"});
    expect("", "steps of", {"material.soil.density=1e-300"});
    expect("", "the mass of a point", {"material.soil.density=1e-307"});
    expect("", "the shear modulus is inf Pa", {"material.soil.youngs_modulus=\"1/0\""});
    expect("", "finite", {"time.end=nan"});
    expect("", "material[0].youngs_modulus", {"material.soil.youngs_modulus=nan"});
    expect("", "grid.size", {"grid.cell_size=1e300"});
    expect("", "grid.size", {"grid.cell_size=1e-300"});
    expect("", "outside the lattice", {"body.soil.max=[1e300, 1e300]"});
    expect("", "time.end", {"time.end=0"});
    expect("", "time.end", {"time.end=1e300"});
    expect("", "time.cfl", {"time.cfl=0"});
    expect("", "time.cfl", {"time.cfl=1e9"});
    expect("", "steps of", {"time.cfl=1e-300"});
    expect("", "steps of", {"time.dt=1e-300"});
    expect("", "time.dt", {"time.dt=1e-320"});
    expect("", "points_per_cell", {"body.soil.points_per_cell=1000000"});
    expect("", "points_per_cell", {"body.soil.points_per_cell=-4"});
    expect("", "grid.cell_size", {"grid.cell_size=-0.5"});
    expect("", "grid.cell_size", {"grid.cell_size=0"});
}

/// More points than any memory holds are counted, not made; a small body in a large lattice is made at once.
TEST(Hardening, LargeScenes)
{
    const std::vector<std::string> large{"grid.size=[20000, 20000]", "body.soil.points_per_cell=64"};
    auto filled = large;
    filled.emplace_back("body.soil.max=[20000, 20000]");
    filled.emplace_back("body.soil.min=[0, 0]");
    expect("", "points, more than 1e+09", filled);
    expect("", "cells", {"grid.size=[4e5, 4e5]"});
    const std::string with_disk =
        block + "[[body]]\nname = \"d\"\nmaterial = \"soil\"\nshape = \"disk\"\ncenter = [20000.0, 20000.0]\nradius = 1.0\n";
    EXPECT_EQ(problems_of(with_disk, {"grid.size=[20002, 20002]", "grid.cell_size=1.0"}), "");
}

/// Shapes that lack a part have no overlap to look for.
TEST(Hardening, ShapesThatLackAPart)
{
    expect("[[body]]\nname = \"d\"\nmaterial = \"soil\"\nshape = \"disk\"\n", "body[1].center: missing");
    expect("[[body]]\nname = \"p\"\nmaterial = \"soil\"\nshape = \"polygon\"\nvertices = [[0, 0]]\n", "at least three corners");
    expect("[[body]]\nname = \"p\"\nmaterial = \"soil\"\nshape = \"polygon\"\nvertices = [[3, 3], [5, 5], [5, 3], [3, 5]]\n",
           "the edges after corners 1 and 3 cross");
    expect("[[body]]\nname = \"b\"\nmaterial = \"soil\"\nshape = \"box\"\nmin = [0, 3]\n", "body[1].max: missing");
    expect("[[body]]\nname = \"d\"\nmaterial = \"soil\"\nshape = \"disk\"\ncenter = [0.5, 3]\nradius = 0\n", "must be positive");
}

TEST(Hardening, DeepText)
{
    expect(repeated("a.", 100000) + "a = 1\n", "scene.toml:20: a key of more than 16 parts");
    expect("[" + repeated("a.", 100000) + "a]\n", "a key of more than 16 parts");
    expect("a = " + repeated("[", 100000) + repeated("]", 100000), "not TOML");
    expect("a = " + repeated("{a = ", 100000), "not TOML");
    expect("", "a key of more than 16 parts", {repeated("a.", 30000) + "a=1"});
    EXPECT_EQ(problems_of("title = \"a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r\" # a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r\n" + block), "");
    EXPECT_EQ(problems_of("title = '''a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r\n\"'''\n" + block), "");
    const std::string where = "[[boundary]]\nname = \"b\"\nfix = \"y\"\nwhere = \"";
    EXPECT_EQ(problems_of(block + where + repeated("(", 2000) + "y" + repeated(")", 2000) + "\"\n"), "");
    expect(where + repeated("(", 3000) + "y" + repeated(")", 3000) + "\"\n", "longer than 5000 bytes");
}

/// Neither the number nor the length of messages grows with what is wrong, and no control character reaches the terminal.
TEST(Hardening, MessagesAreBounded)
{
    std::string many;
    for (int k = 0; k < 2000; ++k)
        many += "key" + std::to_string(k) + " = 1\n";
    const std::string told = problems_of(many + block);
    EXPECT_NE(told.find("and 1950 more"), std::string::npos) << told.substr(told.size() - 200);
    EXPECT_LT(told.size(), 20000u);
    const std::string long_name = repeated("\u00e4", 100000);
    EXPECT_LT(problems_of("\"" + long_name + "\" = 1\n" + block).size(), 2000u);
    EXPECT_LT(problems_of(block, {"body.soil.material=\"" + long_name + "\""}).size(), 2000u);
    EXPECT_LT(problems_of(block, {"body.soil.name=\"" + long_name + "\""}).size(), 2000u);
    EXPECT_LT(problems_of(block, {"material.soil.youngs_modulus=\"" + repeated("1+", 2000) + "z\""}).size(), 2000u);
    const std::string escape = problems_of(block, {"method=\"\\u001b[2J\""});
    EXPECT_EQ(escape.find('\x1b'), std::string::npos);
    EXPECT_NE(escape.find("\\x1b[2J"), std::string::npos) << escape;
    std::string names = "[constants]\n";
    for (int k = 0; k < 300; ++k)
        names += "c" + std::to_string(k) + " = 1\n";
    expect(names, "300 names are more than 256");
}

TEST(Hardening, ShownKeepsCharactersWhole)
{
    EXPECT_EQ(shown("plain"), "plain");
    EXPECT_EQ(shown("a\nb\x7f"), "a\\x0ab\\x7f");
    for (std::size_t most = 3; most < 30; ++most)
    {
        const std::string text = shown(repeated("\u00e4", 50), most);
        EXPECT_LE(text.size(), most + 30);
        std::size_t letters = 0;
        for (std::size_t at = text.find("\u00e4"); at != std::string::npos; at = text.find("\u00e4", at + 2))
            ++letters;
        const auto continuations = std::count_if(text.begin(), text.end(), [](unsigned char c) { return c >= 0x80; });
        EXPECT_EQ(static_cast<std::size_t>(continuations), 2 * letters) << text;
    }
}

/// Other line ends and letters are no error.
TEST(Hardening, LineEndsAndLetters)
{
    std::string crlf;
    for (const char c : block)
        crlf += c == '\n' ? "\r\n" : std::string(1, c);
    EXPECT_EQ(problems_of(crlf), "");
    EXPECT_EQ(problems_of("\xef\xbb\xbf" + block), "");
    EXPECT_EQ(problems_of("title = \"S\u00e4ule \u7802\"\n" + block, {"body.soil.name=\"Sand \u7802\""}), "");
    EXPECT_NE(problems_of("title = \"\xff\xfe\"\n" + block).find("not TOML"), std::string::npos);
    EXPECT_NE(problems_of(block + std::string("a = \"\0\"\n", 8)).find("not TOML"), std::string::npos);
}

TEST(Hardening, NamesTwice)
{
    expect("[[body]]\nname = \"soil\"\nmaterial = \"soil\"\nshape = \"box\"\nmin = [0, 3]\nmax = [1, 4]\n", "'soil' is used twice");
    expect("[[probe]]\nname = \"p\"\nwhere = \"1\"\n[[probe]]\nname = \"p\"\nwhere = \"1\"\n", "'p' is used twice");
}
