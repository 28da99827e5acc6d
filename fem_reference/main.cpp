#include "core/run/run_options.hpp"
#include "fem_reference/fem.hpp"

/// The `testbed-fem` command: what `testbed run` becomes when the method is FEM.
namespace testbed
{
namespace
{
int run(int argc, char** argv)
{
    CLI::App app("FEM reference of the testbed: small-strain elasticity with deal.II");
    RunOptions options;
    add_run_options(app, options);
    try
    {
        app.parse(argc, argv);
    }
    catch (const CLI::ParseError& e)
    {
        return app.exit(e) == 0 ? 0 : static_cast<int>(ExitCode::bad_scene);
    }
    return static_cast<int>(
        run_scene(options,
                  [&](const Scene& scene)
                  {
                      if (method_of(scene).name != "fem")
                          throw SceneError(scene.path + ": method '" + scene.method + "' is not an FEM one; add --method fem-q2");
                      const auto refuse = [&](const std::string& message) { throw SceneError(scene.path + ": " + message); };
                      return make_fem(scene, options.strict ? Warn(refuse) : Warn());
                  }));
}
}  // namespace
}  // namespace testbed

int main(int argc, char** argv)
{
    return testbed::guarded_main([&] { return testbed::run(argc, argv); });
}
