"""A study run by Snakemake: one job a run, the same results as without, and what is killed goes on."""
import json
import os
import shutil
import signal
import subprocess
import time

import h5py
import numpy as np
import pytest
from conftest import REPORTS

TESTBED = os.environ.get("TESTBED", "")
pytestmark = [pytest.mark.skipif(not TESTBED, reason="no executable"), pytest.mark.skipif(not shutil.which("snakemake"), reason="snakemake is not installed")]
STUDY = f"""title = "s"
scene = "{REPORTS.parent}/benchmarks/elastic/elastic_column_sudden/scene.toml"
[axes]
method = ["lpfdm", "mpm-cpgimp"]
"grid.cell_size" = [2.0, 1.0, 0.5]
"""


def study(folder, *options, **more):
    (folder / "s.toml").write_text(STUDY)
    command = [TESTBED, "study", "s.toml", "-j", "2", "-o", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, **more)


def results(folder):
    return {path.parent.name: path for path in sorted((folder / "s" / "runs").glob("*/result.h5"))}


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(lambda name, node: found.update({name: node[()]}) if isinstance(node, h5py.Dataset) else None)
    return found


def test_the_same_results(tmp_path):
    assert study(tmp_path, "plain", "--quiet").returncode == 0
    done = study(tmp_path, "jobs", "--engine", "snakemake", "--quiet")
    assert done.returncode == 0, done.stderr
    plain, jobs = results(tmp_path / "plain"), results(tmp_path / "jobs")
    assert list(plain) == list(jobs) and len(plain) == 6
    for name in plain:
        a, b = datasets(plain[name]), datasets(jobs[name])
        assert a.keys() == b.keys() and all(np.asarray(a[k]).tobytes() == np.asarray(b[k]).tobytes() for k in a), name
    asked = json.loads((tmp_path / "jobs" / "s" / "campaign" / "tasks.json").read_text())
    assert all(a["threads"] == 1 and a["minutes"] >= 2 and a["mem_mb"] > 300 for a in asked.values()) and len(asked) == 6
    again = study(tmp_path, "jobs", "--engine", "snakemake")
    assert again.returncode == 0 and "6 finished already, 0 to do" in again.stderr


@pytest.mark.parametrize("victim", ["snakemake", "study", "run"])
def test_what_is_killed_goes_on(tmp_path, victim):
    """SIGKILL of the controller, of the study or of a run; the same command then ends with all results."""
    (tmp_path / "s.toml").write_text(STUDY.replace("[2.0, 1.0, 0.5]", "[1.0, 0.25]"))
    command = [TESTBED, "study", "s.toml", "-j", "2", "-o", "out", "--engine", "snakemake", "--quiet"]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    runs = tmp_path / "out" / "s" / "runs"
    for _ in range(600):
        if list(runs.glob("*/result.h5.part")):
            break
        time.sleep(0.05)
    else:
        pytest.fail("no run began")
    pattern = {"snakemake": "snakemake --snakefile", "study": "testbed-study s.toml", "run": f"testbed run .*{tmp_path}"}[victim]
    found = subprocess.run(["pgrep", "-f", pattern], capture_output=True, text=True).stdout.split()
    own = [pid for pid in found if os.path.exists(f"/proc/{pid}") and os.readlink(f"/proc/{pid}/cwd").startswith(str(tmp_path))]
    for pid in own[:1] if victim == "run" else own:
        try:
            os.kill(int(pid), signal.SIGKILL)
        except ProcessLookupError:
            pass
    process.wait(timeout=120)
    time.sleep(1)
    try:  # what the killed one left running
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert len(results(tmp_path / "out")) == 4 and all(h5py.File(p).attrs["status"] == "completed" for p in results(tmp_path / "out").values())


def test_what_fails_is_told(tmp_path):
    (tmp_path / "s.toml").write_text(STUDY)
    environment = {**os.environ, "PATH": "/nowhere"}
    done = subprocess.run(["/usr/bin/python3", REPORTS / "testbed-study", "s.toml", "-o", "out", "--engine", "snakemake"], cwd=tmp_path, capture_output=True,
                          text=True, env=environment)
    assert done.returncode == 1 and "no 'snakemake' on PATH" in done.stderr and "Traceback" not in done.stderr
