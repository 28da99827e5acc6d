"""Lines over time, and of one history against another."""
import math

import numpy as np
from matplotlib.lines import Line2D

from ..grade import components, metrics
from ..grade.targets import number
from ..read.figure_tables import figure_kind
from ..read.study_reader import FLAG, LIST, NUMBER, TEXT
from .drawing import HISTORY_NAMES, Drawing, FigureError, axis_scale, by_series, chosen, one_size, short, with_result, with_unit
from .style import EXACT, WIDTH, frame, legend_below, legend_shape


def signal(result, quantity, support=None, probe=None, exact=False):
    """(M,) a component of a support's or a probe's history, or a global history; None when an exact one is not there."""
    if support or probe:
        name, part = components.split(quantity)
        if exact and not (probe and result.has(f"history/probes/{probe}/exact_{name}")):
            return None
        if support:
            return components.pick(result.support(support, name), name, part)
        return components.pick(result.probe(probe, f"exact_{name}" if exact else name), name, part)
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


def _title(quantity, of_component):
    """(what the axis is called, SI unit) of a history."""
    if of_component:
        return components.symbol(quantity), components.default_unit(components.split(quantity)[0])
    return HISTORY_NAMES.get(quantity, (quantity.replace("_", " "), ""))


def named_number(run, value):
    """A number, or the one of a name of report.reference; '-name' is its negative."""
    if not isinstance(value, str):
        return float(value)
    name, reference = value.removeprefix("-"), run.result.reference
    if name not in reference:
        raise FigureError(f"{run.id} lacks report.reference.{name}")
    return -reference[name] if value.startswith("-") else reference[name]


def _scale(run, scale):
    return 1.0 if scale is None or scale == "initial" else named_number(run, scale)


def _told(value):
    """A scale in words."""
    return value.removeprefix("-").replace("_", " ") if isinstance(value, str) else number(value)


def _collect(study, entry, style, notes, of_run):
    """(runs, [(label, run, x (M,), y (M,))]), coarse before fine; runs that did not complete are shown and told."""
    runs = with_result(one_size(chosen(study, entry), entry), notes, completed=False)
    lines = []
    for label, own in by_series(runs, entry, style).items():
        for run in sorted(own, key=lambda r: -(r.values.get("L") or 0)):
            if not run.completed:
                notes.append(f"{label} ({short('L', run.values['L'])}) {run.status}: {run.reason}".rstrip(": "))
            lines.append((label, run, *of_run(run)))
    return runs, lines


def _names(lines):
    """(name of each line in the legend, whether cell sizes differ)."""
    several = len({run.values["L"] for _, run, _, _ in lines}) > 1
    return [f"{label}, L = {run.values['L']:g} m" if several else label for label, run, _, _ in lines], several


def _bounded(lines, index):
    """The data of completed runs, which set the range of an axis; of all when none completed."""
    return [line[index] for line in lines if line[1].completed] or [line[index] for line in lines]


