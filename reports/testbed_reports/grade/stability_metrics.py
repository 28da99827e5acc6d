"""Quantities of the group `stability`: whether a run kept what it must keep, each with its course in time.

Scales stand in the scene's [report.reference]; a quantity whose scale is not given is not computed.
"""
import numpy as np

from ..read.results import TENSOR
from .metric_base import MetricError, nonzero
from .norms import length


def total_energy(result):
    """Kinetic + strain - external work, (M,) [J/m]; not the kinetic energy of the points, which is looked at in some samples only."""
    work = "external_work" if "external_work" in result.histories else "gravity_work"
    return result.history("kinetic_energy") + result.history("strain_energy") - result.history(work)


def beside_nodes(result):
    """Kinetic energy of the points less that of the nodes, (M,) [J/m]; between the samples at which the points were looked at, interpolated."""
    nodes = result.history("kinetic_energy")
    if "kinetic_energy_points" not in result.histories:
        return np.zeros_like(nodes)
    points, time = result.history("kinetic_energy_points"), result.history("time")
    looked = np.flatnonzero(np.concatenate([[True], np.diff(points) != 0]))
    return np.interp(time, time[looked], (points - nodes)[looked])


def energy_gain(result):
    """(time, gain over `energy_scale`): energy beyond what was put in, `energy_start` or that of the first sample, as far as the points have
    it: the lumped masses of nodes hold more of a motion with gradients than the points do, and a share that swings."""
    total, numbers, beside = total_energy(result), result.reference, beside_nodes(result)
    start = max(total[0], numbers.get("energy_start", total[0]))
    total = total + np.minimum(0.0, beside - beside[0])
    return result.history("time"), (total - start) / nonzero(numbers["energy_scale"], "energy_scale")


def energy_growth(result):
    """(time, energy over that of the start): of a seed of rounding size, beside `energy_seed` = 1."""
    total = total_energy(result)
    return result.history("time"), total / nonzero(total[0], "the energy at the start")


def momentum_change(result):
    """(time, |p - p(0)| over `momentum_scale`) where no outer force acts."""
    p = result.history("linear_momentum")
    return result.history("time"), length(p - p[0]) / nonzero(result.reference["momentum_scale"], "momentum_scale")


def perturbation(result):
    """(time, growth): root mean square of the points' velocity about its mean, over that of the first snapshot."""
    if len(result.snapshots) < 2:
        raise MetricError("'stability' lacks snapshots for the growth of a perturbation")
    sizes = []
    for snapshot in result.snapshots:
        v, m = snapshot["velocity"][:, :2], snapshot["mass"]
        sizes.append(np.sqrt(np.average(np.sum((v - np.average(v, axis=0, weights=m))**2, axis=1), weights=m)))
    return np.array([s.time for s in result.snapshots]), np.array(sizes) / nonzero(sizes[0], "the perturbation at the start")


def windowed_settlement(result):
    """(time, mean over the `window` [s] that ends there) of the downward displacement of the probe `tip`, from the first full window on."""
    time, u = result.history("time"), -result.probe("tip", "displacement")[:, 1]
    window = result.reference["window"]
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (u[1:] + u[:-1]) * np.diff(time))])
    ends = time[time >= window * (1 - 1e-9)]
    if not len(ends):
        raise MetricError(f"'stability': the record is shorter than the window ({window:g} s)")
    return ends, (np.interp(ends, time, integral) - np.interp(ends - window, time, integral)) / window


def settlement_drift(result):
    """(time, |windowed mean over that of the first window - 1|)."""
    time, mean = windowed_settlement(result)
    return time, np.abs(mean / nonzero(abs(mean[0]), "the mean settlement of the first window") - 1.0)


def settlement_error(result):
    """(time (1,), |settlement of the probe `tip` at the end over `settlement` - 1|)."""
    exact = nonzero(result.reference["settlement"], "report.reference.settlement")
    return result.history("time")[-1:], np.abs(-result.probe("tip", "displacement")[-1:, 1] / exact - 1.0)


def deflection_error(result):
    """(time (1,), |in-plane displacement of the probe `tip` at the end over `deflection` - 1|)."""
    exact = nonzero(result.reference["deflection"], "report.reference.deflection")
    return result.history("time")[-1:], np.abs(length(result.probe("tip", "displacement")[-1:, :2]) / exact - 1.0)


def reaction_error(result):
    """(time (1,), |mean in-plane reaction of the support `grip` over the last twentieth of the time, over `reaction`, - 1|): a
    grip that drives one line of nodes after the other makes waves, of which the mean is free."""
    exact = nonzero(result.reference["reaction"], "report.reference.reaction")
    time, force = result.history("time"), result.support("grip", "reaction")[:, :2]
    late = force[time >= 0.95 * time[-1]]
    return time[-1:], np.abs(length(late.mean(axis=0)[None]) / exact - 1.0)


