"""A study's folder in memory: its runs, their results and their rows of metrics."""
import hashlib
import json
import math
import os
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from ..read.results import Result, ResultError
from ..read.study_file import StudyError, matches, read_study
from . import metrics
from .foreign import faults, outside_name
from .limits import find_limits
from .recorded import QUANTITIES, recorded
from .verdicts import judge_study

PLAN = "plan.json"


@dataclass
class Run:
    """One run of a study. `values` holds what a `where` may ask for; `result` is None when there is no usable file."""
    id: str
    folder: Path
    values: dict
    status: str
    reason: str = ""
    result: Result | None = None
    rows: dict = field(default_factory=dict)
    errors: list = field(default_factory=list)
    command: str = ""  # that makes it again
    search: str = ""  # what is common to the runs of one bisection
    verdict: object = None  # of a study with cases
    outside: bool = False  # of another code

    @property
    def completed(self):
        return self.status == "completed"

    @property
    def name(self):
        return self.values.get("variant") or self.id

    @property
    def suspect(self):
        """Completed, and its guards say that the answer may be wrong."""
        return self.completed and self.result is not None and self.result.soundness.startswith("suspect")

    @property
    def label(self):
        """How it ended: the status, or 'suspect: CODE, ...'."""
        return self.result.soundness if self.suspect else self.status

    @property
    def told(self):
        """The reason, what the guards say, and what would help, as one text."""
        if self.result is None:
            return self.reason
        parts = [self.reason, *self.result.suspect]
        if self.result.cause:
            parts.append(f"cause: {self.result.cause}" + (f", remedy: {self.result.remedy}" if self.result.remedy else ""))
        return "; ".join(part for part in parts if part)

    def value(self, quantity, norm=""):
        """The metric, or what was recorded last; nan when the run has none."""
        if (quantity, norm) not in self.rows and quantity in QUANTITIES:
            return self.recorded.get((quantity, norm), math.nan)
        return self.rows.get((quantity, norm), math.nan)

    @cached_property
    def recorded(self):
        """What probes and supports of a completed run recorded last."""
        return recorded(self.result) if self.completed and self.result is not None else {}


@dataclass
class Study:
    """A study's folder: the study file, the runs of its present plan, and the combinations left out."""
    folder: Path
    spec: object
    plan: dict
    runs: list
    left_out: list
    outside: list = field(default_factory=list)  # ids of results that no plan has made
    limits: list = field(default_factory=list)  # found by searches

    def case(self, name):
        """The [[case]] of that name."""
        return next(case for case in self.spec.cases if case.name == name)

    @property
    def name(self):
        return self.folder.name

    def select(self, where):
        return [run for run in self.runs if matches(run.values, where)]

    def left_out_of(self, where):
        """The combinations that a `where` chooses and that could not be run."""
        return [e for e in self.left_out if matches({**e.get("axes", {}), **{k: e.get(k) for k in ("variant", "method", "L", "case")}}, where)]

    def variants(self):
        return list(dict.fromkeys(run.name for run in self.runs))


# What makes no line of its own in a table or an order.
NO_SERIES = ("scene", "method", "variant", "L", "ppc", "dt", "seed", "repeat", "grid.cell_size")


def groups(runs, leave_out=()):
    """Runs by variant, and within by further axes than method, cell size and repeats, as labels."""
    further = [k for run in runs for k in run.values
               if k not in NO_SERIES and k not in leave_out and not k.endswith(".seed")]
    varying = [k for k in dict.fromkeys(further) if len({str(r.values[k]) for r in runs if k in r.values}) > 1]
    found = {}
    for run in runs:
        parts = [run.name] + [f"{k.rsplit('.', 1)[-1]} = {run.values.get(k)}" for k in varying]
        found.setdefault(", ".join(parts), []).append(run)
    return found


def write_atomically(path, text):
    """Writes a whole file or none."""
    path = Path(path)
    part = path.with_name(path.name + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, path)


def digest(*parts, length=8):
    """So many hexadecimal digits of a hash of texts or bytes."""
    sha = hashlib.sha256()
    for part in parts:
        data = part if isinstance(part, bytes) else str(part).encode()
        sha.update(len(data).to_bytes(8, "little") + data)
    return sha.hexdigest()[:length]


