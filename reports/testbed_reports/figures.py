"""The figures that a study declares. Each function takes (study, entry, style) and returns a Drawing.

What a run did not give is shown (top rail) or told in the notes, never dropped in silence.
"""
import math
from dataclasses import dataclass, field

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from . import components, metrics
from .components import of_snapshot
from .convergence import fit_order
from .results import ResultError
from .style import EXACT, RAIL, WIDTH, frame, legend_below, legend_shape, nice_unit, plt
from .targets import number

QUANTITY_NAMES = {
    ("stress", "l2"): "Stress error, $L_2$", ("stress", "linf"): r"Stress error, $L_\infty$",
    ("stress", "l1_yy"): r"Vertical stress error, $L_1$", ("displacement", "l2"): "Displacement error, $L_2$",
    ("displacement", "linf"): r"Displacement error, $L_\infty$",
    ("displacement", "rms_scaled"): "Displacement error, scaled RMS",
    ("static", "kinetic_over_strain"): "Kinetic / strain energy", ("static", "unbalanced"): "Unbalanced force ratio",
    ("first_peak", "ratio"): "First peak / static", ("first_peak", "time"): "Time of first peak / exact",
    ("energy_drift", "per_period"): "Energy drift per period", ("energy_gain", "max"): "Largest energy gain",
    ("kinetic_energy", "retained"): "Kinetic energy retained", ("momentum", "error"): "Momentum error",
    ("angular_momentum", "retained"): "Angular momentum retained",
    ("angular_momentum", "error"): "Angular momentum error",
    ("spurious_stress", "max"): "Largest stress / Young's modulus",
    ("particle_steps_per_second", ""): "Particle steps per second [1/s]", ("bytes_per_point", ""): "Memory [B/point]",
    ("solve_s", ""): "Solve time [s]"}
HISTORY_NAMES = {"kinetic_energy": ("Kinetic energy", "J/m"), "strain_energy": ("Strain energy", "J/m"),
                 "gravity_work": ("Work of gravity", "J/m"), "total_energy": ("Total energy", "J/m"),
                 "unbalanced_force": ("Unbalanced force ratio", ""), "max_stress": ("Largest stress", "Pa"),
                 "angular_momentum": ("Angular momentum", "kg m/s"),
                 "linear_momentum_x": ("Momentum $p_x$", "kg/s"), "linear_momentum_y": ("Momentum $p_y$", "kg/s"),
                 "linear_momentum": ("Momentum $|p|$", "kg/s")}


class FigureError(Exception):
    """A figure that cannot be drawn; the message says why."""


@dataclass
class Drawing:
    """A drawn figure, the runs it shows, and notes for its caption."""
    figure: object
    runs: list
    notes: list = field(default_factory=list)


def name_of(quantity, norm):
    """What a quantity is called on an axis."""
    if quantity == "settlement":
        return f"Settlement error, {norm}"
    return QUANTITY_NAMES.get((quantity, norm), f"{quantity} {norm}".replace("_", " ").strip())


def short(key, value):
    key = {"grid.cell_size": "L"}.get(key, key.rsplit(".", 1)[-1])
    return f"{key} = {value:g}" if isinstance(value, float) else f"{key} = {value}"


def label_of(run, entry):
    """The name of the series a run belongs to."""
    parts = [str(run.values.get(k, "?")) if k in ("variant", "method") else short(k, run.values.get(k, "?"))
             for k in entry["series"]]
    return ", ".join(parts)


def chosen(study, entry):
    runs = study.select(entry["where"])
    if not runs:
        raise FigureError("no run of the study is chosen by 'where'")
    return runs


def by_series(runs, entry, style):
    """Runs grouped by series, in the order of the style."""
    groups = {}
    for run in runs:
        groups.setdefault(label_of(run, entry), []).append(run)
    return dict(sorted(groups.items(), key=lambda item: style.rank(item[0])))


