"""The one place that grades all methods: groups of quantities computed from a result file.

A scene asks for groups with `[report] metrics = [...]`; named numbers stand in its `[report.reference]`.
A group is a function Result -> {(quantity, norm): value}. Runs that did not complete get the same rows with value nan.
"""
from dataclasses import dataclass, field

import numpy as np

from ..read.results import TENSOR, ResultError
from ..read.spelling import did_you_mean
from . import norms, picture_metrics, soil_metrics, stability_metrics
from .metric_base import MetricError, need, nonzero

ALWAYS = ("particle_steps_per_second", "bytes_per_point", "solve_s")

# Rows that fall to zero with the cell size: those for which an order means something.
ERRORS = {("stress", "l2"), ("stress", "linf"), ("stress", "l1_yy"),
          ("displacement", "l2"), ("displacement", "linf"), ("displacement", "rms_scaled"),
          ("momentum", "error"), ("angular_momentum", "error"),
          ("energy_drift", "per_period")}


# An error below this is rounding: it has no order, and would flatten a picture of others.
ROUNDING = 1e-9


def is_error(quantity, norm):
    """Whether (quantity, norm) is an error that should vanish with the cell size."""
    return quantity == "settlement" or (quantity, norm) in ERRORS


@dataclass
class Grades:
    """Rows {(quantity, norm): value} of one run, and what could not be computed."""
    rows: dict = field(default_factory=dict)
    errors: list = field(default_factory=list)


def _pair(snapshot, name):
    for lacking in (name, f"exact_{name}", "initial_volume"):
        if lacking not in snapshot:
            raise MetricError(f"'{name}' lacks the field {lacking} in snapshot {snapshot.name}")
    return snapshot[name], snapshot[f"exact_{name}"], snapshot["initial_volume"]


def stress(result):
    s, exact, v = _pair(result.final, "stress")
    error, size = norms.frobenius(s - exact), norms.frobenius(exact)
    nonzero(np.max(size), "the exact stress")
    scale = result.reference.get("stress_scale", np.max(np.abs(exact[:, TENSOR["yy"]])))
    return {("stress", "l2"): norms.l2(error, size, v),
            ("stress", "linf"): norms.linf(error, size),
            ("stress", "l1_yy"): norms.l1_yy(s, exact, v, nonzero(scale, "the stress scale"))}


def displacement(result):
    u, exact, v = _pair(result.final, "displacement")
    error, size = norms.length(u - exact), norms.length(exact)
    scale = result.reference.get("displacement_scale")
    rows = {}
    if np.max(size) > 0:
        rows = {("displacement", "l2"): norms.l2(error, size, v), ("displacement", "linf"): norms.linf(error, size)}
    elif scale is None:
        nonzero(0.0, "the exact displacement")
    if scale is not None:
        rows["displacement", "rms_scaled"] = norms.rms(error, v) / scale
    return rows


def settlement(result):
    rows = {}
    for probe in result.probes:
        if not result.has(f"history/probes/{probe}/exact_displacement"):
            continue
        u = result.probe(probe, "displacement")[-1, :2]
        exact = result.probe(probe, "exact_displacement")[-1, :2]
        size = nonzero(np.hypot(*exact), f"the exact displacement of probe {probe}")
        rows["settlement", probe] = np.hypot(*(u - exact)) / size
    if not rows:
        raise MetricError("'settlement' lacks a probe with exact_displacement")
    return rows


def static(result):
    kinetic, strain = abs(result.history("kinetic_energy")[-1]), result.history("strain_energy")[-1]  # a product of two half steps has a sign
    return {("static", "kinetic_over_strain"): kinetic / nonzero(strain, "the strain energy"),
            ("static", "unbalanced"): result.history("unbalanced_force")[-1]}


def peak(time, value):
    """(time, value) of the first peak of a signal (M,): the top of its first stretch above half its maximum,
    refined by the parabola through three samples. None when the record ends before it turns."""
    above = value > 0.5 * np.max(value)
    first = int(np.argmax(above))
    stretch = int(np.argmin(above[first:])) if not above[first:].all() else len(value) - first
    i = first + int(np.argmax(value[first:first + stretch]))
    if i == 0 or i == len(value) - 1:
        return None
    a, b, _ = np.polyfit(time[i - 1:i + 2] - time[i], value[i - 1:i + 2], 2)
    if not a < 0:
        return time[i], value[i]
    shift = -b / (2.0 * a)
    return time[i] + shift, value[i] - b * b / (4.0 * a)


def first_peak(result):
    found = peak(result.history("time"), np.abs(result.probe("tip", "displacement")[:, 1]))
    if found is None:
        raise MetricError("'first_peak': the probe 'tip' does not turn back within the record")
    numbers, rows = result.reference, {}
    if "peak_time" in numbers:
        rows["first_peak", "time"] = found[0] / numbers["peak_time"]
    rows["first_peak", "ratio"] = found[1] / abs(need(numbers, "static_displacement", "first_peak"))
    return rows


