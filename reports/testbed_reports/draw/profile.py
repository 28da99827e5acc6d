"""A component of all points along one direction of the initial position, in panels."""
import math
from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D

from ..grade import components
from ..grade.components import of_snapshot
from ..read.figure_tables import figure_kind
from ..read.study_reader import LIST, NUMBER, TEXT, WHOLE
from .drawing import (Drawing, FigureError, axis_scale, by_series, chosen, one_size, short, snapshot_of, where_of_title, with_result,
                      with_unit)
from .style import EXACT, WIDTH, frame, legend_below, legend_shape

LOOKS = (("o", "#56B4E9"), ("s", "#D55E00"), ("^", "#009E73"), ("D", "#CC79A7"), ("v", "#0072B2"))  # of cell sizes in one panel
PANELS = {"variant": lambda line: line.label, "L": lambda line: short("L", line.size), "none": lambda line: ""}


@dataclass
class Line:
    """The points of a run in order of their place (N,), with the component and its exact value (None: not known), (N,) each."""
    label: str
    run: object
    at: np.ndarray
    value: np.ndarray
    exact: np.ndarray | None

    @property
    def size(self):
        return self.run.values["L"]

    @property
    def thin(self):
        """Every how many points one is drawn."""
        return max(1, len(self.at) // 1500)


def _line(label, run, snapshot, entry):
    component, axis = entry["component"], {"x": 0, "y": 1}[entry.get("along", "y")]
    at = snapshot["initial_position"][:, axis]
    keep = np.ones(len(at), bool)
    if "band" in entry:
        other = snapshot["initial_position"][:, 1 - axis]
        keep = (other >= entry["band"][0]) & (other <= entry["band"][1])
    order = np.argsort(at[keep], kind="stable")
    value = of_snapshot(snapshot, component)[keep][order]
    exact = of_snapshot(snapshot, component, True)[keep][order] if components.has_exact(snapshot, component) else None
    return Line(label, run, at[keep][order], value, exact)


def _collect(runs, entry, style):
    """([Line], [snapshot]) of the runs, coarse before fine."""
    lines, snapshots = [], []
    for label, own in by_series(runs, entry, style).items():
        for run in sorted(own, key=lambda r: -(r.values.get("L") or 0)):
            snapshots.append(snapshot_of(run, entry.get("snapshot", -1)))
            lines.append(_line(label, run, snapshots[-1], entry))
    return lines, snapshots


def _looks(lines, split_by):
    """{cell size: (marker, colour)} where cell sizes are told apart inside a panel; else empty, and series keep their own."""
    sizes = sorted({line.size for line in lines}, reverse=True)
    return {s: LOOKS[k % len(LOOKS)] for k, s in enumerate(sizes)} if split_by == "variant" and len(sizes) > 1 else {}


def _texts(lines, split_by):
    """What the legend says of each line."""
    several = len({line.size for line in lines}) > 1 and split_by != "L"
    return [", ".join(([line.label] if split_by != "variant" else []) + ([f"L = {line.size:g} m"] if several else [])) for line in lines]


def _ordered(along, place, value):
    """(x, y): places stand on the axis along which they lie."""
    return (value, place) if along == "y" else (place, value)


def _draw_line(axis, line, look, along, factor):
    marker, colour = look
    axis.plot(*_ordered(along, line.at[::line.thin], line.value[::line.thin] * factor), linestyle="none", marker=marker, markersize=2.2,
              color=colour, markeredgewidth=0, alpha=0.75, rasterized=len(line.at) > 800)


def _draw_exact(axis, lines, along, factor):
    """The exact solution at the places of the line that has the most."""
    known = [line for line in lines if line.exact is not None]
    if known:
        finest = max(known, key=lambda line: len(np.unique(line.at)))
        places, index = np.unique(np.round(finest.at, 12), return_index=True)
        axis.plot(*_ordered(along, places, finest.exact[index] * factor), **EXACT)


def _label_axes(axes, count, x_name, y_name):
    """Titles and tick labels at the left and the lower edge of the panels, of which there are `count`."""
    columns = axes.shape[1]
    for axis in axes.flat[count:]:
        axis.set_visible(False)
    for axis in axes[:, 0]:
        axis.set_ylabel(y_name)
    for k, axis in enumerate(axes.flat[:count]):
        axis.locator_params(axis="x", nbins=4)
        if k % columns:
            axis.tick_params(labelleft=False)
        if k + columns >= count:
            axis.set_xlabel(x_name)
        else:
            axis.tick_params(labelbottom=False)


def _frame(panels, legend_rows, width):
    """(figure, axes) with rows of like length."""
    rows = math.ceil(len(panels) / max(1, int(width / 1.5)))
    return frame(width, 2.2, legend_rows, rows, math.ceil(len(panels) / rows), left=0.55, right=0.12, gap=(0.2, 0.36),
                 rails=1.4 if len(panels) > 1 else 0, sharex=True, sharey=True)


@figure_kind("profile", {"component": TEXT}, {"along": TEXT, "panels": TEXT, "L": NUMBER + LIST, "band": LIST, "snapshot": WHOLE})
def profile(study, entry, style):
    """Points of each run in the panel of its variant or cell size, over the exact solution."""
    component, along, split_by, notes = entry["component"], entry.get("along", "y"), entry.get("panels", "variant"), []
    if along not in ("x", "y"):
        raise FigureError("'along' must be 'x' or 'y'")
    if split_by not in PANELS:
        raise FigureError("'panels' must be 'variant', 'L' or 'none'")
    runs = with_result(one_size(chosen(study, entry), entry), notes, completed=not entry.get("unfinished"))
    lines, snapshots = _collect(runs, entry, style)
    field_name = components.split(component)[0]
    unit, factor = axis_scale([line.value for line in lines], snapshots[0].unit(field_name) or components.default_unit(field_name))

    texts, panels = _texts(lines, split_by), {}
    for line, text in zip(lines, texts):
        panels.setdefault(PANELS[split_by](line), []).append((line, text))
    has_exact = any(line.exact is not None for line in lines)
    width = WIDTH[entry.get("width", "page" if len(panels) > 1 else "column")]
    columns, rows = legend_shape([text for text in dict.fromkeys(texts) if text] + (["exact"] if has_exact else []), width)
    figure, axes = _frame(panels, rows, width)
    looks, handles = _looks(lines, split_by), {}
    for axis, (title, own) in zip(axes.flat, panels.items()):
        for line, text in own:
            look = looks.get(line.size) or (style.marker(line.label), style.colour(line.label))
            _draw_line(axis, line, look, along, factor)
            if text:
                handles[text] = Line2D([], [], linestyle="none", marker=look[0], markersize=4, color=look[1], label=text)
            if line.thin > 1:
                notes.append(f"Every {line.thin}th point of the finest runs is drawn")
        _draw_exact(axis, [line for line, _ in own], along, factor)
        if len(panels) > 1:
            axis.set_title(title, pad=3)
    place = f"Initial position ${along.upper()}$ [m]"
    _label_axes(axes, len(panels), *_ordered(along, place, with_unit(components.symbol(component), unit)))
    if has_exact:
        handles["exact"] = Line2D([], [], **EXACT)
    legend_below(figure, list(handles.values()), columns)
    notes.insert(0, where_of_title(snapshots))
    return Drawing(figure, runs, [n for n in dict.fromkeys(notes) if n])
