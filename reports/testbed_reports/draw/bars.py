"""Bars: one number of each series at one size."""
import math

import numpy as np

from ..grade.targets import number
from ..read.figure_tables import figure_kind
from ..read.study_reader import FLAG, NUMBER, TEXT
from .drawing import Drawing, FigureError, by_series, chosen, name_of, one_size
from .style import RAIL, WIDTH, frame


@figure_kind("bars", {"quantity": TEXT}, {"norm": TEXT, "L": NUMBER, "log": FLAG})
def bars(study, entry, style):
    quantity, norm = entry["quantity"], entry.get("norm", "")
    runs, notes = one_size(chosen(study, entry), entry), []
    groups = by_series(runs, entry, style)
    rows, most = {}, 1
    for label, own in groups.items():
        good = [v for v in (run.value(quantity, norm) for run in own) if math.isfinite(v)]
        seeds = len({str(run.values.get("seed", "")) for run in own})
        rows[label] = np.array([np.mean(good) if seeds > 1 else np.median(good), min(good), max(good)]) if good else None
        most = max(most, seeds)
    if all(v is None for v in rows.values()):
        raise FigureError(f"no completed run has {quantity} {norm}".rstrip())
    title, largest = name_of(quantity, norm), max(abs(v[2]) for v in rows.values() if v is not None)
    if largest >= 1e4 and not entry.get("log"):  # the power of ten goes into the unit
        power = 3 * int(math.log10(largest) // 3)
        rows = {label: None if v is None else v / 10.0**power for label, v in rows.items()}
        title = title.replace("[1/", "[").replace("[", rf"[$10^{{{power}}}$" + ("/" if "[1/" in title else " ")) \
            if "[" in title else rf"{title} [$10^{{{power}}}$]"
    width = WIDTH[entry.get("width", "column")]
    longest = max(len(label) for label in rows)
    figure, axes = frame(width, 0.24 * len(rows) + 0.15, left=0.15 + 0.073 * longest, right=0.55)
    axis = axes[0, 0]
    for k, (label, value) in enumerate(rows.items()):
        if value is None:
            statuses = ", ".join(dict.fromkeys(run.status for run in groups[label]))
            axis.annotate(f"× {statuses}", (0, k), xycoords=("axes fraction", "data"), xytext=(3, 0),
                          textcoords="offset points", va="center", fontsize=7, color=RAIL)
            continue
        if entry.get("log"):  # a bar has no foot on a log axis: a dot on a rule
            axis.axhline(k, color="0.88", linewidth=0.6, zorder=0)
            axis.plot(value[0], k, **style.of(label) | {"linestyle": "none", "markersize": 5.5})
        else:
            axis.barh(k, value[0], height=0.62, color=style.colour(label), alpha=0.85, edgecolor="white", linewidth=0,
                      hatch=("", "///", "...", "xxx", "\\\\\\")[style.slot(label) % 5])
        if value[2] > value[1]:
            axis.plot(value[1:], [k, k], color="black", linewidth=0.8, marker="|", markersize=5)
        axis.annotate(number(value[0]), (max(value[0], value[2], 0), k), xytext=(5, 0), textcoords="offset points",
                      va="center", fontsize=7, annotation_clip=False)
    axis.set_yticks(range(len(rows)), list(rows))
    axis.tick_params(axis="y", length=0, labelsize=8)
    axis.set_ylim(len(rows) - 0.5, -0.5)
    if entry.get("log"):
        axis.set_xscale("log")
    else:
        axis.locator_params(axis="x", nbins=5)
    axis.set_xlabel(title)
    if any(v is not None and v[2] > v[1] for v in rows.values()):
        notes.append(f"Means over seeds (up to {most}) with their range" if most > 1 else "Medians with their range")
    return Drawing(figure, runs, notes)
