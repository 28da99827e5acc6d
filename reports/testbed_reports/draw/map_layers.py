"""What a map shows of the points: values of a field, errors, stripes of the initial position, and the squares that stand for the points."""
import math
from dataclasses import dataclass

import numpy as np

from ..grade import components
from ..grade.components import of_snapshot
from .drawing import axis_scale, with_unit

PATTERNS = ("checker", "strata")
SAND = ("#E3CD9B", "#7A5C36")  # light and dark stripes


@dataclass
class Layer:
    """One quantity over all panels: `data` (N,) in the unit shown or RGB (N, 3), per row and panel (None: no such field)."""
    title: str
    data: list
    low: float = 0.0
    high: float = 1.0
    cmap: str = ""


def squares(snapshot, scale=1.0):
    """Corners (N, 4, 2) of squares with each point's current area times scale^2, about its current position."""
    centre = snapshot["position"][:, :2]
    area = snapshot["volume"] if "volume" in snapshot else snapshot["initial_volume"]
    half = 0.5 * scale * np.sqrt(np.clip(np.nan_to_num(area), 0.0, None))
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    return centre[:, None, :] + half[:, None, None] * corners[None]


def inclusions(snapshot, entry):
    """(N,) True for points of bodies other than the first, when they are to be told apart."""
    count = len(snapshot["position"])
    if not entry.get("inclusions", True) or "body" not in snapshot:
        return np.zeros(count, bool)
    return snapshot["body"] > snapshot["body"].min()


def _limits(values, component, given=None):
    """(low, high, map): 1st to 99th percentile; a diverging map about zero when both signs occur, zero below for a strain."""
    if given:
        return given[0], given[1], "RdBu_r" if given[0] < 0 < given[1] else "viridis"
    finite = np.concatenate(values)
    finite = finite[np.isfinite(finite)]
    if not len(finite):
        return 0.0, 1.0, "viridis"
    low, high = np.percentile(finite, [1, 99])
    if component == "plastic_shear_strain":
        low = 0.0
    if low < 0 < high and min(-low, high) > 0.1 * max(-low, high):
        bound = max(-low, high)
        return -bound, bound, "RdBu_r"
    return (low, high, "viridis") if high > low else (low - 0.5, high + 0.5, "viridis")


def _unit(data, base):
    """(unit, factor) in which the 99th percentile of the data reads well."""
    return axis_scale([np.percentile(np.abs(d[np.isfinite(d)]), 99) if np.isfinite(d).any() else [0.0] for d in data], base)


def field_layers(rows, entry):
    """The values of a component, and the errors where an exact solution is there."""
    component = entry["component"]
    name = components.split(component)[0]
    base = rows[0][0][2].unit(name) or components.default_unit(name)
    values = [[of_snapshot(s, component) for _, _, s in row] for row in rows]
    soil = [v[~inclusions(s, entry)] for row, own in zip(rows, values) for v, (_, _, s) in zip(own, row)]
    unit, factor = _unit(soil, base)
    limits = _limits([v * factor for v in soil], component, entry.get("range"))
    layers = [Layer(with_unit(components.symbol(component), unit), [[v * factor for v in own] for own in values], *limits)]
    errors = [[v - of_snapshot(s, component, True) if components.has_exact(s, component) else None
               for v, (_, _, s) in zip(own, row)] for row, own in zip(rows, values)]
    present = [e for own in errors for e in own if e is not None]
    if entry.get("error", True) and present:
        unit, factor = _unit(present, base)
        low, high, _ = _limits([e * factor for e in present], component)
        bound = max(abs(low), abs(high)) or 1.0
        title = with_unit(f"Error of {components.symbol(component).split(' ')[-1]}", unit)
        layers.append(Layer(title, [[None if e is None else e * factor for e in own] for own in errors], -bound, bound, "PuOr"))
    return layers


def stripe(across, h):
    """Default width of a stripe: whole points, about a sixth of the narrow side (`across`), without a rest if some number nearby allows."""
    points = max(1, round(across / h))
    even = [k for k in range(math.ceil(points / 8), points // 4 + 1) if points % k == 0]
    return h * (min(even, key=lambda k: abs(points / k - 6)) if even else max(1, round(points / 6)))


def stripes(snapshot, entry):
    """RGB (N, 3): a checker or strata of the initial position."""
    X = snapshot["initial_position"][:, :2]
    h = math.sqrt(np.median(snapshot["initial_volume"]))
    corner, extent = X.min(axis=0) - h / 2, np.ptp(X, axis=0) + h
    spacing = entry.get("spacing", stripe(extent.min(), h))
    index = np.floor((X - corner) / spacing * (1 + 1e-9)).astype(int)
    number = index[:, 1] if entry.get("pattern", PATTERNS[0]) == "strata" else index.sum(axis=1)
    light, dark = (np.array([int(c[k:k + 2], 16) / 255 for k in (1, 3, 5)]) for c in SAND)
    return np.where((number % 2 == 0)[:, None], light, dark)
