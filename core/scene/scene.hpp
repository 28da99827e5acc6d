#pragma once
/// A scene: what is computed, with which method. The describe() of each struct is at once the parser, the strict check of keys,
/// `testbed doc` and the writer of the resolved scene.

#include "core/materials/kinematics.hpp"
#include "core/materials/material_spec.hpp"
#include "core/scene/method.hpp"
#include "core/scene/tables.hpp"

#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace testbed
{
struct Scene
{
    std::string title, method = "lpfdm";
    Constants constants;
    GridSpec grid;
    TimeSpec time;
    std::optional<GravitySpec> gravity;
    std::optional<DampingSpec> damping;
    std::vector<MaterialSpec> materials;
    std::vector<BodySpec> bodies;
    std::vector<BoundarySpec> boundaries;
    std::vector<WallSpec> walls;
    std::vector<TractionSpec> tractions;
    std::optional<BodyForceSpec> body_force;
    std::optional<ConfinementSpec> confinement;
    std::vector<ProbeSpec> probes;
    std::map<std::string, ExactSpec> exact;  ///< by kinematics
    OutputSpec output;
    ReportSpec report;
    std::vector<MethodOptions> method_options;  ///< in the order of methods()

    std::string path;  ///< as given by the user

    Scene();
    template <class V>
    void describe(V& v)
    {
        v.optional("title", title, "", "one line for reports");
        v.optional("method", method, "", "a variant: see `testbed list`");
        v.named_numbers("constants", constants,
                        "names for the expressions of the scene; pi is known, and the cell size L if it is a number");
        v.table("grid", grid, "the fixed lattice");
        v.table("time", time, "duration and time step");
        v.table("gravity", gravity, "body force, eq. (11)");
        v.table("damping", damping, "for quasi-static scenes");
        v.list("material", materials, "constitutive laws");
        v.list("body", bodies, "clusters of material points");
        v.list("boundary", boundaries, "fixities and rollers");
        v.list("wall", walls, "rigid walls, moving or not");
        v.list("traction", tractions, "loads on faces");
        v.table("confinement", confinement, "cell pressure of a compression test");
        v.table("body_force", body_force, "acceleration field, for manufactured solutions");
        v.list("probe", probes, "means over chosen points in the history");
        v.tables("exact", exact, names_of<Kinematics>(), "exact solution for methods that integrate this law");
        v.table("output", output, "what is written");
        v.table("report", report, "what is graded");
        for (std::size_t m = 0; m < method_options.size(); ++m)
            v.table(methods()[m].name.c_str(), method_options[m], methods()[m].about);
    }

    /// The table of the method whose options these are. @throws std::logic_error if there is no such method
    template <class Options>
    Options& options()
    {
        for (MethodOptions& table : method_options)
            if (Options* found = table.as<Options>())
                return *found;
        throw std::logic_error("options of a method that is not in the list");
    }
    template <class Options>
    const Options& options() const
    {
        return const_cast<Scene*>(this)->options<Options>();
    }
    /// Name of the folder that holds the scene.
    /// Of the folder of the scene's file, and of the file where that is not scene.toml.
    std::string case_name() const;
    const MaterialSpec& material(const std::string& name) const;
    const BodySpec& body(const std::string& name) const;
    /// Whether the law of some body has a strength, so that it may flow or break.
    bool may_flow() const;
    /// Constants with L, as expressions see them.
    Constants expression_constants() const;
};

/// The name of the scene's variant, with the options that the scene changes in brackets.
std::string variant_label(const Scene& scene);

/// All problems of a scene at once, each with file, line and key.
struct SceneError : std::runtime_error
{
    using std::runtime_error::runtime_error;
};

struct LoadedScene
{
    Scene scene;
    std::vector<std::string> warnings;
};

/// @param overrides "key.path=value" strings; list entries by number from 0 or by name.
/// @throws SceneError
LoadedScene load_scene(const std::string& path, const std::string& method = "", const std::vector<std::string>& overrides = {});
/// What a scene may have at most: points have numbers of 32 bits, and some 150 bytes each.
struct SceneBounds
{
    double points = 1e9, cells = 2e9;
};
/// The same from the text of a scene. @param path what messages call it, and what names its case
LoadedScene load_scene_text(const std::string& text, const std::string& path, const std::string& method = "",
                            const std::vector<std::string>& overrides = {}, const SceneBounds& bounds = {});

std::string resolved_toml(const Scene& scene);
/// Documentation of all tables, or of one. @throws SceneError for an unknown table.
std::string scene_documentation(const std::string& table = "");
/// The nearest of the candidates, or nothing if none is near.
std::optional<std::string> nearest(const std::string& word, const std::vector<std::string>& candidates);
}  // namespace testbed
