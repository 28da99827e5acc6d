"""Groups of metrics for what a picture of a flow, of a fault or of an inclusion shows. Called by metrics.py; see docs/file_formats.md."""
import numpy as np

from .metric_base import MetricError, need, nonzero


def _field(snapshot, name):
    if name not in snapshot:
        raise MetricError(f"snapshot {snapshot.name} lacks the field {name}")
    return snapshot[name]


def inclusion(result):
    """Share of the plastic shear strain above its median that lies, by initial height, below the middle of the lowest inclusion, and above
    that of the highest. Inclusions are all bodies but the first."""
    snapshot = result.final
    body, y = _field(snapshot, "body"), snapshot["initial_position"][:, 1]
    inside = np.unique(body)[1:]
    if not len(inside):
        raise MetricError("'inclusion' needs a second body")
    middles = [y[body == b].mean() for b in inside]
    soil = body == body.min()
    strain = _field(snapshot, "plastic_shear_strain")[soil]
    weight = snapshot["initial_volume"][soil] * np.maximum(strain - np.median(strain), 0.0)
    nonzero(weight.sum(), "'inclusion': the plastic shear strain above its median")
    return {("strain_share", "below"): weight[y[soil] < min(middles)].sum() / weight.sum(),
            ("strain_share", "above"): weight[y[soil] > max(middles)].sum() / weight.sum()}


def passed(result):
    """Area of the points that are below the height `door`, and how far below it the lowest of them is."""
    snapshot, door = result.final, need(result.reference, "door", "passed")
    y = snapshot["position"][:, 1]
    return {("passed", "area"): snapshot["volume"][y < door].sum(), ("passed", "depth"): max(door - y.min(), 0.0)}


def uplift(result):
    """Area between the top row of points and where it was, and the height in cells of the highest bump on the way up to its higher end."""
    snapshot = result.final
    start = snapshot["initial_position"]
    row = np.flatnonzero(start[:, 1] > start[:, 1].max() - 0.5 * np.sqrt(np.median(snapshot["initial_volume"])))
    row = row[np.argsort(start[row, 0])]
    width = np.ptp(start[row, 0]) / (len(row) - 1) if len(row) > 1 else 0.0
    nonzero(width, "'uplift': the distance of points in the top row")
    y = snapshot["position"][row, 1]
    upward = y if y[-1] >= y[0] else y[::-1]
    fall = upward - np.minimum.accumulate(upward[::-1])[::-1]
    return {("uplift", "area"): width * snapshot["displacement"][row, 1].sum(), ("uplift", "bump"): fall.max() / result.cell_size}


# Group -> (function, the rows that a run which did not complete is given with value nan, the keys of report.reference that it reads).
GROUPS = {
    "inclusion": (inclusion, [("strain_share", "below"), ("strain_share", "above")], ()),
    "passed": (passed, [("passed", "area"), ("passed", "depth")], ("door",)),
    "uplift": (uplift, [("uplift", "area"), ("uplift", "bump")], ()),
}
