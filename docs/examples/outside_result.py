#!/usr/bin/python3
"""How another code joins a comparison: writes the result file of the elastic column by a method of its own (here: the exact small-strain
solution, sampled at the material points).

    outside_result.py REFERENCE.h5 OUT.h5

REFERENCE.h5 is a run of the same scene by the testbed: it says where the material points are, what the case is called and what is graded.
"""
import sys
import time

import h5py
import numpy as np

XX, XY, XZ, YY, YZ, ZZ = range(6)  # columns of a stress


def solve(X, scene):
    """Displacement (N, 3) and stress (N, 6) of an elastic column under its own weight, rollers at the sides, at points X (N, 3)."""
    E, nu, rho, g, H = (scene[k] for k in ("E", "nu", "rho", "g", "H"))
    M = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    u, stress = np.zeros((len(X), 3)), np.zeros((len(X), 6))
    u[:, 1] = -rho * g / M * (H * X[:, 1] - X[:, 1] ** 2 / 2)
    stress[:, YY] = -rho * g * (H - X[:, 1])
    stress[:, XX] = stress[:, ZZ] = nu / (1 - nu) * stress[:, YY]
    return u, stress


def main(reference, out):
    with h5py.File(reference) as run, h5py.File(out, "w") as file:
        first = run["snapshots/0000"]
        X, V = first["initial_position"][()], first["initial_volume"][()]
        constants = dict(line.split(" = ") for line in run["scene"].attrs["constants"].splitlines())
        scene = {key: float(value) for key, value in constants.items()}
        started = time.perf_counter()
        u, stress = solve(X, scene)
        seconds = time.perf_counter() - started

        file.attrs.update(format="testbed-result", format_version=np.int64(1), case=run.attrs["case"], title="Exact column", method="other",
                          variant="my-code", kinematics="small_strain", status="completed", reason="")
        file.create_group("scene").attrs.update({key: run["scene"].attrs[key] for key in ("resolved", "cell_size", "points_per_cell", "metrics")})
        file.create_group("performance").attrs.update(solve_s=seconds, steps=1, points=len(X), particle_steps=len(X), dofs=2 * len(X),
                                                      particle_steps_per_second=len(X) / seconds, bytes_per_point=8.0 * 9)
        file.create_group("provenance").attrs.update(commit="my-code 1.0", cpu="this machine", threads=1)
        history = file.create_group("history")
        history["time"], history["kinetic_energy"] = [0.0, 1.0], [0.0, 0.0]
        history["strain_energy"] = [0.0, float(np.sum(V * stress[:, YY] ** 2)) / 2 / scene["E"]]
        history["unbalanced_force"] = [1.0, 0.0]
        snapshot = file.create_group("snapshots/0000")
        snapshot.attrs.update(time=1.0, step=1)
        last = run["snapshots"][max(run["snapshots"])]
        exact = {name: last[name][()] for name in ("exact_displacement", "exact_stress") if name in last}  # what the case is graded against
        for name, values in {"initial_position": X, "position": X + u, "displacement": u, "stress": stress, "initial_volume": V, "volume": V, **exact}.items():
            snapshot[name] = values


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
