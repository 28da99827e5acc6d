"""A study's runs as jobs of a real Slurm: its daemons are started on loopback where they are installed and this user may. A job is cancelled and the controller
stopped and started on the way. SLURM_RUNS sets the number of runs (default 8)."""
import os
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import REPORTS
from test_campaign import TESTBED, datasets, results

NEEDED = ("slurmctld", "slurmd", "munged", "sbatch", "scancel", "snakemake")
pytestmark = [pytest.mark.skipif(not TESTBED, reason="no executable"), pytest.mark.skipif(os.geteuid() != 0, reason="daemons of Slurm need root"),
              pytest.mark.skipif(not all(map(shutil.which, NEEDED)), reason="Slurm is not installed")]
CONF = """ClusterName=test
SlurmctldHost={host}(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthInfo=socket={home}/munge.socket
StateSaveLocation={home}/state
SlurmdSpoolDir={home}/spool
SlurmctldPidFile={home}/slurmctld.pid
SlurmdPidFile={home}/slurmd.pid
SlurmctldLogFile={home}/slurmctld.log
SlurmdLogFile={home}/slurmd.log
SlurmctldPort={port}
SlurmdPort={other}
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
ReturnToService=2
MpiDefault=none
JobAcctGatherType=jobacct_gather/none
NodeName={host} NodeAddr=127.0.0.1 CPUs=2 RealMemory=4000 State=UNKNOWN
PartitionName=all Nodes={host} Default=YES MaxTime=INFINITE State=UP
"""


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


class Slurm:
    """munged, slurmctld and slurmd with all of their files in one folder."""

    def __init__(self, home):
        self.home, self.environment = home, {**os.environ, "SLURM_CONF": str(home / "slurm.conf")}
        for name in ("state", "spool"):
            (home / name).mkdir(parents=True)
        (home / "munge.key").write_bytes(os.urandom(1024))
        (home / "munge.key").chmod(0o400)
        (home / "slurm.conf").write_text(CONF.format(home=home, host=socket.gethostname().split(".")[0], port=free_port(), other=free_port()))
        self.run("munged", f"--key-file={home}/munge.key", f"--socket={home}/munge.socket", f"--pid-file={home}/munged.pid", f"--log-file={home}/munged.log",
                 f"--seed-file={home}/seed", "--force")
        self.run("slurmctld")
        self.run("slurmd")

    def run(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=60)

    def is_ready(self):
        return any("idle" in self.run("sinfo", "-h").stdout or time.sleep(0.5) for _ in range(40))

    def kill(self, daemon, how=signal.SIGKILL):
        try:
            os.kill(int((self.home / f"{daemon}.pid").read_text()), how)
        except (OSError, ValueError):
            pass

    def stop(self):
        self.run("scancel", "--user=root")
        for daemon in ("slurmd", "slurmctld", "munged"):
            self.kill(daemon)


@pytest.fixture
def slurm():
    # a socket's path has 108 characters at most: no tmp_path
    home = Path(tempfile.mkdtemp(prefix="slurm"))
    cluster = Slurm(home)
    try:
        if not cluster.is_ready():
            pytest.skip("Slurm does not start here: " + cluster.run("sinfo").stderr)
        yield cluster
    finally:
        cluster.stop()
        shutil.rmtree(home, ignore_errors=True)


def test_a_job_and_the_controller_stop(slurm, tmp_path):
    runs = int(os.environ.get("SLURM_RUNS", "8"))
    (tmp_path / "s.toml").write_text(f'title = "s"\nscene = "{REPORTS.parent}'
                                     '/benchmarks/elastic/elastic_column_sudden/scene.toml"\n'
                                     f'[axes]\nmethod = ["lpfdm", "mpm-cpgimp"]\n"grid.cell_size" = [0.25]\n"time.end" = {[2 + 0.001 * k for k in range(runs // 2)]}\n')
    command, log = [TESTBED, "study", "s.toml", "--quiet", "-o"], tmp_path / "log.txt"
    process = subprocess.Popen([*command, "jobs", "--engine", "slurm"], cwd=tmp_path, env=slurm.environment, stdout=subprocess.DEVNULL, stderr=open(log, "w"))
    for _ in range(240):  # a job that runs is cancelled, then the controller is killed
        if running := slurm.run("squeue", "-h", "-t", "R", "-o", "%i").stdout.split():
            break
        time.sleep(0.25)
    else:
        pytest.fail("no job began: " + slurm.run("squeue").stdout)
    slurm.run("scancel", running[0])
    time.sleep(8)  # within which the controller writes down what it knows
    slurm.kill("slurmctld", signal.SIGTERM)  # SIGKILL survives, too, but then Slurm itself takes minutes to find its jobs again, or asks who keeps it to
    time.sleep(3)
    slurm.run("slurmctld")
    end = time.monotonic() + 100 + 8 * runs
    while process.poll() is None and time.monotonic() < end:  # Slurm drains a node that runs a job of which it lost track; who keeps the cluster resumes it
        if "drain" in slurm.run("sinfo", "-h", "-o", "%T").stdout:
            slurm.run("scontrol", "update", f"nodename={socket.gethostname().split('.')[0]}", "state=resume")
        time.sleep(2)
    if process.poll() is None:
        process.kill()
        pytest.fail("not done in time: " + slurm.run("squeue").stdout[-1000:])
    told = log.read_text()
    assert process.returncode == 0, told[-3000:]
    assert subprocess.run([*command, "plain", "-j", "2"], cwd=tmp_path).returncode == 0
    plain, jobs = results(tmp_path / "plain"), results(tmp_path / "jobs")
    assert list(plain) == list(jobs) and len(plain) == runs
    for name in plain:
        a, b = datasets(plain[name]), datasets(jobs[name])
        assert a.keys() == b.keys() and all(np.asarray(a[k]).tobytes() == np.asarray(b[k]).tobytes() for k in a), name
