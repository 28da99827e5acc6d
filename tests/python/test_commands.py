"""The built commands as a user meets them: what they write, what they refuse, what is left when they are stopped."""
import os
import resource
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from testbed_reports.read.study_file import read_study
from testbed_reports.study.study import expand

ROOT = Path(__file__).resolve().parents[2]
TESTBED = Path(os.environ.get("TESTBED") or ROOT / "build" / "bin" / "testbed")
COLUMN = str(ROOT / "benchmarks" / "elastic" / "elastic_column" / "scene.toml")
SPEED = str(ROOT / "benchmarks" / "elastic" / "speed" / "scene.toml")
FEM = TESTBED.with_name("testbed-fem").exists()


def run(*arguments, **options):
    assert TESTBED.exists(), f"{TESTBED} is not built"
    return subprocess.run([str(TESTBED), *map(str, arguments)], capture_output=True, text=True, timeout=300, **options)


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, item: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None)
    return found


@pytest.mark.parametrize("method", ["lpfdm-2000", "lpfdm", "mpm-linear", "mpm-linear-bbar", "mpm-cpgimp"])
def test_same_bits_for_one_and_two_threads(tmp_path, method):
    for threads in (1, 2):
        done = run("run", SPEED, "--method", method, "--set", "time.end=0.01", "--threads", threads, "-o", tmp_path / f"{threads}.h5")
        assert done.returncode == 0, done.stderr
    one, two = datasets(tmp_path / "1.h5"), datasets(tmp_path / "2.h5")
    assert one.keys() == two.keys() and len(one) > 15
    for name, values in one.items():
        assert np.array_equal(values, two[name]), name


def test_result_file_and_xdmf(tmp_path):
    done = run("run", COLUMN, "--set", "grid.cell_size=2.0", "-o", tmp_path / "r.h5")
    assert done.returncode == 0 and "million particle-steps per second" in done.stderr and "bytes per point" in done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "completed" and file.attrs["case"] == "elastic_column"
        assert file.attrs["variant"] == "lpfdm" and file.attrs["kinematics"] == "hypoelastic"
        for name in ("commit", "compiler", "flags", "cpu", "threads", "load_average", "started"):
            assert name in file["provenance"].attrs
        last = file["snapshots/0001"]
        n = file["performance"].attrs["points"]
        assert last["position"].shape == (n, 3) and last["stress"].shape == (n, 6)
        assert last["stress"].attrs["unit"] == "Pa"
        assert np.array_equal(last["id"], np.arange(n))
        assert np.allclose(last["displacement"], last["position"][()] - last["initial_position"][()])
        assert file["history/probes/tip/displacement"].shape[0] == file["history/time"].shape[0]
    xdmf = (tmp_path / "r.xdmf").read_text()
    assert "r.h5:/snapshots/0001/position" in xdmf and "Tensor6" in xdmf
    assert sorted(p.name for p in tmp_path.iterdir()) == ["r.h5", "r.xdmf"]


BAD = [("grid.cel_size=1", "did you mean 'cell_size'"), ("grid.cell_size=\"a lot\"", "grid.cell_size"),
       ("grid.cell_size=0.3", "not a multiple of the cell size"), ("body.column.max=[2.0, 30.0]", "outside the lattice"),
       ("material.soil.poissons_ratio=0.5", "poissons_ratio"), ("material.soil.density=-1", "must be positive"),
       ("body.column.velocity=[\"2*spede\", 0]", "spede"), ("boundary.base.where=\"y <\"", "boundary[0].where"),
       ("boundary.base.where=\"y > 99\"", "holds at no node"), ("probe.tip.where=\"Y > 99\"", "holds at no point"),
       ("boundary.base.where=\"y <= 3 && t < 0.1\"", "'t' is not known here, only x, y"), ("probe.tip.where=\"y > 1\"", "'y' is not known here"),
       ("body.column.velocity=[\"1/(X-X)\", 0]", "body 'column': velocity"), ("time.end=1e300", "steps of"),
       ("exact.hypoelastic.displacement=[\"0\", \"1/(4-t)\"]", "exact.hypoelastic.displacement"),
       ("body=[]", "no [[body]]"), ("method=\"mpm\"", "method")]


