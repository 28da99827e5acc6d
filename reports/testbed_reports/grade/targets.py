"""Expectations of a study, judged against its runs."""
import math
from dataclasses import dataclass, replace

import numpy as np

from . import metrics
from .convergence import fit_order
from .dataset import groups

NOT_CONVERGING_ORDER = 0.5


@dataclass
class Verdict:
    """`verdict` is 'pass', 'fail', 'known' (fails, and the study says why) or 'not run'; `note` says why when it is not plain."""
    label: str
    asked: str
    measured: str
    verdict: str
    note: str = ""
    source: str = ""


def number(value, digits=3):
    """So many significant digits."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "n/a"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    if 1e-3 <= abs(value) < 1e4:
        rounded = float(f"{value:.{digits - 1}e}")
        return f"{rounded:.{max(0, digits - 1 - math.floor(math.log10(abs(rounded))))}f}"
    return f"{value:.{digits - 1}e}"


def graded(study):
    """(quantity, norm) that the study's targets ask for, or, without targets, its figures."""
    asked = study.spec.targets or [f for f in study.spec.figures if "quantity" in f]
    return list(dict.fromkeys((entry["quantity"], entry.get("norm", "")) for entry in asked))


def digits_of(quantity, norm):
    """Errors are read to three digits; a ratio near one or two needs five."""
    return 3 if metrics.is_error(quantity, norm) else 5


def asked(target):
    """The target in words."""
    kind, what = target["kind"], " ".join(filter(None, (target["quantity"], target.get("norm", ""))))
    where = ", ".join(f"{key} = {' | '.join(map(str, value)) if isinstance(value, list) else value}"
                      for key, value in target.get("where", {}).items())
    sizes = ""
    if "L_from" in target or "L_to" in target:
        sizes = f" for L {target.get('L_from', '...')} to {target.get('L_to', '...')}"
    text = {"value_max": lambda: f"{what} ≤ {target['value']:g}",
            "value_min": lambda: f"{what} ≥ {target['value']:g}",
            "value_between": lambda: f"{target['low']:g} ≤ {what} ≤ {target['high']:g}",
            "exponent_max": lambda: f"exponent of {what} ≤ {target['value']:g}",
            "exponent_between": lambda: f"{target['low']:g} ≤ exponent of {what} ≤ {target['high']:g}",
            "order_min": lambda: f"order of {what} ≥ {target['value']:g}",
            "order_between": lambda: f"{target['low']:g} ≤ order of {what} ≤ {target['high']:g}",
            "not_converging": lambda: f"order of {what} < {NOT_CONVERGING_ORDER} on the finer half of L"}[kind]()
    return text + sizes + (f" ({where})" if where else "")


def in_sizes(run, target):
    """Whether the run's cell size lies in L_from..L_to, given in either order."""
    ends = [target[k] for k in ("L_from", "L_to") if k in target]
    if not ends:
        return True
    size = run.values.get("L")
    if not isinstance(size, (int, float)):
        return False
    if len(ends) == 2:
        return min(ends) * (1 - 1e-9) <= size <= max(ends) * (1 + 1e-9)
    return size <= ends[0] * (1 + 1e-9) if "L_from" in target else size >= ends[0] * (1 - 1e-9)


def mean_by_size(runs, quantity, norm):
    """(L, mean, lost): sorted cell sizes (K,), mean of the metric over completed runs (nan where there is none), and
    the runs that gave no number."""
    by_size, lost = {}, []
    for run in runs:
        value = run.value(quantity, norm)
        by_size.setdefault(run.values.get("L"), [])
        if math.isfinite(value):
            by_size[run.values.get("L")].append(value)
        else:
            lost.append(run)
    sizes = sorted(s for s in by_size if isinstance(s, (int, float)))
    means = [float(np.mean(by_size[s])) if by_size[s] else math.nan for s in sizes]
    return np.array(sizes, float), np.array(means, float), lost


def values_by_size(runs, quantity, norm):
    """(L (K,), metric (K,)): one pair for each run that gave a number."""
    pairs = [(run.values.get("L"), run.value(quantity, norm)) for run in runs]
    pairs = [(size, value) for size, value in pairs if isinstance(size, (int, float)) and math.isfinite(value)]
    return np.array(pairs, float).reshape(-1, 2).T


def _told(run):
    if run.result is None:
        return f"{run.id} {run.status}"
    size = run.values.get("L")
    at = f" at L = {size:g}" if isinstance(size, (int, float)) else ""
    return f"{run.name} {run.status}{at}"


