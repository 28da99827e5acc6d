"""The tables of a study."""
import math
import statistics
from dataclasses import replace

import numpy as np

from ..draw.drawing import name_of
from ..draw.table import Table
from ..draw.work_precision import is_busy, reach
from ..grade import metrics
from ..grade.convergence import fit_order, fit_power, pairwise_orders
from ..grade.dataset import groups
from ..grade.numbers import mean_of_seeds
from ..grade.targets import digits_of, graded, mean_by_size, number, values_by_size


def _range(values, digits=3):
    """'median [min-max]' of finite values."""
    values = [v for v in values if isinstance(v, (int, float)) and math.isfinite(v)]
    if not values:
        return "n/a"
    middle = number(statistics.median(values), digits)
    return middle if min(values) == max(values) else f"{middle} [{number(min(values), digits)}–{number(max(values), digits)}]"


def told(runs, key):
    """The metric `key` of some runs in words: 'mean ± standard deviation (n)' over seeds, else the median of repeats and their range."""
    return mean_of_seeds([(run.values.get("seed", ""), run.value(*key)) for run in runs], digits_of(*key)) or \
        _range([run.value(*key) for run in runs], digits_of(*key))


def unit_of(quantity, norm):
    """' [m]' of a quantity that has a unit."""
    name = name_of(quantity, norm)
    return " [" + name.rsplit("[", 1)[1].replace("$", "") if name.endswith("]") else ""


def _whole(value):
    return str(int(value)) if isinstance(value, (int, float)) and math.isfinite(value) else "n/a"


def pairs(study):
    """(quantity, norm) that occur, in order, without the performance numbers."""
    keys = dict.fromkeys(key for run in study.runs for key in run.rows)
    return [key for key in keys if key[0] not in metrics.ALWAYS]


def _ratio_note(runs):
    ratios = [r.value("static", "kinetic_over_strain") for r in runs]
    ratios = [r for r in ratios if math.isfinite(r)]
    return [f"Largest kinetic/strain energy ratio of these runs: {number(max(ratios))}."] if ratios else []


def convergence_table(study, quantity, norm):
    """Rows: variants; per cell size the value and, for errors, the order from the size before. None for one size."""
    series, ordered = groups(study.runs), metrics.is_error(quantity, norm)
    data = {}
    for label, runs in series.items():
        if any((quantity, norm) in run.rows for run in runs) or any(not run.completed for run in runs):
            size, mean, _ = mean_by_size(runs, quantity, norm)
            data[label] = (size[::-1], mean[::-1], runs)
    sizes = sorted({size for own, _, _ in data.values() for size in own}, reverse=True)
    if len(sizes) < 2:
        return None
    header = ["variant"]
    for k, size in enumerate(sizes):
        header += [f"L = {size:g} m"] + (["order"] if ordered and k else [])
    header += ["order of all"] if ordered else []
    rows = []
    for label, (own, mean, runs) in data.items():
        # an error of rounding has no order
        orders = np.where(mean > metrics.ROUNDING, pairwise_orders(own, mean), np.nan)
        row = [label]
        for k, size in enumerate(sizes):
            at = np.flatnonzero(own == size)
            value, order = (mean[at[0]], orders[at[0]]) if len(at) else (math.nan, math.nan)
            status = next((r.status for r in runs if r.values.get("L") == size and not r.completed), None)
            row.append(told([r for r in runs if r.values.get("L") == size], (quantity, norm)) if math.isfinite(value)
                       else status or ("n/a" if len(at) else ""))
            if ordered and k:
                row.append(f"{order:.2f}" if math.isfinite(order) else "")
        if ordered:
            fit = fit_order(own, mean)
            row.append(str(fit) if math.isfinite(fit.order) and np.nanmax(mean) > metrics.ROUNDING else "")
        rows.append(row)
    title = f"{quantity} {norm} against cell size".replace("_", " ")
    notes = [] if quantity == "static" else _ratio_note(study.runs)
    return Table(f"{quantity}_{norm}".strip("_"), title, header, rows, notes=notes)