@pytest.mark.parametrize("override,told", BAD)
def test_bad_input_is_refused_before_anything_is_written(tmp_path, override, told):
    done = run("run", COLUMN, "--set", override, "-o", tmp_path / "r.h5")
    assert done.returncode == 1, done.stderr
    assert told in done.stderr and "scene.toml" in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("override,told", BAD)
def test_check_finds_what_run_refuses(override, told):
    done = run("check", COLUMN, "--set", override)
    assert done.returncode == 1 and told in done.stderr, done.stderr


def test_check_finds_what_fails_at_the_start():
    done = run("check", COLUMN, "--set", "body.column.velocity=[0, 1e200]", "--method", "mpm-cpgimp")
    assert done.returncode == 1 and "at the start: " in done.stderr, done.stderr


def test_files_that_are_no_scene(tmp_path):
    (tmp_path / "no.toml").write_text("this is no TOML")
    for path in (tmp_path / "no.toml", tmp_path / "missing.toml", tmp_path):
        done = run("run", path, "-o", tmp_path / "r.h5")
        assert done.returncode == 1 and done.stderr.startswith("error: "), done.stderr
    (tmp_path / "bytes.toml").write_bytes(os.urandom(4000))
    assert run("check", tmp_path / "bytes.toml").returncode == 1
    assert not (tmp_path / "r.h5").exists()


def test_large_time_step_warns_and_strict_refuses(tmp_path):
    arguments = ["run", COLUMN, "--set", "time.dt=0.01", "--set", "time.end=0.1", "-o", tmp_path / "r.h5"]
    done = run(*arguments, "--strict")
    assert done.returncode == 1 and "above the critical one" in done.stderr and not list(tmp_path.iterdir())
    done = run(*arguments)
    assert "warning: " in done.stderr and done.returncode == 2  # it diverges, and the file says why
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "diverged" and file.attrs["reason"]


def test_unwritable_output(tmp_path):
    done = run("run", COLUMN, "-o", tmp_path / "no" / "such" / "r.h5")
    assert done.returncode == 1 and "cannot write" in done.stderr
    assert not list(tmp_path.iterdir())


def test_pipes_and_devices_are_not_replaced(tmp_path):
    for name in ("r.h5", "stress.csv"):
        os.mkfifo(tmp_path / name)
    done = run("run", COLUMN, "-o", tmp_path / "r.h5")
    assert done.returncode == 1 and "is no file" in done.stderr
    law = str(ROOT / "benchmarks" / "soil" / "laws" / "mohr_coulomb.toml")
    read = subprocess.Popen(["cat", tmp_path / "stress.csv"], stdout=subprocess.PIPE)
    assert run("point", law, "-o", tmp_path / "stress.csv").returncode == 0
    assert read.communicate(timeout=20)[0].decode() == run("point", law).stdout
    assert all((tmp_path / name).is_fifo() for name in ("r.h5", "stress.csv"))


@pytest.mark.parametrize("arguments", [["--points", "nan"], ["--points", "0"], ["--seconds", "nan"], ["--seconds", "0"]])
def test_bench_refuses_what_it_cannot_measure(arguments):
    done = run("bench", "--method", "lpfdm", "--law", "elastic", *arguments)
    assert done.returncode == 1 and arguments[0] in done.stderr


def test_bench_fits_flows_to_any_number_of_points(tmp_path):
    """Their lattices take some cell sizes alone."""
    sizes = ["--points", "100", "700", "--points-per-cell", "1", "3", "--seconds", "0.01", "--threads", "1"]
    done = run("bench", "--method", "lpfdm-2000", "--scene", "dam_break", "collapse", "trapdoor", *sizes, "-o", tmp_path / "bench.csv")
    assert done.returncode == 0, done.stderr
    assert len((tmp_path / "bench.csv").read_text().splitlines()) == 2 + 3 * 4