def one_size(runs, entry):
    """Runs at the asked cell size(s), else at the finest that is planned for all variants."""
    asked = entry.get("L")
    if asked is not None:
        sizes = asked if isinstance(asked, list) else [asked]
        found = [r for r in runs if any(math.isclose(r.values.get("L") or -1, s, rel_tol=1e-9) for s in sizes)]
        if not found:
            raise FigureError(f"no run has L = {asked}")
        return found
    per_variant = {}
    for run in runs:
        if isinstance(run.values.get("L"), (int, float)):
            per_variant.setdefault(run.name, set()).add(run.values["L"])
    if not per_variant:
        raise FigureError("no run has a cell size")
    common = set.intersection(*per_variant.values())
    finest = min(common) if common else None
    return [r for r in runs if (r.values.get("L") == finest if finest is not None
                                else r.values.get("L") == min(per_variant.get(r.name, {math.inf})))]


def with_result(runs, notes, completed=True):
    """The first repeat of each run that can be shown; the others are told."""
    good, seen = [], set()
    for run in runs:
        key = tuple((k, str(v)) for k, v in run.values.items() if k not in ("repeat", "dt"))
        if run.result is None or (completed and not run.completed):
            notes.append(f"{run.name} ({short('L', run.values.get('L', '?'))}) is not shown: {run.status}")
        elif key not in seen:
            seen.add(key)
            good.append(run)
    if not good:
        raise FigureError("no run has a result to show: " + "; ".join(dict.fromkeys(notes)))
    notes[:] = list(dict.fromkeys(notes))
    return good


def _sizes_axis(axis, values, formatter="{:g}"):
    """A log axis ticked at the values that occur, thinned until the labels fit."""
    values = sorted(set(values))
    shown, last = [], None
    span = math.log(values[-1] / values[0]) if len(values) > 1 else 1.0
    for value in values:
        if last is None or math.log(value / last) > 0.11 * span:
            shown.append(value)
            last = value
    axis.set_major_locator(FixedLocator(shown))
    axis.set_major_formatter(FuncFormatter(lambda v, _: formatter.format(v)))
    axis.set_minor_locator(FixedLocator(values))
    axis.set_minor_formatter(NullFormatter())


def _log_y(axis, low, high):
    """Ticks of a log axis that are readable over a small range as well."""
    axis.set_ylim(low, high)
    if math.log10(high / low) < 1.3:
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axis.yaxis.set_minor_locator(NullLocator())
    else:
        axis.yaxis.set_minor_formatter(NullFormatter())


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


def _rails(axis, lost, style, text):
    """Runs without a number above the axes, one row per series: hollow marker and a cross."""
    transform = axis.get_xaxis_transform()
    height = axis.get_position().height * axis.figure.get_figheight()
    for row, (label, where) in enumerate(lost.items()):
        y = 1.0 + (0.08 + 0.12 * row) / height
        axis.plot([0, 1], [y, y], transform=axis.transAxes, color="0.85", linewidth=0.6, clip_on=False, zorder=1)
        axis.plot(where, [y] * len(where), transform=transform, linestyle="none", marker=style.marker(label),
                  markersize=5.5, markerfacecolor="white", markeredgecolor=style.colour(label), clip_on=False)
        axis.plot(where, [y] * len(where), transform=transform, linestyle="none", marker="x", markersize=3,
                  color=style.colour(label), clip_on=False)
        if row == 0:
            axis.annotate(text, (0, y), xycoords="axes fraction", xytext=(-3, 0), textcoords="offset points",
                          fontsize=6.5, color=RAIL, ha="right", va="center", annotation_clip=False)


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
        _log_y(axis, low / 1.6, high)
    else:  # a ratio, not an error
        margin = 0.15 * (top - low) or 0.1 * abs(top)
        axis.set_ylim(low - margin, top + margin)
    span = max(everything) / min(everything)
    axis.set_xlim(min(everything) / span**0.05 / 1.02, max(everything) * span**0.05 * 1.02)
    _sizes_axis(axis.xaxis, everything)
    axis.set_xlabel(X_NAMES.get(x, x))
    axis.set_ylabel(name_of(quantity, norm))
    _rails(axis, failing, style, "failed")
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


