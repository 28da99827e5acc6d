"""A quantity as a power of the cell size, fitted to every run."""
import math

import numpy as np
from matplotlib.lines import Line2D

from ..grade.convergence import fit_power
from ..grade.targets import in_sizes, number, values_by_size
from ..read.figure_tables import figure_kind
from ..read.study_reader import NUMBER, TEXT
from .drawing import Drawing, FigureError, by_series, chosen, log_y, name_of, rails, sizes_axis, told_lost
from .style import WIDTH, frame, legend_below, legend_shape


@figure_kind("power_law", {"quantity": TEXT}, {"norm": TEXT, "L_from": NUMBER, "L_to": NUMBER})
def power_law(study, entry, style):
    """Every run as a faint dot, the means of cell sizes, and the fitted line a L^q with the 95 % interval of q."""
    quantity, norm, notes = entry["quantity"], entry.get("norm", ""), []
    runs = chosen(study, entry)
    data, laws, labels, failing = {}, {}, {}, {}
    for label, own in by_series(runs, entry, style).items():
        L, value = values_by_size(own, quantity, norm)
        data[label] = L[value > 0], value[value > 0]
        fitted = [run for run in own if in_sizes(run, entry)]
        laws[label] = fit_power(*values_by_size(fitted, quantity, norm))
        labels[label] = label
        if math.isfinite(laws[label].q.order):
            few = f" ({laws[label].q.points} of {len(fitted)} runs)" if laws[label].q.points < len(fitted) else ""
            labels[label] = f"{label}: a = {number(laws[label].a)}, q = {laws[label].q}{few}"
        lost = sorted({run.values["L"] for run in own if not run.value(quantity, norm) > 0
                       and isinstance(run.values.get("L"), (int, float))})
        if lost:
            failing[label] = lost
            notes.append(told_lost(label, own, "L", lambda run: run.value(quantity, norm) > 0))
    sizes, values = (np.concatenate([pair[k] for pair in data.values()]) for k in (0, 1))
    if not len(values):
        raise FigureError(f"no completed run has a positive {quantity} {norm}".rstrip())
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(labels.values(), width)
    figure, axes = frame(width, 2.3, rows, rails=len(failing), left=0.62, right=0.2)
    axis, handles = axes[0, 0], []
    axis.set_xscale("log")
    axis.set_yscale("log")
    for label, (L, value) in data.items():
        handles.append(Line2D([], [], **style.of(label), label=labels[label]))
        axis.plot(L, value, linestyle="none", marker=".", markersize=4, markeredgewidth=0, color=style.colour(label), alpha=0.5)
        at = np.unique(L)
        axis.plot(at, [value[L == size].mean() for size in at], **style.of(label) | {"linestyle": "none"})
        if math.isfinite(laws[label].q.order):
            axis.plot(at[[0, -1]], laws[label](at[[0, -1]]), **style.of(label) | {"marker": ""})
    everything = np.concatenate([sizes, *failing.values()])
    span = everything.max() / everything.min()
    axis.set_xlim(everything.min() / span**0.05 / 1.02, everything.max() * span**0.05 * 1.02)
    log_y(axis, values.min() / 1.3, values.max() * 1.3)
    sizes_axis(axis.xaxis, everything)
    axis.set_xlabel("Cell size $L$ [m]")
    axis.set_ylabel(name_of(quantity, norm))
    rails(axis, failing, style, "no number")
    legend_below(figure, handles, columns)
    notes[:0] = ["Lines a L^q: log-log least squares over every run, q with its 95 % interval; dots are runs, markers means"]
    return Drawing(figure, runs, notes)
