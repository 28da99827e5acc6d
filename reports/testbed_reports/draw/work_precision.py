"""Error against cost: what accuracy a method buys for how many seconds or unknowns, and which buys it cheapest."""
import math
from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from ..grade import metrics
from ..grade.targets import number
from ..read.figure_tables import figure_kind
from ..read.study_reader import LIST, NUMBER, TEXT
from .drawing import Drawing, FigureError, by_series, chosen, exact_of, log_y, lower_edge, name_of, rails
from .peers import check_peers, peers_of
from .style import WIDTH, frame, legend_below, legend_shape

AXES = {"solve_s": "Solve time [s]", "dofs": "Degrees of freedom"}
ACCURACIES = (0.01, 0.001)


@dataclass
class Cost:
    """One setting of a method: its error, the mean over repeats, and what it costs: the median time and its range."""
    L: float
    settings: dict
    error: float
    solve_s: float
    least_s: float
    most_s: float
    dofs: float
    busy: bool
    runs: list


def error_of(run, entry):
    """The error of a run; with the key 'exact' the relative distance of a measured quantity from it. nan when there is none."""
    value = run.value(entry["quantity"], entry.get("norm", ""))
    return abs(value / entry["exact"] - 1.0) if "exact" in entry else abs(value)


def is_busy(run, cores):
    """Whether at the start of a run no core was left for it: as many others ran as there are cores; where a file does not tell, whether the load
    average, which lags by a minute, was above the number of cores."""
    others, load = (run.result.provenance.get(name) for name in ("others_running", "load_average"))
    if isinstance(others, (int, float)) and others >= 0:
        return bool(cores and others >= cores)
    return bool(cores and isinstance(load, (int, float)) and load > cores)


def costs_of(runs, entry, cores=None):
    """([Cost], [runs without a number]) of the runs of one series, repeats and seeds taken together: a setting of which one seed is lost
    has no error."""
    found = {}
    for run in runs:
        error, seconds = error_of(run, entry), run.value("solve_s")
        key = tuple((k, str(v)) for k, v in run.values.items() if k not in ("repeat", "dt", "seed") and not k.endswith(".seed"))
        found.setdefault(key, []).append((run, max(error, np.finfo(float).tiny), seconds))  # an error of zero is exact, not lost
    costs, lost = [], []
    for same in found.values():
        if not all(run.completed and math.isfinite(error) and seconds > 0 for run, error, seconds in same):
            lost += [run for run, _, _ in same]
            continue
        values = same[0][0].values
        settings = {k: v for k, v in values.items() if k not in ("repeat", "dt", "L", "grid.cell_size", "case", "scene", "method", "variant", "seed") and not k.endswith(".seed")}
        times = [seconds for _, _, seconds in same]
        costs.append(Cost(values.get("L"), settings, float(np.mean([error for _, error, _ in same])), float(np.median(times)), min(times), max(times),
                          float(same[0][0].result.performance.get("dofs", math.nan)), any(is_busy(run, cores) for run, _, _ in same),
                          [run for run, _, _ in same]))
    return sorted(costs, key=lambda c: (-(c.L or 0), c.solve_s)), lost


def front(points):
    """Those of the points (x, y) that no other beats in both, by x."""
    best, kept = math.inf, []
    for x, y in sorted(points):
        if y < best:
            kept.append((x, y))
            best = y
    return kept


def _several(costs):
    """Whether a method ran with several settings at one cell size."""
    return len({c.L for c in costs}) < len(costs)


def _points(costs, x, y):
    return [(getattr(c, x), getattr(c, y)) for c in costs]


def _collect(study, runs, entry, style):
    """({label: [Cost]}, {label: x of its runs without a number}, notes) of all series."""
    series, failing, notes = {}, {}, []
    by_time = entry.get("x", "solve_s") == "solve_s"
    for label, own in by_series(runs, entry, style).items():
        series[label], lost = costs_of(own, entry, study.plan.get("cores"))
        at = [run.value("solve_s") if by_time else float(run.result.performance.get("dofs", math.nan)) for run in lost if run.result]
        if at := sorted({a for a in at if a > 0}):
            failing[label] = at
        if without := sum(run.result is None for run in own):
            notes.append(f"{label}: {without} of {len(own)} runs have no result")
    if not any(series.values()):
        raise FigureError(f"no completed run has {entry['quantity']} {entry.get('norm', '')}".rstrip() + " and a solve time")
    return series, failing, notes