def power_law_table(study, quantity):
    """a and q of quantity = a L^q with their 95 % intervals, fitted to every run: rows are variants and norms. None without a fit."""
    norms, rows = [norm for name, norm in pairs(study) if name == quantity], []
    for label, runs in groups(study.runs).items():
        for norm in norms:
            law = fit_power(*values_by_size(runs, quantity, norm))
            if math.isfinite(law.q.order):
                rows.append([label, norm, f"{law.q.order:.3f}", _interval(law.q.low, law.q.high, "{:.3f}".format), number(law.a, 4),
                             _interval(law.a_low, law.a_high, lambda v: number(v, 4)), str(law.q.points) + (f" of {len(runs)}" if law.q.points < len(runs) else "")])
    words = quantity.replace("_", " ")
    return Table(f"power_law_{quantity}", f"{words} = a L^q", ["variant", "norm", "q", "95 % of q", "a", "95 % of a", "runs"], rows, 2,
                 ["Least squares of the logarithms over all runs; a is the value at L = 1 m."]) if rows else None


def _interval(low, high, text):
    return f"[{text(low)}, {text(high)}]" if math.isfinite(low) else ""


def values_tables(study, asked):
    """Numbers of studies with one cell size, two tables for each case: of what is asked for, and folded away of all. Rows are variants, columns
    quantities, or the other way round where there are more of these."""
    tables = []
    for case in dict.fromkeys(run.values.get("case", "") for run in study.runs if run.rows):
        series = {}
        for label, runs in groups(study.runs, leave_out=("case",)).items():
            own = [run for run in runs if run.values.get("case", case) == case]
            if own:
                series[label] = own
        keys = [key for key in pairs(study) if any(key in run.rows for runs in series.values() for run in runs)]
        title = f"Measured quantities: {case}".replace("_", " ").removesuffix(": ")
        few = [key for key in keys if key in asked]
        if few:
            tables.append(_values(f"values_{case}".rstrip("_"), title, series, few))
        if few != keys:
            tables.append(replace(_values(f"all_values_{case}".rstrip("_"), f"All of it. {title}", series, keys), folded=True))
    return tables


def _values(name, title, series, keys):
    """{label: runs} against (quantity, norm)."""
    def text(runs, key):
        values = [run.value(*key) for run in runs]
        return told(runs, key) if any(map(math.isfinite, values)) else next((r.status for r in runs if not r.completed), "n/a")

    what = [" ".join(key).replace("_", " ").strip() + unit_of(*key) for key in keys]
    if len(keys) > len(series):
        return Table(name, title, ["quantity", *series], [[w, *(text(runs, key) for runs in series.values())] for w, key in zip(what, keys)])
    return Table(name, title, ["variant", *what], [[label, *(text(runs, key) for key in keys)] for label, runs in series.items()])


def slow_runs(runs):
    """Those of one series that do less than half of the particle-steps a second that another does with as many points, or fewer."""
    rated = [(float(r.result.performance.get("points", 0)), float(r.result.performance.get("particle_steps_per_second", 0)), r)
             for r in runs if r.result is not None]
    return [run for points, rate, run in rated
            if 0 < rate < 0.5 * max(other for fewer, other, _ in rated if fewer <= 1.1 * points)]


