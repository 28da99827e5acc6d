"""A run that was stopped, killed or time-limited and goes on from its restart file gives the same bits as one that was not."""
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from damage import damaged_copies

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "benchmarks"
TESTBED = Path(os.environ.get("TESTBED") or ROOT / "build" / "bin" / "testbed")
FEM = TESTBED.with_name("testbed-fem").exists()
PARTICLES = ["lpfdm-2000", "lpfdm", "mpm-linear", "mpm-linear-bbar", "mpm-bspline", "mpm-cpgimp"]
COLUMN = ("elastic/elastic_column", "grid.cell_size=0.5")
PSC = ("soil/psc", "time.end=0.1", "grid.cell_size=0.1")


def run_testbed(*arguments, code=0):
    done = subprocess.run([str(TESTBED), *map(str, arguments)], capture_output=True, text=True, timeout=300)
    assert done.returncode == code, done.stderr
    return done.stderr


def sets(settings):
    return [word for setting in settings for word in ("--set", setting)]


def content(path):
    """All datasets, the times of the snapshots and the verdict."""
    found = {}
    with h5py.File(path) as file:
        def visit(name, thing):
            if isinstance(thing, h5py.Dataset):
                found[name] = thing[()].tobytes()
            if name.startswith("snapshots/"):
                found.update({f"{name}@{key}": value for key, value in thing.attrs.items()})
        file.visititems(visit)
        found.update({key: file.attrs[key] for key in ("status", "reason", "suspect", "cause")})
        found["steps"] = file["performance"].attrs["steps"]
    return found


def assert_same(one, other):
    one, other = content(one), content(other)
    assert one.keys() == other.keys()
    assert not [name for name in one if one[name] != other[name]]


def stopped_at_a_third(tmp_path, scene, *arguments):
    """Runs a scene whole, and another time to about a third; the paths of both results."""
    whole, part = tmp_path / "whole.h5", tmp_path / "part.h5"
    run_testbed("run", scene, *arguments, "-o", whole, "--quiet")
    with h5py.File(whole) as file:
        seconds = file["performance"].attrs["solve_s"] + file["performance"].attrs["output_s"]
    for share in (3, 10, 30, 1e6):  # the second time all may be faster
        done = subprocess.run([str(TESTBED), "run", str(scene), *arguments, "--set", f"time.wall_clock_limit={seconds / share}", "-o",
                               str(part), "--quiet"], capture_output=True, text=True, timeout=300)
        if done.returncode == 3:
            return whole, part
    raise AssertionError("the run was too fast to be stopped")


def scenes():
    for method in PARTICLES:
        yield method, *COLUMN
        yield method, *PSC
    yield "lpfdm", "soil/trapdoor", "time.end=2", "grid.cell_size=0.5"
    yield "mpm-linear", "soil/trapdoor", "time.end=2", "grid.cell_size=0.5"
    yield "lpfdm", "soil/reverse_fault", "time.end=0.5"
    yield "lpfdm", "soil/psc_band_nonlocal", "time.end=0.05", "grid.cell_size=0.1"
    yield "mpm-cpgimp", "soil/psc_band_nonlocal", "time.end=0.05", "grid.cell_size=0.1"
    yield "lpfdm-2000", "soil/psc_confined", "time.end=0.05"
    yield "lpfdm", "manufactured/axis_aligned"
    yield "mpm-bspline", "manufactured/axis_aligned"
    yield "mpm-linear", "manufactured/axis_aligned", "mpm.scheme=usf"
    yield "mpm-cpgimp", "manufactured/axis_aligned", "mpm.scheme=usl", "mpm.flip=0.9"
    yield "mpm-linear", *COLUMN, "mpm.transfer=xpic"
    yield "lpfdm", *COLUMN, "time.density_scaling=true"
    yield "lpfdm", *COLUMN, "time.dt=auto", "time.cfl=0.4"
    yield "lpfdm", "elastic/elastic_column_sudden", "output.history=1e-9"  # a guard that keeps the whole history
    yield "mpm-linear", "stability/pull_apart"
    yield "lpfdm", "stability/impact_bodies"
    if FEM:
        yield "fem-q1", "elastic/elastic_column_sudden"
        yield "fem-q2", "elastic/elastic_column_sudden", "fem.integrator=central_difference", "fem.degree=1"


