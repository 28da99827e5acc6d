#pragma once
/// The mesh that a scene asks for.

#include "core/loads/node_ops.hpp"
#include "lpfdm/mesh/mesh.hpp"

namespace testbed
{
/// A mesh, and the lattice that gives its nodes their numbers and NodeOps their indices: the scene's own if the mesh is made of it, else
/// one of a single line.
struct NumberedMesh
{
    Lattice<2> numbers;
    Mesh mesh;
};

/// @throws SceneError for a file that cannot be read or is no mesh
NumberedMesh make_mesh(const Scene& scene);
/// Loads, supports and walls at its nodes.
NodeOps node_ops_of(const Scene& scene, const NumberedMesh& mesh);
}  // namespace testbed
