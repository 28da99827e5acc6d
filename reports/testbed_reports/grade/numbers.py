"""Numbers in words: taken from the runs of a study, with what is needed to find them again in metrics.csv."""
import math
import statistics
from dataclasses import dataclass, field, replace

import numpy as np

from ..read.results import FINISHED
from .convergence import fit_order
from .partners import NO_SETTING, ratio
from .targets import mean_by_size, number, values_by_size


@dataclass
class Number:
    """`text` as it is read; `values`: the number, or both ends of a range. `take` says what was made of the metric (`quantity`, `norm`) of
    the `runs` that gave it, and of `over` where it is a ratio; then times `scale`, plus `offset`. `missing`: why it is none, or not all of it."""
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
    failed: bool = False  # what is missing did not complete: no evidence is lacking
    left_out: bool = False  # its method is not built
    suspect: int = 0  # so many of its runs are suspect

    def __str__(self):
        return self.text


TAKEN = {"mean": statistics.fmean, "median": statistics.median, "min": min, "max": max}


def value_of(run, quantity, norm):
    """The metric; of a run that did not complete only its verdict."""
    return run.value(quantity, norm) if run.completed or quantity == "verdict" else math.nan


def taken(take, runs, quantity, norm):
    """(values, runs without a number): of each run, or the one number made of all."""
    values = [value_of(run, quantity, norm) for run in runs]
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


def mean_of_seeds(pairs, digits):
    """'mean ± standard deviation (n seeds)' of (seed, value), repeats of a seed taken together; '' of less than two seeds."""
    by_seed = {}
    for seed, value in pairs:
        if math.isfinite(value):
            by_seed.setdefault(str(seed), []).append(value)
    means, seeds = [statistics.fmean(values) for values in by_seed.values()], len({str(seed) for seed, _ in pairs})
    if len(means) < 2:
        return ""
    of = f"{len(means)} of {seeds}" if len(means) < seeds else f"{seeds}"
    return f"{number(statistics.fmean(means), digits)} ± {number(statistics.stdev(means), 2)} ({of} seeds)"


def _of_seeds(runs, quantity, norm, entry):
    """'mean ± standard deviation (n seeds)' of runs that differ by their seeds alone; '' for others."""
    settings = {tuple((k, str(v)) for k, v in run.values.items() if k not in NO_SETTING and not k.endswith(".seed")) for run in runs}
    seeds = {str(run.values.get("seed", "")) for run in runs}
    if len(settings) > 1 or len(seeds) < 2:
        return ""
    return mean_of_seeds([(run.values.get("seed", ""), value_of(run, quantity, norm) * entry["scale"] + entry["offset"]) for run in runs], entry["digits"])


def told(runs, words):
    """The first of some runs by name, each with words(run)."""
    return ", ".join(f"{run.id} {words(run)}".rstrip() for run in runs[:3]) + (f" and {len(runs) - 3} more" if len(runs) > 3 else "")


def number_of(study, entry):
    """The number that a [[number]] or a [[claim.test]] asks for; where it cannot be made, or not of all its runs, `missing` says why."""
    quantity, norm, take, scale, offset = (entry[k] for k in ("quantity", "norm", "take", "scale", "offset"))
    below_where = {**entry["where"], **entry.get("over", {})}
    runs, below = study.select(entry["where"]), study.select(below_where) if "over" in entry else []
    found = Number("?", (), study.name, quantity, norm, "each over its partner" if take == "every" and "over" in entry else take, [r.id for r in runs], [r.id for r in below], scale, offset)
    what = f"{quantity} {norm}".rstrip()
    for chosen, where in ((runs, entry["where"]), *([(below, below_where)] if "over" in entry else [])):
        if not chosen:
            return replace(found, left_out=bool(study.left_out_of(where)), missing=f"no run to take {what} from: 'where' chooses none")
    if "over" in entry:
        made = ratio(take, runs, below, lambda run: value_of(run, quantity, norm), lambda side: taken(take, side, quantity, norm)[0], entry["over"])
        values, lost, alone, zero, runs, below = made.values, made.lost, made.alone, made.zero, made.runs, made.below
    else:
        (values, lost), alone, zero = taken(take, runs, quantity, norm), [], []
        runs = [run for run in runs if not any(run is other for other in lost)]
    missing = [f"no {what} of {told(lost, lambda run: run.label if not run.completed else 'has none')}"] if lost else []
    missing += [f"no partner at the settings of {told(alone, lambda run: '')}"] if alone else []
    missing += [f"nothing to divide {told(zero, lambda run: '')} by: zero"] if zero else []
    failed = len(lost) > 0 and not alone and all(run.status in FINISHED and not run.completed for run in lost)
    if not values:
        return replace(found, failed=failed, missing="; ".join(missing) or f"no {what}")
    values = [v * scale + offset for v in values]
    text = _of_seeds(study.select(entry["where"]), quantity, norm, entry) if take == "every" and "over" not in entry else ""
    return replace(found, text=text or _text(values, entry["digits"]), values=tuple(sorted({min(values), max(values)})), failed=failed, missing="; ".join(missing),
                   runs=[r.id for r in runs], over=[r.id for r in below], suspect=sum(run.suspect for run in runs + below))


def numbers_of(study):
    """{name: Number} of the study's [[number]]s."""
    return {name: number_of(study, entry) for name, entry in study.spec.numbers.items()}