def work_precision(study, entry, style):
    quantity, norm = entry["quantity"], entry.get("norm", "")
    runs, notes = chosen(study, entry), []
    series, failing = {}, {}
    for label, own in by_series(runs, entry, style).items():
        points, lost = {}, []
        for run in own:
            key = tuple((k, str(v)) for k, v in run.values.items() if k not in ("repeat", "dt"))
            error, seconds = abs(run.value(quantity, norm)), run.value("solve_s")
            if math.isfinite(error) and seconds > 0:  # an error of zero is exact, not lost
                points.setdefault(key, []).append((run.values.get("L"), max(error, np.finfo(float).tiny), seconds))
            elif seconds > 0:
                lost.append(seconds)
        rows = [(p[0][0], np.mean([q[1] for q in p]), *np.percentile([q[2] for q in p], [50, 0, 100]))
                for p in points.values()]
        series[label] = np.array(sorted(rows, reverse=True), float).reshape(-1, 5)
        if lost:
            failing[label] = sorted(lost)
        without = [r for r in own if not r.value("solve_s") > 0]
        if without:
            notes.append(f"{label}: {len(without)} of {len(own)} runs have no result")
    exact = [label for label, s in series.items() if len(s) and (s[:, 1] < metrics.ROUNDING).all()]
    exact = [] if len(exact) == sum(len(s) > 0 for s in series.values()) or not metrics.is_error(quantity, norm) else exact
    finite = np.concatenate([s for label, s in series.items() if len(s) and label not in exact] or [np.empty((0, 5))])
    if not len(finite):
        raise FigureError(f"no completed run has {quantity} {norm} and a solve time".replace("  ", " "))
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape([f"{label}: exact (≤ 1.00e-12)" if label in exact else label for label in series], width)
    figure, axes = frame(width, 2.3, rows, rails=len(failing), left=0.62, right=0.12)
    axis = axes[0, 0]
    handles = []
    for label, data in series.items():
        text = f"{label}: exact (≤ {number(data[:, 1].max())})" if label in exact else label
        handles.append(Line2D([], [], **style.of(label), label=text))
        if label in exact:
            _floor(axis, data[:, 2], label, style)
        elif len(data):
            bars = np.array([data[:, 2] - data[:, 3], data[:, 4] - data[:, 2]])
            axis.errorbar(data[:, 2], data[:, 1], xerr=bars, **style.of(label), elinewidth=0.7, capsize=1.8)
    axis.set_xscale("log")
    axis.set_yscale("log")
    high = min(finite[:, 1].max(), 10 * finite[finite[:, 0] >= finite[:, 0].max() / 1.001][:, 1].max())
    if finite[:, 1].max() > 1.6 * high:
        notes.append("Errors above the upper edge are off the scale")
    _log_y(axis, finite[:, 1].min() / 1.6, high * 1.6)
    every = np.concatenate([s[:, k] for s in series.values() if len(s) for k in (3, 4)] + list(failing.values()))
    axis.set_xlim(every.min() / 1.5, every.max() * 1.5)
    axis.xaxis.set_minor_formatter(NullFormatter())
    axis.set_xlabel("Solve time [s]")
    axis.set_ylabel(name_of(quantity, norm))
    _rails(axis, failing, style, "failed")
    legend_below(figure, handles, columns)
    if exact:
        notes.append("Methods that are exact to rounding stand on the lower edge")
    notes.insert(0, "Medians of repeats with their range; set-up and output are left out")
    return Drawing(figure, runs, notes)


def _axis_scale(values, unit):
    finite = np.concatenate([np.ravel(v) for v in values])
    finite = finite[np.isfinite(finite)]
    return nice_unit(unit, np.max(np.abs(finite)) if len(finite) else 0.0)


def _snapshot(run, entry):
    if not run.result.snapshots:
        raise ResultError(f"{run.id}: lacks snapshots")
    try:
        return run.result.snapshots[entry.get("snapshot", -1)]
    except IndexError:
        raise FigureError(f"{run.id} has no snapshot {entry['snapshot']}") from None


