"""What became of a run of a study with cases: sound, wrong (bounded, but beyond a bound of its case) or failed; why, since when,
and which setting of the study held."""
import math
from dataclasses import dataclass, field

from ..read.results import ResultError
from ..read.study_file import matches, same
from .stability_metrics import first_time

LEVELS = ("sound", "wrong", "failed")
HOLDS = {"sound": "holds", "wrong": "does not hold", "failed": "failed"}  # of a case that is a condition
WORDS = {"sound": "sound", "wrong": "bounded but wrong", "failed": "failed"}
CAUSES = {"time_step": "time step beyond the limit", "sliver": "node with little mass", "null_mode": "null mode", "tension": "tension",
          "locking": "locking", "separation": "numerical separation", "crossing": "points crossing cells"}


@dataclass
class RunVerdict:
    """`level` of LEVELS; `silent`: completed, called sound or not called suspect, and yet not sound by the bounds of the case;
    `warned`: called suspect although within the bounds."""
    level: str
    cause: str = ""
    time: float = math.nan
    held: str = ""
    beyond: list = field(default_factory=list)
    silent: bool = False
    warned: bool = False

    @property
    def rank(self):
        return LEVELS.index(self.level)


def limits(bound):
    return bound.get("min", -math.inf), bound.get("max", math.inf)


def bound_text(bound):
    """'energy gain scaled ≤ 0.02'."""
    low, high = limits(bound)
    what = " ".join(filter(None, (bound["quantity"], bound.get("norm", "")))).replace("_", " ")
    return (f"{low:g} ≤ " if math.isfinite(low) else "") + what + (f" ≤ {high:g}" if math.isfinite(high) else "")


def of_case(bounds, values):
    """The bounds that apply to a run: of each quantity the last one whose `where` chooses it."""
    chosen = {}
    for bound in bounds:
        if matches(values, bound.get("where", {})):
            chosen[bound["quantity"], bound.get("norm", "")] = bound
    return list(chosen.values())


def _last_time(result):
    try:
        return float(result.history("time")[-1])
    except (ResultError, IndexError):
        return math.nan


def told_cause(result, otherwise):
    """The cause in words: what the solver found, else the codes it suspects, else `otherwise`."""
    cause = str(result.root.get("cause", ""))
    if cause:
        return CAUSES.get(cause, cause)
    codes = [line.split(":")[0].strip() for line in str(result.root.get("suspect", "")).splitlines() if line.strip()]
    return otherwise or ", ".join(codes)


def judge_run(run, bounds):
    """The verdict on one run; `bounds` are those of its case."""
    result = run.result
    if result is None:
        return RunVerdict("failed", run.reason or run.status)
    held = str(result.root.get("remedy", ""))
    if not run.completed:
        return RunVerdict("failed", told_cause(result, run.reason or run.status), _last_time(result), held)
    level, beyond, times = "sound", [], []
    for bound in of_case(bounds, run.values):
        key, (low, high) = (bound["quantity"], bound.get("norm", "")), limits(bound)
        value = run.value(*key)
        if low <= value <= high:
            continue
        name = " ".join(filter(None, key)).replace("_", " ")
        beyond.append(f"{name} {value:.3g}" if key in run.rows else f"no number: {name}")
        lost = not math.isfinite(value) or abs(value) > bound.get("failed", math.inf)
        level = LEVELS[max(LEVELS.index(level), 2 if lost else 1)]
        try:
            times.append(first_time(result, key, low, high))
        except Exception:  # a damaged course has no first time; the verdict stands
            times.append(None)
    times = [t for t in times if t is not None]
    soundness = str(result.root.get("soundness", ""))
    if level == "sound":
        return RunVerdict("sound", warned=soundness == "suspect")
    return RunVerdict(level, told_cause(result, "; ".join(beyond)), min(times, default=_last_time(result)), held, beyond,
                      silent=soundness != "suspect")


def _distance(a, b):
    numbers = all(isinstance(v, (int, float)) and not isinstance(v, bool) for v in (a, b))
    return abs(math.log(abs(a) / abs(b))) if numbers and a and b else 1.0


def nearest_sound(run, others, axes):
    """The setting of a sound run that differs from this one by one axis, the nearest value first, another method last; '' if none."""
    found = []
    for other in others:
        keys = ["variant" if k == "method" else k for k in axes]  # a run's `method` is its family
        differ = [k for k in keys if k in run.values and not same(run.values[k], other.values.get(k))]
        if other.verdict.level == "sound" and len(differ) == 1:
            key = differ[0]
            found.append((key == "variant", _distance(run.values[key], other.values[key]), f"{'method' if key == 'variant' else key} = {other.values[key]}"))
    return min(found)[2] if found else ""


def judge_study(study):
    """Gives each run of a study with cases its `verdict`, and rows (`verdict`, norm) that targets can ask for."""
    cases = {case.name: case for case in study.spec.cases}
    for run in study.runs:
        case = cases.get(run.values.get("case"))
        run.verdict = judge_run(run, case.bounds if case else [])
        if case and case.condition:
            run.verdict.silent = run.verdict.warned = False
    by_case = {}
    for run in study.runs:
        by_case.setdefault(run.values.get("case"), []).append(run)
    for name, runs in by_case.items():
        axes = cases[name].axis_keys if name in cases else []
        for run in runs:
            verdict = run.verdict
            if verdict.level != "sound" and not verdict.held:
                verdict.held = nearest_sound(run, runs, axes)
            run.rows.update({("verdict", "level"): float(verdict.rank), ("verdict", "silent"): float(verdict.silent),
                             ("verdict", "warned"): float(verdict.warned)})
