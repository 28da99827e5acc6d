"""`testbed mesh`: a mesh of Gmsh, or of any program whose files meshio reads, as LPFDM reads it (`[lpfdm] cells = "file"`)."""
import argparse
import contextlib
import io
import sys
from pathlib import Path

import numpy as np

KINDS = ("triangle", "quad", "polygon")  # of straight sides


class MeshError(Exception):
    """What is wrong with a mesh, and what to do."""


def read(path):
    """(nodes [n, 2] in m, list of cells as lists of node numbers, kinds that were left out). Raises MeshError."""
    try:
        import meshio
    except ImportError as error:
        raise MeshError("this needs the Python package meshio (Debian: python3-meshio)") from error
    if not Path(path).is_file():
        raise MeshError(f"{path}: there is no such file")
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # meshio prints warnings there, and ends the program where it knows no format
            mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # noqa: BLE001 - each of its readers fails in its own way
        raise MeshError(f"{path}: not a mesh that can be read ({type(error).__name__}: {error})") from error
    cells, left_out = [], set()
    for block in mesh.cells:
        if block.type in KINDS:
            cells += [list(map(int, corners)) for corners in block.data]
        elif block.type.rstrip("0123456789") in KINDS:
            raise MeshError(f"{path}: cells of kind {block.type} have curved sides; ask for a mesh of order 1")
        elif block.type not in ("vertex",) and not block.type.startswith("line"):
            raise MeshError(f"{path}: cells of kind {block.type} are not plane; triangles and quadrilaterals are asked")
        else:
            left_out.add(block.type)
    if not cells:
        raise MeshError(f"{path}: no triangles or quadrilaterals in it; in Gmsh, is there a plane surface, and was it meshed (gmsh -2)?")
    points = np.asarray(mesh.points, float)
    if points.shape[1] == 3:
        used = points[sorted({n for cell in cells for n in cell}), 2]
        if np.ptp(used) > 1e-9 * np.ptp(points[:, :2], axis=0).max():
            raise MeshError(f"{path}: the mesh is not plane: z goes from {used.min():g} to {used.max():g}")
    if not np.isfinite(points[sorted({n for cell in cells for n in cell}), :2]).all():
        raise MeshError(f"{path}: a node is not finite")
    return points[:, :2], cells, sorted(left_out)


def tidy(nodes, cells):
    """Cells that run anticlockwise, over nodes that some cell has, numbered anew in their order. Raises MeshError."""
    def twice_area(cell):
        x, y = nodes[cell].T
        return np.dot(x, np.roll(y, -1)) - np.dot(np.roll(x, -1), y)

    cells = [cell if twice_area(cell) > 0 else cell[::-1] for cell in cells]
    for cell in cells:
        x = nodes[cell]
        along, on = np.roll(x, -1, axis=0) - x, np.roll(x, -2, axis=0) - np.roll(x, -1, axis=0)
        if (along[:, 0] * on[:, 1] - along[:, 1] * on[:, 0] <= 0).any():
            raise MeshError(f"a cell with its first corner at ({x[0, 0]:g}, {x[0, 1]:g}) m is not convex, or has three corners in a line")
    used = sorted({n for cell in cells for n in cell})
    number = {n: k for k, n in enumerate(used)}
    return nodes[used], [[number[n] for n in cell] for cell in cells]


def write(path, nodes, cells, source):
    """The TOML file that `[lpfdm] mesh` names (docs/file_formats.md)."""
    rows = [f"# {len(nodes)} nodes, {len(cells)} cells, from {source}", "nodes = [  # x, y [m]"]
    rows += [f"  [{x!r}, {y!r}]," for x, y in nodes.tolist()]
    rows += ["]", "cells = [  # nodes from 0, anticlockwise"] + [f"  {cell}," for cell in cells] + ["]", ""]
    Path(path).write_text("\n".join(rows), encoding="utf-8")


def main(argv=None):
    """Exit codes: 0 written, 1 not a mesh that can be used."""
    parser = argparse.ArgumentParser(prog="testbed mesh", description=__doc__)
    parser.add_argument("mesh", help="of triangles and quadrilaterals: .msh of Gmsh 2 or 4, .vtu, .inp, ...")
    parser.add_argument("output", help="OUT.toml, for [lpfdm] mesh")
    options = parser.parse_args(argv)
    try:
        if Path(options.output).suffix != ".toml":
            raise MeshError(f"output '{options.output}': the name of a mesh file ends in .toml")
        nodes, cells, left_out = read(options.mesh)
        nodes, cells = tidy(nodes, cells)
        write(options.output, nodes, cells, Path(options.mesh).name)
    except (MeshError, OSError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    (x0, y0), (x1, y1) = nodes.min(axis=0), nodes.max(axis=0)
    also = f"; left out: {', '.join(left_out)}" if left_out else ""
    print(f"{options.output}: {len(nodes)} nodes, {len(cells)} cells, x from {x0:g} to {x1:g} m, y from {y0:g} to {y1:g} m{also}")
    return 0
