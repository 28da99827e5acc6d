#pragma once
/// What the testbed knows of its methods: a row for each, which the folder of the method fills in.

#include "core/scene/method_options.hpp"

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace testbed
{
struct Scene;
class Problems;
class Solver;

using MakeSolver = std::function<std::unique_ptr<Solver>(const Scene&)>;

/// A named set of options of a method, that is, what `method` in a scene may be.
struct Variant
{
    std::string name, description;
    void (*apply)(Scene&);
};

/// Below this share of a full node's mass the acceleration of a node is not limited by the soil around it.
inline constexpr double sliver_mass = 1e-3;

/// Settings, as for --set, that help where a run went wrong; empty where the method has none, or has it on
/// already, or the other options exclude it.
struct Remedies
{
    std::string crossing = "";   ///< of points that belong to a cell as a whole
    std::string null_mode = "";  ///< of motion that the points, or the nodes, do not see
    std::string locking = "";    ///< of a nearly incompressible body
    std::string tension = "";    ///< of points whose volume has grown beyond their cell
    std::string sliver = "";     ///< of nodes with next to no mass
};

/// What walls, guards and diagnosis ask of a method with the options of a scene.
struct Traits
{
    bool has_points = true;           ///< that move, and are its state; FEM samples its solution at them
    int reach = 2;                    ///< bins apart at which two points still share a node; 1: a point belongs to one cell as a whole
    double elements_per_cell = 1;     ///< along a side
    bool shares_cells = false;        ///< nodes take a cell's mass as a whole, wherever its points lie
    bool damps_hourglass = false;     ///< by a force of its own
    bool may_lock = false;            ///< where nearly incompressible
    bool divides_by_slivers = false;  ///< velocities of nodes with next to no mass enter the strain
    Remedies remedies = {};
};

/// One row. No function is empty but `make`.
struct Method
{
    std::string name;  ///< of its table in a scene, and in results
    const char* about;
    std::vector<Variant> variants;
    MethodOptions options;                   ///< with their default values
    void (*check)(const Scene&, Problems&);  ///< the table: what is wrong in it
    void (*warn)(const Scene&, Problems&);   ///< a right scene: what the method leaves out of it, or is known to do badly
    Traits (*traits)(const Scene&);
    MakeSolver make;  ///< empty if the method is a program of its own, testbed-NAME
};

/// All of them. Core only declares this: programs say which methods they have (benchmarks/harness/methods.cpp).
const std::vector<Method>& methods();

std::vector<std::string> variant_names();
/// @throws SceneError if there is none of this name
const Method& find_method(const std::string& variant);
const Variant& find_variant(const std::string& name);
const Method& method_of(const Scene& scene);
Traits traits_of(const Scene& scene);
}  // namespace testbed
