"""Numbers in words: taken from the runs of a study, with what is needed to find them again in metrics.csv."""
import math
import statistics
from dataclasses import dataclass, field, replace

import numpy as np

from .convergence import fit_order
from .targets import mean_by_size, number, values_by_size


@dataclass
class Number:
    """`text` as it is read; `values`: the number, or both ends of a range. `take` says what was made of the metric (`quantity`, `norm`) of
    `runs`, and of `over` where it is a ratio; then times `scale`, plus `offset`. `missing`: why it is none, or not all of it."""
    text: str
    values: tuple
    study: str
    quantity: str
    norm: str = ""
    take: str = "every"
    runs: list = field(default_factory=list)
    over: list = field(default_factory=list)
    scale: float = 1
    offset: float = 0
    missing: str = ""

    def __str__(self):
        return self.text


TAKEN = {"mean": statistics.fmean, "median": statistics.median, "min": min, "max": max}


def taken(take, runs, quantity, norm):
    """(values, runs without a number): of each run, or the one number made of all."""
    values = [run.value(quantity, norm) for run in runs]
    lost, good = [run for run, v in zip(runs, values) if not math.isfinite(v)], [v for v in values if math.isfinite(v)]
    if not good or take == "every":
        return good, lost
    if take in TAKEN:
        return [TAKEN[take](good)], lost
    sizes, means = values_by_size(runs, quantity, norm) if take == "exponent" else mean_by_size(runs, quantity, norm)[:2]
    order = fit_order(sizes, np.abs(means)).order
    return ([order] if math.isfinite(order) else []), lost


def _text(values, digits):
    low, high = (number(v, digits) for v in (min(values), max(values)))
    return low if low == high else f"{low} to {high}"


def number_of(study, entry):
    """The number that a [[number]] or a [[claim.test]] asks for; where it cannot be made, `missing` says why and the text is '?'."""
    quantity, norm, take, scale, offset = (entry[k] for k in ("quantity", "norm", "take", "scale", "offset"))
    runs, below = study.select(entry["where"]), study.select({**entry["where"], **entry["over"]}) if "over" in entry else []
    found = Number("?", (), study.name, quantity, norm, take, [r.id for r in runs], [r.id for r in below], scale, offset)
    what = f"{quantity} {norm}".rstrip()
    if not runs or ("over" in entry and not below):
        return replace(found, missing=f"no run to take {what} from")
    values, lost = taken(take, runs, quantity, norm)
    if "over" in entry:
        base, lost_below = taken("mean" if take == "every" else take, below, quantity, norm)
        lost = lost + lost_below
        values = [v / base[0] for v in values] if base and base[0] else []
    if not values:
        first = lost[0] if lost else None
        return replace(found, missing=f"no {what}" + (f": {first.name} {first.label}" if first and not first.completed else ""))
    values = [v * scale + offset for v in values]
    return replace(found, text=_text(values, entry["digits"]), values=tuple(sorted({min(values), max(values)})),
                   missing=f"{len(lost)} of {len(runs) + len(below)} runs have no {what}" if lost else "")


def numbers_of(study):
    """{name: Number} of the study's [[number]]s."""
    return {name: number_of(study, entry) for name, entry in study.spec.numbers.items()}
