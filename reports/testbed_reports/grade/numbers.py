"""Numbers in words: taken from the runs of a study, with what is needed to find them again in metrics.csv."""
import math
import statistics
from dataclasses import dataclass, field, replace

import numpy as np

from ..read.results import FINISHED
from ..read.study_file import same
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
    failed: bool = False  # what is missing did not complete: no evidence is lacking
    left_out: bool = False  # its method is not built
    suspect: int = 0  # so many of its runs are suspect

    def __str__(self):
        return self.text


TAKEN = {"mean": statistics.fmean, "median": statistics.median, "min": min, "max": max}
NO_SETTING = ("repeat", "dt", "seed")


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


def ratios(take, runs, below, quantity, norm, changed):
    """The same over that of the runs `below`; of each run over the mean of those that share its setting, as far as these have several
    beside the keys that are `changed`."""
    if take != "every":
        (top, lost), (base, lost_below) = taken(take, runs, quantity, norm), taken(take, below, quantity, norm)
        return [v / base[0] for v in top] if base and base[0] else [], lost + lost_below
    keys = [k for k in dict.fromkeys(k for run in below for k in run.values) if k not in (*NO_SETTING, *changed, "variant", "method", "ppc") and len({str(run.values.get(k)) for run in below}) > 1]
    found, lost = [], [run for run in runs + below if not math.isfinite(value_of(run, quantity, norm))]
    for run in runs:
        pair = [value_of(b, quantity, norm) for b in below if all(same(b.values.get(k), run.values.get(k)) for k in keys)]
        pair = [v for v in pair if math.isfinite(v)]
        if math.isfinite(value_of(run, quantity, norm)) and pair and statistics.fmean(pair):
            found.append(value_of(run, quantity, norm) / statistics.fmean(pair))
    return found, list({id(run): run for run in lost}.values())


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


def _of_seeds(runs, values, digits):
    """'mean ± standard deviation (n seeds)' of runs that differ by their seeds alone; '' for others."""
    settings = {tuple((k, str(v)) for k, v in run.values.items() if k not in NO_SETTING and not k.endswith(".seed")) for run in runs}
    seeds = {str(run.values.get("seed", "")) for run in runs}
    if len(settings) > 1 or len(seeds) < 2:
        return ""
    return mean_of_seeds([(run.values.get("seed", ""), value) for run, value in zip(runs, values)], digits)


def number_of(study, entry):
    """The number that a [[number]] or a [[claim.test]] asks for; where it cannot be made, or not of all its runs, `missing` says why."""
    quantity, norm, take, scale, offset = (entry[k] for k in ("quantity", "norm", "take", "scale", "offset"))
    below_where = {**entry["where"], **entry.get("over", {})}
    runs, below = study.select(entry["where"]), study.select(below_where) if "over" in entry else []
    found = Number("?", (), study.name, quantity, norm, "each over its partner" if take == "every" and "over" in entry else take, [r.id for r in runs], [r.id for r in below], scale, offset,
                   suspect=sum(run.suspect for run in runs + below))
    what = f"{quantity} {norm}".rstrip()
    for chosen, where in ((runs, entry["where"]), *([(below, below_where)] if "over" in entry else [])):
        if not chosen:
            return replace(found, left_out=bool(study.left_out_of(where)), missing=f"no run to take {what} from: 'where' chooses none")
    values, lost = ratios(take, runs, below, quantity, norm, entry["over"]) if "over" in entry else taken(take, runs, quantity, norm)
    failed = [run for run in lost if run.status in FINISHED and not run.completed]
    told = ", ".join(f"{run.id} {run.label if not run.completed else 'has none'}" for run in lost[:3]) + (f" and {len(lost) - 3} more" if len(lost) > 3 else "")
    if not values:
        return replace(found, failed=bool(failed) and len(failed) == len(lost), missing=f"no {what}" + (f": {told}" if told else ""))
    values = [v * scale + offset for v in values]
    text = _of_seeds(runs, [value_of(run, quantity, norm) * scale + offset for run in runs], entry["digits"]) if take == "every" and "over" not in entry else ""
    return replace(found, text=text or _text(values, entry["digits"]), values=tuple(sorted({min(values), max(values)})), failed=len(failed) == len(lost) > 0,
                   missing=f"no {what} of {told}" if lost else "")


def numbers_of(study):
    """{name: Number} of the study's [[number]]s."""
    return {name: number_of(study, entry) for name, entry in study.spec.numbers.items()}
