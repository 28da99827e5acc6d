"""A quantity against the cell size or another axis, with the order at which errors fall."""
import math
from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D

from ..grade import metrics
from ..grade.convergence import fit_order
from ..grade.targets import number
from ..read.figure_tables import figure_kind
from ..read.study_reader import LIST, NUMBER, TEXT
from .drawing import Drawing, FigureError, by_series, chosen, exact_of, log_y, lower_edge, name_of, rails, sizes_axis, told_lost
from .style import WIDTH, frame, legend_below, legend_shape

X_NAMES = {"L": "Cell size $L$ [m]", "dt": "Time step [s]", "ppc": "Points per cell and direction",
           "grid.cell_size": "Cell size $L$ [m]"}


@dataclass
class Series:
    """Mean and range over completed runs (K,) each, by x; and the x of runs without a number."""
    at: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray
    lost: list

    @property
    def spread(self):
        return (self.high > self.low * (1 + 1e-9)).any()


def _triangle(axis, orders, points, x_low, x_high):
    """Slope triangles (a fan from one corner) under all points; returns the lowest y they need."""
    orders = sorted(orders)
    right = x_high
    left = max(x_low, right / max(2.0, (x_high / x_low) ** 0.3)) if x_high > x_low else right / 2
    over = [y for x, y in points if x >= left / 1.3]
    neighbours = [y for _, y in sorted(points, key=lambda p: abs(math.log(p[0] / left)))[:1]]
    top = 0.55 * min(over + neighbours)
    bottom = top / (right / left) ** orders[-1]
    axis.plot([left, right, right], [bottom, bottom, top], color="0.35", linewidth=0.7, zorder=1)
    for order in orders:
        end = bottom * (right / left) ** order
        axis.plot([left, right], [bottom, end], color="0.35", linewidth=0.7, zorder=1)
        axis.annotate(f"{order:g}", (right, end), xytext=(2.5, 0), textcoords="offset points", fontsize=6.5,
                      color="0.25", va="center", annotation_clip=False)
    return bottom


def _gather(runs, quantity, norm, x):
    groups, lost = {}, []
    for run in runs:
        at, value = run.values.get(x), run.value(quantity, norm)
        if not isinstance(at, (int, float)) or at <= 0:
            continue
        if math.isfinite(value):
            groups.setdefault(at, []).append(abs(value))
        else:
            lost.append(at)
    rows = [(at, np.mean(v), np.min(v), np.max(v)) for at, v in sorted(groups.items())]
    return Series(*np.array(rows, float).reshape(-1, 4).T, sorted(set(lost)))


def _fit(own, entry):
    """The order over the sizes from L_from to L_to."""
    least, most = sorted((entry.get("L_from", math.inf), entry.get("L_to", 0.0)))
    keep = (own.at <= most * (1 + 1e-9)) & (own.at >= least * (1 - 1e-9))
    return fit_order(own.at[keep], own.mean[keep])


def _text(label, own, exact, fits):
    """What the legend says of a series."""
    if label in exact:
        return f"{label}: exact (≤ {number(own.mean.max())})"
    if label in fits:
        return f"{label}: order {fits[label]}" if math.isfinite(fits[label].order) else label
    return label if len(own.at) else f"{label}: no number"


def _extent(points, graded):
    """(low, top) of what is shown. Methods that diverge must not flatten the picture: at most ten times the largest error on the
    coarsest cells."""
    coarsest = max(a for a, _ in points)
    cap = max(b for a, b in points if a >= coarsest / 1.001) * (10 if graded else 2)
    return min(b for _, b in points), min(max(b for _, b in points), cap)


def _draw_series(axis, label, own, high, style):
    """Means over the range of repeats; what is above `high` as triangles at the upper edge."""
    if own.spread:
        axis.fill_between(own.at, own.low, own.high, where=own.mean <= high, color=style.colour(label), alpha=0.15, linewidth=0)
    axis.plot(own.at, np.minimum(own.mean, high * 1e3), **{**style.of(label), "marker": ""})
    axis.plot(own.at, np.where(own.mean > high, np.nan, own.mean), **{**style.of(label), "linestyle": "none"})
    over = own.at[own.mean > high]
    axis.plot(over, [0.975] * len(over), transform=axis.get_xaxis_transform(), linestyle="none", marker="^", markersize=4,
              color=style.colour(label))


