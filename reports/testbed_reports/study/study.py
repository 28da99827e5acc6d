"""`testbed study`: runs what a study still lacks, and grades it."""
import argparse
import concurrent.futures
import fcntl
import json
import os
import re
import shlex
import shutil
import signal
import sys
from pathlib import Path

from ..grade.dataset import PLAN, digest, read_study_folder, write_atomically
from ..grade.metrics_csv import metrics_csv
from ..grade.scene_words import of_runs
from ..grade.targets import as_text, judge_all
from ..read.results import is_finished, seed_of
from ..read.study_file import StudyError, read_study, toml_value
from .campaign import job, run_by_snakemake
from .resolve import Refused, method_of, refusals, refuse_misspelt, refuse_twins, resolve, run_arguments, with_own_constants
from .runner import Task, run_all
from .search import Searches, name_of

OK, BAD, RUNS_FAILED, INTERRUPTED = 0, 1, 4, 130
FEM_MISSING = "the FEM reference (testbed-fem) is not built"


def find_testbed():
    """The `testbed` executable: $TESTBED, else on PATH, else ../build/bin/testbed beside the package."""
    named = os.environ.get("TESTBED")
    if named:
        found = shutil.which(named)
        if not found:
            raise StudyError(f"TESTBED={named}: no such executable")
        return Path(found).resolve()
    found = shutil.which("testbed")
    beside = Path(__file__).resolve().parents[3] / "build" / "bin" / "testbed"
    if found or beside.is_file():
        return Path(found or beside).resolve()
    raise StudyError("no 'testbed' executable: build it, put it on PATH, or set TESTBED")


def family(method):
    """The family of a variant: 'mpm' of 'mpm-linear'."""
    return method.split("-")[0]


def is_fem(method):
    return family(method) == "fem"


def name_of_scene(scene):
    """Of its folder, and of its file where that is not scene.toml, as the solver writes it."""
    return scene.parent.name + ("" if scene.stem == "scene" else f"-{scene.stem}")


def case_of(combination):
    """The name of the study's [[case]], else of the scene."""
    return combination.case or name_of_scene(combination.scene.resolve())


def points_per_cell(resolved):
    """Of the first body of a resolved scene."""
    bodies = resolved.get("body") or [{}]
    return bodies[0].get("points_per_cell")


def readable(method, axes, repeat, case=""):
    """'lpfdm_L0.5_r1': what a run is, as a folder's name."""
    parts = [case, method] if case else [method]
    for key, value in axes.items():
        if key == "scene":
            parts.insert(0, name_of_scene(Path(value)))
        elif key != "method":
            short = {"grid.cell_size": "L"}.get(key, key.rsplit(".", 1)[-1])
            text = f"{value:g}" if isinstance(value, float) else toml_value(value)
            parts.append(short + text)
    parts.append(f"r{repeat}")
    return re.sub(r"[^\w.+=-]+", "", "_".join(parts))[:120]


def rerun_command(combination):
    """What a reader types to make a run again."""
    arguments = run_arguments(combination)
    return shlex.join(["testbed", "run", os.path.normpath(arguments[0]), *arguments[1:], "--threads", str(combination.threads),
                       "-o", "result.h5"])


