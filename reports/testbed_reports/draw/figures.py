"""The figures that a study declares. Each function takes (study, entry, style) and returns a Drawing.

What a run did not give is shown (top rail) or told in the notes, never dropped in silence.
"""
import math

import numpy as np
from matplotlib.lines import Line2D

from ..grade import components, metrics
from ..grade.components import of_snapshot
from ..grade.convergence import fit_order
from ..grade.targets import number
from ..read.results import ResultError
from .curves import curve, history
from .drawing import (Drawing, FigureError, axis_scale, by_series, chosen, label_of, log_y, name_of, one_size, rails, short,
                      sizes_axis, snapshot_of, where_of_title, with_result, with_unit)
from .maps import field_maps
from .matrix import stability_matrix
from .power_law import power_law
from .style import EXACT, RAIL, WIDTH, frame, legend_below, legend_shape
from .work_precision import work_precision


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
    """(x, mean, low, high) over completed runs, sorted, (K,) each; and the x of runs without a number."""
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
    return np.array(rows, float).reshape(-1, 4).T, sorted(set(lost))


def _floor(axis, at, label, style):
    """Points that are exact to rounding, on the lower edge."""
    axis.plot(at, [0.0] * len(at), transform=axis.get_xaxis_transform(), linestyle="none", marker=style.marker(label),
              markersize=4.5, markerfacecolor="white", markeredgecolor=style.colour(label), clip_on=False, zorder=5)


X_NAMES = {"L": "Cell size $L$ [m]", "dt": "Time step [s]", "ppc": "Points per cell and direction",
           "grid.cell_size": "Cell size $L$ [m]"}


def convergence(study, entry, style):
    quantity, norm, x = entry["quantity"], entry.get("norm", ""), entry.get("x", "L")
    runs = chosen(study, entry)
    if not any((quantity, norm) in run.rows for run in runs):
        known = sorted({" ".join(key).strip() for run in runs for key in run.rows})
        raise FigureError(f"no run has {quantity} {norm}".rstrip() + f" (there is: {', '.join(known) or 'nothing'})")
    series = {label: _gather(own, quantity, norm, x) for label, own in by_series(runs, entry, style).items()}
    notes, labels, fits = [], {}, {}
    exact = {}
    if metrics.is_error(quantity, norm):
        exact = {label: data for label, (data, _) in series.items() if data.shape[1] and (data[1] < metrics.ROUNDING).all()}
        exact = {} if len(exact) == sum(data.shape[1] > 0 for data, _ in series.values()) else exact
    limits = sorted((entry.get("L_from", math.inf), entry.get("L_to", 0.0)))
    for label, (data, lost) in series.items():
        labels[label] = label
        if label in exact:
            labels[label] = f"{label}: exact (≤ {number(data[1].max())})"
        elif metrics.is_error(quantity, norm) and data.shape[1] > 1:
            keep = (data[0] <= limits[1] * (1 + 1e-9)) & (data[0] >= limits[0] * (1 - 1e-9))
            fits[label] = fit_order(data[0][keep], data[1][keep])
            labels[label] = f"{label}: order {fits[label]}" if math.isfinite(fits[label].order) else label
        elif not data.shape[1]:
            labels[label] = f"{label}: no number"
    finite = [(a, b) for label, (data, _) in series.items() if label not in exact for a, b in data[:2].T if b > 0]
    if not finite:
        raise FigureError("no completed run has a positive number")
    failing = {label: lost for label, (_, lost) in series.items() if lost}
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(labels.values(), width)
    figure, axes = frame(width, 2.3, rows, rails=len(failing), left=0.62, right=0.2)
    axis = axes[0, 0]

    # Methods that diverge must not flatten the picture: cap at ten times the largest error on the coarsest cells.
    coarsest = max(a for a, _ in finite)
    graded = metrics.is_error(quantity, norm)
    cap = max([b for a, b in finite if a >= coarsest / 1.001]) * (10 if graded else 2)
    low, top = min(b for _, b in finite), min(max(b for _, b in finite), cap)
    everything = [a for a, _ in finite] + [a for where in failing.values() for a in where]
    high = top * 1.6
    handles, capped = [], False
    for label, (data, _) in series.items():
        handles.append(Line2D([], [], **style.of(label), label=labels[label]))
        if label in exact:
            _floor(axis, data[0], label, style)
            continue
        if not data.shape[1]:
            continue
        shown = np.where(data[1] > high, np.nan, data[1])
        spread = (data[3] > data[2] * (1 + 1e-9)).any()
        if spread:
            axis.fill_between(data[0], data[2], data[3], where=data[1] <= high, color=style.colour(label), alpha=0.15,
                              linewidth=0)
        axis.plot(data[0], np.minimum(data[1], high * 1e3), **{**style.of(label), "marker": ""})
        axis.plot(data[0], shown, **{**style.of(label), "linestyle": "none"})
        over = data[0][data[1] > high]
        capped = capped or len(over) > 0
        axis.plot(over, [0.975] * len(over), transform=axis.get_xaxis_transform(), linestyle="none", marker="^",
                  markersize=4, color=style.colour(label))
        if spread:
            notes.append("Lines are means, bands the range")
    axis.set_xscale("log")
    if graded or top > 30 * low:
        axis.set_yscale("log")
        if entry.get("orders"):
            low = min(low, _triangle(axis, entry["orders"], finite, min(everything), max(everything)))
        log_y(axis, low / 1.6, high)
    else:  # a ratio, not an error
        margin = 0.15 * (top - low) or 0.1 * abs(top)
        axis.set_ylim(low - margin, top + margin)
    span = max(everything) / min(everything)
    axis.set_xlim(min(everything) / span**0.05 / 1.02, max(everything) * span**0.05 * 1.02)
    sizes_axis(axis.xaxis, everything)
    axis.set_xlabel(X_NAMES.get(x, x.rsplit(".", 1)[-1]))
    axis.set_ylabel(name_of(quantity, norm))
    rails(axis, failing, style, "failed")
    legend_below(figure, handles, columns)
    if any(math.isfinite(f.order) for f in fits.values()):
        notes.append("Orders are log-log least squares with their 95 % interval")
    if exact:
        notes.append("Methods that are exact to rounding stand on the lower edge")
    if capped:
        notes.append("Triangles at the upper edge are off the scale")
    for label, where in failing.items():
        notes.append(f"{label} gave no number at {x.rsplit('.', 1)[-1]} = " + ", ".join(f"{v:g}" for v in where)
                     + (" m" if x == "L" else ""))
    return Drawing(figure, runs, list(dict.fromkeys(notes)))


