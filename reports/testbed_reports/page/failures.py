"""Classes of failure of a study with cases: two sentences, a picture of the worst run, the cheapest remedy with its cost."""
import math
import statistics
from dataclasses import dataclass, replace

from ..draw.drawing import FigureError
from ..draw.maps import field_maps
from ..draw.table import Table
from ..grade.targets import number
from ..read.results import ResultError


@dataclass
class RemedyCost:
    """One remedy: (sound, all) of its runs without and with it; `time`, `memory`: its cost as a ratio, nan when not known."""
    label: str
    failure: str
    without: tuple
    with_it: tuple
    time: float
    memory: float

    @property
    def holds(self):
        return self.with_it[1] > 0 and self.with_it[0] == self.with_it[1]


def _sound(runs):
    return sum(r.verdict.level == "sound" for r in runs), len(runs)


def _pace(run):
    """Time to solve a second of the scene [s/s]: also of a run that ended early."""
    try:
        return float(run.result.performance["solve_s"]) / float(run.result.history("time")[-1])
    except (AttributeError, KeyError, IndexError, ResultError, ZeroDivisionError, TypeError):
        return math.nan


def _memory(run):
    return float(run.result.performance.get("bytes_per_point", math.nan)) if run.result else math.nan


def _ratio(measure, with_it, without):
    ends = [[v for v in map(measure, runs) if math.isfinite(v) and v > 0] for runs in (with_it, without)]
    return statistics.median(ends[0]) / statistics.median(ends[1]) if all(ends) else math.nan


def costs(study):
    """The costs of all [[remedy]] tables."""
    found = []
    for entry in study.spec.remedies:
        without, with_it = study.select(entry["without"]), study.select(entry["with"])
        found.append(RemedyCost(entry["label"], entry["failure"], _sound(without), _sound(with_it), _ratio(_pace, with_it, without),
                                _ratio(_memory, with_it, without)))
    return found


def cost_table(study):
    """Remedies with their cost beside them; None when the study has none."""
    titles = {f["name"]: f["title"] for f in study.spec.failures}
    rows = [[titles[c.failure], c.label, f"{c.without[0]}/{c.without[1]}", f"{c.with_it[0]}/{c.with_it[1]}", number(c.time), number(c.memory)]
            for c in costs(study)]
    return Table("remedies", "Remedies and what they cost",
                 ["failure", "remedy", "sound without", "sound with", "time, with / without", "memory, with / without"], rows, 2,
                 ["Time: medians of the solve time of one second of the scene. The runs are small and may share the machine: read "
                  "ratios within a fifth of 1 as no cost."]) if rows else None


def cheapest(found, failure):
    """What to do about a class of failure, in one sentence."""
    own = [c for c in found if c.failure == failure and c.without[1] and c.with_it[1]]
    if own and all(c.without[0] == c.without[1] for c in own):
        return "not needed by the runs of this study, which are sound without."
    own = [c for c in own if c.without[0] < c.without[1]]
    good = sorted((c for c in own if c.holds), key=lambda c: c.time if math.isfinite(c.time) else math.inf)
    if good:
        c = good[0]
        return f"{c.label}: {c.with_it[0]} of {c.with_it[1]} runs sound instead of {c.without[0]} of {c.without[1]}, at {number(c.time)} times the time."
    if own:
        c = max(own, key=lambda c: c.with_it[0] / max(1, c.with_it[1]))
        return f"none tried here cures all of it; the best, {c.label}, leaves {c.with_it[1] - c.with_it[0]} of {c.with_it[1]} runs unsound."
    return "none tried here."


def worst_run(study, where):
    """The run of a class whose picture is shown: the worst one that has a snapshot, of the case named first; None when all are sound."""
    cases = where.get("case", [])
    cases = cases if isinstance(cases, list) else [cases]
    place = {name: -k for k, name in enumerate(cases)}
    bad = [r for r in study.select(where) if r.verdict.rank > 0 and r.result is not None and r.result.snapshots]
    return max(bad, key=lambda r: (place.get(r.values.get("case"), 0), r.verdict.silent, r.verdict.rank, -r.verdict.time if math.isfinite(r.verdict.time) else -math.inf),
               default=None)


def classes(study, style):
    """[(failure table, run or None, drawing or None, what went wrong with it, remedy)] for the page."""
    found, sections = costs(study), []
    for entry in study.spec.failures:
        run, drawing, error = worst_run(study, entry["where"]), None, ""
        if run is not None:
            alone = replace(study, runs=[run])
            shown = {"kind": "field", "where": {}, "series": ["variant"], "error": False, "width": "column", "unfinished": True,
                     **{k: entry[k] for k in ("component", "snapshot", "range") if k in entry}}
            try:
                drawing = field_maps(alone, shown, style)
            except (FigureError, ResultError, ValueError) as problem:
                error = str(problem)
        affected = sum(r.verdict.rank > 0 for r in study.select(entry["where"]))
        sections.append((entry, run, drawing, error, cheapest(found, entry["name"]), affected))
    return sections