def _draw_front(axis, points):
    """The Pareto front of all methods, a broad line."""
    if points:
        axis.plot(*zip(*points), color="0.82", linewidth=5.0, solid_capstyle="round", zorder=0)


def _draw_costs(axis, costs, x, y, look):
    """The settings of a method and the line through the best of them."""
    points, several = _points(costs, x, y), _several(costs)
    fastest = [min((c for c in costs if c.L == size), key=lambda c: c.solve_s) for size in {c.L for c in costs}]
    if several:
        axis.plot(*zip(*points), **{**look, "linestyle": "none", "markersize": 2.5, "alpha": 0.45})
    axis.plot(*zip(*(front(points) if several and y == "error" else sorted(_points(fastest, x, y)))), **look)
    if x == "solve_s" and not several:
        data = np.array([(c.solve_s, c.error, c.solve_s - c.least_s, c.most_s - c.solve_s) for c in costs]).T
        axis.errorbar(data[0], data[1], xerr=data[2:], color=look["color"], linestyle="none", elinewidth=0.7, capsize=1.8)
    if any(c.busy for c in costs):
        axis.plot(*zip(*[p for p, c in zip(points, costs) if c.busy]), linestyle="none", marker="o", markersize=6, markerfacecolor="none",
                  markeredgecolor="0.7", markeredgewidth=0.5, zorder=1)


def _cap(series, exact):
    """Ten times the largest error on the coarsest cells: a method that diverges must not flatten the picture."""
    coarsest = max(c.L or 0 for costs in series.values() for c in costs)
    return 10 * max((c.error for label, costs in series.items() for c in costs if label not in exact and (c.L or 0) >= coarsest / 1.001),
                    default=math.inf)


def _scale_x(axis, series, failing, x, peers):
    """Wide enough for all costs, the range of times, the runs without a number and other codes."""
    costs = [c for own in series.values() for c in own]
    every = [getattr(c, x) for c in costs] + [a for at in failing.values() for a in at] + peers.seconds
    if x == "solve_s":
        every += [t for c in costs for t in (c.least_s, c.most_s)]
    axis.set_xlim(min(every) / 1.5, max(every) * 1.5)
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel(AXES[x])


def _title(entry, y):
    """What the y axis is called."""
    if y == "solve_s":
        return AXES[y]
    name = name_of(entry["quantity"], entry.get("norm", ""))
    return f"Error of {name.lower()}" if "exact" in entry else name


def _medians(series, x):
    """The note on what the times are."""
    ranges = x == "solve_s" and not any(_several(costs) for costs in series.values())
    return "Medians of repeats" + (" with their range" if ranges else "") + "; set-up and output are left out"


def _check_keys(reader, entry, index):
    axes = (entry.get("x", "solve_s"), entry.get("y", "error"))
    if axes not in (("solve_s", "error"), ("dofs", "error"), ("dofs", "solve_s")):
        reader.fail(f"'x' and 'y' in [[figure]] number {index + 1} must be solve_s and error, dofs and error, or dofs and solve_s",
                    "x" if "x" in entry else "y", "figure", index)
    if "peer" in entry and axes != ("solve_s", "error"):
        reader.fail(f"[[figure]] number {index + 1} has peers, which have seconds and errors alone: 'x' and 'y' must be solve_s and error", "peer", "figure", index)
    check_peers(reader, entry, index)
    if entry.get("exact") == 0:
        reader.fail(f"'exact' in [[figure]] number {index + 1} must not be zero: errors are relative to it", "exact", "figure", index)


