"""Maps over the points: a field, or stripes of the initial position that show the motion."""
import itertools
import math
from dataclasses import dataclass, replace

import numpy as np
from matplotlib.collections import PolyCollection
from matplotlib.patches import Rectangle

from ..read.figure_tables import figure_kind
from ..read.study_reader import FLAG, LIST, NUMBER, TEXT, WHOLE
from ..read.spelling import did_you_mean
from .drawing import Drawing, FigureError, by_series, chosen, one_size, snapshot_of, where_of_title, with_result
from .map_layers import PATTERNS, Layer, field_layers, inclusions, squares, stripes
from .style import WIDTH, plt

INCLUSION, OUTLINE, WALL = "0.62", "0.1", "0.45"
OVERLAP = 1.25  # of the squares that close the gaps between stretched neighbours
LEFT, RIGHT, TOP, BOTTOM = 0.5, 1.0, 0.28, 0.42  # inches about the panels
TALLEST = 2.6  # panel, inches


def _draw_points(axis, snapshot, data, layer, entry):
    """Squares of the points, larger ones below so that stretched neighbours leave no gaps; inclusions grey and outlined."""
    grey = inclusions(snapshot, entry)
    for order, scale in enumerate((OVERLAP, 1.0)):
        shown = squares(snapshot, scale)[~grey]
        look = {"array": data[~grey], "cmap": layer.cmap, "clim": (layer.low, layer.high)} if layer.cmap else \
            {"facecolors": data[~grey]}
        mapped = axis.add_collection(PolyCollection(shown, linewidths=0, antialiased=False, rasterized=True,
                                                    zorder=1 + 0.1 * order, **look))
    for order, (scale, colour) in enumerate(((1.6, OUTLINE), (1.15, INCLUSION))):
        if grey.any():
            axis.add_collection(PolyCollection(squares(snapshot, scale)[grey], facecolors=colour, linewidths=0, antialiased=False,
                                               rasterized=True, zorder=1.3 + 0.1 * order))
    return mapped


def _walls(snapshot):
    """[(low corner (2,), high corner (2,))] of the scene's walls at the time of a snapshot."""
    result, boxes = snapshot.result, []
    for wall in result.resolved.get("wall", []):
        try:
            low, high = (np.array(wall[key], dtype=float)[:2] for key in ("min", "max"))
        except (KeyError, TypeError, ValueError):
            continue
        if wall.get("name") in result.supports and result.has(f"history/supports/{wall['name']}/displacement"):
            moved, time = result.support(wall["name"], "displacement"), result.history("time")
            shift = np.array([np.interp(snapshot.time, time, moved[:, k]) for k in range(2)])
            low, high = low + shift, high + shift
        door = wall.get("door") if snapshot.time >= wall.get("door_opens", 0.0) else None
        if door:  # an opening along the longer side
            along = np.arange(2) == np.argmax(high - low)
            boxes += [(low, np.where(along, door[0], high)), (np.where(along, door[1], low), high)]
        else:
            boxes.append((low, high))
    return boxes


def _draw_walls(axis, snapshot, view):
    for low, high in _walls(snapshot):
        low, high = np.clip(low, view[0] - 1, view[1] + 1), np.clip(high, view[0] - 1, view[1] + 1)
        axis.add_patch(Rectangle(low, *(high - low), facecolor="0.93", edgecolor=WALL, hatch="/////", linewidth=0.6, zorder=0.5))


def _draw_curves(axis, snapshot, names):
    """Reference curves of the scene, such as a measured surface."""
    known = snapshot.result.curves
    for name, line in zip(names, itertools.cycle(("--", "-.", ":"))):
        if name not in known:
            raise FigureError(f"the scene has no [[report.curve]] '{name}'{did_you_mean(name, known)}")
        axis.plot(*known[name], color="black", linestyle=line, linewidth=1.0, zorder=3)


def _view(snapshots):
    """Corners (2,), (2,) of what is shown: all points but for the farthest thousandth, with a margin."""
    every = np.concatenate([squares(s).reshape(-1, 2) for s in snapshots])
    every = every[np.isfinite(every).all(axis=1)]
    if not len(every):
        raise FigureError("no point has a finite position")
    low, high = np.percentile(every, 0.1, axis=0), np.percentile(every, 99.9, axis=0)
    pad = (0.05 if any(_walls(s) for s in snapshots) else 0.03) * max(high - low)
    return low - pad, high + pad


