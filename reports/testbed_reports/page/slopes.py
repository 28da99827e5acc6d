"""Questions for orders and exponents: those that targets ask, of every method."""
import math

from ..grade import metrics
from ..grade.dataset import groups
from ..grade.numbers import Number, taken
from ..grade.targets import in_sizes
from .names import table_anchor
from .question import BY_METHOD, Question, about_of, by_variant, is_whole, marks

NEAR = 0.05  # orders that differ by less are alike


def _range(target):
    """' for L 0.5 to 2' of a target that is restricted to some sizes."""
    ends = [f"{target[k]:g}" if k in target else "..." for k in ("L_from", "L_to")]
    return f" for L {' to '.join(ends)}" if {"L_from", "L_to"} & set(target) else ""


def _cell(study, kind, runs, quantity, norm):
    """What a method answers: the slope or, of several settings, those of each; 'exact' where all errors are of rounding."""
    values, used = [], []
    for own in (groups(runs).values() if kind == "order" else [runs]):
        found, lost = taken(kind, own, quantity, norm)
        values += found
        used += [run for run in own if found and not any(run is other for other in lost)]
    sizes = [abs(v) for run in runs if math.isfinite(v := run.value(quantity, norm))]
    if kind == "order" and sizes and max(sizes) <= metrics.ROUNDING:
        return "exact" + marks(runs, [run for run in runs if math.isfinite(run.value(quantity, norm))])
    if not values:
        return next((run.status for run in runs if not run.completed), "n/a")
    text = " to ".join(dict.fromkeys(f"{v:.2f}" for v in (min(values), max(values))))
    return Number(text + marks(runs, used), tuple(sorted({min(values), max(values)})), study.name, quantity, norm, kind, [run.id for run in used])


def _best(cells):
    """The exact ones, else those whose orders, the lowest and the highest of their settings, are near those of the method whose lowest is the highest.
    A method that lost a run, or has a suspect one, is none."""
    exact = [v for v, cell in cells.items() if cell == "exact"]
    ends = {v: (cell.values[0], cell.values[-1]) for v, cell in cells.items() if isinstance(cell, Number) and is_whole(cell)}
    top = max(ends.values(), default=None)
    return exact or [v for v, own in ends.items() if all(a >= b - NEAR for a, b in zip(own, top))]


def slopes_of(study):
    """The questions, once each."""
    found = {}
    for target in study.spec.targets:
        kind = "exponent" if target["kind"].startswith("exponent") else "order"
        if kind == "order" and not (target["kind"].startswith("order") or target["kind"] == "not_converging"):
            continue
        quantity, norm = target["quantity"], target.get("norm", "")
        where = {k: v for k, v in target["where"].items() if k not in BY_METHOD}
        key = (kind, quantity, norm, str(where), target.get("L_from"), target.get("L_to"))
        what = about_of(study, where, quantity, norm) + _range(target)
        question = Question(f"{'Exponent of L' if kind == 'exponent' else 'Order'}: {what}", what, kind,
                            table_anchor(study, f"power_law_{quantity}" if kind == "exponent" else f"{quantity}_{norm}".strip("_")))
        for variant, runs in by_variant(study.select(where)).items():
            runs = [run for run in runs if in_sizes(run, target)]
            if len({run.values.get("L") for run in runs}) > 1:
                question.cells[variant] = _cell(study, kind, runs, quantity, norm)
        if kind == "order":
            question.best = _best(question.cells)
        if question.cells:
            found[key] = question
    return list(found.values())
