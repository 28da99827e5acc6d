#!/usr/bin/python3
"""A result of CB-Geo MPM (Kumar et al. 2019) as a result of the testbed, from the HDF5 files of its points.

    cb_geo_result.py REFERENCE.h5 FIRST.h5 LAST.h5 OUT.h5 [--time T] [--seconds S] [--variant NAME]

REFERENCE.h5 is a run of the same scene by the testbed: it names the case and what is graded, and has the exact solution at the points, which must
begin in the same places. FIRST.h5 and LAST.h5 (particles-000.h5 and so on) are the points at the start and at time T [s]: a table of id, mass, volume,
coord_x, velocity_x, stress_xx, tau_xy, ... In two dimensions that is per metre of thickness, as here. S is the time that the run took [s].
"""
import argparse
import sys

import h5py
import numpy as np
from scipy.spatial import cKDTree

STRESS = ("stress_xx", "tau_xy", "tau_xz", "stress_yy", "tau_yz", "stress_zz")  # in the testbed's order


def read_points(path):
    """The table of a file, by id."""
    with h5py.File(path) as file:
        table = file["table"][()]
    lacking = [name for name in ("id", "mass", "volume", "coord_x", "coord_y", "velocity_x", "velocity_y", *STRESS) if name not in table.dtype.names]
    if lacking:
        sys.exit(f"{path}: the table lacks {', '.join(lacking)}")
    return table[np.argsort(table["id"])]


def vectors(table, name):
    return np.column_stack([table[f"{name}_x"], table[f"{name}_y"], np.zeros(len(table))])


def places_in(reference, X):
    """For each of the points X (N, 3) the number of the reference's point that begins there."""
    spacing = cKDTree(reference).query(reference[:1], k=2)[0][0, 1]
    distance, number = cKDTree(reference).query(X)
    if len(X) != len(reference) or distance.max() > 1e-6 * spacing or len(set(number)) != len(X):
        sys.exit(f"the points do not begin where those of the reference do ({len(X)} of {len(reference)}, up to {distance.max():g} m apart): "
                 "errors are compared on the same sampling; write the reference's initial positions as the input of CB-Geo")
    return number


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name in ("reference", "first", "last", "out"):
        parser.add_argument(name)
    parser.add_argument("--time", type=float, help="default: the end of the reference")
    parser.add_argument("--seconds", type=float, help="without it there is no error against run time")
    parser.add_argument("--variant", default="cb-geo", help="name in reports")
    options = parser.parse_args()
    first, last = read_points(options.first), read_points(options.last)
    if not np.array_equal(first["id"], last["id"]):
        sys.exit("points have come or gone between the two files")
    with h5py.File(options.reference) as run, h5py.File(options.out, "w") as file:
        X, end = vectors(first, "coord"), run["snapshots"][max(run["snapshots"])]
        number = places_in(run["snapshots/0000/initial_position"][()], X)
        time = end.attrs["time"] if options.time is None else options.time
        file.attrs.update(format="testbed-result", format_version=np.int64(1), case=run.attrs["case"], title="CB-Geo MPM", method="other",
                          variant=options.variant, kinematics=run.attrs["kinematics"], status="completed", reason="")
        file.create_group("scene").attrs.update({key: run["scene"].attrs[key] for key in ("resolved", "cell_size", "points_per_cell", "metrics")})
        performance = file.create_group("performance").attrs
        performance.update(points=len(X))
        if options.seconds is not None:
            performance["solve_s"] = options.seconds
        file.create_group("provenance").attrs.update(commit=options.variant)
        history = file.create_group("history")
        history["time"] = [0.0, time]
        history["kinetic_energy"] = [float(0.5 * np.sum(t["mass"] * (vectors(t, "velocity") ** 2).sum(axis=1))) for t in (first, last)]
        snapshot = file.create_group("snapshots/0000")
        snapshot.attrs.update(time=time, step=1)
        fields = {"initial_position": X, "position": vectors(last, "coord"), "displacement": vectors(last, "coord") - X, "velocity": vectors(last, "velocity"),
                  "stress": np.column_stack([last[name] for name in STRESS]), "initial_volume": first["volume"], "volume": last["volume"], "mass": last["mass"]}
        fields |= {name: end[name][()][number] for name in ("exact_displacement", "exact_stress") if name in end}
        for name, values in fields.items():
            snapshot[name] = values


if __name__ == "__main__":
    main()