def call_outside(run):
    """Marks a run as one of another code, with a name that no run of the testbed has."""
    run.outside = True
    run.values |= {key: outside_name(run.values[key]) for key in ("method", "variant")}


def read_run(folder, entry, file="result.h5"):
    """A run from its folder; never raises for a bad file, but says so in `reason`."""
    folder = Path(folder)
    values = {**entry.get("axes", {}), "repeat": entry.get("repeat", 1)}
    for key in ("case", "method", "variant", "L", "ppc", "seed"):
        if entry.get(key) not in (None, ""):
            values[key] = entry[key]
    run = Run(entry["id"], folder, values, "missing", entry.get("outcome", "") or "not run yet", command=entry.get("command", ""),
              search=entry.get("search", ""))
    path = folder / file
    if not path.is_file():
        return run
    try:
        result = Result(path)
        values.update(case=entry.get("case") or result.case, method=result.method, variant=result.variant, L=result.cell_size,
                      ppc=result.scene.get("points_per_cell", ""), dt=result.performance.get("dt", ""),
                      seed=result.seed)
    except ResultError as error:
        run.status, run.reason = "unreadable", str(error).replace(str(folder) + os.sep, "")
        return run
    if entry.get("scene") not in (None, digest(str(result.scene.get("resolved", "")))):
        run.status, run.reason = "unreadable", f"{file} is of another scene than the plan says: run the study once more"
        return run
    run.result, run.status, run.reason = result, result.status, result.reason
    if not result.own:
        call_outside(run)
    grades = metrics.grade(result)
    run.rows, run.errors = grades.rows, grades.errors
    return run


def _check_plan(path, plan):
    """Raises StudyError when a plan is not what `testbed study` writes."""
    lists = [plan.get(key, []) for key in ("runs", "left_out")] if isinstance(plan, dict) else [None]
    if not all(isinstance(entries, list) and all(isinstance(e, dict) and isinstance(e.get("axes", {}), dict) for e in entries)
               for entries in lists):
        raise StudyError(f"{path}: is no plan of a study")
    if not all(isinstance(entry.get("id"), str) for entry in plan.get("runs", [])):
        raise StudyError(f"{path}: a run has no 'id'")


OWN_RUN = re.compile(r"_[0-9a-f]{8}-[0-9a-f]{4}")  # how the id of a run of a plan ends


def outside_runs(folder, plan):
    """Ids of the results that lie in runs/ beside those that plans have made: of other codes."""
    planned = {entry["id"] for entry in plan.get("runs", [])}
    found = sorted(p.parent.name for p in (Path(folder) / "runs").glob("*/result.h5"))
    return [name for name in found if name not in planned and not OWN_RUN.search(name[-14:])]


def read_plan(folder):
    """plan.json of a study's folder; without one, every folder under runs/."""
    path = Path(folder) / PLAN
    if path.is_file():
        try:
            plan = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise StudyError(f"{path}: cannot be read: {error}") from error
        _check_plan(path, plan)
        return plan
    runs = sorted(p.name for p in (Path(folder) / "runs").glob("*") if p.is_dir())
    return {"runs": [{"id": name} for name in runs], "left_out": []}


def _read_outside(folder, name, own):
    """The run of a result that no plan has made; unreadable where it cannot be what it says."""
    run = read_run(folder, {"id": name})
    if run.result is None:
        return run
    wrong = faults(run.result, [r.result for r in own if r.result is not None])
    if wrong:
        return Run(name, folder, run.values, "unreadable", "; ".join(wrong), outside=True)
    if not run.outside:
        call_outside(run)
    return run


def read_study_folder(folder):
    """A study's folder, graded. Raises StudyError when the study file or the plan is unusable."""
    folder = Path(folder)
    spec, plan = read_study(folder / "study.toml", need_scene=False), read_plan(folder)
    runs, outside = [read_run(folder / "runs" / entry["id"], entry) for entry in plan.get("runs", [])], outside_runs(folder, plan)
    runs += [_read_outside(folder / "runs" / name, name, runs) for name in outside]
    study = Study(folder, spec, plan, runs, plan.get("left_out", []), [run.id for run in runs if run.outside and run.result is not None])
    if spec.cases:
        judge_study(study)
        study.limits = find_limits(study)
    return study
