"""`testbed modes` as a user meets it, and the picture of a mode."""
import csv
import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from testbed_reports.draw import modes

ROOT = Path(__file__).resolve().parents[2]
TESTBED = Path(os.environ.get("TESTBED") or ROOT / "build" / "bin" / "testbed")
SCENE = """[grid]
size = [8.0, 8.0]
cell_size = 1.0
[time]
end = 1.0
[[material]]
name = "m"
law = "hypoelastic_jaumann"
density = 1000.0
youngs_modulus = 1e6
poissons_ratio = 0.3
[[body]]
name = "b"
material = "m"
shape = "box"
min = [2.0, 2.0]
max = [4.0, 4.0]
points_per_cell = 2
"""


@pytest.fixture
def scene(tmp_path):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE)
    return path


def run(*arguments):
    return subprocess.run([str(TESTBED), "modes", *map(str, arguments)], capture_output=True, text=True, timeout=300)


def test_json_says_what_the_study_reads(scene):
    done = run(scene, "--method", "lpfdm-2000", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["hourglass_modes"] == 2 and found["rigid_modes"] == 3 and found["unseen_modes"] == 0
    assert abs(found["spectral_radius"] - 1) < 1e-7
    assert 0.8 < found["critical_dt"] / found["claimed_dt"] < 1.3
    assert {m["kind"] for m in found["modes"]} == {"swinging"}
    beyond = json.loads(run(scene, "--method", "lpfdm-2000", "--json", "--no-critical-step", "--set",
                            f"time.dt={1.01 * found['critical_dt']:.17g}").stdout)
    assert beyond["critical_dt"] is None and beyond["spectral_radius"] > 1.001
    assert beyond["modes"][0]["kind"] == "unstable" and beyond["modes"][0]["growth_per_step"] == beyond["spectral_radius"]


def test_the_step_may_follow_the_limit(scene):
    found = json.loads(run(scene, "--json", "--no-critical-step", "--set", "time.dt=auto", "--at", "0.1").stdout)
    assert found["time"] >= 0.1 and abs(found["spectral_radius"] - 1) < 1e-7


def test_picture_and_table(scene, tmp_path):
    done = run(scene, "--method", "lpfdm-2000", "--no-critical-step", "-o", tmp_path / "m.png")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "m.png").stat().st_size > 10000
    attributes, position, points, found = modes.read(tmp_path / "m.h5")
    assert attributes["variant"] == "lpfdm-2000" and position.shape == (9, 2) and points.shape == (16, 2)
    hourglass = [m for m in found if m["kind"] == "hourglass"]
    assert len(hourglass) == 2
    sign = np.where(position.sum(axis=1) % 2 == 0, 1.0, -1.0)
    for k, mode in enumerate(hourglass):
        assert np.allclose(np.abs(mode["velocity"][:, k] @ sign), 9) and np.allclose(mode["velocity"][:, 1 - k], 0)
    done = run(scene, "--no-critical-step", "-o", tmp_path / "m.csv")
    assert done.returncode == 0, done.stderr
    rows = list(csv.DictReader((tmp_path / "m.csv").open()))
    assert rows and max(float(r["growth_per_step"]) for r in rows) < 1 + 1e-6


@pytest.mark.parametrize("arguments,message", [(["-o", "m.pdf"], "none of .h5, .csv, .png"),
                                               (["--set", "grid.cell_size=0.05"], "unknowns"),
                                               (["--method", "fem-q1"], "particles")])
def test_refuses(scene, arguments, message):
    done = run(scene, *arguments)
    assert done.returncode == 1 and message in done.stderr


def test_plot_refuses_another_file(tmp_path, capsys):
    (tmp_path / "x.h5").write_text("no")
    assert modes.main([str(tmp_path / "x.h5"), str(tmp_path / "x.png")]) == 1
    assert "error:" in capsys.readouterr().err


def test_a_run_that_fails_on_the_way(scene):
    done = run(scene, "--method", "mpm-linear", "--set", 'body.0.velocity=["10", "0"]', "--at", "1")
    assert done.returncode == 1 and "left the lattice" in done.stderr and "--at 1 s" in done.stderr
