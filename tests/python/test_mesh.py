"""`testbed mesh`: meshes of other programs, and what is refused of them."""
import os
import subprocess
import tomllib

import pytest
from testbed_reports.study.mesh import main

pytest.importorskip("meshio")
TESTBED = os.environ.get("TESTBED", "")

# Gmsh 2.2: a patch of 2 x 4 m, two quadrilaterals, the upper one clockwise, a line, and a node that no cell has
HEAD = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
NODES = "$Nodes\n7\n1 9 9 0\n2 0 0 0\n3 2 0 0\n4 2 2 0\n5 0 2 0\n6 2 4 0\n7 0 4 {z}\n$EndNodes\n"
CELLS = "$Elements\n3\n1 1 2 0 1 2 3\n2 3 2 0 1 2 3 4 5\n3 3 2 0 1 5 7 6 4\n$EndElements\n"


def converted(tmp_path, text, output="mesh.toml"):
    (tmp_path / "mesh.msh").write_text(text)
    return main([str(tmp_path / "mesh.msh"), str(tmp_path / output)])


def test_quadrilaterals_of_gmsh(tmp_path, capsys):
    """Anticlockwise, numbered anew without the node that no cell has; what was left out is said."""
    assert converted(tmp_path, HEAD + NODES.format(z=0) + CELLS) == 0
    assert "6 nodes, 2 cells, x from 0 to 2 m, y from 0 to 4 m; left out: line" in capsys.readouterr().out
    mesh = tomllib.loads((tmp_path / "mesh.toml").read_text())
    assert mesh["nodes"] == [[0, 0], [2, 0], [2, 2], [0, 2], [2, 4], [0, 4]]
    assert mesh["cells"] == [[0, 1, 2, 3], [2, 4, 5, 3]]


@pytest.mark.parametrize("text, message", [
    ("nonsense", "not a mesh that can be read"),
    (HEAD + NODES.format(z=0.5) + CELLS, "not plane: z goes from 0 to 0.5"),
    (HEAD + NODES.format(z=0) + "$Elements\n1\n1 1 2 0 1 2 3\n$EndElements\n", "no triangles or quadrilaterals"),
    (HEAD + NODES.format(z=0) + "$Elements\n1\n1 9 2 0 1 2 3 4 5 6 7\n$EndElements\n", "curved sides"),
    (HEAD + NODES.format(z=0).replace("6 2 4", "6 nan 4") + CELLS, "not finite"),
    (HEAD + NODES.format(z=0) + "$Elements\n1\n1 3 2 0 1 2 4 3 5\n$EndElements\n", "not convex"),
    (HEAD + NODES.format(z=0) + "$Elements\n1\n1 4 2 0 1 2 3 4 5\n$EndElements\n", "kind tetra are not plane"),
])
def test_refused(tmp_path, capsys, text, message):
    assert converted(tmp_path, text) == 1
    assert message in capsys.readouterr().err
    assert not (tmp_path / "mesh.toml").exists()


def test_names_of_files(tmp_path, capsys):
    assert converted(tmp_path, HEAD, "mesh.h5") == 1
    assert "ends in .toml" in capsys.readouterr().err
    assert main([str(tmp_path / "none.msh"), str(tmp_path / "mesh.toml")]) == 1
    assert "there is no such file" in capsys.readouterr().err


@pytest.mark.skipif(not TESTBED, reason="no executable")
def test_column_runs_on_it(tmp_path):
    """From the file of Gmsh to a column at rest on two cells, which have the stress of their middles; the mesh may lie elsewhere than the
    run; and a mesh that does not cover the body is refused."""
    assert converted(tmp_path, HEAD + NODES.format(z=0) + CELLS) == 0
    scene = tmp_path / "scene.toml"
    scene.write_text("""
method = "lpfdm-2000"
[grid]
size = [2.0, 4.0]
cell_size = 1.0
[time]
end = 5.0
stop_unbalanced = 1e-6
[gravity]
acceleration = [0.0, -10.0]
[damping]
local = 0.7
[[material]]
name = "soil"
law = "linear_elastic"
density = 1000.0
youngs_modulus = 1e8
poissons_ratio = 0.0
[[body]]
name = "column"
material = "soil"
shape = "box"
min = [0.0, 0.0]
max = [2.0, 4.0]
[[boundary]]
name = "base"
where = "y <= 0"
fix = "y"
[[boundary]]
name = "sides"
where = "x <= 0 || x >= 2"
fix = "x"
[[probe]]
name = "low"
where = "Y < 2"
[lpfdm]
cells = "file"
mesh = "mesh.toml"
""")
    (tmp_path / "elsewhere").mkdir()
    command = [TESTBED, "run", str(scene), "-o", "r.h5"]
    done = subprocess.run(command, cwd=tmp_path / "elsewhere", capture_output=True, text=True)
    assert done.returncode == 0 and "completed, sound" in done.stderr + done.stdout, done.stderr
    import h5py
    with h5py.File(tmp_path / "elsewhere" / "r.h5") as file:
        last = file["snapshots"][sorted(file["snapshots"])[-1]]
        stress, height = last["stress"][:, 3], last["initial_position"][:, 1]
    assert abs(stress[height < 2].mean() / -30e3 - 1) < 1e-3
    assert abs(stress[height > 2].mean() / -10e3 - 1) < 1e-3
    (tmp_path / "mesh.toml").write_text("nodes = [[0, 0], [2, 0], [2, 2], [0, 2]]\ncells = [[0, 1, 2, 3]]\n")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "at the start point" in done.stderr and "the mesh must cover the bodies" in done.stderr