@figure_kind("work_precision", {"quantity": TEXT}, {"norm": TEXT, "x": TEXT, "y": TEXT, "exact": NUMBER, "peer": LIST}, _check_keys)
def work_precision(study, entry, style):
    """Error against seconds or unknowns, or seconds against unknowns. Where a method ran with several settings at one cell size, all are
    shown and its line joins those that nothing of its own beats (against unknowns: the fastest)."""
    x, y, runs = entry.get("x", "solve_s"), entry.get("y", "error"), chosen(study, entry)
    series, failing, notes = _collect(study, runs, entry, style)
    is_error = y == "error" and ("exact" in entry or metrics.is_error(entry["quantity"], entry.get("norm", "")))
    exact = exact_of({label: [c.error for c in costs] for label, costs in series.items()}) if is_error else set()
    texts = {label: f"{label}: exact (≤ {number(max(c.error for c in costs))})" if label in exact else label for label, costs in series.items()}
    width = WIDTH[entry.get("width", "column")]
    peers = peers_of(entry, series)
    columns, rows = legend_shape([*texts.values(), *(name for name, _, _ in peers.lines)], width)
    figure, axes = frame(width, 2.3, rows, rails=len(failing), left=0.62, right=0.12)
    axis, handles = axes[0, 0], [Line2D([], [], **style.of(label), label=text) for label, text in texts.items()]
    peers.draw(axis)
    if y == "error":
        best = front([p for costs in series.values() for p in _points(costs, x, y)])
        _draw_front(axis, [p for p in best if p[1] > metrics.ROUNDING or not is_error])
        notes.append("The broad line is the Pareto front of all methods")
    for label, costs in series.items():
        if label in exact:
            lower_edge(axis, [getattr(c, x) for c in costs], label, style)
        elif costs:
            _draw_costs(axis, costs, x, y, style.of(label))
    if any(c.busy for costs in series.values() for c in costs):
        notes.append("Circled: timed on a busy machine")
    axis.set_xscale("log")
    axis.set_yscale("log")
    heights = [getattr(c, y) for label, costs in series.items() if label not in exact for c in costs] + peers.errors
    cap = _cap(series, exact) if is_error else math.inf
    if max(heights) > 1.6 * cap:
        notes.append("Errors above the upper edge are off the scale")
    log_y(axis, min(heights) / 1.6, min(max(heights), cap) * 1.6)
    _scale_x(axis, series, failing, x, peers)
    axis.set_ylabel(_title(entry, y))
    rails(axis, failing, style, "failed")
    legend_below(figure, handles + peers.handles(), columns)
    notes += peers.notes
    if exact:
        notes.append("Methods that are exact to rounding stand on the lower edge")
    if "solve_s" in (x, y):
        notes.insert(0, _medians(series, x))
    return Drawing(figure, runs, notes)


def cheapest(costs, accuracy):
    """The fastest setting whose error is at most `accuracy`; None when there is none."""
    return min((c for c in costs if c.error <= accuracy), key=lambda c: c.solve_s, default=None)


def reach(study, entry):
    """(header, rows, notes) of 'which method reaches 1 % and 0.1 %, with which L, in how long' for one figure of error against time."""
    runs = study.select(entry["where"])
    series = {}
    for run in runs:
        series.setdefault(run.name, []).append(run)
    header, rows = ["variant"], []
    for accuracy in ACCURACIES:
        header += [f"{100 * accuracy:g} %: L [m]", "settings", "solve [s]", "× fastest"]
    found = {label: costs_of(own, entry, study.plan.get("cores"))[0] for label, own in series.items()}
    fastest = {a: min((c.solve_s for costs in found.values() if (c := cheapest(costs, a))), default=math.nan) for a in ACCURACIES}
    for label, costs in found.items():
        row = [label]
        for accuracy in ACCURACIES:
            best = cheapest(costs, accuracy)
            if best is None:
                least = min((c.error for c in costs), default=math.nan)
                row += ["not reached", f"best {number(100 * least, 2)} %" if math.isfinite(least) else "no number", "", ""]
                continue
            settings = ", ".join(f"{k.rsplit('.', 1)[-1]} {v:g}" for k, v in best.settings.items() if isinstance(v, (int, float)) and k != "constants.ppc")
            row += [f"{best.L:g}", settings, f"{best.solve_s:.3g}" + (" busy" if best.busy else ""), f"{best.solve_s / fastest[accuracy]:.1f}"]
        rows.append(row)
    return header, rows, ["The fastest of the runs whose error is at most the one asked; no interpolation between them. Solve time: median of repeats."]
