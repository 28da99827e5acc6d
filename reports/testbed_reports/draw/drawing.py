"""What all figures share: names of quantities, the choice of runs, axes."""
import math
from dataclasses import dataclass, field

import numpy as np
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator

from ..grade import metrics
from ..read.results import ResultError
from .style import RAIL, nice_unit

ESTIMATOR_NAMES = {"std": r"$\sqrt{12}$ std", "integral": "integral / maximum", "half_max": "half maximum", "exact_support": "support"}
QUANTITY_NAMES = {
    ("stress", "l2"): "Stress error, $L_2$", ("stress", "linf"): r"Stress error, $L_\infty$",
    ("stress", "l1_yy"): r"Vertical stress error, $L_1$", ("displacement", "l2"): "Displacement error, $L_2$",
    ("displacement", "linf"): r"Displacement error, $L_\infty$",
    ("displacement", "rms_scaled"): "Displacement error, scaled RMS",
    ("limit", "measured"): "Largest value that holds", ("strain_share", "below"): "Share of plastic strain below the inclusion", ("strain_share", "above"): "Share of plastic strain above the inclusion",
    ("passed", "area"): "Area that has passed [m$^2$]", ("passed", "depth"): "Depth below the door [m]",
    ("uplift", "area"): "Area of uplift [m$^2$]", ("uplift", "bump"): "Highest bump / $L$",
    ("curve", "secant"): "Stiffness to the peak / initial", ("curve", "roughness"): "Scatter of the load after the peak [Pa]",
    ("static", "kinetic_over_strain"): "Kinetic / strain energy", ("static", "unbalanced"): "Unbalanced force ratio",
    ("first_peak", "ratio"): "First peak / static", ("first_peak", "time"): "Time of first peak / exact",
    ("energy_drift", "per_period"): "Energy drift per period", ("energy_gain", "max"): "Largest energy gain",
    ("kinetic_energy", "retained"): "Kinetic energy retained", ("momentum", "error"): "Momentum error",
    ("angular_momentum", "retained"): "Angular momentum retained",
    ("angular_momentum", "error"): "Angular momentum error",
    ("spurious_stress", "max"): "Largest stress / Young's modulus",
    ("particle_steps_per_second", ""): "Particle steps per second [1/s]", ("bytes_per_point", ""): "Memory [B/point]",
    ("solve_s", ""): "Solve time [s]",
    ("modulus", "initial"): "Initial modulus [Pa]", ("modulus", "ratio"): "Initial / plane strain modulus",
    ("peak", "stress"): "Peak stress [Pa]", ("peak", "ratio"): "Peak stress / reference", ("peak", "strain"): "Strain at peak",
    ("residual", "stress"): "Residual stress [Pa]", ("residual", "ratio"): "Residual stress / reference",
    ("band_count", ""): "Number of shear bands", ("band_angle", "first"): "Inclination of first band [°]",
    ("band_angle", "second"): "Inclination of second band [°]",
    ("runout", "front"): "Position of the front [m]", ("runout", "ratio"): "Runout / reference",
    ("surface", "rms"): "Free surface, RMS distance [m]", ("failure_line", "rms"): "Failure line, RMS distance [m]",
    ("collapse_load", "first"): "Collapse load", ("collapse_load", "second"): "Collapse load, second threshold",
    ("slope", "postpeak"): r"Softening slope $-\mathrm{d}u/\mathrm{d}\tau$ [m/Pa]", ("slope", "ratio"): "Softening slope / reference",
    ("dissipation", "total"): "Dissipation [J/m$^2$]", ("dissipation", "ratio"): "Dissipation / reference",
    ("band_width", "ratio"): "Band width / reference",
    **{("band_width", norm): f"Band width, {words} [m]" for norm, words in ESTIMATOR_NAMES.items()},
    **{("band_width_cells", norm): f"Band width / $L$, {words}" for norm, words in ESTIMATOR_NAMES.items()}}
HISTORY_NAMES = {"time": ("Time $t$", "s"), "gravity_factor": ("Share of gravity", ""),
                 "kinetic_energy": ("Kinetic energy", "J/m"), "strain_energy": ("Strain energy", "J/m"),
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
    if quantity in ("reaction_max", "reaction_end"):
        return f"{'Largest' if quantity == 'reaction_max' else 'Final'} reaction of {norm} [N/m]"
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


def sizes_axis(axis, values, formatter="{:g}"):
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


def log_y(axis, low, high):
    """Ticks of a log axis that are readable over a small range as well."""
    axis.set_ylim(low, high)
    if math.log10(high / low) < 1.3:
        axis.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        axis.yaxis.set_minor_locator(NullLocator())
    else:
        axis.yaxis.set_minor_formatter(NullFormatter())


def exact_of(errors):
    """Labels of the series whose errors are all of rounding; none when no series has others."""
    exact = {label for label, own in errors.items() if len(own) and all(e < metrics.ROUNDING for e in own)}
    return set() if len(exact) == sum(len(own) > 0 for own in errors.values()) else exact


def told_lost(label, runs, x, gave):
    """'lpfdm gave no number at L = 0.2 m, 0.1 m (1 of 3 seeds)': where on the axis x some or all runs gave none; '' where all did."""
    at = {}
    for run in runs:
        if isinstance(run.values.get(x), (int, float)):
            at.setdefault(run.values[x], []).append(run)
    parts = []
    for place, own in sorted(at.items(), reverse=True):
        lost = sum(not gave(run) for run in own)
        what = "seeds" if len({str(run.values.get("seed", "")) for run in own}) == len(own) else "runs"
        if lost:
            parts.append(f"{place:g}" + (" m" if x == "L" else "") + (f" ({lost} of {len(own)} {what})" if lost < len(own) else ""))
    return f"{label} gave no number at {x.rsplit('.', 1)[-1]} = {', '.join(parts)}" if parts else ""


def lower_edge(axis, at, label, style):
    """Points that are exact to rounding, on the lower edge."""
    axis.plot(at, [0.0] * len(at), transform=axis.get_xaxis_transform(), linestyle="none", marker=style.marker(label),
              markersize=4.5, markerfacecolor="white", markeredgecolor=style.colour(label), clip_on=False, zorder=5)


def rails(axis, lost, style, text):
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


def axis_scale(values, unit):
    finite = np.concatenate([np.ravel(v) for v in values])
    finite = finite[np.isfinite(finite)]
    return nice_unit(unit, np.max(np.abs(finite)) if len(finite) else 0.0)


def snapshot_of(run, index):
    """The snapshot of that number, or the nearest to a time, a float [s]."""
    if not run.result.snapshots:
        raise ResultError(f"{run.id}: lacks snapshots")
    if isinstance(index, float):
        return min(run.result.snapshots, key=lambda snapshot: abs(snapshot.time - index))
    try:
        return run.result.snapshots[index]
    except IndexError:
        raise FigureError(f"{run.id} has no snapshot {index}") from None


def with_unit(title, unit):
    """An axis title; a number without a unit has no brackets."""
    return f"{title} [{unit}]" if unit not in ("", "-") else title


def where_of_title(snapshots):
    """'t = 1.2 s' when all snapshots agree."""
    times = {f"{s.time:.4g}" for s in snapshots if s.time is not None}
    return f"At t = {times.pop()} s" if len(times) == 1 else ""
