"""Result files with known errors: an elastic column whose fields are the exact ones plus a given amount.

The column is 1 m wide and H high, with `ppc` points per cell and direction. Exact: syy = -rho g (H - Y), sxx = k0 syy,
u_y = -(rho g / M) (H Y - Y^2 / 2).
"""
import json
import math
import os
import zlib
from pathlib import Path

import h5py
import numpy as np

RHO, G, M, K0, H = 1000.0, 10.0, 1.0e6, 0.25, 10.0
TIP = RHO * G * H**2 / (2.0 * M)
PERIOD = 4.0 * H / math.sqrt(M / RHO)


def seal(path):
    """Ends a file with its checksum, as the testbed does."""
    data = path.read_bytes()
    path.write_bytes(data + b"testbed-crc32 %08x %016x\n" % (zlib.crc32(data), len(data)))
    return path


def column(L, ppc):
    """(X (N, 3), V0 (N,)) of the points."""
    h = L / ppc
    x = (np.arange(round(2 * L / h)) + 0.5) * h
    y = (np.arange(round(H / h)) + 0.5) * h
    X = np.zeros((len(x) * len(y), 3))
    X[:, 1], X[:, 0] = (a.ravel() for a in np.meshgrid(y, x, indexing="ij"))
    return X, np.full(len(X), h * h)


