"""Runs of a study as jobs of Snakemake, on a machine or, by a profile, on a cluster."""
import json
import math
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..grade.dataset import write_atomically
from ..read.study_file import StudyError
from .runner import Outcome, Task, judge, start

SLOWEST = 1e6  # particle steps per second on the safe side of every method: what a job asks for is time enough
SPARE_MB = 300  # of a program beside the arrays of its points


def _asked(task):
    """What a job asks of the machine, from what `testbed check` says of the run."""
    arguments = task.command[task.command.index("run") + 1:task.command.index("-o")]
    threads = int(arguments[arguments.index("--threads") + 1])
    done = subprocess.run([task.command[0], "check", *arguments[:arguments.index("--threads")]], capture_output=True, text=True)

    def number(pattern):
        found = re.search(pattern, done.stdout, re.M)
        return float(found.group(1)) if found else math.nan

    work, memory = number(r"^points +(\d+)") * number(r", (\d+) steps"), number(r"([\d.]+) MB\)")
    return {"folder": str(task.folder.resolve()), "cwd": str(Path.cwd()), "command": task.command, "threads": threads,
            "minutes": 2 + math.ceil(work / SLOWEST / 60) if math.isfinite(work) else 60,
            "mem_mb": SPARE_MB + math.ceil(2 * memory) if math.isfinite(memory) else 2000}


def _outcome(home, task):
    """How a job ended; what left no word was lost."""
    try:
        told = json.loads((home / "outcomes" / f"{task.id}.json").read_text())
        return Outcome(task, told["status"], told["reason"], told["seconds"])
    except (OSError, ValueError, KeyError):
        return Outcome(task, "failed", "its job left no word: see Snakemake's log", 0.0)


def _profile(home):
    """Options for Slurm: the profile beside this file, with the place of its script."""
    here, own = Path(__file__).with_name("slurm"), home / "slurm"
    own.mkdir(exist_ok=True)
    write_atomically(own / "config.yaml", (here / "config.yaml").read_text().replace("STATUS", str(here / "status")))
    return ["--profile", str(own.resolve())]


def run_by_snakemake(tasks, jobs, tell, folder, engine, options, quiet):
    """As run_all(): outcomes of the tasks, of which `jobs` run side by side, or, with the engine slurm, as many as that takes; `options` are
    passed on to Snakemake.

    Raises StudyError without Snakemake, KeyboardInterrupt with the outcomes so far.
    """
    if not tasks:
        return []
    program = shutil.which("snakemake")
    if not program:
        raise StudyError(f"--engine {engine}: no 'snakemake' on PATH (Debian: apt-get install snakemake)")
    home = folder / "campaign"
    for name in ("done", "outcomes"):
        (home / name).mkdir(parents=True, exist_ok=True)
        for task in tasks:  # of an earlier build or a killed job
            (home / name / task.id).unlink(missing_ok=True)
            (home / name / f"{task.id}.json").unlink(missing_ok=True)
    with ThreadPoolExecutor(jobs) as pool:
        asked = list(pool.map(_asked, tasks))
    write_atomically(home / "tasks.json", json.dumps({task.id: a for task, a in zip(tasks, asked)}, indent=1) + "\n")
    shutil.copyfile(Path(__file__).with_name("Snakefile"), home / "Snakefile")
    job = shlex.join([sys.executable, str(Path(__file__).resolve().parents[2] / "testbed-study"), "--job"])
    command = [program, "--snakefile", "Snakefile", "--config", f"job={job}", *(_profile(home) if engine == "slurm" else ["--cores", str(jobs)]), "--keep-going", "--nolock", "--rerun-incomplete",
               "--rerun-triggers", "mtime", *(["--quiet"] if quiet else []), *shlex.split(options)]
    process = subprocess.Popen(command, cwd=home, stdout=sys.stderr)
    try:
        process.wait()
    except KeyboardInterrupt:  # Snakemake stops its jobs then
        process.send_signal(signal.SIGINT)
        process.wait()
        raise KeyboardInterrupt([_outcome(home, task) for task in tasks]) from None
    outcomes = [_outcome(home, task) for task in tasks]
    for k, outcome in enumerate(outcomes, 1):
        tell(outcome, k, [])
    return outcomes


def job(arguments):
    """One run of tasks.json, in a job: `--job tasks.json ID`; returns the exit code, 0 when the run is done, however it ended."""
    file, name = Path(arguments[0]).resolve(), arguments[1]
    asked = json.loads(file.read_text())[name]
    os.chdir(asked["cwd"])
    task, begin = Task(name, Path(asked["folder"]), asked["command"]), time.monotonic()
    process = start(task)
    outcome = judge(task, process.wait(), time.monotonic() - begin)
    write_atomically(file.parent / "outcomes" / f"{name}.json",
                     json.dumps({"status": outcome.status, "reason": outcome.reason, "seconds": outcome.seconds}))
    return 0 if outcome.done else 1