def _bar(figure, mapped, layer, box):
    """The colour bar in a box (x, y, height) of inches."""
    width, total = figure.get_size_inches()
    bar = figure.add_axes([box[0] / width, box[1] / total, 0.09 / width, box[2] / total])
    colours = figure.colorbar(mapped, cax=bar, extend="both")
    colours.outline.set_linewidth(0.4)
    colours.ax.locator_params(nbins=max(2, min(6, int(box[2] / 0.3))))
    colours.set_label(layer.title)


def _scale_axes(axis, view, width, height):
    """True to scale, with ticks for a panel of so many inches."""
    axis.set_xlim(view[0][0], view[1][0])
    axis.set_ylim(view[0][1], view[1][1])
    axis.set_aspect("equal")
    if width < 0.4:  # room for one number
        axis.set_xticks([0.0 if view[0][0] <= 0 <= view[1][0] else view[0][0]])
    else:
        axis.locator_params(axis="x", nbins=2 if width < 0.8 else 4)
    axis.locator_params(axis="y", nbins=max(2, min(6, int(height / 0.35))))


@dataclass
class Layout:
    """Lines of panels on a figure, in inches; a row of panels takes `bands` lines."""
    width: float
    lines: int
    bands: int
    columns: int
    panel: tuple  # width and height of one
    gap: float
    left: float
    edge: float  # where the colour bars stand

    @property
    def step(self):
        return self.panel[1] + TOP

    @property
    def height(self):
        return self.lines * self.step + BOTTOM + 0.02

    def box(self, line, column):
        """Where a panel stands, in shares of the figure."""
        return [(self.left + column * (self.panel[0] + self.gap)) / self.width, (self.height - (line + 1) * self.step) / self.height,
                self.panel[0] / self.width, self.panel[1] / self.height]

    def bar(self, first, lines):
        """Where the colour bar of some lines stands: (x, y, height)."""
        room = lines * self.step - TOP
        long = min(room, 3.0)
        return self.edge, self.height - (first + lines) * self.step + (room - long) / 2, long


def _layout(entry, labels, rows, layers, ratio):
    """The layout for so many rows and layers of panels whose height is `ratio` times their width."""
    width, right = WIDTH[entry.get("width", "page")], 0.15 if entry.get("deformed_grid", False) else RIGHT
    left = LEFT + (0.18 if rows > 1 else 0.0)  # times beside the rows
    gap, room = 0.12, width - left - right
    most = max(1, int(room / (1.5 if ratio < 1 / 1.3 else 0.8)))
    columns = min(entry.get("columns", most), len(labels), max(1, int(room / 0.8)))
    bands = math.ceil(len(labels) / columns)
    if "columns" not in entry:
        columns = math.ceil(len(labels) / bands)  # rows of like length
    panel = (room - (columns - 1) * gap) / columns
    height = panel * ratio
    if height > TALLEST:  # tall and narrow bodies
        height, panel = TALLEST, TALLEST / ratio
        spread = (room - columns * panel) / max(1, columns - 1) if columns > 1 else 0
        gap = min(spread, 0.45)
    longest = max(len(label) for label in labels) * 0.07
    edge = left + columns * panel + (columns - 1) * gap + 0.12 + min(max(0.0, (longest - panel) / 2), 0.3)  # of a long title
    return Layout(min(width, edge + right - 0.12), bands * rows * layers, bands, columns, (panel, height), gap, left, edge)


def _label_axes(axis, left, bottom, text):
    """Titles and tick labels of a panel, where it stands at the left or the bottom."""
    if left:
        axis.set_ylabel(text + "$y$ [m]")
    else:
        axis.tick_params(labelleft=False)
    if bottom:
        axis.set_xlabel("$x$ [m]")
    else:
        axis.tick_params(labelbottom=False)


def _draw_layer(figure, layout, first, layer, rows, view, entry):
    """The panels of a layer, from the line `first` on, and its colour bar."""
    mapped = None
    for number, row in enumerate(rows):
        top = first + number * layout.bands
        time = where_of_title([s for _, _, s in row]).removeprefix("At ")
        text = f"({chr(ord('a') + number)}) {time}\n" if len(rows) > 1 else ""
        for k, (label, _, snapshot) in enumerate(row):
            line, column = divmod(k, layout.columns)
            axis = figure.add_axes(layout.box(top + line, column))
            if layer.data[number][k] is not None:
                mapped = _draw_points(axis, snapshot, layer.data[number][k], layer, entry)
            _draw_walls(axis, snapshot, view)
            _draw_curves(axis, snapshot, entry.get("curves", []))
            _scale_axes(axis, view, *layout.panel)
            axis.set_title(label, pad=3, fontsize=8 if len(label) * 0.07 < layout.panel[0] + layout.gap else 6)
            _label_axes(axis, column == 0, top + layout.bands == layout.lines and k + layout.columns >= len(row), text)
    if mapped is not None and layer.cmap:
        _bar(figure, mapped, layer, layout.bar(first, layout.bands * len(rows)))


