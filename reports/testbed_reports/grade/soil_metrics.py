"""Groups of metrics of soil tests: loading, shear bands, flow, collapse. Called by metrics.py; see docs/file_formats.md."""
import math

import numpy as np
from scipy.integrate import trapezoid

from .metric_base import MetricError, need, nonzero
from .shear_band import ESTIMATORS, estimate_widths, find_bands, widths

END_SHARE = 0.2  # of the strain at the end, over which a residual stress is the mean
ELASTIC = (0.1, 0.4)  # of the peak stress, between which a modulus is fitted
SOFTENING = (0.9, 0.15)  # of the drop from peak to residual stress that is still to come, where its slope is fitted


def _ratio(rows, key, value, numbers, name):
    """Adds the row of a value over a reference, when the scene gives that reference."""
    if name in numbers:
        rows[key] = value / numbers[name]


def _ratios(result, *pairs):
    """Keys of the rows whose reference the scene gives."""
    return [key for key, name in pairs if name in result.reference]


def _initial_slope(strain, stress, group):
    """Least-squares slope of the rise between 10 % and 40 % of the peak; both (M,)."""
    top = int(np.argmax(stress))
    part = np.flatnonzero((stress[:top] >= ELASTIC[0] * stress[top]) & (stress[:top] <= ELASTIC[1] * stress[top]))
    if not stress[top] > 0 or len(part) < 2 or not np.ptp(strain[part]) > 0:
        raise MetricError(f"'{group}' needs two samples between {ELASTIC[0]:.0%} and {ELASTIC[1]:.0%} of the peak")
    return np.polyfit(strain[part], stress[part], 1)[0]


def _residual(strain, stress):
    """Mean stress over the last part of the strain, which must grow; both (M,)."""
    start = strain[-1] - END_SHARE * (strain[-1] - strain[0])
    at = np.append(start, strain[strain > start])
    return trapezoid(np.interp(at, strain, stress), at) / (at[-1] - at[0])


def compression(result):
    """Nominal axial strain from the travel of 'cap', deviatoric stress from the reaction of 'base', both positive in compression.

    The base carries the whole axial force (there is no gravity); the lateral stress does not act on it, and is taken off.
    """
    numbers = result.reference
    travel = result.support("cap", "displacement")[:, 1]
    strain = np.abs(travel - travel[0]) / need(numbers, "height", "compression")
    stress = (result.support("base", "reaction")[:, 1] / need(numbers, "width", "compression")
              - numbers.get("confinement", 0.0))
    nonzero(strain[-1], "'compression': the travel of the cap")
    if len(stress) == 2:  # a static analysis: unloaded and loaded
        modulus, residual = np.ptp(stress) / np.ptp(strain), stress[1]
    else:
        modulus, residual = _initial_slope(strain, stress, "compression"), _residual(strain, stress)
    top = int(np.argmax(stress))
    rows = {("modulus", "initial"): modulus, ("peak", "stress"): stress[top], ("peak", "strain"): strain[top],
            ("residual", "stress"): residual}
    if len(stress) > 2:
        rows["curve", "secant"] = stress[top] / (strain[top] * modulus)
        after = np.diff(stress[strain > 2 * strain[top]])
        if len(after) > 2:
            rows["curve", "roughness"] = np.std(after)
    _ratio(rows, ("modulus", "ratio"), modulus, numbers, "plane_strain_modulus")
    _ratio(rows, ("peak", "ratio"), stress[top], numbers, "peak_stress")
    _ratio(rows, ("residual", "ratio"), residual, numbers, "residual_stress")
    return rows


def _compression_rows(result):
    return [("modulus", "initial"), ("peak", "stress"), ("peak", "strain"), ("residual", "stress"), ("curve", "secant"), ("curve", "roughness"),
            *_ratios(result, (("modulus", "ratio"), "plane_strain_modulus"), (("peak", "ratio"), "peak_stress"),
                     (("residual", "ratio"), "residual_stress"))]


