"""Runs child processes side by side, and says how each one ended."""
import ctypes
import os
import signal
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path

from ..read.results import FINISHED, Result, ResultError

DONE_CODES = (0, 2, 3, 5)
_PR_SET_PDEATHSIG = 1


@dataclass
class Task:
    """One run to start."""
    id: str
    folder: Path
    command: list


@dataclass
class Outcome:
    """How a run ended: `status` of its file, or 'failed'; `reason` in words."""
    task: Task
    status: str
    reason: str
    seconds: float

    @property
    def done(self):
        return self.status in FINISHED


def _die_with_parent():
    """In the child: do not outlive a study that is killed."""
    try:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    except (OSError, AttributeError):
        pass


def last_line(path):
    """Last line of a log that is not empty."""
    try:
        lines = [line for line in Path(path).read_text(errors="replace").splitlines() if line.strip()]
    except OSError:
        return ""
    return lines[-1].strip()[:300] if lines else ""


def start(task):
    """A child process with a log, that does not outlive this one."""
    task.folder.mkdir(parents=True, exist_ok=True)
    for name in ("result.h5", "result.h5.part"):
        (task.folder / name).unlink(missing_ok=True)
    with open(task.folder / "log.txt", "wb") as log:
        return subprocess.Popen(task.command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, start_new_session=True, preexec_fn=_die_with_parent)


def judge(task, code, seconds):
    """The outcome of a run that ended with an exit code."""
    path = task.folder / "result.h5"
    if code < 0:
        try:
            name = signal.Signals(-code).name
        except ValueError:
            name = "unknown"
        return Outcome(task, "failed", f"killed by signal {-code} ({name})", seconds)
    told = last_line(task.folder / "log.txt")
    told = f": {told}" if told else ""
    if code not in DONE_CODES:
        if path.exists():  # whatever it holds, the solver does not vouch for it
            os.replace(path, task.folder / "result.h5.part")
        return Outcome(task, "failed", f"exit code {code}{told}", seconds)
    if not path.is_file():
        return Outcome(task, "failed", f"exit code {code}, but no result.h5{told}", seconds)
    try:
        result = Result(path)
    except ResultError as error:
        return Outcome(task, "failed", f"exit code {code}, but {error}", seconds)
    if not result.finished:
        return Outcome(task, "failed", result.status, seconds)
    return Outcome(task, result.status, result.reason, seconds)


def run_all(tasks, jobs, tell=lambda outcome, done, running: None, tick=lambda running: None, grace=15.0):
    """Runs tasks, `jobs` at a time, and yields nothing but a list of outcomes; one bad child never stops the others.

    On KeyboardInterrupt the children are asked to stop (SIGINT, after `grace` seconds SIGKILL), and the exception
    goes on with the outcomes so far as its argument.
    """
    waiting, running, outcomes = list(tasks), {}, []

    def collect():
        for process in [p for p in running if p.poll() is not None]:
            task, start = running.pop(process)
            outcomes.append(judge(task, process.returncode, time.monotonic() - start))
            tell(outcomes[-1], len(outcomes), [t.id for t, _ in running.values()])

    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                task = waiting.pop(0)
                try:
                    running[start(task)] = (task, time.monotonic())
                except OSError as error:
                    outcomes.append(Outcome(task, "failed", f"cannot be started: {error}", 0.0))
                    tell(outcomes[-1], len(outcomes), [])
            tick([t.id for t, _ in running.values()])
            time.sleep(0.02)
            collect()
    except KeyboardInterrupt:
        _stop(running, grace)
        collect()
        raise KeyboardInterrupt(outcomes) from None
    return outcomes


def _stop(running, grace):
    for process in running:
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
    end = time.monotonic() + grace
    for process in running:
        try:
            process.wait(max(0.0, end - time.monotonic()))
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            process.kill()
            process.wait()
