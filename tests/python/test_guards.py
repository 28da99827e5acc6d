"""Soundness of a run, from the guards to the report: closing line, result file, exit code, metrics, page."""
import csv
import io
import os
import re
import subprocess
from pathlib import Path

import h5py
import numpy as np
import pytest

from synthetic import write_result, write_study
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.grade.metrics_csv import metrics_csv
from testbed_reports.page.report import build
from testbed_reports.read.results import Result

ROOT = Path(__file__).resolve().parents[2]
TESTBED = Path(os.environ.get("TESTBED") or ROOT / "build" / "bin" / "testbed")
COLUMN = str(ROOT / "benchmarks" / "elastic" / "elastic_column" / "scene.toml")
SUDDEN = str(ROOT / "benchmarks" / "elastic" / "elastic_column_sudden" / "scene.toml")
FEM = TESTBED.with_name("testbed-fem").exists()

SERIES = ("kinetic_energy_points", "plastic_dissipation", "damping_dissipation", "hourglass_dissipation", "external_work",
          "numerical_energy", "volume_ratio_min", "volume_ratio_max", "points_outside", "courant_motion")


def run(*arguments):
    return subprocess.run([str(TESTBED), "run", *map(str, arguments)], capture_output=True, text=True, timeout=300)


def attributes(path):
    with h5py.File(path) as file:
        return dict(file.attrs)


def test_a_sound_run_says_so(tmp_path):
    done = run(COLUMN, "--strict", "-o", tmp_path / "r.h5")
    assert done.returncode == 0 and ": completed, sound;" in done.stderr, done.stderr
    root = attributes(tmp_path / "r.h5")
    assert (root["soundness"], root["suspect"], root["cause"], root["remedy"]) == ("sound", "", "", "")
    with h5py.File(tmp_path / "r.h5") as file:
        n = file["history/time"].shape
        assert all(file["history"][name].shape == n for name in SERIES)
        h = {name: file["history"][name][()] for name in (*SERIES, "kinetic_energy", "strain_energy")}
        share = file["performance"].attrs["guards_s"] / file["performance"].attrs["solve_s"]
    assert share < 0.05  # of a run of a tenth of a second
    assert h["external_work"][-1] > 0 and h["damping_dissipation"][-1] == pytest.approx(h["external_work"][-1] - h["strain_energy"][-1], rel=0.02)


@pytest.mark.parametrize("method", ["lpfdm", "lpfdm-2000", "mpm-linear", "mpm-bspline", "mpm-cpgimp"])
def test_energy_ledger_of_a_free_oscillation(tmp_path, method):
    done = run(SUDDEN, "--method", method, "-o", tmp_path / "r.h5")  # not strict: check warns of nu = 0.47
    assert ": completed, sound;" in done.stderr, done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        h = {name: node[()] for name, node in file["history"].items() if isinstance(node, h5py.Dataset)}
    assert np.abs(h["numerical_energy"]).max() < 5e-3 * h["external_work"].max()
    assert np.allclose(h["external_work"], h["gravity_work"], atol=0.01 * h["gravity_work"].max())


@pytest.mark.parametrize("strict, code", [((), 0), (("--strict",), 5)])
def test_a_suspect_run_says_so(tmp_path, strict, code):
    done = run(COLUMN, "--set", "time.end=0.3", *strict, "-o", tmp_path / "r.h5")
    assert done.returncode == code, done.stderr
    assert "completed, suspect: not_at_rest" in done.stderr and "suspect: not_at_rest: it was to come to rest" in done.stderr
    root = attributes(tmp_path / "r.h5")
    assert root["status"] == "completed" and root["soundness"] == "suspect" and root["suspect"].startswith("not_at_rest: ")


def test_a_quiet_suspect_run_still_says_so(tmp_path):
    done = run(COLUMN, "--set", "time.end=0.3", "--quiet", "-o", tmp_path / "r.h5")
    assert done.returncode == 0 and done.stderr.startswith("suspect: not_at_rest: ")


def test_time_step_above_the_limit_and_its_remedy(tmp_path):
    done = run(COLUMN, "--set", "time.cfl=1.3", "--diagnose", "-o", tmp_path / "r.h5")
    root = attributes(tmp_path / "r.h5")
    assert root["soundness"] == "suspect" and "time_step" in root["suspect"] and root["cause"] == "time_step", done.stderr
    assert root["remedy"] == "time.cfl=0.9" and root["remedy_was_run"] == 1
    assert "cause: time_step; holds with --set time.cfl=0.9" in done.stderr
    assert attributes(tmp_path / "r.remedy.h5")["soundness"] == "sound"


@pytest.mark.skipif(not FEM, reason="testbed-fem is not built")
def test_fem_strain_beyond_small(tmp_path):
    done = run(COLUMN, "--method", "fem-q2", "--strict", "-o", tmp_path / "r.h5")
    assert done.returncode == 0 and ": completed, sound;" in done.stderr, done.stderr
    done = run(COLUMN, "--method", "fem-q2", "--strict", "--set", "gravity.acceleration=[0, -1e5]", "-o", tmp_path / "r.h5")
    assert done.returncode == 5 and "suspect: small_strain" in done.stderr, done.stderr


