"""Result files of soil tests with known answers: lattices of points with given fields, supports and reference curves."""
from pathlib import Path

import h5py
import numpy as np
from synthetic import seal, write_result

UNITS = {"plastic_shear_strain": "-", "cohesion": "Pa", "friction_angle": "rad", "body": ""}
CONSTANT = ("cohesion", "friction_angle")  # written once


def lattice(width, height, h):
    """(N, 3) initial positions of points of spacing h that fill a box from the origin."""
    x, y = ((np.arange(round(size / h)) + 0.5) * h for size in (width, height))
    X = np.zeros((len(x) * len(y), 3))
    X[:, 1], X[:, 0] = (a.ravel() for a in np.meshgrid(y, x, indexing="ij"))
    return X


def toml_curves(**curves):
    """[[report.curve]] tables of name = (x, y)."""
    return "".join(f'[[report.curve]]\nname = "{name}"\nx = {list(map(float, x))}\ny = {list(map(float, y))}\n'
                   for name, (x, y) in curves.items())


def write_soil(path, X, h, fields=None, displacement=None, time=(0.0, 1.0), history=None, supports=None, probes=None,
               snapshots=1, **common):
    """Writes a result with points X (N, 3) of spacing h; returns its path.

    `fields`, `displacement` (N, 3): at the last snapshot, growing in equal parts; `supports`: {name: {field: (M, 3)}};
    `probes`: {name: displacement (M, 3)}; `history`: {name: (M,)}; the rest goes to write_result.
    """
    path, time = Path(path), np.asarray(time, float)
    common = {"metrics": "", "L": 2 * h, **common, "probes": (), "snapshots": 0, "samples": len(time)}
    write_result(path, **common, sealed=False, history={"time": time, **(history or {})})
    u, fields = np.zeros_like(X) if displacement is None else displacement, fields or {}
    with h5py.File(path, "a") as file:
        for name, values in (supports or {}).items():
            for key, data in values.items():
                file[f"history/supports/{name}/{key}"] = data
        for name, data in (probes or {}).items():
            file[f"history/probes/{name}/displacement"] = data
        for k in range(snapshots):
            share, group = (k + 1) / snapshots, file.create_group(f"snapshots/{k:04d}")
            group.attrs.update(time=share * time[-1], step=k)
            if k == 0 and set(CONSTANT) & set(fields):
                group.attrs["constant"] = " ".join(CONSTANT)
            volume = np.full(len(X), h * h)
            for name, data in {"initial_position": X, "displacement": share * u, "position": X + share * u, "volume": volume,
                               "initial_volume": volume, "body": np.zeros(len(X))}.items():
                group[name] = fields.get(name, data)
            for name in set(fields) - set(group):
                constant = name in CONSTANT
                if constant and k:
                    continue
                group[name] = fields[name] if constant else share * fields[name]
                group[name].attrs["unit"] = UNITS.get(name, "Pa")
    return seal(path)


def vectors(x=0.0, y=0.0):
    """(M, 3) from components, of which one may be a number."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return np.stack([x, y, np.zeros_like(x)], axis=1)


def write_soil_study(folder, figures, results, study_extra=""):
    """A study's folder of (run id, run's changes for write_soil); a change holds X and h."""
    import json
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text('title = "Soil"\nscene = "scene.toml"\n' + study_extra + figures)
    plan = {"command": "testbed study soil.toml", "runs": []}
    for name, changes in results.items():
        plan["runs"].append({"id": name, "axes": {}, "repeat": 1})
        write_soil(folder / "runs" / name / "result.h5", **changes)
    (folder / "plan.json").write_text(json.dumps(plan))
    return folder