def _spacing(snapshot):
    """Distance of neighbouring points at the start [m]."""
    return math.sqrt(np.median(snapshot["initial_volume"]))


def _plastic(snapshot):
    if "plastic_shear_strain" not in snapshot:
        raise MetricError(f"snapshot {snapshot.name} lacks the field plastic_shear_strain")
    strain = snapshot["plastic_shear_strain"]
    if not np.isfinite(strain).all():
        raise MetricError(f"snapshot {snapshot.name}: plastic_shear_strain is not finite")
    return strain


def shear_band(result):
    """Number, inclination and width of the bands of the last snapshot; nan where there is no band."""
    snapshot, most = result.final, result.reference.get("bands", 2)
    if most not in (1, 2):
        raise MetricError(f"report.reference.bands: 1 or 2 is asked, not {most:g}")
    bands = find_bands(snapshot["initial_position"][:, :2], _plastic(snapshot), snapshot["initial_volume"], _spacing(snapshot),
                       int(most))
    found = [widths(band) for band in bands]
    rows = {("band_count", ""): len(bands)}
    for k, name in enumerate(("first", "second")):
        rows["band_angle", name] = bands[k].inclination if k < len(bands) else math.nan
    for name in ESTIMATORS:
        mean = float(np.mean([w[name] for w in found])) if found else math.nan
        rows["band_width", name] = mean
        rows["band_width_cells", name] = mean / result.cell_size
    return rows


def heap(result):
    """(N,) the points above `base` in the columns that hang together with the thickest one.

    A column belongs to the heap when its material above the base is `front_height` thick (default: half a layer of points), and no thinner
    column lies between.
    """
    snapshot = result.final
    least = result.reference.get("front_height", 0.5 * result.reference.get("point_spacing", _spacing(snapshot)))
    finite = np.isfinite(snapshot["position"]).all(axis=1)
    if not finite.all():
        raise MetricError("a point has no finite position")
    above = snapshot["position"][:, 1] > result.reference.get("base", 0.0)
    x = snapshot["position"][:, 0]
    edge = math.floor(x.min() / result.cell_size) * result.cell_size
    place = ((x - edge) / result.cell_size).astype(int)
    volume = np.bincount(place, snapshot["volume"] * above)
    thick = volume / result.cell_size >= least
    thickest, part = int(np.argmax(volume)), np.cumsum(~thick)
    connected = thick & (part == part[thickest])
    if not above.any():
        raise MetricError("no point lies above report.reference.base")
    return connected[place] & above


def _top_by_column(result, points, at, base):
    """Height (K,) of the top of the points (their boxes) in columns of one cell size about `at` (K,); `base` where there is none."""
    snapshot = result.final
    x, y = snapshot["position"][points, :2].T
    top = y + 0.5 * np.sqrt(snapshot["volume"][points])
    near = np.abs(x[None, :] - at[:, None]) <= 0.5 * result.cell_size
    return np.array([top[own].max() if own.any() else base for own in near])


def _rms(values):
    return math.sqrt(np.mean(np.square(values)))


def runout(result):
    """Front, free surface and failure line of a heap that flows to the right, at the last snapshot."""
    snapshot, numbers, curves = result.final, result.reference, result.curves
    inside = heap(result)
    front = float(np.max(snapshot["position"][inside, 0] + 0.5 * np.sqrt(snapshot["volume"][inside])))
    rows, L, base = {("runout", "front"): front}, result.cell_size, numbers.get("base", 0.0)
    _ratio(rows, ("runout", "ratio"), front, numbers, "runout")
    if "surface" in curves:
        x, y = curves["surface"]
        at = np.arange(x[0] + 0.5 * L, max(x[-1], front), L)
        rows["surface", "rms"] = _rms(_top_by_column(result, inside, at, base) - np.interp(at, x, y, right=base))
    if "failure" in curves:
        x, y = curves["failure"]
        height = np.ptp(snapshot["initial_position"][:, 1]) + _spacing(snapshot)
        still = np.hypot(*snapshot["displacement"][:, :2].T) < numbers.get("still", 0.01 * height)
        at = np.arange(x[0] + 0.5 * L, x[-1], L)
        rows["failure_line", "rms"] = _rms(_top_by_column(result, still, at, base) - np.interp(at, x, y))
    return rows