def _draw_lines(axis, lines, style, factor_x, factor_y):
    """Draws the lines; returns a legend handle for each name."""
    names, several = _names(lines)
    sizes, handles = sorted({run.values["L"] for _, run, _, _ in lines}, reverse=True), {}
    for k, ((label, run, x, y), name) in enumerate(zip(lines, names)):
        look = style.of(label)
        if several:
            look |= {"linestyle": ("-", "--", "-.", ":")[sizes.index(run.values["L"]) % 4]}
        every = max(1, len(x) // 8)
        axis.plot(x * factor_x, y * factor_y, **look, markevery=(k * every // max(1, len(lines)), every), markersize=3)
        handles.setdefault(name, Line2D([], [], **look, label=name, markersize=3))
    return list(handles.values())


def _range(values, factor, more=()):
    """(low, high) of finite values and of `more`, with a margin."""
    finite = np.concatenate([np.ravel(v) for v in values] + [np.ravel(m) for m in more]) * factor
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        raise FigureError("no run has a finite number to show")
    pad = 0.06 * np.ptp(finite) or 1.0
    return finite.min() - pad, finite.max() + pad


def _check_recorder(reader, entry, index):
    if "support" in entry and "probe" in entry:
        reader.fail(f"[[figure]] number {index + 1} takes its quantity from a support or a probe, not both", "probe", "figure", index)


@figure_kind("history", {"quantity": TEXT}, {"probe": TEXT, "support": TEXT, "L": NUMBER + LIST, "scale_x": TEXT + NUMBER,
                                             "scale_y": TEXT + NUMBER, "log": FLAG, "t_max": NUMBER}, _check_recorder)
def history(study, entry, style):
    notes, exact = [], []
    of = {"support": entry.get("support"), "probe": entry.get("probe")}

    def of_run(run):
        time, values = run.result.history("time"), signal(run.result, entry["quantity"], **of)
        keep, sx = time <= entry.get("t_max", math.inf), _scale(run, entry.get("scale_x"))
        if entry.get("log"):
            values = np.where(values > 0, values, np.nan)
        sy = values[0] if entry.get("scale_y") == "initial" else _scale(run, entry.get("scale_y"))
        true = signal(run.result, entry["quantity"], **of, exact=True)
        if true is not None and run.completed and (not exact or len(time) > len(exact[0])):
            exact[:] = time[keep] / sx, true[keep] / sy
        return time[keep] / sx, values[keep] / sy

    runs, lines = _collect(study, entry, style, notes, of_run)
    title, unit = _title(entry["quantity"], of["support"] or of["probe"])
    bounded, factor = _bounded(lines, 3), 1.0
    if "scale_y" in entry:
        by = "initial value" if entry["scale_y"] == "initial" else _told(entry["scale_y"])
        title, unit = f"{title.split(' ')[-1] if '$' in title else title} / {by}", ""
        largest = max(np.nanmax(np.abs(v)) for v in bounded)
        if 0 < largest < 1e-2:  # the power of ten goes into the label: long tick labels would push it off the page
            power = 3 * math.floor(math.log10(largest) / 3)
            unit, factor = rf"$10^{{{power}}}$", 10.0**-power
    else:
        unit, factor = axis_scale(bounded, unit)
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(list(dict.fromkeys(_names(lines)[0])) + (["exact"] if exact else []), width)
    figure, axes = frame(width, 2.1, rows, left=0.62, right=0.12)
    axis = axes[0, 0]
    if exact:
        axis.plot(exact[0], exact[1] * factor, **EXACT)
    handles = _draw_lines(axis, lines, style, 1.0, factor)
    if entry.get("log"):
        axis.set_yscale("log")
        positive = np.concatenate([v[v > 0] for v in bounded if (v > 0).any()] or [[1.0]]) * factor
        axis.set_ylim(max(positive.min(), positive.max() * 1e-12) / 2, positive.max() * 2)
    else:
        axis.set_ylim(*_range(bounded, factor, exact[1:]))
    axis.set_xlim(0, max(t[-1] for _, _, t, _ in lines if len(t)))
    scale = entry.get("scale_x")
    axis.set_xlabel("Time $t$ [s]" if scale is None else f"Time / {_told(scale)}")
    axis.set_ylabel(with_unit(title, unit))
    if exact:
        handles.append(Line2D([], [], **EXACT))
    legend_below(figure, handles, columns)
    return Drawing(figure, runs, list(dict.fromkeys(notes)))


def _side(entry, side):
    """What an axis of a curve shows: (quantity, where it is recorded)."""
    return entry[side], {key: entry.get(f"{side}_{key}") for key in ("support", "probe")}


def _axis_of_curve(entry, side, values):
    """(title, factor) of an axis: words of the entry, else those of the quantity; a scaled one has no unit unless one is given."""
    quantity, where = _side(entry, side)
    title, unit = _title(quantity, where["support"] or where["probe"])
    if f"scale_{side}" in entry:
        title, unit = f"{title} / {_told(entry[f'scale_{side}'])}", ""
    unit, factor = axis_scale(values, entry.get(f"{side}_unit", unit))
    return with_unit(entry.get(f"{side}_label", title), unit), factor


def _check_recorders(reader, entry, index):
    for side in ("x", "y"):
        if f"{side}_support" in entry and f"{side}_probe" in entry:
            reader.fail(f"[[figure]] number {index + 1} takes '{side}' from a support or a probe, not both", f"{side}_probe",
                        "figure", index)


@figure_kind("curve", {"x": TEXT, "y": TEXT},
             {f"{key}_{side}": TEXT + NUMBER for side in "xy" for key in ("offset", "scale")}
             | {f"{side}_{key}": TEXT for side in "xy" for key in ("support", "probe", "label", "unit")}
             | {"L": NUMBER + LIST, "levels": LIST}, _check_recorders)
def curve(study, entry, style):
    """y against x, both histories less an offset and over a scale; horizontal lines at reference levels."""
    notes = []

    def of_run(run):
        sides = []
        for side in ("x", "y"):
            quantity, where = _side(entry, side)
            values = signal(run.result, quantity, **where) - named_number(run, entry.get(f"offset_{side}", 0.0))
            sides.append(values / _scale(run, entry.get(f"scale_{side}")))
        return sides

    runs, lines = _collect(study, entry, style, notes, of_run)
    levels = {level: named_number(lines[0][1], level) for level in entry.get("levels", [])}
    x, y = _bounded(lines, 2), _bounded(lines, 3)
    (x_title, fx), (y_title, fy) = _axis_of_curve(entry, "x", x), _axis_of_curve(entry, "y", [*y, list(levels.values())])
    width = WIDTH[entry.get("width", "column")]
    columns, rows = legend_shape(list(dict.fromkeys(_names(lines)[0])), width)
    figure, axes = frame(width, 2.1, rows, left=0.62, right=0.12)
    axis = axes[0, 0]
    handles = _draw_lines(axis, lines, style, fx, fy)
    for level, value in levels.items():
        axis.axhline(value * fy, color="0.4", linewidth=0.8, linestyle=(0, (6, 3)), zorder=0)
        text = _told(level) if isinstance(level, str) else f"{value * fy:.4g}"
        axis.annotate(text, (1.0, value * fy), xycoords=("axes fraction", "data"), xytext=(-1, 1.5), textcoords="offset points",
                      fontsize=6.5, color="0.3", ha="right", va="bottom")
    low, high = _range(x, fx)
    margin = 0.06 / 1.12 * (high - low)  # the margin goes where the curve begins and ends
    axis.set_xlim(low + margin if min(np.nanmin(v) for v in x) >= 0 else low, high)
    axis.set_ylim(*_range(y, fy, [list(levels.values())]))
    axis.locator_params(axis="x", nbins=5)
    axis.set_xlabel(x_title)
    axis.set_ylabel(y_title)
    legend_below(figure, handles, columns)
    return Drawing(figure, runs, list(dict.fromkeys(notes)))
