"""Ratios of runs to those at the same settings: which runs are partners, and which have none."""
import math
import statistics
from dataclasses import dataclass, field

from ..read.study_file import same

NO_SETTING = ("repeat", "dt", "seed")
OTHER_NAMES = {"grid.cell_size": "L", "scene": "case", "method": "variant"}  # axes that a column stands for
COLUMNS = {"L", "ppc", "case", "seed", "dt", *OTHER_NAMES} - {"method"}  # that follow from axes: with one of them these change, too
FAMILIES = ("lpfdm", "mpm", "fem")  # tables of a scene that belong to one method


def _keys(runs, below, changed):
    """What must be equal in two partners beside the variant."""
    named = {*changed, *(OTHER_NAMES.get(k) for k in changed)}
    found = []
    for key in dict.fromkeys(k for run in runs + below for k in run.values):
        if key in (*NO_SETTING, *OTHER_NAMES, *named, "variant", "ppc"):
            continue
        tops, bases = ({str(run.values[key]) for run in side if key in run.values} for side in (runs, below))
        if COLUMNS & named:
            asked = len(bases) > 1
        else:  # options of one method alone belong to it
            asked = len(tops | bases) > 1 and (bool(tops & bases) or key.split(".")[0] not in FAMILIES)
        found += [key] if asked else []
    return found


def _method(run):
    """The variant without the options that it was given."""
    return str(run.values.get("variant", "")).split("[")[0]


def partners(runs, below, changed):
    """[(run, those of `below` at its settings)]; `changed`: the keys in which they are meant to differ."""
    keys = _keys(runs, below, changed)
    own = not {"variant", "method"} & set(changed)
    return [(run, [b for b in below if all(same(b.values.get(k), run.values.get(k)) for k in keys) and (not own or _method(b) == _method(run))]) for run in runs]


@dataclass
class Ratio:
    """`values` of the `runs` that are used over `below`; `lost`: runs without a number; `alone`: without a partner at their settings;
    `zero`: whose partners are zero."""
    values: list
    runs: list
    below: list
    lost: list = field(default_factory=list)
    alone: list = field(default_factory=list)
    zero: list = field(default_factory=list)


def _union(groups):
    return list({id(run): run for group in groups for run in group}.values())


def ratio(take, runs, below, value, taken, changed):
    """The Ratio of `runs` to `below`: where `take` is "every", of each run over the mean of its partners, else taken(runs) over
    taken(partners), of the settings that both have. `value`: a run's number."""
    pairs = partners(runs, below, changed)
    met = _union(own for _, own in pairs)
    alone = [run for run, own in pairs if not own] + [b for b in below if not any(b is m for m in met)]
    lost = [run for run in _union([runs, below]) if not math.isfinite(value(run)) and not any(run is a for a in alone)]
    whole = [(run, [b for b in own if math.isfinite(value(b))]) for run, own in pairs if math.isfinite(value(run))]
    whole = [(run, own) for run, own in whole if own]
    zero = [run for run, own in whole if take == "every" and not statistics.fmean(map(value, own))]
    whole = [(run, own) for run, own in whole if not any(run is z for z in zero)]
    top, base = [run for run, _ in whole], _union(own for _, own in whole)
    if take == "every":
        values = [value(run) / statistics.fmean(map(value, own)) for run, own in whole]
    else:
        above, under = (taken(side) if side else [] for side in (top, base))
        values = [v / under[0] for v in above] if under and under[0] else []
    return Ratio(values, top, base, lost, alone, zero)
