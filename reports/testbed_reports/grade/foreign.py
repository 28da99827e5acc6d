"""Results of other codes: what cannot be in them, and what they are called beside runs of the testbed."""
import re

import numpy as np

from ..read.results import ResultError
from .sampling import sampling

FAMILIES = ("lpfdm", "mpm", "fem")
OUTSIDE = " (outside)"
COLUMNS = {"stress": 6, "exact_stress": 6, **dict.fromkeys(("position", "displacement", "velocity", "initial_position", "exact_displacement"), 3)}
POSITIVE = ("volume", "initial_volume", "mass")
NEAR = 1e-6  # of a length or a time
EXACT = 1e-9  # of the largest value


def outside_name(name):
    """A method or variant of another code by a name that none of the testbed's own has."""
    return name + OUTSIDE if name.split("[")[0].split("-")[0] in FAMILIES else name


def _shapes(snapshot):
    told, sizes = [], {}
    for name in sorted(snapshot.fields):
        values = snapshot[name]
        if not values.ndim:
            told.append(f"the last snapshot's {name} is a single number, not one for each point")
            continue
        sizes.setdefault(len(values), []).append(name)
        columns = COLUMNS.get(name)
        if columns and values.shape[1:] != (columns,):
            told.append(f"the last snapshot's {name} has the shape {values.shape}, not (N, {columns})")
        if not np.isfinite(values).all():
            told.append(f"the last snapshot's {name} is not finite everywhere")
        elif name in POSITIVE and not (values > 0).all():
            told.append(f"the last snapshot's {name} is not positive everywhere")
    if len(sizes) > 1:
        told.append("fields of the last snapshot differ in their number of points: " + "; ".join(f"{', '.join(names)}: {n}" for n, names in sizes.items()))
    return told


def _times(result):
    """Snapshots follow each other up to the end of the scene; one that may stop at rest has its whole gravity on by then."""
    times, scene = [s.time for s in result.snapshots], result.resolved
    told = [] if all(a < b for a, b in zip(times, times[1:])) else ["times of the snapshots do not ascend"]
    tables = {name: scene[name] if isinstance(scene.get(name), dict) else {} for name in ("time", "gravity")}
    end, ramp = tables["time"].get("end"), tables["gravity"].get("ramp", 0)
    if not times or result.status != "completed" or not isinstance(end, (int, float)):
        return told
    least = ramp if tables["time"].get("stop_unbalanced") and isinstance(ramp, (int, float)) else end
    if not least * (1 - NEAR) <= times[-1] <= end * (1 + NEAR):
        told.append(f"the last snapshot is of t = {times[-1]:g} s, and the scene ends at {end:g} s" + (f", or at rest after {least:g} s" if least != end else ""))
    return told


def _scene(result):
    """What /scene says must be what its scene says."""
    grid, bodies = result.resolved.get("grid", {}), result.resolved.get("body", [])
    pairs = (("cell_size", result.cell_size, grid.get("cell_size")),
             ("points_per_cell", result.scene.get("points_per_cell"), bodies[0].get("points_per_cell") if bodies else None))
    return [f"/scene says {name} = {told:g}, its scene {asked:g}" for name, told, asked in pairs
            if all(isinstance(v, (int, float)) for v in (told, asked)) and not np.isclose(told, asked, rtol=NEAR, atol=0)]


def _in_order(places, length):
    """Indices that sort points by their places, whatever their rounding."""
    return np.lexsort(np.round(places[:, :2] / (0.01 * length)).T)


def _points(result):
    """Initial positions and volumes are those of the scene's points, in any order."""
    asked, last = sampling(result.resolved), result.final
    if asked is None or "initial_position" not in last or last["initial_position"].ndim != 2:
        return []
    X, length = last["initial_position"][:, :2], np.sqrt(asked[:, 2].min())
    if len(X) != len(asked):
        return [f"it has {len(X)} points, the scene {len(asked)}"]
    mine, own = _in_order(X, length), _in_order(asked, length)
    if not np.allclose(X[mine], asked[own, :2], rtol=0, atol=0.01 * length):
        return ["initial_position: not where the scene puts its points"]
    if "initial_volume" in last and not np.allclose(last["initial_volume"][mine], asked[own, 2], rtol=1e-3):
        return ["initial_volume: not that of the scene's points"]
    return []


def _exact(result, peers):
    """Exact fields are those of one of the testbed's own runs of the same scene."""
    last, told = result.final, []
    fixed = not re.search(r"\b[xyt]\b", str(result.resolved.get("exact", "")))  # at the points, at all times
    peers = [p.final for p in peers if p.snapshots and (fixed or np.isclose(p.final.time, last.time, rtol=NEAR))]
    mine = _in_order(last["initial_position"], result.cell_size / 64)
    for name in ("exact_stress", "exact_displacement"):
        own = [p[name][_in_order(p["initial_position"], result.cell_size / 64)] for p in peers if name in p] if name in last else []
        if own and not any(np.allclose(last[name][mine], values, rtol=0, atol=EXACT * np.abs(values).max()) for values in own):
            told.append(f"{name}: not that of the scene")
    return told


def faults(result, peers=()):
    """Sentences on what keeps a result from being used. `peers`: results of the testbed's own runs; those of the same points and exact solution are looked at."""
    try:
        told = _scene(result) + _times(result) + (_shapes(result.final) if result.snapshots else [])
        if told or not result.snapshots:
            return told
        told = _points(result)
        alike = [p for p in peers if all(p.resolved.get(k) == result.resolved.get(k) for k in ("body", "grid", "exact"))]
        return told or ("initial_position" in result.final and _exact(result, alike)) or []
    except ResultError as error:
        return [str(error).removeprefix(f"{result.path}: ")]