def performance_table(study):
    """Timings per variant and cell size; runs on a busy machine are marked."""
    cores, rows, busy_any, slow_any = study.plan.get("cores"), [], False, False
    for label, runs in groups(study.runs).items():
        slow = slow_runs(runs)
        for size in sorted({r.values.get("L") for r in runs if r.result is not None}, reverse=True):
            own = [r for r in runs if r.values.get("L") == size and r.result is not None]
            slow_here = any(r in slow for r in own)
            slow_any = slow_any or slow_here
            perf = [r.result.performance for r in own]
            loads = [r.result.provenance.get("load_average") for r in own]
            loads = [float(v) for v in loads if isinstance(v, (int, float))]
            busy = any(is_busy(r, cores) for r in own)
            busy_any = busy_any or busy
            rows.append([label, f"{size:g}", _whole(perf[0].get("points")), _whole(perf[0].get("steps")),
                         *(_range([p.get(k) for p in perf]) for k in ("solve_s", "setup_s", "output_s")),
                         _range([p.get("particle_steps_per_second") for p in perf]) + (" slow" if slow_here else ""),
                         number(float(perf[0].get("bytes_per_point", math.nan))),
                         (f"{max(loads):.2f}" if loads else "n/a") + (" busy" if busy else ""),
                         ", ".join(dict.fromkeys(r.label for r in own if r.suspect or not r.completed))])
    if not rows:
        return None
    notes = ["Medians of repeats [smallest–largest]; solve is the time of the steps alone."]
    if study.plan.get("jobs", 1) > 1:
        notes.append(f"Runs went {study.plan['jobs']} at a time: timings are those of a shared machine.")
    if busy_any:
        notes.append(f"busy: at the start as many others ran as there are cores ({cores}), or, where a file does not tell, the load average was above that.")
    if slow_any:
        notes.append("slow: less than half of the rate that the same method has in this scene with as many points, or fewer: look at the load, or for numbers below 1e-308.")
    header = ["variant", "L [m]", "points", "steps", "solve [s]", "set-up [s]", "output [s]", "particle steps [1/s]",
              "memory [B/point]", "load", "status"]
    return Table("performance", "Performance", header, rows, notes=notes, folded=True)


def reach_table(study, entry):
    """'To reach 1 %, 0.1 %: which method, which L, how long' for a figure of error against time."""
    header, rows, notes = reach(study, entry)
    what = entry.get("title") or f"{entry['quantity']} {entry.get('norm', '')}".replace("_", " ").strip()
    return Table(f"reach_{entry.get('name') or entry['quantity'] + '_' + entry.get('norm', '')}".rstrip("_"), f"To reach an accuracy: {what[:1].lower() + what[1:]}", header, rows, notes=notes)


def targets_table(verdicts):
    return Table("targets", "Expectations", ["target", "asked", "measured", "verdict", "note", "source"],
                 [[v.label, v.asked, v.measured, v.verdict, v.note, v.source] for v in verdicts], 6)


SIGNS = {"*": "*: some of the runs gave no number; the number is of so many of them.", "‡": "‡: some of the runs are suspect.", "†": "†: one static solve.",
         "busy": "busy: measured while others ran."}  # in the matrix of the first screen


def questions_table(first):
    """The matrix of the first screen."""
    rows = [[row["text"], *(c["piece"] if isinstance(c["piece"], str) else c["piece"][1].text for c in row["cells"])] for row in first["matrix"]]
    notes = [meaning for sign, meaning in SIGNS.items() if any(sign in cell for row in rows for cell in row[1:])]
    return Table("questions", "Questions by method", ["question", *first["variants"]], rows, notes=notes)


def claims_table(claims):
    """Every test of every claim, for other programs."""
    def plain(pieces):
        return "".join(p if isinstance(p, str) else str(p[1]) for p in pieces)
    rows = [[c["name"], c["verdict"], t["when"], t["asked"], plain(t["measured"]), t["verdict"], t["study"], c["source"]] for c in claims
            for t in c["tests"] or [{"when": "", "asked": "", "measured": [], "verdict": "not run", "study": ""}]]
    return Table("claims", "Claims", ["claim", "verdict", "if", "asked", "measured", "test", "study", "source"], rows, 8)


def study_tables(study):
    """All tables of a study but the targets. What the targets do not ask for is folded away."""
    asked = graded(study)
    found = [(key, convergence_table(study, *key)) for key in pairs(study)]
    tables = [replace(t, folded=key not in asked) for key, t in found if t]
    if not tables:
        tables = values_tables(study, asked)
    asked = [entry["quantity"] for entry in study.spec.figures if entry["kind"] == "power_law"]
    asked += [target["quantity"] for target in study.spec.targets if target["kind"].startswith("exponent")]
    tables += [power_law_table(study, quantity) for quantity in dict.fromkeys(asked)] + [performance_table(study)]
    tables += [reach_table(study, entry) for entry in study.spec.figures if entry["kind"] == "work_precision"
               and entry.get("x", "solve_s") == "solve_s" and (("exact" in entry) or metrics.is_error(entry["quantity"], entry.get("norm", "")))]
    return [table for table in tables if table]