def suspect_root(variant):
    return {"attributes": {"soundness": "suspect", "suspect": "energy: made <2> J/m\nvolume: a point grew", "cause": "null_mode",
                     "remedy": "lpfdm.hourglass=0.05"}} if variant == "lpfdm" else {}


def test_soundness_in_files_metrics_and_page(tmp_path):
    write_result(tmp_path / "old.h5")
    old = Result(tmp_path / "old.h5")
    assert (old.soundness, old.suspect, old.cause, old.remedy) == ("", [], "", "")
    folder = write_study(tmp_path / "studies" / "s", sizes=(1.0,), change=lambda variant, L, repeat: suspect_root(variant))
    study = read_study_folder(folder)
    rows = list(csv.DictReader(io.StringIO(metrics_csv(study.runs))))
    told = {(r["variant"], r["status"], r["soundness"], r["cause"], r["remedy"]) for r in rows}
    assert ("lpfdm", "completed", "suspect: energy, volume", "null_mode", "lpfdm.hourglass=0.05") in told
    assert ("fem-q2", "completed", "", "", "") in told
    build([folder], tmp_path / "out", "testbed report")
    page = (tmp_path / "out" / "report.html").read_text()
    assert '<b class="fail">suspect: energy, volume</b>' in page  # the badge, in the tables
    text = re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page))
    assert "4 runs: 1 suspect, 3 completed." in text
    assert "energy: made &lt;2&gt; J/m; volume: a point grew; cause: null_mode, remedy: lpfdm.hourglass=0.05" in text


def flight(folder, more=""):
    scene = Path(folder) / "scene.toml"
    scene.write_text("""[grid]
size = [4.0, 4.0]
cell_size = 0.5
[time]
end = 0.6
dt = 0.03
[output]
history = 0.1
[[material]]
name = "soil"
law = "linear_elastic"
density = 1000.0
youngs_modulus = 1e3
poissons_ratio = 0.2
[[body]]
name = "block"
material = "soil"
shape = "box"
min = [1.0, 1.0]
max = [2.0, 2.0]
velocity = ["0.5", "0"]
""" + more)
    return scene


def test_the_history_tells_how_far_points_go_in_a_step_and_samples_the_nearest_ones(tmp_path):
    done = run(flight(tmp_path, '[[probe]]\nname = "left"\nwhere = "X < 1.6"\n'), "-o", tmp_path / "r.h5")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["history/courant_motion"][-1] == pytest.approx(0.5 * 0.03 / 0.5)
        assert file["history/time"][()] == pytest.approx([0.0, 0.09, 0.21, 0.3, 0.39, 0.51, 0.6])
        assert file["history/probes/left/displacement"][-1, 0] == pytest.approx(0.5 * 0.6)  # the mean over its points
        assert file["history/probes/left/velocity"][-1, 0] == pytest.approx(0.5)


def test_rest_is_not_found_before_gravity_is_there(tmp_path):
    base = "[[boundary]]\nname = \"base\"\nwhere = \"y <= 1\"\nfix = \"xy\"\n"
    scene = flight(tmp_path, base + "[damping]\nlocal = 0.8\n[gravity]\nacceleration = [0.0, -0.1]\nramp = 40.0\nprofile = \"linear\"\n")
    settings = ("time.end=80", "time.stop_unbalanced=0.5", "body.block.velocity=[\"0\",\"0\"]", "output.history=1")
    done = run(scene, *[word for s in settings for word in ("--set", s)], "-o", tmp_path / "r.h5")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        assert 40.0 <= file["history/time"][-1] < 79.0


def test_a_truncated_share_is_that_of_all_points_of_a_material(tmp_path):
    """One point in one body, 400 in another; of relative deviations of 2 a third is cut at zero."""
    scene = flight(tmp_path)
    text = scene.read_text().replace('law = "linear_elastic"', 'law = "mohr_coulomb"')
    strength = "[material.strength]\ncohesion = 9800.0\nfriction_angle = 0.5\n[material.random]\nseed = 1\ncohesion_deviation = 2.0\n[[body]]\n"
    crumb = '[[body]]\nname = "crumb"\nmaterial = "soil"\nshape = "box"\nmin = [3.0, 3.0]\nmax = [3.5, 3.5]\npoints_per_cell = 1\n'
    scene.write_text(text.replace("[[body]]\n", strength) + "points_per_cell = 10\n" + crumb)
    done = run(scene, "--set", "time.end=0.06", "-o", tmp_path / "r.h5")
    assert done.returncode == 0, done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        share = file["materials/soil"].attrs["truncated_share"]
    assert share * 401 == pytest.approx(round(share * 401), abs=1e-9) and 0.22 < share < 0.40