@pytest.mark.parametrize("method, case, settings", [(method, case, settings) for method, case, *settings in scenes()])
def test_same_bits_after_a_restart(tmp_path, method, case, settings):
    arguments = ["--method", method, *sets(settings)]
    whole, part = stopped_at_a_third(tmp_path, CASES / case / "scene.toml", *arguments)
    rest = tmp_path / "rest.h5"
    said = run_testbed("run", "--restart", part.with_suffix(".restart.h5"), "--set", "time.wall_clock_limit=1e6", "--threads", 2, "-o", rest)
    assert "restarted at t = " in said
    assert_same(whole, rest)


@pytest.mark.parametrize("method", ["lpfdm", "mpm-cpgimp"])
def test_nothing_is_lost_but_the_time_since_the_last_checkpoint(tmp_path, method):
    """Killed at twenty random moments, and each time taken up again."""
    scene, settings = CASES / "soil/psc/scene.toml", sets(["time.end=0.5"])
    whole, killed = tmp_path / "whole.h5", tmp_path / "killed.h5"
    run_testbed("run", scene, "--method", method, *settings, "-o", whole, "--quiet")
    with h5py.File(whole) as file:
        seconds = file["performance"].attrs["solve_s"] + file["performance"].attrs["output_s"]
    restart, moments, kills = killed.with_suffix(".restart.h5"), random.Random(1), 0
    every = ["--set", f"output.checkpoint={seconds / 200}"]
    while kills < 20:
        source = ["--restart", restart] if restart.exists() else [scene, "--method", method, *settings]
        written = restart.stat().st_mtime_ns if restart.exists() else 0
        process = subprocess.Popen([str(a) for a in (TESTBED, "run", *source, *every, "-o", killed, "--quiet")], stderr=subprocess.PIPE)
        while process.poll() is None and (restart.stat().st_mtime_ns if restart.exists() else 0) == written:
            time.sleep(0.002)
        time.sleep(seconds * moments.uniform(0, 0.04))
        if process.poll() is not None:
            assert process.returncode == 0, process.stderr.read()
            break  # through before its time
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stderr.close()
        kills += 1
    assert kills >= 10
    run_testbed("run", "--restart", restart, "-o", killed, "--quiet")
    assert_same(whole, killed)


def test_an_interrupted_run_goes_on(tmp_path):
    process = subprocess.Popen([str(TESTBED), "run", str(CASES / "soil/psc/scene.toml"), "--set", "time.end=2", "-o", str(tmp_path / "r.h5")],
                               stderr=subprocess.PIPE, text=True)
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130, said
    with h5py.File(tmp_path / "r.h5") as file:
        t = file["history/time"][-1]
    said = run_testbed("run", "--restart", tmp_path / "r.restart.h5", "--set", f"time.end={1.05 * t}", "-o", tmp_path / "r.h5")
    assert float(re.search(r"restarted at t = (\S+) s", said)[1]) == pytest.approx(t, rel=1e-5)


def test_a_longer_end_continues_a_completed_run(tmp_path):
    """The first part leaves its restart file because checkpoints are asked for; steps are as long as before, and none is made twice."""
    scene = CASES / "elastic/elastic_column/scene.toml"
    short = sets(["time.dt=0.0005", "time.end=0.5", "grid.cell_size=0.5", "output.history=0.01"])
    run_testbed("run", scene, *short, "--set", "output.checkpoint=1000", "-o", tmp_path / "a.h5", "--quiet")
    run_testbed("run", "--restart", tmp_path / "a.restart.h5", "--set", "time.end=1", "-o", tmp_path / "b.h5", "--quiet")
    run_testbed("run", scene, *short, "--set", "time.end=1", "-o", tmp_path / "whole.h5", "--quiet")
    one, other = content(tmp_path / "whole.h5"), content(tmp_path / "b.h5")
    assert other["steps"] == 2000
    assert not [name for name in one if name.startswith("history/") and one[name] != other[name]]
    with h5py.File(tmp_path / "whole.h5") as a, h5py.File(tmp_path / "b.h5") as b:
        assert [b[f"snapshots/{k}"].attrs["time"] for k in b["snapshots"]] == pytest.approx([0, 1])  # the end was no snapshot but the last one
        last = sorted(a["snapshots"])[-1], sorted(b["snapshots"])[-1]
        assert np.array_equal(a[f"snapshots/{last[0]}/stress"][()], b[f"snapshots/{last[1]}/stress"][()])


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    path = tmp_path_factory.mktemp("stopped") / "r.h5"
    run_testbed("run", CASES / "elastic/elastic_column/scene.toml", "--set", "time.wall_clock_limit=1e-9", "-o", path, "--quiet", code=3)
    return path.with_suffix(".restart.h5")