@dataclass
class Maps:
    """What is shown: `series` of (label, run), a row of (label, run, snapshot) for each time, and what all panels share."""
    series: list
    rows: list
    layers: list
    view: tuple

    @classmethod
    def of(cls, study, entry, style, notes):
        runs = with_result(one_size(chosen(study, entry), entry), notes, completed=not entry.get("unfinished"))
        series = [(label, run) for label, own in by_series(runs, entry, style).items() for run in own]
        wanted = entry.get("snapshot", -1)
        wanted = wanted if isinstance(wanted, list) else [wanted]
        rows = [[(label, run, snapshot_of(run, index)) for label, run in series] for index in wanted]
        layers = [Layer("", [[stripes(s, entry) for _, _, s in row] for row in rows])] if entry.get("deformed_grid", False) else \
            field_layers(rows, entry)
        return cls(series, rows, layers, _view([s for row in rows for _, _, s in row]))

    @property
    def snapshots(self):
        return [s for row in self.rows for _, _, s in row]

    def row(self, number):
        """The same, of one row alone, on the scales of all."""
        layers = [replace(layer, data=[layer.data[number]]) for layer in self.layers]
        return replace(self, rows=[self.rows[number]], layers=layers)

    def draw(self, entry):
        """The figure of all panels; with `tell_time` it says when, as a picture without a caption must."""
        extent = self.view[1] - self.view[0]
        layout = _layout(entry, [label for label, _ in self.series], len(self.rows), len(self.layers), extent[1] / extent[0])
        figure = plt.figure(figsize=(layout.width, layout.height))
        for number, layer in enumerate(self.layers):
            _draw_layer(figure, layout, number * layout.bands * len(self.rows), layer, self.rows, self.view, entry)
        if entry.get("tell_time") and len(self.rows) == 1:
            figure.text(0.01, 0.995, where_of_title(self.snapshots).removeprefix("At "), va="top", fontsize=8)
        return figure


def _notes(entry, snapshots):
    notes = []
    if not entry.get("deformed_grid", False) and "range" not in entry:
        notes.append("Colours span the 1st to 99th percentile")
    if entry.get("curves"):
        notes.append(f"Broken lines: reference {', '.join(entry['curves'])}".replace("_", " "))
    if any(inclusions(s, entry).any() for s in snapshots):
        notes.append("Other bodies than the first are grey")
    return notes


def _check_keys(reader, entry, index):
    if ("component" in entry) == entry.get("deformed_grid", False):
        reader.fail(f"[[figure]] number {index + 1} needs either the key 'component' or 'deformed_grid = true'",
                    "kind", "figure", index)
    for key in {"pattern", "spacing"} & set(entry) if "component" in entry else ():
        reader.fail(f"'{key}' in [[figure]] number {index + 1} means nothing without 'deformed_grid = true'", key, "figure", index)
    reader.choice(entry.get("pattern", PATTERNS[0]), PATTERNS, "pattern", "figure", index)
    if entry.get("spacing", 1) <= 0:
        reader.fail(f"'spacing' in [[figure]] number {index + 1} must be positive", "spacing", "figure", index)


@figure_kind("field", {}, {"component": TEXT, "L": NUMBER, "range": LIST, "error": FLAG, "columns": WHOLE, "snapshot": WHOLE + LIST,
                          "inclusions": FLAG, "curves": LIST, "deformed_grid": FLAG, "pattern": TEXT, "spacing": NUMBER}, _check_keys)
def field_maps(study, entry, style):
    """Panels: variants across, snapshots down; errors, where there are any, below the values."""
    notes = []
    maps = Maps.of(study, entry, style, notes)
    if len(maps.rows) == 1:
        notes.insert(0, where_of_title(maps.snapshots))
    notes += _notes(entry, maps.snapshots)
    return Drawing(maps.draw(entry), [run for _, run in maps.series], [n for n in dict.fromkeys(notes) if n])