def write_result(path, L=1.0, ppc=2, variant="lpfdm", method=None, status="completed", reason="", case="column",
                 metrics="stress, displacement", reference=None, stress_error=0.0, displacement_error=0.0,
                 solve_s=1.0, load=0.5, drop=(), history=None, samples=81, probes=("tip",), scene_extra="", seed=None,
                 commit="abc1234", overshoot=2.0, damping=0.0, energy_slope=0.0, snapshots=2, attributes=None, sealed=True, resolved_text=None):
    """Writes a result file whose relative L2 errors are `stress_error` and `displacement_error`; returns its path.

    `drop`: names of datasets left out; `history`: replaces named histories; `energy_slope`: energy made per second; `attributes`:
    further ones of the file; `sealed`: with a checksum at its end.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    method = method or variant.split("-")[0]
    reference = {"static_displacement": TIP, "peak_time": PERIOD / 2, "period": PERIOD, "displacement_scale": TIP,
                 **(reference or {})}
    reference = {k: v for k, v in reference.items() if v is not None}
    X, V0 = column(L, ppc)
    exact_s = np.zeros((len(X), 6))
    exact_s[:, 3] = -RHO * G * (H - X[:, 1])
    exact_s[:, 0] = exact_s[:, 5] = K0 * exact_s[:, 3]
    exact_u = np.zeros((len(X), 3))
    exact_u[:, 1] = -RHO * G / M * (H * X[:, 1] - X[:, 1] ** 2 / 2)
    s, u = exact_s * (1 + stress_error), exact_u * (1 + displacement_error)
    resolved = [f'title = "Synthetic column"\nmethod = "{variant}"\n{scene_extra}\n[grid]\ncell_size = {L!r}\n']
    resolved.append("[report.reference]\n" + "".join(f"{k} = {float(v)!r}\n" for k, v in reference.items()))
    if seed is not None:
        resolved.append(f"[random]\nseed = {seed}\n")
    resolved += [f'[[probe]]\nname = "{p}"\n' for p in probes]

    time = np.linspace(0.0, 2.0 * PERIOD, samples)
    w = 2.0 * math.pi / PERIOD
    decay = np.exp(-damping * time)
    tip = np.zeros((samples, 3))
    tip[:, 1] = -TIP * (1.0 - (overshoot - 1.0) * decay * np.cos(w * time))
    strain = 50.0 * (1.0 - np.cos(w * time)) ** 2
    kinetic = 100.0 * np.sin(w * time) ** 2 + 1e-3
    data = {"time": time, "kinetic_energy": kinetic, "strain_energy": strain,
            "gravity_work": strain + kinetic - 20.0 - energy_slope * time,
            "linear_momentum": np.outer(1.0 - 0.01 * time / time[-1], [3.0, 4.0, 0.0]),
            "angular_momentum": np.linspace(2.0, 1.9, samples), "unbalanced_force": np.linspace(1.0, 1e-4, samples),
            "max_stress": np.linspace(0.0, 2e5, samples), **(history or {})}
    units = {"time": "s", "max_stress": "Pa", "unbalanced_force": "", "linear_momentum": "kg/s"}

    with h5py.File(path, "w") as file:
        file.attrs.update(format="testbed-result", format_version=1, case=case, title="Synthetic column",
                          method=method, variant=variant, status=status, reason=reason,
                          kinematics="small_strain" if method == "fem" else "hypoelastic", **(attributes or {}))
        scene = file.create_group("scene")
        scene.attrs.update(resolved="".join(resolved) if resolved_text is None else resolved_text, cell_size=L, points_per_cell=ppc, metrics=metrics,
                           cell_origin=[0.0, 0.0])
        provenance = file.create_group("provenance")
        provenance.attrs.update(commit=commit, compiler="g++ 12.2", flags="-O3", build_type="Release", cpu="a CPU",
                                threads=1, load_average=load, started="2024-01-01T00:00:00Z")
        steps = 1000
        performance = file.create_group("performance")
        performance.attrs.update(setup_s=0.01, solve_s=solve_s, output_s=0.02, steps=steps, points=len(X),
                                 particle_steps=steps * len(X), particle_steps_per_second=steps * len(X) / solve_s,
                                 bytes_per_point=200.0, cells=10, dofs=20, dt=1e-3 * L, dt_critical=2e-3 * L)
        file.create_group("performance/phases").attrs.update(points=0.5 * solve_s)
        soil = file.create_group("materials/soil")
        soil.attrs.update(law="elastic", density=RHO, youngs_modulus=1.0e6, poissons_ratio=0.2)
        file.create_group("materials/rock").attrs.update(law="elastic", density=RHO, youngs_modulus=1.0e9)

        def put(name, values, unit):
            if name not in drop and name.rsplit("/", 1)[-1] not in drop:
                file.create_dataset(name, data=values).attrs["unit"] = unit

        for name, values in data.items():
            put(f"history/{name}", values, units.get(name, "J/m"))
        for probe in probes:
            put(f"history/probes/{probe}/displacement", tip * (1 + displacement_error), "m")
            put(f"history/probes/{probe}/exact_displacement", tip, "m")
        for k in range(snapshots):
            share = (k + 1) / snapshots
            where = f"snapshots/{k:04d}"
            file.create_group(where).attrs.update(time=share * time[-1], step=int(share * steps))
            for name, values, unit in (("initial_position", X, "m"), ("displacement", share * u, "m"),
                                       ("position", X + share * u, "m"), ("stress", share * s, "Pa"),
                                       ("exact_stress", share * exact_s, "Pa"),
                                       ("exact_displacement", share * exact_u, "m"), ("initial_volume", V0, "m2"),
                                       ("volume", V0, "m2"), ("mass", RHO * V0, "kg/m")):
                put(f"{where}/{name}", values, unit)
    return seal(path) if sealed else path


STUDY = """\
title = "Synthetic column"
purpose = "Known orders."
scene = "scene.toml"
repeats = {repeats}
[axes]
method = ["lpfdm", "mpm-linear", "mpm-cpgimp", "fem-q2"]
"grid.cell_size" = [2.0, 1.0, 0.5, 0.25]
"""

# Error of the k-th method at cell size L: orders 2, -1 (diverging), 1, 2.
MODELS = {"lpfdm": lambda L: 0.02 * L**2, "mpm-linear": lambda L: 0.06 / L, "mpm-cpgimp": lambda L: 0.03 * L,
          "fem-q2": lambda L: 0.001 * L**2}


def write_study(folder, extra="", repeats=1, models=None, sizes=(2.0, 1.0, 0.5, 0.25), left_out=(), change=None, **common):
    """A study's folder as `testbed study` leaves it. `change(variant, L, repeat)` gives further changes of a run, or
    None for a run without a file."""
    folder = Path(folder)
    models = MODELS if models is None else models
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "study.toml").write_text(STUDY.format(repeats=repeats) + extra)
    plan = {"command": "testbed study column.toml", "jobs": 1, "cores": 2, "runs": [], "left_out": []}
    for variant, model in models.items():
        for L in sizes:
            axes = {"method": variant, "grid.cell_size": L}
            if variant in left_out:
                plan["left_out"].append({"axes": axes, "variant": variant, "method": "fem", "L": L,
                                         "reason": "the FEM reference (testbed-fem) is not built"})
                continue
            for repeat in range(1, repeats + 1):
                run_id = f"{variant}_L{L:g}_r{repeat}_0"
                entry = {"id": run_id, "variant": variant, "L": L, "axes": axes, "repeat": repeat, "outcome": ""}
                plan["runs"].append(entry)
                changes = change(variant, L, repeat) if change else {}
                if changes is None:
                    entry["outcome"] = "killed by signal 9 (SIGKILL)"
                    continue
                speed = {"lpfdm": 1.0, "mpm-linear": 2.0, "mpm-cpgimp": 4.0, "fem-q2": 8.0}.get(variant, 3.0)
                write_result(folder / "runs" / run_id / "result.h5",
                             **{"L": L, "variant": variant, "stress_error": model(L), "displacement_error": model(L) / 3,
                                "solve_s": speed * L**-3 * (1 + 0.1 * repeat), **common, **changes})
    (folder / "plan.json").write_text(json.dumps(plan))
    return folder


FAKE_TESTBED = '''#!/usr/bin/python3
"""A stand-in for the solver: counts its runs, and does what `behave.json` says for a variant."""
import json, os, signal, sys, time
from pathlib import Path
sys.path[:0] = [{reports!r}, {here!r}]
here = Path(__file__).resolve().parent
arguments = sys.argv[1:]
command, scene = arguments[0], Path(arguments[1])
sets = dict(a.split("=", 1) for f, a in zip(arguments, arguments[1:]) if f == "--set")
option = lambda name, default="": arguments[arguments.index(name) + 1] if name in arguments else default
method = option("--method", "lpfdm")
if "grid.cel_size" in sets:
    sys.exit("scene.toml: unknown key 'grid.cel_size', did you mean 'grid.cell_size'?")
L = float(sets.get("grid.cell_size", 1.0))
from synthetic import write_result, TIP, PERIOD
text = 'method = "%s"\\ntext = %s\\n[grid]\\ncell_size = %r\\n' % (method, json.dumps(scene.read_text()), L)
text += "\\n".join('[set."%s"]\\nvalue = %s' % item for item in sets.items())
text += '\\n[report.reference]\\nstatic_displacement = %r\\npeak_time = %r\\nperiod = %r\\ndisplacement_scale = %r\\n' % (TIP, PERIOD / 2, PERIOD, TIP)
text += '[[probe]]\\nname = "tip"\\n'
if command == "check":
    print(text, end="")
    sys.exit(0)
with open(here / "calls.txt", "a") as calls:
    calls.write(json.dumps([method, L, sets, option("--threads")]) + "\\n")
behaviour = json.loads((here / "behave.json").read_text()) if (here / "behave.json").exists() else {{}}
what = behaviour.get(method, "")
out = Path(option("-o"))
if what == "kill":
    os.kill(os.getpid(), signal.SIGKILL)
if what == "internal":
    sys.exit("testbed: something broke") if False else (print("something broke", file=sys.stderr), sys.exit(4))
if what == "nothing":
    sys.exit(0)
if what == "sleep":
    (here / "sleeping").touch()
    time.sleep(60)
status = {{"diverge": "diverged", "limit": "time_limit", "interrupt": "interrupted"}}.get(what, "completed")
write_result(out.with_suffix(".h5.part"), L=L, variant=method, status=status, reason=what, stress_error=0.02 * L**2, resolved_text=text)
os.replace(out.with_suffix(".h5.part"), out)
sys.exit({{"diverge": 2, "limit": 3}}.get(what, 0))
'''


def write_fake_testbed(folder):
    """An executable `testbed` in `folder`; its calls go to calls.txt."""
    here = Path(__file__).resolve().parent
    path = Path(folder) / "testbed"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(FAKE_TESTBED.format(reports=str(here.parents[1] / "reports"), here=str(here)))
    os.chmod(path, 0o755)
    return path