def expand(study, combinations, testbed, folder, keep, jobs):
    """(entries of the plan, combinations left out, tasks): every run of some combinations with its id, and those not finished."""
    fem = testbed.with_name("testbed-fem")
    binaries = {False: testbed.read_bytes(), True: fem.read_bytes() if fem.is_file() else None}
    hashes = {key: digest(data, length=4) for key, data in binaries.items() if data is not None}

    chosen, left_out = [], []
    for combination in with_own_constants(combinations, study.combinations):
        method = combination.method or method_of(combination.scene)
        if is_fem(method) and binaries[True] is None:
            left_out.append({"axes": combination.axes, "case": case_of(combination), "variant": method, "method": "fem",
                             "L": combination.axes.get("grid.cell_size"), "reason": FEM_MISSING, "search": name_of(combination)})
        else:
            chosen.append((combination, method))
    with concurrent.futures.ThreadPoolExecutor(max(1, jobs)) as pool:
        futures = [pool.submit(resolve, testbed, c) for c, _ in chosen]
        scenes, refused = [], []
        for future in futures:
            try:
                scenes.append(future.result())
            except Refused as error:
                refused.append(error)
        if refused:
            raise StudyError(refusals(refused))
    refuse_twins(study, chosen, scenes)
    refuse_misspelt(study, chosen, scenes)

    entries, tasks = [], []
    for (combination, method), (text, resolved) in zip(chosen, scenes):
        for repeat in range(1, study.repeats + 1):
            name = readable(method, combination.axes, repeat, combination.case)
            stem = f"{name}_{digest(text, repeat, combination.threads)}"
            run_id = f"{stem}-{hashes[is_fem(method)]}"
            runs = folder / "runs"
            if keep and not is_finished(runs / run_id / "result.h5"):
                old = [p for p in runs.glob(f"{stem}-*") if is_finished(p / "result.h5")]
                if old:
                    run_id = max(old, key=lambda p: p.stat().st_mtime).name
            entries.append({"id": run_id, "case": case_of(combination), "method": family(method), "variant": method,
                            "L": resolved.get("grid", {}).get("cell_size"), "ppc": points_per_cell(resolved),
                            "seed": seed_of(resolved), "axes": combination.axes, "repeat": repeat, "outcome": "",
                            "scene": digest(text), "command": rerun_command(combination), "search": name_of(combination)})
            out = runs / run_id
            if not is_finished(out / "result.h5"):
                command = [str(testbed), "run", *run_arguments(combination), "--threads", str(combination.threads),
                           "-o", str(out / "result.h5"), "--quiet"]
                tasks.append(Task(run_id, out, command))
    return entries, left_out, tasks


class Progress:
    """One line that is redrawn on a terminal, else one line per finished run; nothing when quiet."""

    def __init__(self, name, total, quiet):
        self.name, self.total, self.quiet, self.done, self.failed = name, total, quiet, 0, 0
        self.terminal = sys.stderr.isatty()
        self.shown = None

    def say(self, text):
        if not self.quiet:
            self._clear()
            print(text, file=sys.stderr, flush=True)

    def _clear(self):
        if self.terminal and self.shown:
            print("\r\033[K", end="", file=sys.stderr)
            self.shown = None

    def tell(self, outcome, done, running):
        self.done, self.failed = done, self.failed + (not outcome.done)
        if not outcome.done or not self.terminal:
            reason = f" ({outcome.reason})" if outcome.reason else ""
            self.say(f"{self.name}: [{done}/{self.total}] {outcome.task.id} {outcome.status}{reason} "
                     f"{outcome.seconds:.1f} s")
        self.tick(running)

    def tick(self, running):
        if self.quiet or not self.terminal:
            return
        line = f"{self.name}: {self.done}/{self.total} done, {self.failed} failed, running {', '.join(running)}"
        line = line[:shutil.get_terminal_size().columns - 1]
        if line != self.shown:
            print(f"\r\033[K{line}", end="", file=sys.stderr, flush=True)
            self.shown = line

    def close(self):
        self._clear()


def _write_plan(folder, plan):
    """plan.json, and what was left out in words."""
    if plan["left_out"]:
        lines = [f"{readable(e['variant'], e['axes'], 1)[:-3]}: {e['reason']}" for e in plan["left_out"]]
        write_atomically(folder / "left_out.txt", "\n".join(lines) + "\n")
    else:
        (folder / "left_out.txt").unlink(missing_ok=True)
    write_atomically(folder / PLAN, json.dumps(plan, indent=1) + "\n")