@pytest.mark.parametrize("limit", [1000, 30000, 100000])
def test_full_disk_leaves_no_half_result(tmp_path, limit):
    done = run("run", COLUMN, "-o", tmp_path / "r.h5",
               preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)))
    assert done.returncode == 4 and "disk full" in done.stderr, done.stderr
    assert not list(tmp_path.iterdir())


def test_killed_run_leaves_no_result_or_a_whole_one(tmp_path):
    for k in range(8):
        out = tmp_path / f"{k}.h5"
        process = subprocess.Popen([TESTBED, "run", SPEED, "--set", "output.snapshots=20", "--quiet", "-o", out])
        time.sleep(0.1 * k)
        process.kill()
        process.wait()
        if out.exists():
            with h5py.File(out) as file:
                assert file.attrs["status"] == "completed"


@pytest.mark.parametrize("sent", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_run_writes_what_it_has(tmp_path, sent):
    process = subprocess.Popen([TESTBED, "run", SPEED, "--set", "time.end=100", "--quiet", "-o", tmp_path / "r.h5"])
    time.sleep(1.0)
    process.send_signal(sent)
    assert process.wait(timeout=60) == 130
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "interrupted" and len(file["snapshots"]) == 2


def test_time_limit(tmp_path):
    done = run("run", SPEED, "--set", "time.end=100", "--set", "time.wall_clock_limit=0.5", "-o", tmp_path / "r.h5")
    assert done.returncode == 3 and "time_limit" in done.stderr
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "time_limit"


SUDDEN = str(ROOT / "benchmarks" / "elastic" / "elastic_column_sudden" / "scene.toml")
FLIGHT = str(ROOT / "benchmarks" / "manufactured" / "free_flight" / "scene.toml")
DISK = str(ROOT / "benchmarks" / "manufactured" / "rotating_disk" / "scene.toml")


@pytest.mark.parametrize("method", ["lpfdm", "lpfdm-2000", "mpm-linear", "mpm-cpgimp"])
@pytest.mark.parametrize("modulus", ["E", "\"2*E*(1-0.7*Y/H)\""])
def test_energy_balance_of_the_history(tmp_path, method, modulus):
    """Kinetic + strain energy - work of gravity stays zero at every sample, with a uniform and a varying modulus."""
    done = run("run", SUDDEN, "--method", method, "--set", "grid.cell_size=0.5", "--set", "material.soil.poissons_ratio=0.2",
               "--set", f"material.soil.youngs_modulus={modulus}", "-o", tmp_path / "r.h5")
    assert done.returncode == 0, done.stderr
    h = datasets(tmp_path / "r.h5")
    total = h["history/kinetic_energy"] + h["history/strain_energy"] - h["history/gravity_work"]
    assert np.abs(total).max() < 2e-3 * h["history/strain_energy"].max()
    assert h["history/gravity_work"].max() > 0.9 * h["history/strain_energy"].max()


@pytest.mark.parametrize("method", ["lpfdm", "lpfdm-2000", "mpm-linear", "mpm-cpgimp"])
def test_momentum_of_free_fall(tmp_path, method):
    done = run("run", FLIGHT, "--method", method, "--set", "gravity.acceleration=[3.0, -7.0]", "--set", "time.end=0.05",
               "-o", tmp_path / "r.h5")
    assert done.returncode == 0, done.stderr
    h = datasets(tmp_path / "r.h5")
    t, p = h["history/time"], h["history/linear_momentum"]
    mass = h["snapshots/0000/mass"].sum()
    assert np.allclose(p[:, :2] - p[0, :2], mass * np.outer(t, [3.0, -7.0]), rtol=0, atol=1e-9 * np.abs(p).max())


def test_velocity_of_points_is_bilinear(tmp_path):
    assert run("run", DISK, "--set", "time.end=0.001", "-o", tmp_path / "r.h5").returncode == 0
    h = datasets(tmp_path / "r.h5")
    x, v = h["snapshots/0000/position"], h["snapshots/0000/velocity"]
    omega = v[0, 1] / x[0, 0]
    assert omega > 0 and np.allclose(v[:, 0], -omega * x[:, 1], atol=1e-12) and np.allclose(v[:, 1], omega * x[:, 0], atol=1e-12)


@pytest.mark.parametrize("method", ["lpfdm", "mpm-linear"])
def test_a_damped_column_stops_at_rest(tmp_path, method):
    assert run("run", COLUMN, "--method", method, "-o", tmp_path / "r.h5").returncode == 0
    h = datasets(tmp_path / "r.h5")
    assert 0.5 < h["history/time"][-1] < 3.9  # after the ramp, before the end
    assert h["history/unbalanced_force"][-1] < 1e-8
    assert h["history/kinetic_energy"][-1] < 1e-8 * h["history/strain_energy"][-1]


def test_output_replaces_results_only(tmp_path):
    (tmp_path / "folder.h5").mkdir()
    os.mkfifo(tmp_path / "pipe.h5.part")
    for name, told in (("folder.h5", "is no file"), ("pipe.h5", ""), ("x.xdmf", "ends in .h5"), ("scene.toml", "ends in .h5")):
        done = run("run", COLUMN, "-o", tmp_path / name)
        assert done.returncode == 1 and told in done.stderr, done.stderr
    assert sorted(p.name for p in tmp_path.iterdir()) == ["folder.h5", "pipe.h5.part"]


def test_two_runs_with_one_output(tmp_path):
    first = subprocess.Popen([TESTBED, "run", SPEED, "--set", "time.end=0.5", "--quiet", "-o", tmp_path / "r.h5"])
    time.sleep(0.7)
    done = run("run", SPEED, "-o", tmp_path / "r.h5")
    assert done.returncode == 1 and "another run" in done.stderr
    assert first.wait(timeout=120) == 0
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "completed"


@pytest.mark.parametrize("override", ["time.end=1e300", "time.cfl=1e-300", "body.column.velocity=[\"1/0\", 0]", "boundary.base.where=\"0/0\""])
def test_nonsense_that_is_valid_syntax(tmp_path, override):
    done = run("run", COLUMN, "--set", override, "-o", tmp_path / "r.h5")
    assert done.returncode == 1 and done.stderr.startswith("error: "), done.stderr
    assert not list(tmp_path.iterdir())


def test_points_turned_inside_out_end_as_diverged(tmp_path):
    done = run("run", SUDDEN, "--method", "lpfdm-2000", "--set", "time.cfl=2.5", "-o", tmp_path / "r.h5")
    assert done.returncode == 2
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["status"] == "diverged" and file.attrs["reason"]


def test_case_is_the_folder_however_the_scene_is_named(tmp_path):
    done = run("run", "scene.toml", "--set", "time.end=0.01", "-o", tmp_path / "r.h5", cwd=Path(COLUMN).parent)
    assert done.returncode == 0
    with h5py.File(tmp_path / "r.h5") as file:
        assert file.attrs["case"] == "elastic_column"


def test_check_says_what_the_scene_uses():
    text = run("check", COLUMN).stdout
    for told in ("half_width_x", "local damping", "bytes per point", "limits           stiffness", "c_p", "exact solution (hypoelastic)"):
        assert told in text
    assert "velocity_x" not in text and "body force" not in text  # absent
    assert "velocity_x" in run("check", COLUMN, "--method", "mpm-linear").stdout


@pytest.mark.parametrize("asked", [True, False])
def test_the_sharp_limit_is_what_check_says_where_the_scene_asks_for_it(tmp_path, asked):
    settings = ("--method", "mpm-cpgimp", "--set", f"time.sharp_limit={str(asked).lower()}")
    assert run("run", COLUMN, *settings, "-o", tmp_path / "r.h5", "--set", "time.end=0.01").returncode == 0
    said = float(run("check", COLUMN, *settings).stdout.split("sharp limit")[1].split()[0])
    with h5py.File(tmp_path / "r.h5") as file:
        known = file["performance"].attrs.get("dt_sharp")
    assert known == pytest.approx(said, rel=1e-4) if asked else known is None


def test_doc_list_and_usage():
    assert "cell_size" in run("doc", "grid").stdout
    assert run("doc", "gird").returncode == 1
    assert "mpm-cpgimp" in run("list").stdout
    for arguments in ([], ["fly"], ["run"], ["run", COLUMN, "--threads", "0"], ["run", COLUMN, "--sett", "a=1"]):
        assert run(*arguments).returncode == 1, arguments
    assert run("--help").returncode == 0


def test_fem_where_it_is_built(tmp_path):
    done = run("run", COLUMN, "--method", "fem-q2", "-o", tmp_path / "r.h5")
    if FEM:
        assert done.returncode == 0, done.stderr
        last = datasets(tmp_path / "r.h5")
        error = last["snapshots/0001/displacement"] - last["snapshots/0001/exact_displacement"]
        assert np.abs(error).max() < 1e-9 * np.abs(last["snapshots/0001/displacement"]).max()
    else:
        assert done.returncode == 1 and "testbed-fem" in done.stderr and not list(tmp_path.iterdir())


STUDY = """
title = "Resume"
scene = "{scene}"
[axes]
method = ["lpfdm-2000", "lpfdm", "mpm-cpgimp"]
"grid.cell_size" = [1.0, 0.5, 0.25]
[[target]]
label = "stress of order 1"
quantity = "stress"
norm = "l2"
kind = "order_between"
low = 0.9
high = 1.1
"""


def test_study_goes_on_after_a_kill_and_repeats_nothing(tmp_path):
    (tmp_path / "resume.toml").write_text(STUDY.format(scene=COLUMN))
    command = [TESTBED, "study", tmp_path / "resume.toml", "-j", "1", "-o", tmp_path / "out", "--quiet"]
    process = subprocess.Popen(command)
    runs = tmp_path / "out" / "resume" / "runs"
    for _ in range(600):
        time.sleep(0.05)
        if len(list(runs.glob("*/result.h5"))) >= 3:
            break
    process.kill()
    process.wait()
    first = {p: p.stat().st_mtime_ns for p in runs.glob("*/result.h5")}
    assert 3 <= len(first) < 9
    done = subprocess.run([*map(str, command), "--check"], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    after = {p: p.stat().st_mtime_ns for p in runs.glob("*/result.h5")}
    assert len(after) == 9 and all(after[p] == t for p, t in first.items())
    for path in after:
        with h5py.File(path) as file:
            assert file.attrs["status"] == "completed"
    done = subprocess.run([str(TESTBED), "report", str(tmp_path / "out"), "-o", str(tmp_path / "report")], capture_output=True,
                          text=True, timeout=300)
    assert done.returncode == 0 and (tmp_path / "report" / "report.html").stat().st_size > 10000, done.stderr


@pytest.mark.parametrize("path", sorted((ROOT / "benchmarks" / "studies").glob("*.toml")), ids=lambda path: path.stem)
def test_the_solver_takes_every_shipped_study(tmp_path, path):
    study = read_study(path)
    first = [combination for combination in study.combinations if not combination.bisection] or [c.at(c.bisection.low) for c in study.combinations]
    entries, left_out, tasks = expand(study, first[::max(1, len(first) // 30)], TESTBED, tmp_path, False, 2)
    assert entries and len(tasks) == len(entries) and all("testbed-fem" in entry["reason"] for entry in left_out)