@pytest.mark.parametrize("setting, told", [
    ("grid.cell_size=0.5", "cell_size"), ("time.cfl=0.3", "cfl"), ("material.soil.density=1", "density"), ("gravity.ramp=1", "ramp")])
def test_another_scene_is_refused(tmp_path, stopped, setting, told):
    said = run_testbed("run", "--restart", stopped, "--set", setting, "-o", tmp_path / "x.h5", code=1)
    assert "the scene differs" in said and told in said and str(stopped) in said
    scene = CASES / "elastic/elastic_column/scene.toml"
    assert "the scene differs" in run_testbed("run", scene, "--restart", stopped, "--set", setting, "-o", tmp_path / "x.h5", code=1)
    assert "the scene differs" in run_testbed("run", scene, "--method", "mpm-linear", "--restart", stopped, "-o", tmp_path / "x.h5", code=1)
    assert not list(tmp_path.iterdir())


def test_the_scene_may_be_named_and_its_output_changed(tmp_path, stopped):
    run_testbed("run", CASES / "elastic/elastic_column/scene.toml", "--restart", stopped, *sets(["output.snapshots=3", "time.wall_clock_limit=99"]),
            "-o", tmp_path / "x.h5", "--quiet")
    assert "before the time of the restart" in run_testbed(  # of another one
        "run", "--restart", _late(tmp_path), "--set", "time.end=1e-3", "-o", tmp_path / "y.h5", code=1)


def test_another_output_holds_from_the_restart_on(tmp_path, stopped):
    testbed_output = sets(["output.snapshots=16", "output.history=0.25", "time.wall_clock_limit=99"])
    run_testbed("run", "--restart", stopped, *testbed_output, "-o", tmp_path / "x.h5", "--quiet")
    with h5py.File(tmp_path / "x.h5") as file:
        for times in ([node.attrs["time"] for node in file["snapshots"].values()], file["history/time"][()]):
            assert len(times) > 5 and np.diff(times)[:-1] == pytest.approx(0.25, abs=0.01)  # the run comes to rest before its end
    copy = tmp_path / "y.restart.h5"
    copy.write_bytes(stopped.read_bytes())
    assert "the restart file itself" in run_testbed("run", "--restart", copy, "-o", copy, code=1)
    assert copy.read_bytes() == stopped.read_bytes()


def _late(tmp_path):
    run_testbed("run", CASES / "elastic/elastic_column/scene.toml", *sets(["time.end=0.1", "output.checkpoint=9"]), "-o", tmp_path / "late.h5",
            "--quiet")
    return tmp_path / "late.restart.h5"


def test_bad_restart_files_are_refused(tmp_path, stopped):
    bad, out = tmp_path / "bad.restart.h5", tmp_path / "x.h5"
    data = stopped.read_bytes()
    cuts = [("cut", data[:-n]) for n in (1, 39, 40, 41, 1000, len(data) - 1, len(data))]
    for what, damaged in [*damaged_copies(stopped, int(os.environ.get("DAMAGED", "60")), seed=3), *cuts]:
        bad.write_bytes(damaged)
        said = run_testbed("run", "--restart", bad, "-o", out, code=1)
        assert "restart file" in said, what
    for other, told in ((tmp_path / "none", "there is none"), (tmp_path, "is no file"), (ROOT / "README.md", "no restart file")):
        assert told in run_testbed("run", "--restart", other, "-o", out, code=1)
    assert "format testbed-restart" in run_testbed("run", "--restart", stopped.with_name("r.h5"), "-o", out, code=1)
    assert not out.exists()


def test_a_scene_or_a_restart_file_is_asked(tmp_path):
    assert "--restart" in run_testbed("run", "-o", tmp_path / "x.h5", code=1)
