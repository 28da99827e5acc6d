"""Quantities of the group `stability` on records whose answer is known by hand, and the verdicts that they lead to."""
import math
from types import SimpleNamespace

import numpy as np
import pytest
from testbed_reports.grade import stability_metrics as sm
from testbed_reports.grade import verdicts


class Snapshot(dict):
    def __init__(self, time, **fields):
        super().__init__(fields)
        self.time = time


def record(history=None, probe=None, grip=None, snapshots=(), **reference):
    """What the metrics ask of a result."""
    history = {"time": np.arange(5.0), **(history or {})}
    return SimpleNamespace(histories=list(history), history=history.__getitem__, reference=reference, snapshots=list(snapshots), resolved={},
                           probe=lambda name, field: probe, support=lambda name, field: grip)


def test_what_nodes_hold_beyond_the_points_is_no_gain():
    energy = {"kinetic_energy": np.array([10.0, 13.0, 12.0]), "strain_energy": np.zeros(3), "external_work": np.zeros(3),
              "kinetic_energy_points": np.array([8.0, 8.0 + 1.0, 8.0 + 2.0]), "time": np.arange(3.0)}
    _, gain = sm.energy_gain(record(energy, energy_scale=10.0))
    # beside the nodes -2, -4, -2: at the second sample two of the three that were made are not the points'
    assert gain == pytest.approx([0.0, 0.1, 0.2])


def test_a_perturbation_is_what_differs_from_the_mean_motion():
    mass = np.array([1.0, 3.0])
    at = [Snapshot(t, velocity=np.array([[5 + 3 * a, 1, 0], [5 - a, 1, 0]]), mass=mass) for t, a in ((0.0, 1.0), (1.0, 0.5), (2.0, 4.0))]
    _, growth = sm.perturbation(record(snapshots=at))
    assert growth == pytest.approx([1.0, 0.5, 4.0])


def test_the_mean_over_a_window_is_that_of_the_line_between_samples():
    t = np.array([0.0, 1.0, 3.0, 4.0])
    u = np.zeros((4, 3))
    u[:, 1] = -np.array([0.0, 2.0, 2.0, 6.0])
    time, mean = sm.windowed_settlement(record({"time": t}, probe=u, window=2.0))
    assert time == pytest.approx([3.0, 4.0])
    assert mean == pytest.approx([2.0, 0.5 * (2.0 + 4.0)])


def test_a_drift_upwards_is_a_drift():
    t, u = np.linspace(0.0, 4.0, 41), np.zeros((41, 3))
    u[:, 1] = -(1.0 - 0.1 * t)
    _, drift = sm.settlement_drift(record({"time": t}, probe=u, window=1.0))
    assert drift[0] == pytest.approx(0.0) and drift[-1] == pytest.approx(0.3 / 0.95)


def test_a_reaction_is_the_mean_of_the_last_twentieth():
    force = np.zeros((101, 3))
    force[:, 0] = np.linspace(0.0, 3.0, 101)
    force[95:, 0] = [4.0, 2.0, 3.0, 2.0, 4.0, 3.0]
    _, error = sm.reaction_error(record({"time": np.linspace(0.0, 1.0, 101)}, grip=force, reaction=2.0))
    assert error == pytest.approx([0.5])


def test_noise_is_what_differs_from_the_mean_stress():
    volume = np.array([1.0, 3.0])
    stress = [np.zeros((2, 6)) for _ in range(2)]
    for s, a in zip(stress, (3.0, 1.0)):
        s[:, 0] = s[:, 3] = -100.0 + a * np.array([3.0, -1.0])
    _, noise = sm.stress_noise(record(snapshots=[Snapshot(float(k), stress=s, initial_volume=volume) for k, s in enumerate(stress)]))
    assert noise == pytest.approx([1.0, 1.0 / 3.0])


def test_a_volume_changes_both_ways():
    one = np.ones(2)
    at = [Snapshot(0.0, volume=np.array([1.0, 1.2]), initial_volume=one), Snapshot(1.0, volume=np.array([0.5, 1.2]), initial_volume=one)]
    _, change = sm.volume_change(record(snapshots=at))
    assert change == pytest.approx([math.log(1.2), math.log(2.0)])


def test_some_quantities_count_at_the_end():
    t = np.linspace(0.0, 4.0, 41)
    u = np.zeros((41, 3))
    u[:, 1] = -np.where(t < 2.0, 1.0 + 0.2 * np.minimum(t, 2.0 - t), 1.0)
    result = record({"time": t}, probe=u, window=0.5)
    function, how, _ = sm.SERIES["settlement_drift", "tip"]
    assert how == "end" and np.max(function(result)[1]) > 2 * function(result)[1][-1]
    snapshots = [Snapshot(float(k), volume=np.ones(1), initial_volume=np.ones(1)) for k in range(2)]
    assert sm.stability(record({"time": t}, probe=u, window=0.5, snapshots=snapshots))["settlement_drift", "tip"] == pytest.approx(function(result)[1][-1])


def test_the_first_time_is_none_where_a_course_begins_outside():
    def stress(values):
        return record({"time": np.arange(4.0), "max_stress": np.array(values)}, stress_scale_max=1.0)
    key = ("stress_peak", "scaled")
    assert sm.first_time(stress([0.0, 1.0, 3.0, 4.0]), key, -math.inf, 2.0) == 2.0
    assert sm.first_time(stress([3.0, 1.0, 3.0, 4.0]), key, -math.inf, 2.0) is None
    assert sm.first_time(stress([0.0, 1.0, 1.0, 1.0]), key, -math.inf, 2.0) is None


def run(bounds, soundness="suspect", **values):
    """The verdict on a completed run with two courses."""
    result = record({"time": np.arange(4.0), "max_stress": np.array([0.0, 1.0, 3.0, 4.0])}, stress_scale_max=1.0,
                    snapshots=[Snapshot(float(k), volume=np.full(1, v), initial_volume=np.ones(1)) for k, v in enumerate((1.0, 3.0, 1.0, 1.0))])
    result.root = {"soundness": soundness}
    rows = {tuple(k.split("__")): v for k, v in values.items()}
    one = SimpleNamespace(result=result, completed=True, values={}, rows=rows, value=lambda *key: rows.get(key, math.nan), reason="", status="completed")
    return verdicts.judge_run(one, bounds)


def test_the_earliest_of_several_first_times_counts():
    bounds = [{"quantity": "stress_peak", "norm": "scaled", "max": 2.0}, {"quantity": "volume_change", "norm": "max", "max": 0.5}]
    assert run(bounds, stress_peak__scaled=4.0, volume_change__max=math.log(3.0)).time == 1.0


def test_far_below_a_bound_is_a_failure_too():
    bound = {"quantity": "energy_gain", "norm": "scaled", "min": -0.1, "failed": 1.0}
    assert run([bound], energy_gain__scaled=-0.5).level == "wrong"
    assert run([bound], energy_gain__scaled=-1.5).level == "failed"


def test_the_nearest_setting_that_held_is_near_by_its_ratio():
    def at(value, level):
        return SimpleNamespace(values={"cfl": value}, verdict=SimpleNamespace(level=level))
    others = [at(0.1, "sound"), at(4.0, "sound"), at(0.8, "wrong")]
    assert verdicts.nearest_sound(at(1.0, "failed"), others, ["cfl"]) == "cfl = 4.0"