def total_energy(result):
    """Kinetic + strain - work of gravity, (M,) [J/m]: constant without damping."""
    return (result.history("kinetic_energy") + result.history("strain_energy")
            - result.history("gravity_work"))


def energy(result):
    time, total, kinetic = result.history("time"), total_energy(result), result.history("kinetic_energy")
    rows, period = {}, result.reference.get("period")
    if period is not None:
        start = time[time + period <= time[-1] * (1 + 1e-9)]
        if not len(start):
            raise MetricError(f"'energy': the record is shorter than one period ({period:g} s)")
        change = np.interp(start + period, time, total) - np.interp(start, time, total)
        scale = nonzero(np.max(result.history("strain_energy")), "the strain energy")
        rows["energy_drift", "per_period"] = np.max(np.abs(change)) / scale
    if total[0] > 0:
        rows["energy_gain", "max"] = np.max(total) / total[0] - 1.0
    if kinetic[0] > 0:
        rows["kinetic_energy", "retained"] = abs(kinetic[-1]) / kinetic[0]
    if not rows:
        raise MetricError("'energy' lacks report.reference.period, and starts from rest")
    return rows


def momentum(result):
    p = result.history("linear_momentum")
    scale = result.reference.get("momentum_scale", np.linalg.norm(p[0]))
    return {("momentum", "error"): np.linalg.norm(p[-1] - p[0]) / nonzero(scale, "the momentum at the start")}


def angular_momentum(result):
    start, end = result.history("angular_momentum")[[0, -1]]
    nonzero(abs(start), "the angular momentum at the start")
    return {("angular_momentum", "retained"): end / start, ("angular_momentum", "error"): abs(1.0 - end / start)}


def spurious_stress(result):
    moduli = [m["youngs_modulus"] for m in result.materials.values() if m.get("youngs_modulus", 0) > 0]
    if not moduli:
        raise MetricError("'spurious_stress' lacks a material with a Young's modulus")
    return {("spurious_stress", "max"): np.max(result.history("max_stress")) / min(moduli)}


def _probes_of_scene(result):
    return [("settlement", p["name"]) for p in result.resolved.get("probe", []) if "name" in p]


# Group -> (function, the rows that a run which did not complete is given with value nan, the keys of report.reference that it reads).
GROUPS = {
    "stress": (stress, [("stress", n) for n in ("l2", "linf", "l1_yy")], ("stress_scale",)),
    "displacement": (displacement, lambda r: [("displacement", n) for n in ("l2", "linf")] + (
        [("displacement", "rms_scaled")]
        if "displacement_scale" in r.reference else []), ("displacement_scale",)),
    "settlement": (settlement, _probes_of_scene, ()),
    "static": (static, [("static", "kinetic_over_strain"), ("static", "unbalanced")], ()),
    "first_peak": (first_peak, [("first_peak", "ratio"), ("first_peak", "time")], ("static_displacement", "peak_time")),
    "energy": (energy, [("energy_drift", "per_period"), ("energy_gain", "max"), ("kinetic_energy", "retained")], ("period",)),
    "momentum": (momentum, [("momentum", "error")], ("momentum_scale",)),
    "angular_momentum": (angular_momentum, [("angular_momentum", "retained"), ("angular_momentum", "error")], ()),
    "spurious_stress": (spurious_stress, [("spurious_stress", "max")], ()),
    **soil_metrics.GROUPS,
    **picture_metrics.GROUPS,
    **stability_metrics.GROUPS,
}


def grade(result):
    """All rows that the scene of a result asks for, never raising: what lacks is told in `errors`."""
    grades = Grades()
    for name in ALWAYS:
        value = result.performance.get(name)
        if value is None:
            grades.errors.append(f"lacks the attribute '{name}' of /performance")
        grades.rows[name, ""] = float("nan") if value is None else float(value)
    for group in result.metrics:
        if group not in GROUPS:
            grades.errors.append(f"unknown metric group '{group}'{did_you_mean(group, GROUPS)}")
            continue
        function, names, _ = GROUPS[group]
        try:
            if result.status == "completed":
                with np.errstate(all="ignore"):
                    grades.rows.update({key: float(value) for key, value in function(result).items()})
            else:
                names = names(result) if callable(names) else names
                grades.rows.update({key: float("nan") for key in names})
        except (MetricError, ResultError) as error:
            grades.errors.append(str(error).removeprefix(f"{result.path}: "))
        except Exception as error:  # a damaged array must not take the other runs with it
            grades.errors.append(f"'{group}' cannot be computed: {type(error).__name__}: {error}")
    return grades