def _scale_y(axis, entry, points, sizes, graded):
    """Log for errors and wide ranges, with the slope triangles that are asked; linear for a ratio."""
    low, top = _extent(points, graded)
    if graded or top > 30 * low:
        axis.set_yscale("log")
        if entry.get("orders"):
            low = min(low, _triangle(axis, entry["orders"], points, min(sizes), max(sizes)))
        log_y(axis, low / 1.6, top * 1.6)
    else:
        margin = 0.15 * (top - low) or 0.1 * abs(top)
        axis.set_ylim(low - margin, top + margin)


def _scale_x(axis, sizes, x):
    span = max(sizes) / min(sizes)
    axis.set_xlim(min(sizes) / span**0.05 / 1.02, max(sizes) * span**0.05 * 1.02)
    sizes_axis(axis.xaxis, sizes)
    axis.set_xlabel(X_NAMES.get(x, x.rsplit(".", 1)[-1]))


def _notes(series, exact, fits, high):
    notes, inexact = [], [own for label, own in series.items() if label not in exact]
    if any(own.spread for own in inexact):
        notes.append("Lines are means, bands the range")
    if any(math.isfinite(f.order) for f in fits.values()):
        notes.append("Orders are log-log least squares with their 95 % interval")
    if exact:
        notes.append("Methods that are exact to rounding stand on the lower edge")
    if any((own.mean > high).any() for own in inexact):
        notes.append("Triangles at the upper edge are off the scale")
    return list(dict.fromkeys(notes))


@figure_kind("convergence", {"quantity": TEXT}, {"norm": TEXT, "x": TEXT, "orders": LIST, "L_from": NUMBER, "L_to": NUMBER})
def convergence(study, entry, style):
    """The mean of each series against x in log axes, orders of errors in the legend."""
    quantity, norm, x = entry["quantity"], entry.get("norm", ""), entry.get("x", "L")
    runs, graded = chosen(study, entry), metrics.is_error(quantity, norm)
    if not any((quantity, norm) in run.rows for run in runs):
        known = sorted({" ".join(key).strip() for run in runs for key in run.rows})
        raise FigureError(f"no run has {quantity} {norm}".rstrip() + f" (there is: {', '.join(known) or 'nothing'})")
    series = {label: _gather(own, quantity, norm, x) for label, own in by_series(runs, entry, style).items()}
    exact = exact_of({label: own.mean for label, own in series.items()}) if graded else set()
    fits = {label: _fit(own, entry) for label, own in series.items() if graded and label not in exact and len(own.at) > 1}
    points = [(a, b) for label, own in series.items() if label not in exact for a, b in zip(own.at, own.mean) if b > 0]
    if not points:
        raise FigureError("no completed run has a positive number")
    failing = {label: own.lost for label, own in series.items() if own.lost}
    sizes = [a for a, _ in points] + [a for where in failing.values() for a in where]
    high = _extent(points, graded)[1] * 1.6

    texts = {label: _text(label, own, exact, fits) for label, own in series.items()}
    handles = [Line2D([], [], **style.of(label), label=text) for label, text in texts.items()]
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(texts.values(), width)
    figure, axes = frame(width, 2.3, rows, rails=len(failing), left=0.62, right=0.2)
    axis = axes[0, 0]
    for label, own in series.items():
        if label in exact:
            lower_edge(axis, own.at, label, style)
        elif len(own.at):
            _draw_series(axis, label, own, high, style)
    axis.set_xscale("log")
    _scale_y(axis, entry, points, sizes, graded)
    _scale_x(axis, sizes, x)
    axis.set_ylabel(name_of(quantity, norm))
    rails(axis, failing, style, "failed")
    legend_below(figure, handles, columns)
    lost = [told_lost(label, own, x, lambda run: math.isfinite(run.value(quantity, norm))) for label, own in by_series(runs, entry, style).items()]
    return Drawing(figure, runs, _notes(series, exact, fits, high) + [note for note in lost if note])