def _where_of_title(snapshots):
    """'t = 1.2 s' when all snapshots agree."""
    times = {f"{s.time:.4g}" for s in snapshots if s.time is not None}
    return f"At t = {times.pop()} s" if len(times) == 1 else ""


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
            snapshot = _snapshot(run, entry)
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
    unit, factor = _axis_scale([v for _, _, _, v, _ in lines],
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
    value_name = f"{components.symbol(component)} [{unit}]"
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
    notes.insert(0, _where_of_title(snapshots))
    return Drawing(figure, runs, [n for n in dict.fromkeys(notes) if n])


def _squares(snapshot):
    """Corners (N, 4, 2) of squares with each point's current area, about its current position."""
    centre = snapshot["position"][:, :2]
    area = snapshot["volume"] if "volume" in snapshot else snapshot["initial_volume"]
    half = 0.5 * np.sqrt(np.clip(np.nan_to_num(area), 0.0, None))
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    return centre[:, None, :] + half[:, None, None] * corners[None]


def _limits(values, given=None):
    """(low, high, map): 1st to 99th percentile; a diverging map about zero when both signs occur."""
    if given:
        return given[0], given[1], "RdBu_r" if given[0] < 0 < given[1] else "viridis"
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        return 0.0, 1.0, "viridis"
    low, high = np.percentile(finite, [1, 99])
    if low < 0 < high and min(-low, high) > 0.1 * max(-low, high):
        bound = max(-low, high)
        return -bound, bound, "RdBu_r"
    return (low, high, "viridis") if high > low else (low - 0.5, high + 0.5, "viridis")


def field_maps(study, entry, style):
    component, notes = entry["component"], []
    runs = with_result(one_size(chosen(study, entry), entry), notes)
    shown = [(label, run, _snapshot(run, entry)) for label, own in by_series(runs, entry, style).items() for run in own]
    values = [of_snapshot(s, component) for _, _, s in shown]
    errors = [v - of_snapshot(s, component, True) if components.has_exact(s, component) else None
              for v, (_, _, s) in zip(values, shown)]
    with_error = entry.get("error", True) and any(e is not None for e in errors)
    squares = [_squares(s) for _, _, s in shown]
    every = np.concatenate([q.reshape(-1, 2) for q in squares])
    every = every[np.isfinite(every).all(axis=1)]
    if not len(every):
        raise FigureError("no point has a finite position")
    (x0, y0), (x1, y1) = np.percentile(every, 0.1, axis=0), np.percentile(every, 99.9, axis=0)
    pad = 0.03 * max(x1 - x0, y1 - y0)
    x0, x1, y0, y1 = x0 - pad, x1 + pad, y0 - pad, y1 + pad
    name = components.split(component)[0]
    base = shown[0][2].unit(name) or components.default_unit(name)

    width = WIDTH[entry.get("width", "page")]
    left, right, gap, top, bottom = 0.5, 1.0, 0.12, 0.28, 0.42
    room = width - left - right
    most = max(1, int(room / (1.5 if x1 - x0 > 1.3 * (y1 - y0) else 0.8)))
    columns = min(entry.get("columns", most), len(shown), max(1, int(room / 0.8)))
    bands = math.ceil(len(shown) / columns)
    if "columns" not in entry:
        columns = math.ceil(len(shown) / bands)  # rows of like length
    panel = (room - (columns - 1) * gap) / columns
    height = panel * (y1 - y0) / (x1 - x0)
    if height > 2.6:  # tall and narrow bodies
        height, panel = 2.6, 2.6 * (x1 - x0) / (y1 - y0)
        spread = (room - columns * panel) / max(1, columns - 1) if columns > 1 else 0
        gap = min(spread, 1.0)
    kinds = [("value", values)] + ([("error", errors)] if with_error else [])
    rows = bands * len(kinds)
    step = height + top
    total = rows * step + bottom + 0.02
    figure = plt.figure(figsize=(width, total))
    for kind_index, (kind, data) in enumerate(kinds):
        present = [d for d in data if d is not None]
        unit, factor = _axis_scale([np.percentile(np.abs(d[np.isfinite(d)]), 99) if np.isfinite(d).any() else [0.0]
                                    for d in present], base)
        low, high, cmap = _limits([d * factor for d in present], entry.get("range") if kind == "value" else None)
        if kind == "error":
            bound = max(abs(low), abs(high)) or 1.0
            low, high, cmap = -bound, bound, "PuOr"
        mapped = None
        for k, (label, run, _) in enumerate(shown):
            row = kind_index * bands + k // columns
            y = total - (row + 1) * step
            axis = figure.add_axes([(left + (k % columns) * (panel + gap)) / width, y / total, panel / width,
                                    height / total])
            if data[k] is not None:
                cells = PolyCollection(squares[k], array=data[k] * factor, cmap=cmap, linewidths=0, antialiased=False,
                                       rasterized=True)
                cells.set_clim(low, high)
                mapped = axis.add_collection(cells)
            axis.set_xlim(x0, x1)
            axis.set_ylim(y0, y1)
            axis.set_aspect("equal")
            if panel < 0.4:  # room for one number
                axis.set_xticks([0.0 if x0 <= 0 <= x1 else x0])
            else:
                axis.locator_params(axis="x", nbins=2 if panel < 0.8 else 4)
            axis.locator_params(axis="y", nbins=max(2, min(6, int(height / 0.35))))
            axis.set_title(label, pad=3, fontsize=8 if len(label) * 0.07 < panel + gap else 6)
            if k % columns:
                axis.tick_params(labelleft=False)
            else:
                axis.set_ylabel("$y$ [m]")
            if row == rows - 1 or k + columns >= len(shown) and kind_index == len(kinds) - 1:
                axis.set_xlabel("$x$ [m]")
            else:
                axis.tick_params(labelbottom=False)
        overhang = max(0.0, (max(len(label) for label, _, _ in shown) * 0.07 - panel) / 2)  # of a long title
        edge = left + columns * panel + (columns - 1) * gap + 0.12 + min(overhang, 0.3)
        y_low, y_high = total - (kind_index + 1) * bands * step, total - kind_index * bands * step - top
        bar = figure.add_axes([edge / width, y_low / total, 0.09 / width, (y_high - y_low) / total])
        colours = figure.colorbar(mapped, cax=bar, extend="both")
        colours.outline.set_linewidth(0.4)
        colours.ax.locator_params(nbins=max(2, min(6, int((y_high - y_low) / 0.3))))
        colours.set_label(f"{'Error of ' if kind == 'error' else ''}"
                          f"{components.symbol(component).split(' ')[-1] if kind == 'error' else components.symbol(component)}"
                          f" [{unit}]")
    notes.insert(0, _where_of_title([s for _, _, s in shown]))
    notes.append("Colours span the 1st to 99th percentile" if "range" not in entry else "")
    return Drawing(figure, [r for _, r, _ in shown], [n for n in dict.fromkeys(notes) if n])


def _history_values(result, entry, exact=False):
    """(M,) of a probe's component or of a global history; None when an exact one is not there."""
    quantity = entry["quantity"]
    if "probe" in entry:
        name, part = components.split(quantity)
        dataset = f"exact_{name}" if exact else name
        if exact and not result.has(f"history/probes/{entry['probe']}/{dataset}"):
            return None
        return components.pick(result.probe(entry["probe"], dataset), name, part)
    if exact:
        return None
    if quantity == "total_energy":
        return metrics.total_energy(result)
    if quantity.startswith("linear_momentum"):
        p = result.history("linear_momentum")
        return {"x": p[:, 0], "y": p[:, 1]}.get(quantity[-1]) if quantity[-2] == "_" else np.hypot(p[:, 0], p[:, 1])
    values = result.history(quantity)
    if values.ndim != 1:
        raise FigureError(f"the history '{quantity}' is not one number per sample")
    return values


def _scale(run, scale):
    if scale is None or scale == "initial":
        return 1.0
    if isinstance(scale, str):
        reference = run.result.reference
        if scale not in reference:
            raise FigureError(f"{run.id} lacks report.reference.{scale}")
        return reference[scale]
    return float(scale)


def history(study, entry, style):
    notes = []
    runs = with_result(one_size(chosen(study, entry), entry), notes, completed=False)
    lines, exact = [], None
    for label, own in by_series(runs, entry, style).items():
        for run in sorted(own, key=lambda r: -(r.values.get("L") or 0)):
            if not run.completed:
                notes.append(f"{label} ({short('L', run.values['L'])}) {run.status}: {run.reason}".rstrip(": "))
            time, values = run.result.history("time"), _history_values(run.result, entry)
            sx, sy = _scale(run, entry.get("scale_x")), _scale(run, entry.get("scale_y"))
            if entry.get("log"):
                values = np.where(values > 0, values, np.nan)
            keep = time <= entry.get("t_max", math.inf)
            if entry.get("scale_y") == "initial":
                sy = values[0]
            lines.append((label, run, time[keep] / sx, values[keep] / sy))
            true = _history_values(run.result, entry, True)
            if true is not None and run.completed and (exact is None or len(time) > len(exact[0])):
                exact = (time[keep] / sx, true[keep] / sy)
    several = len({line[1].values["L"] for line in lines}) > 1
    names = [f"{l}, L = {r.values['L']:g} m" if several else l for l, r, _, _ in lines]
    if "probe" in entry:
        name, _ = components.split(entry["quantity"])
        title, unit = components.symbol(entry["quantity"]), components.default_unit(name)
    else:
        title, unit = HISTORY_NAMES.get(entry["quantity"], (entry["quantity"].replace("_", " "), ""))
    bounded = [v for (_, r, _, v) in lines if r.completed] or [v for *_, v in lines]
    factor = 1.0
    if "scale_y" in entry:
        by = entry["scale_y"]
        title = title.split(" ")[-1] if "$" in title else title
        by = "initial value" if by == "initial" else by
        title, unit = f"{title} / {by.replace('_', ' ') if isinstance(by, str) else number(by)}", ""
        largest = max(np.nanmax(np.abs(v)) for v in bounded)
        if 0 < largest < 1e-2:  # the power of ten goes into the label: long tick labels would push it off the page
            power = 3 * math.floor(math.log10(largest) / 3)
            unit, factor = rf"$10^{{{power}}}$", 10.0**-power
    else:
        unit, factor = _axis_scale(bounded, unit)
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(names + (["exact"] if exact else []), width)
    figure, axes = frame(width, 2.1, rows, left=0.62, right=0.12)
    axis, handles = axes[0, 0], []
    if exact:
        axis.plot(exact[0], exact[1] * factor, **EXACT)
    for k, ((label, run, time, values), name) in enumerate(zip(lines, names)):
        look = style.of(label) if not several else style.of(label) | {"linestyle": ("-", "--", "-.", ":")[
            sorted({l[1].values["L"] for l in lines}, reverse=True).index(run.values["L"]) % 4]}
        every = max(1, len(time) // 8)
        axis.plot(time, values * factor, **look, markevery=(k * every // max(1, len(lines)), every), markersize=3)
        handles.append(Line2D([], [], **look, label=name, markersize=3))
    low = min(np.nanmin(np.where(np.isfinite(v), v, np.nan)) for v in bounded) * factor
    high = max(np.nanmax(np.where(np.isfinite(v), v, np.nan)) for v in bounded) * factor
    if exact:
        low, high = min(low, exact[1].min() * factor), max(high, exact[1].max() * factor)
    if entry.get("log"):
        axis.set_yscale("log")
        positive = np.concatenate([v[v > 0] for v in bounded if (v > 0).any()] or [[1.0]]) * factor
        axis.set_ylim(max(positive.min(), positive.max() * 1e-12) / 2, positive.max() * 2)
    else:
        pad = 0.06 * (high - low) or 1.0
        axis.set_ylim(low - pad, high + pad)
    axis.set_xlim(0, max(t[-1] for _, _, t, _ in lines if len(t)))
    scale = entry.get("scale_x")
    axis.set_xlabel("Time $t$ [s]" if scale is None else
                    f"Time / {scale.replace('_', ' ') if isinstance(scale, str) else number(scale)}")
    axis.set_ylabel(f"{title} [{unit}]" if unit else title)
    if exact:
        handles.append(Line2D([], [], **EXACT))
    legend_below(figure, handles, columns)
    return Drawing(figure, runs, list(dict.fromkeys(notes)))


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


KINDS = {"convergence": convergence, "work_precision": work_precision, "profile": profile, "field": field_maps,
         "history": history, "bars": bars}


def draw(study, entry, style):
    """Draws one declared figure; raises FigureError or ResultError with the reason when it cannot."""
    try:
        return KINDS[entry["kind"]](study, entry, style)
    except (FigureError, ResultError):
        raise
    except Exception as error:  # odd data must not take the report with it
        raise FigureError(f"cannot be drawn: {type(error).__name__}: {error}") from error