def stress_peak(result):
    """(time, largest stress component over `stress_scale_max`)."""
    return result.history("time"), result.history("max_stress") / nonzero(result.reference["stress_scale_max"], "stress_scale_max")


def rest_motion(result):
    """(time, largest displacement of a point over `rest_scale` [m]) over the snapshots of a body that must not move."""
    scale = nonzero(result.reference["rest_scale"], "rest_scale")
    return (np.array([s.time for s in result.snapshots]),
            np.array([np.max(length(s["displacement"][:, :2])) for s in result.snapshots]) / scale)


def flight_error(result):
    """(time, largest distance of a point from its exact place over `displacement_scale`) over the snapshots."""
    scale = nonzero(result.reference["displacement_scale"], "displacement_scale")
    if not all("exact_displacement" in s for s in result.snapshots):
        raise MetricError("'stability' lacks an exact displacement")
    return (np.array([s.time for s in result.snapshots]),
            np.array([np.max(length((s["displacement"] - s["exact_displacement"])[:, :2])) for s in result.snapshots]) / scale)


def stress_noise(result):
    """(time, root mean square over the points of the mean in-plane stress about its mean, over that of the first snapshot)."""
    sizes = []
    for snapshot in result.snapshots:
        p, v = snapshot["stress"][:, [TENSOR["xx"], TENSOR["yy"]]].mean(axis=1), snapshot["initial_volume"]
        sizes.append(np.sqrt(np.average((p - np.average(p, weights=v))**2, weights=v)))
    return np.array([s.time for s in result.snapshots]), np.array(sizes) / nonzero(sizes[0], "the stress at the start")


def points_outside(result):
    """(time, share of points outside the lattice) over the snapshots."""
    grid = result.resolved.get("grid", {})
    low = np.array(grid.get("origin", [0.0, 0.0]), float)
    high = low + np.array(grid["size"], float)
    x = [s["position"][:, :2] for s in result.snapshots]
    return np.array([s.time for s in result.snapshots]), np.array([1.0 - np.mean(np.all((p >= low) & (p <= high), axis=1)) for p in x])


def volume_change(result):
    """(time, largest |ln (volume / initial volume)| of a point) over the snapshots."""
    with np.errstate(all="ignore"):
        change = [np.max(np.abs(np.log(s["volume"] / s["initial_volume"]))) for s in result.snapshots]
    return np.array([s.time for s in result.snapshots]), np.array(change)


# (quantity, norm) -> (function of a result, how its course is summed up, keys of report.reference or of the grid that it needs)
SERIES = {
    ("energy_gain", "scaled"): (energy_gain, "max", ("energy_scale",)),
    ("energy_growth", "max"): (energy_growth, "max", ("energy_seed",)),
    ("momentum_change", "scaled"): (momentum_change, "max", ("momentum_scale",)),
    ("perturbation", "growth"): (perturbation, "max", ("perturbation",)),
    ("perturbation", "end"): (perturbation, "end", ("perturbation",)),
    ("settlement_drift", "tip"): (settlement_drift, "end", ("window",)),
    ("settlement_error", "tip"): (settlement_error, "end", ("settlement",)),
    ("deflection_error", "tip"): (deflection_error, "end", ("deflection",)),
    ("reaction_error", "grip"): (reaction_error, "end", ("reaction",)),
    ("stress_peak", "scaled"): (stress_peak, "max", ("stress_scale_max",)),
    ("stress_noise", "end"): (stress_noise, "end", ("stress_noise",)),
    ("rest_motion", "max"): (rest_motion, "max", ("rest_scale",)),
    ("flight_error", "max"): (flight_error, "max", ("flight",)),
    ("points_outside", "share"): (points_outside, "max", ("grid.size",)),
    ("volume_change", "max"): (volume_change, "max", ()),
}


def asked(result):
    """The (quantity, norm) whose scales the scene gives."""
    known = set(result.reference) | {f"grid.{key}" for key in result.resolved.get("grid", {})}
    return [key for key, (_, _, needs) in SERIES.items() if known.issuperset(needs)]


def stability(result):
    rows = {}
    for key in asked(result):
        function, how, _ = SERIES[key]
        values = function(result)[1]
        # NaN anywhere in a course must not be passed over by a maximum of the rest
        rows[key] = values[-1] if how == "end" else np.max(values)
    return rows


def first_time(result, key, low, high):
    """The first time [s] at which a quantity is not within low..high; None when its course is not known, or begins outside (what
    must decay is too large at the start)."""
    if key not in SERIES:
        return None
    time, values = SERIES[key][0](result)
    out = np.flatnonzero(~((values >= low) & (values <= high)))
    return float(time[out[0]]) if len(out) and (out[0] > 0 or len(values) == 1) else None


READ = {key for _, _, needs in SERIES.values() for key in needs if not key.startswith("grid.")} | {"energy_start", "displacement_scale"}
GROUPS = {"stability": (stability, asked, READ)}