def run_study(study, testbed, out, options, command):
    """Runs one study in out/<name>. Returns (list of problems, interrupted)."""
    folder, jobs, quiet = Path(out) / study.name, options.jobs, options.quiet
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / ".lock", "w", encoding="utf-8") as lock:
        try:
            fcntl.lockf(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            raise StudyError(f"{folder}: another study process works in this folder") from None
        write_atomically(folder / "study.toml", study.path.read_text(encoding="utf-8"))
        plan = {"study": str(study.path), "jobs": jobs, "cores": os.cpu_count(), "runs": [], "left_out": [], "command": command}
        searches, failed, interrupted = Searches(study, folder), {}, False
        waiting = [c for c in study.combinations if not c.bisection] + searches.next([])
        while waiting and not interrupted:
            entries, left_out, tasks = expand(study, waiting, testbed, folder, options.keep, jobs)
            first = not plan["runs"]
            plan["runs"] += entries
            plan["left_out"] += left_out
            searches.forget(left_out)
            _write_plan(folder, plan)
            progress = Progress(study.name, len(tasks), quiet)
            if first or tasks:
                progress.say(f"{study.name}: {len(entries)} runs" + ("" if first else " to search on")
                             + f", {len(entries) - len(tasks)} finished already, {len(tasks)} to do")
            if first and plan["left_out"]:
                progress.say(f"{study.name}: {len(plan['left_out'])} combinations left out: {plan['left_out'][0]['reason']}")
            try:
                outcomes = run_all(tasks, jobs, progress.tell, progress.tick) if options.engine == "processes" else \
                    run_by_snakemake(tasks, jobs, progress.tell, folder, options.engine, options.snakemake, quiet)
            except KeyboardInterrupt as stop:
                outcomes, interrupted = (stop.args[0] if stop.args else []), True
            progress.close()
            failed.update({o.task.id: o.reason or o.status for o in outcomes if not o.done})
            waiting = [] if interrupted else searches.next(plan["runs"])
        for entry in plan["runs"]:
            entry["outcome"] = failed.get(entry["id"], "")
        _write_plan(folder, plan)
        data = read_study_folder(folder)
        write_atomically(folder / "metrics.csv", metrics_csv(data.runs))
        if data.outside:
            progress.say(f"{study.name}: results that this study did not run are taken: {', '.join(data.outside)}")
        for run in data.runs:
            for error in run.errors:
                progress.say(f"{study.name}: {run.id}: {error}")
        for text in of_runs(data.runs, data.spec.figures)[1]:
            progress.say(f"{study.name}: {text}")
        problems = [f"{study.name}: {name}: {reason}" for name, reason in failed.items()]
        return problems, interrupted, data


def parse_arguments(arguments):
    parser = argparse.ArgumentParser(prog="testbed study", description="Run what a study lacks; never repeat a "
                                     "finished run. Failure of a method is data: a diverged run counts as done.")
    parser.add_argument("studies", nargs="+", metavar="STUDY.toml")
    parser.add_argument("-j", "--jobs", type=int, default=1, metavar="N", help="runs side by side (default 1)")
    parser.add_argument("-o", "--output", default="results", metavar="DIR", help="folder of studies (default results)")
    parser.add_argument("--keep", action="store_true", help="keep finished runs of another build of the executable")
    parser.add_argument("--check", action="store_true", help="judge the targets, exit code 1 if one fails")
    parser.add_argument("--quiet", action="store_true")
    parser.add_argument("--engine", choices=("processes", "snakemake", "slurm"), default="processes", help="who runs the runs (default processes)")
    parser.add_argument("--snakemake", default="", metavar="OPTIONS", help="passed on to Snakemake, such as '--profile DIR --jobs 200'")
    options = parser.parse_args(arguments)
    if options.jobs < 1:
        parser.error("-j must be at least 1")
    try:
        shlex.split(options.snakemake)
    except ValueError as error:
        parser.error(f"--snakemake: {error}")
    return options


def _terminate(*_):
    raise KeyboardInterrupt


def main(arguments=None):
    """Entry of `testbed study`; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    if arguments[:1] == ["--job"]:  # within a job of Snakemake
        return job(arguments[1:])
    try:
        options = parse_arguments(arguments)
    except SystemExit as stop:
        return BAD if stop.code else OK
    signal.signal(signal.SIGTERM, _terminate)
    command = shlex.join(["testbed", "study", *arguments])
    problems, passed, interrupted = [], True, False
    try:
        studies = [read_study(path) for path in options.studies]
        names = [s.name for s in studies]
        twice = next((n for n in names if names.count(n) > 1), None)
        if twice:
            raise StudyError(f"two studies are called '{twice}'")
        testbed = find_testbed()
        for study in studies:
            new, interrupted, data = run_study(study, testbed, options.output, options, command)
            problems += new
            if interrupted:
                break
            if options.check and data.spec.targets:
                verdicts = judge_all(data)
                passed = passed and all(v.verdict != "fail" for v in verdicts)
                print(f"{study.name}: {study.title}\n{as_text(verdicts)}", flush=True)
    except (StudyError, OSError) as error:
        print(f"testbed study: {error}", file=sys.stderr)
        return BAD
    except KeyboardInterrupt:
        interrupted = True
    if interrupted:
        print("testbed study: interrupted; the same command goes on from here", file=sys.stderr)
        return INTERRUPTED
    if problems:
        print("testbed study: these runs failed:\n  " + "\n  ".join(problems), file=sys.stderr)
        return RUNS_FAILED
    return OK if passed else BAD