def _judge_value(target, runs, quantity, norm):
    values = [run.value(quantity, norm) if run.completed or quantity == "verdict" else math.nan for run in runs]
    low = target.get("low", target["value"] if target["kind"] == "value_min" else -math.inf)
    high = target.get("high", target["value"] if target["kind"] == "value_max" else math.inf)
    lost = [run for run, v in zip(runs, values) if not math.isfinite(v)]
    good = [v for v in values if math.isfinite(v)]
    digits = digits_of(quantity, norm)
    if not good:
        measured = "n/a"
    elif len(good) == 1 or math.isclose(min(good), max(good), rel_tol=1e-6):
        measured = number(good[0], digits)
    else:
        ends = [number(v, digits) for v in (min(good), max(good))]
        measured = " to ".join(dict.fromkeys(ends))
    if lost:
        return measured, "fail", "no number: " + ", ".join(_why(run, quantity, norm) for run in lost)
    return measured, "pass" if all(low <= v <= high for v in good) else "fail", ""


def _why(run, quantity, norm):
    if run.completed:
        return f"{run.name} has no {quantity} {norm}".rstrip()
    return _told(run)


def _judge_order(target, runs, quantity, norm):
    measured, verdicts, notes = [], [], []
    series = groups(runs)
    for name, own in series.items():
        sizes, means, lost = mean_by_size(own, quantity, norm)
        prefix = f"{name}: " if len(series) > 1 else ""
        if target["kind"] == "not_converging":
            keep = sizes <= np.median(sizes) * (1 + 1e-9) if len(sizes) > 2 else np.ones(len(sizes), bool)
            unfinished = [r for r in lost if r.completed or r.status not in ("diverged",)]
            if unfinished or not np.isfinite(means).any():
                verdicts.append("fail")
                measured.append(f"{prefix}n/a")
                notes.append("no number: " + ", ".join(_why(r, quantity, norm) for r in lost))
                continue
            gone = [r for r in lost if r.values.get("L") in sizes[keep]]
            if gone:
                verdicts.append("pass")
                measured.append(f"{prefix}diverged")
                notes.append(", ".join(_told(r) for r in gone))
                continue
            fit = fit_order(sizes[keep], means[keep])
            verdicts.append("pass" if fit.order < NOT_CONVERGING_ORDER else "fail")
        else:
            exponent = target["kind"].startswith("exponent")  # of every run, not of means
            fit = fit_order(*(values_by_size(own, quantity, norm) if exponent else (sizes, means)))
            at_most = target["kind"] == "exponent_max"
            low = target.get("low", -math.inf if at_most else target.get("value", -math.inf))
            high = target.get("high", target["value"] if at_most else math.inf)
            verdicts.append("pass" if low <= fit.order <= high and not lost else "fail")
            if lost:
                notes.append("no number: " + ", ".join(_why(r, quantity, norm) for r in lost))
        if not math.isfinite(fit.order):
            verdicts[-1] = "fail"
            notes.append("fewer than two cell sizes with a number")
        measured.append(f"{prefix}{fit}")
    return "; ".join(measured), "pass" if all(v == "pass" for v in verdicts) else "fail", "; ".join(notes)


def judge(target, study):
    """The verdict on one target."""
    quantity, norm = target["quantity"], target.get("norm", "")
    runs = [run for run in study.select(target.get("where", {})) if in_sizes(run, target)]
    base = {"label": target["label"], "asked": asked(target), "source": target.get("source", "")}
    if not runs:
        left_out = study.left_out_of(target.get("where", {}))
        if left_out:
            return Verdict(**base, measured="n/a", verdict="not run", note=left_out[0].get("reason", "left out"))
        return Verdict(**base, measured="n/a", verdict="fail", note="no run")
    order = target["kind"].startswith(("order", "exponent")) or target["kind"] == "not_converging"
    measured, verdict, note = (_judge_order if order else _judge_value)(target, runs, quantity, norm)
    ratios = [run.value("static", "kinetic_over_strain") for run in runs]
    ratios = [r for r in ratios if math.isfinite(r)]
    if ratios and quantity != "static":  # a static number never stands without it
        note = "; ".join(filter(None, (note, f"kinetic/strain energy ≤ {number(max(ratios))}")))
    if doubtful := sum(run.suspect for run in runs):
        note = "; ".join(filter(None, (note, f"{doubtful} of {len(runs)} runs suspect")))
    return _with_known(target, Verdict(**base, measured=measured, verdict=verdict, note=note))


def _with_known(target, verdict):
    """A failure that the study knows of is no surprise; that it has gone is one."""
    if "known" not in target:
        return verdict
    if verdict.verdict == "pass":
        return replace(verdict, verdict="fail", note="; ".join(filter(None, ("passes, although `known` says that it fails", verdict.note))))
    return replace(verdict, verdict="known", note="; ".join(filter(None, (target["known"], verdict.note))))


def judge_all(study):
    return [judge(target, study) for target in study.spec.targets]


def as_text(verdicts):
    """An aligned table for a terminal."""
    rows = [("target", "asked", "measured", "verdict", "note")]
    rows += [(v.label, v.asked, v.measured, v.verdict, v.note) for v in verdicts]
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    return "\n".join("  ".join([c.ljust(w) for c, w in zip(row, widths)] + [row[4]]).rstrip() for row in rows)