def _runout_rows(result):
    return [("runout", "front"), *_ratios(result, (("runout", "ratio"), "runout")),
            *(key for key, name in ((("surface", "rms"), "surface"), (("failure_line", "rms"), "failure"))
              if name in result.curves)]


def _first_above(x, y, level):
    """x where y (M,) first exceeds a level, linear between samples; None when it never does."""
    above = np.flatnonzero(y > level)
    if not len(above):
        return None
    k = above[0]
    return x[0] if k == 0 else x[k - 1] + (x[k] - x[k - 1]) * (level - y[k - 1]) / (y[k] - y[k - 1])


def collapse_load(result):
    """Load at which the probe 'crest' leaves its elastic response by `collapse_displacement`, and by twice as much.

    The elastic response is the line fitted to displacement against load, up to `elastic_share` (0.2) of the largest load.
    """
    numbers = result.reference
    load = need(numbers, "full_load", "collapse_load") * result.history("gravity_factor")
    threshold = need(numbers, "collapse_displacement", "collapse_load")
    u = result.probe("crest", "displacement")
    u = np.hypot(*(u - u[0])[:, :2].T)
    early = load <= numbers.get("elastic_share", 0.2) * load.max()
    if early.sum() < 3 or not np.ptp(load[early]) > 0:
        raise MetricError("'collapse_load' needs three samples in the elastic share of the load")
    excess = u - np.polyval(np.polyfit(load[early], u[early], 1), load)
    rows = {}
    for name, factor in (("first", 1.0), ("second", 2.0)):
        found = _first_above(load, excess, factor * threshold)
        if found is None and name == "first":
            raise MetricError(f"'collapse_load': the crest stays within {factor * threshold:g} m of its elastic displacement")
        rows["collapse_load", name] = math.nan if found is None else found
    return rows


def layer_profile(result):
    """(y (K,), plastic shear strain (K,), height of a row): means over the rows of a layer, by initial height."""
    snapshot = result.final
    strain, weight = _plastic(snapshot), snapshot["initial_volume"]
    y, row = np.unique(np.round(snapshot["initial_position"][:, 1], 9), return_inverse=True)
    if len(y) < 2:
        raise MetricError("'shear_layer' needs more than one row of points")
    return y, np.bincount(row, weight * strain) / np.bincount(row, weight), float(np.median(np.diff(y)))


