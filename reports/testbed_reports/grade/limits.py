"""Limits that the searches of a study found, beside those that the solver states."""
import math
from dataclasses import dataclass, field

from ..read.bisection import bracket

STEP_KEYS = ("time.cfl", "time.dt")  # settings of the time step: compared as dt


@dataclass
class Limit:
    """One search: the runs at both ends of the last bracket, None while it is not closed. `measured`: (low, high) of the searched
    value; for a time step `stated` is the solver's own limit over c_p/L like `step`, the bracket of dt c_p / L, and `sharp` that of the
    points as they stand, where the runs know it."""
    case: str
    key: str
    axes: dict
    runs: list = field(default_factory=list)
    below: object = None
    above: object = None
    measured: tuple = (math.nan, math.nan)
    step: tuple = (math.nan, math.nan)
    stated: float = math.nan
    sharp: float = math.nan
    verdict: str = ""

    @property
    def ratio(self):
        """Measured over stated, the middle of the bracket."""
        return sum(self.step) / 2 / self.stated

    @property
    def sharp_ratio(self):
        """Measured over sharp, the middle of the bracket."""
        return sum(self.step) / 2 / self.sharp


def _courant(run, name):
    """A step of the run in units of L / c_p."""
    try:
        dt = float(run.result.performance[name])
        soil = next(m for m in run.result.materials.values() if m.get("constrained_modulus", 0) > 0)
        return dt * math.sqrt(soil["constrained_modulus"] / soil["density"]) / run.result.cell_size
    except (AttributeError, KeyError, StopIteration, TypeError, ValueError):
        return math.nan


def _known_courant(runs, name):
    """Of the first run that knows it."""
    return next((dt for dt in (_courant(run, name) for run in runs) if math.isfinite(dt)), math.nan)


def _close(limit, search):
    held = {}
    for run in limit.runs:
        value = float(run.values[search.key])
        held[value] = held.get(value, True) and search.holds(run.verdict.level)
    found = bracket(search, held)
    if found is None:
        ends = {held.get(search.low), held.get(search.high)}
        limit.verdict = "not searched to the end" if None in ends else \
            f"{search.until} at both ends" if ends == {True} else f"not {search.until} at either end"
        return
    limit.measured = found
    low, high = ([r for r in limit.runs if float(r.values[search.key]) == v] for v in found)
    limit.below = max(low, key=lambda r: r.verdict.rank)
    limit.above = max(high, key=lambda r: r.verdict.rank)
    if search.key in STEP_KEYS:
        limit.step = (_courant(limit.below, "dt"), _courant(limit.above, "dt"))
        limit.stated, limit.sharp = (_known_courant((limit.below, limit.above), name) for name in ("dt_critical", "dt_sharp"))


def find_limits(study):
    """The limits of all searches of a study whose runs have verdicts; marks the runs at the last bracket by `bracket` = 'below'
    or 'above', and gives those below rows (`limit`, norm) that targets can ask for."""
    searches = {(c.case, c.bisection.key): c.bisection for c in study.spec.combinations if c.bisection}
    keys = dict(searches)
    found = {}
    for run in study.runs:
        key = next((k for case, k in keys if case == run.values.get("case")), None)
        if run.search and key in run.values:
            axes = {k: v for k, v in run.values.items() if k in study.case(run.values["case"]).axis_keys and k != key}
            found.setdefault(run.search, Limit(run.values["case"], key, axes)).runs.append(run)
    for limit in found.values():
        _close(limit, searches[limit.case, limit.key])
        if limit.below is None:
            continue
        limit.below.values["bracket"], limit.above.values["bracket"] = "below", "above"
        limit.below.rows["limit", "measured"] = limit.measured[0]
        for name in ("ratio", "sharp_ratio"):
            if math.isfinite(getattr(limit, name)):
                limit.below.rows["limit", name] = getattr(limit, name)
    return list(found.values())
