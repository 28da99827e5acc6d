#pragma once
/// The lattice cells that the bodies cover, as a deal.II mesh.

#include "core/lattice/nodes.hpp"
#include "core/scene/scene.hpp"
#include "fem_reference/options.hpp"

#include <deal.II/grid/tria.h>
#include <functional>

namespace testbed
{
/// Takes what the user should know but may ignore.
using Warn = std::function<void(const std::string&)>;

/// The lattice that the mesh follows: the scene's, moved by part of a cell if the first box does not lie on its lines.
Lattice<2> mesh_lattice(const Scene& scene);

/// Fills `mesh` with the cells of all bodies, refined fem.refinements times; the material id is the number of the body in the
/// scene. Cells of different bodies share their nodes: perfect bonding. A box takes its cells exactly; a disk or a polygon takes
/// those whose centre it holds, with a warning, because its boundary becomes a flight of steps.
/// @param lattice of mesh_lattice()
/// @throws SceneError for a box off the lattice lines, a body without cells, bodies that overlap
void make_mesh(const Scene& scene, const Lattice<2>& lattice, const Warn& warn, dealii::Triangulation<2>& mesh);

/// Cells of the refined mesh along one lattice cell.
inline int cells_per_lattice_cell(const Scene& scene)
{
    return 1 << scene.options<FemSpec>().refinements;
}
}  // namespace testbed