def shear_layer(result):
    """A layer sheared by the wall 'top': its stress-displacement curve, the softening branch, dissipation and band width.

    tau and u are positive along the motion. The row of the slope is -du/dtau; `postpeak_slope` is du/dtau, which is H/G - L/k for a
    band of height L that softens by k.
    Dissipation: work less the elastic energy at the end, less the residual stress times the plastic displacement.
    """
    numbers = result.reference
    u, force = result.support("top", "displacement")[:, 0], result.support("top", "reaction")[:, 0]
    way = math.copysign(1.0, u[-1] - u[0])
    u, stress = way * (u - u[0]), way * force / need(numbers, "width", "shear_layer")
    nonzero(u[-1], "'shear_layer': the travel of the top")
    top, residual = int(np.argmax(stress)), numbers.get("residual_stress", _residual(u, stress))
    stiffness = numbers.get("elastic_stiffness") or _initial_slope(u, stress, "shear_layer")
    left = (stress - residual) / (stress[top] - residual)
    part = top + np.flatnonzero((left[top:] <= SOFTENING[0]) & (left[top:] >= SOFTENING[1]))
    if len(part) < 2:
        raise MetricError("'shear_layer' needs two samples on the softening branch")
    slope = -np.polyfit(stress[part], u[part], 1)[0]
    elastic = stress[-1] / stiffness
    dissipation = trapezoid(stress, u) - 0.5 * stress[-1] * elastic - residual * (u[-1] - elastic)
    rows = {("peak", "stress"): stress[top], ("slope", "postpeak"): slope, ("dissipation", "total"): dissipation}
    _ratio(rows, ("peak", "ratio"), stress[top], numbers, "peak_stress")
    _ratio(rows, ("slope", "ratio"), -slope, numbers, "postpeak_slope")
    _ratio(rows, ("dissipation", "ratio"), dissipation, numbers, "dissipation")

    y, strain, row = layer_profile(result)
    above = np.flatnonzero(strain > 0.01 * nonzero(strain.max(), "'shear_layer': the plastic shear strain"))
    width = y[above[-1]] - y[above[0]] + row
    # a row carries its mean over its height: sampled so finely that the estimators see the steps
    d = np.linspace(y[0] - row, y[-1] + row, 64 * (len(y) + 1) + 1)
    nearest = np.round((d - y[0]) / row).astype(int)
    inside = (nearest >= 0) & (nearest < len(y))
    stepped = np.where(inside, strain[np.clip(nearest, 0, len(y) - 1)] - strain.min(), 0.0)
    rows["band_width", "exact_support"] = width
    rows.update({("band_width", name): value for name, value in estimate_widths(d, stepped).items()})
    _ratio(rows, ("band_width", "ratio"), width, numbers, "band_width")
    return rows


def _shear_layer_rows(result):
    return [("peak", "stress"), ("slope", "postpeak"), ("dissipation", "total"), ("band_width", "exact_support"),
            *(("band_width", name) for name in ESTIMATORS),
            *_ratios(result, (("peak", "ratio"), "peak_stress"), (("slope", "ratio"), "postpeak_slope"),
                     (("dissipation", "ratio"), "dissipation"), (("band_width", "ratio"), "band_width"))]


def reaction(result):
    """Largest and last in-plane length of the reaction [N/m] of every support that has a displacement."""
    rows = {}
    for name in result.supports:
        if result.has(f"history/supports/{name}/displacement"):
            size = np.hypot(*result.support(name, "reaction")[:, :2].T)
            rows["reaction_max", name], rows["reaction_end", name] = size.max(), size[-1]
    if not rows:
        raise MetricError("'reaction' lacks a support with a displacement")
    return rows


def _reaction_rows(result):
    walls = [wall["name"] for wall in result.resolved.get("wall", []) if "name" in wall]
    return [(quantity, name) for name in walls for quantity in ("reaction_max", "reaction_end")]


# Group -> (function, the rows that a run which did not complete is given with value nan, the keys of report.reference that it reads).
GROUPS = {
    "compression": (compression, _compression_rows, ("height", "width", "confinement", "plane_strain_modulus", "peak_stress", "residual_stress")),
    "shear_band": (shear_band, [("band_count", ""), ("band_angle", "first"), ("band_angle", "second"),
                                *((quantity, name) for quantity in ("band_width", "band_width_cells") for name in ESTIMATORS)], ("bands",)),
    "runout": (runout, _runout_rows, ("runout", "base", "front_height", "point_spacing", "still")),
    "collapse_load": (collapse_load, [("collapse_load", "first"), ("collapse_load", "second")], ("full_load", "collapse_displacement", "elastic_share")),
    "shear_layer": (shear_layer, _shear_layer_rows, ("width", "peak_stress", "residual_stress", "elastic_stiffness", "postpeak_slope", "dissipation", "band_width")),
    "reaction": (reaction, _reaction_rows, ()),
}