def profile(study, entry, style):
    component, along = entry["component"], entry.get("along", "y")
    if along not in ("x", "y"):
        raise FigureError("'along' must be 'x' or 'y'")
    split_by = entry.get("panels", "variant")
    if split_by not in ("variant", "L", "none"):
        raise FigureError("'panels' must be 'variant', 'L' or 'none'")
    axis_index, notes = {"x": 0, "y": 1}[along], []
    runs = with_result(one_size(chosen(study, entry), entry), notes)
    lines, snapshots = [], []
    for label, own in by_series(runs, entry, style).items():
        for run in sorted(own, key=lambda r: -(r.values.get("L") or 0)):
            snapshot = snapshot_of(run, entry.get("snapshot", -1))
            at = snapshot["initial_position"][:, axis_index]
            keep = np.ones(len(at), bool)
            if "band" in entry:
                other = snapshot["initial_position"][:, 1 - axis_index]
                keep = (other >= entry["band"][0]) & (other <= entry["band"][1])
            order = np.argsort(at[keep], kind="stable")
            value = of_snapshot(snapshot, component)[keep][order]
            exact = of_snapshot(snapshot, component, True)[keep][order] if components.has_exact(snapshot, component) \
                else None
            lines.append((label, run, at[keep][order], value, exact))
            snapshots.append(snapshot)
    field_name = components.split(component)[0]
    unit, factor = axis_scale([v for _, _, _, v, _ in lines],
                               snapshots[0].unit(field_name) or components.default_unit(field_name))

    keys = {"variant": lambda l: l[0], "L": lambda l: short("L", l[1].values["L"]), "none": lambda l: ""}[split_by]
    panels = {}
    for line in lines:
        panels.setdefault(keys(line), []).append(line)
    several_sizes = len({line[1].values["L"] for line in lines}) > 1
    width = WIDTH[entry.get("width", "page" if len(panels) > 1 else "column")]
    rows = math.ceil(len(panels) / max(1, int(width / 1.5)))
    columns = math.ceil(len(panels) / rows)  # rows of like length

    def text(line):
        parts = [line[0]] if split_by != "variant" else []
        if several_sizes and split_by != "L":
            parts.append(f"L = {line[1].values['L']:g} m")
        return ", ".join(parts)

    shades = {}
    if split_by == "variant":  # cell sizes told apart inside a panel
        sizes = sorted({line[1].values["L"] for line in lines}, reverse=True)
        looks = (("o", "#56B4E9"), ("s", "#D55E00"), ("^", "#009E73"), ("D", "#CC79A7"), ("v", "#0072B2"))
        shades = {s: looks[k % len(looks)] for k, s in enumerate(sizes)}
    names = list(dict.fromkeys(text(line) for line in lines if text(line)))
    has_exact = any(line[4] is not None for line in lines)
    columns_l, rows_l = legend_shape(names + (["exact"] if has_exact else []), width)
    titles = len(panels) > 1
    figure, axes = frame(width, 2.2, rows_l, rows, columns, left=0.55, right=0.12, gap=(0.2, 0.36),
                         rails=1.4 if titles else 0, sharex=True, sharey=True)
    handles = {}
    for k, (title, own) in enumerate(panels.items()):
        axis = axes.flat[k]
        for line in own:
            label, run, at, value, exact = line
            thin = max(1, len(at) // 1500)
            if thin > 1:
                notes.append(f"Every {thin}th point of the finest runs is drawn")
            marker, colour = shades.get(run.values["L"]) or (style.marker(label), style.colour(label))
            if split_by == "variant" and not several_sizes:
                marker, colour = style.marker(label), style.colour(label)
            data = (value[::thin] * factor, at[::thin]) if along == "y" else (at[::thin], value[::thin] * factor)
            axis.plot(*data, linestyle="none", marker=marker, markersize=2.2, color=colour, markeredgewidth=0,
                      alpha=0.75, rasterized=len(at) > 800)
            if text(line):
                handles[text(line)] = Line2D([], [], linestyle="none", marker=marker, markersize=4, color=colour,
                                             label=text(line))
        exact_lines = [line for line in own if line[4] is not None]
        if exact_lines:
            _, _, at, _, exact = max(exact_lines, key=lambda line: len(np.unique(line[2])))
            points, index = np.unique(np.round(at, 12), return_index=True)
            axis.plot(*((exact[index] * factor, points) if along == "y" else (points, exact[index] * factor)), **EXACT)
        if titles:
            axis.set_title(title, pad=3)
        if along == "y" and k % columns:
            axis.tick_params(labelleft=False)
        elif along == "x" and k % columns:
            axis.tick_params(labelleft=False)
        axis.locator_params(axis="x", nbins=4)
    for axis in axes.flat[len(panels):]:
        axis.set_visible(False)
    value_name = with_unit(components.symbol(component), unit)
    place_name = f"Initial position ${'Y' if along == 'y' else 'X'}$ [m]"
    x_name, y_name = (value_name, place_name) if along == "y" else (place_name, value_name)
    for r in range(rows):
        axes[r, 0].set_ylabel(y_name)
    for k in range(len(panels)):
        if k + columns >= len(panels):
            axes.flat[k].set_xlabel(x_name)
        else:
            axes.flat[k].tick_params(labelbottom=False)
    if has_exact:
        handles["exact"] = Line2D([], [], **EXACT)
    legend_below(figure, list(handles.values()), columns_l)
    notes.insert(0, where_of_title(snapshots))
    return Drawing(figure, runs, [n for n in dict.fromkeys(notes) if n])

def bars(study, entry, style):
    quantity, norm = entry["quantity"], entry.get("norm", "")
    runs, notes = one_size(chosen(study, entry), entry), []
    groups = by_series(runs, entry, style)
    rows = {}
    for label, own in groups.items():
        good = [v for v in (run.value(quantity, norm) for run in own) if math.isfinite(v)]
        rows[label] = np.percentile(good, [50, 0, 100]) if good else None
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
        notes.append("Medians with their range")
    return Drawing(figure, runs, notes)


KINDS = {"convergence": convergence, "power_law": power_law, "work_precision": work_precision, "profile": profile, "field": field_maps,
         "history": history, "curve": curve, "bars": bars, "stability_matrix": stability_matrix}


def draw(study, entry, style):
    """Draws one declared figure; raises FigureError or ResultError with the reason when it cannot."""
    try:
        return KINDS[entry["kind"]](study, entry, style)
    except (FigureError, ResultError):
        raise
    except Exception as error:  # odd data must not take the report with it
        raise FigureError(f"cannot be drawn: {type(error).__name__}: {error}") from error
