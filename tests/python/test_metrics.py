"""Metric groups on synthetic results whose numbers are known."""
import math

import h5py
import numpy as np
import pytest
from synthetic import H, PERIOD, TIP, write_result
from testbed_reports.grade import metrics
from testbed_reports.read.results import Result, ResultError


def rows(result):
    grades = metrics.grade(result)
    assert grades.errors == []
    return grades.rows


def test_stress_errors_are_those_put_in(make):
    r = rows(make(metrics="stress", stress_error=-0.03, reference={"stress_scale": 1e5}))
    assert r["stress", "l2"] == pytest.approx(0.03)
    assert r["stress", "linf"] == pytest.approx(0.03)
    assert r["stress", "l1_yy"] == pytest.approx(0.03 * 0.5, rel=1e-6)  # mean of the stress is half of rho g H


def test_stress_scale_defaults_to_the_largest_exact_stress(make):
    r = rows(make(metrics="stress", stress_error=0.03, L=1.0, ppc=2))
    assert r["stress", "l1_yy"] == pytest.approx(0.03 * 0.5 / 0.975)


def test_displacement(make):
    r = rows(make(metrics="displacement", displacement_error=0.02))
    assert r["displacement", "l2"] == pytest.approx(0.02)
    assert r["displacement", "linf"] == pytest.approx(0.02)
    shape = np.sqrt(8.0 / 15.0)  # rms of 2 s - s^2
    assert r["displacement", "rms_scaled"] == pytest.approx(0.02 * shape, rel=2e-3)


def test_no_scale_no_scaled_row(make):
    assert ("displacement", "rms_scaled") not in rows(make(metrics="displacement", reference={"displacement_scale": None}))


def test_settlement_per_probe(make):
    r = rows(make(metrics="settlement", displacement_error=-0.05, probes=("tip", "middle"), damping=3.0))
    assert r["settlement", "tip"] == pytest.approx(0.05)
    assert r["settlement", "middle"] == pytest.approx(0.05)


def test_a_kinetic_energy_below_zero_is_no_rest(make):
    """The product of the velocities of two half steps is negative where points turn: it must not pass a target from above."""
    n, turning = 5, [100.0, 1.0, 1.0, 1.0, -0.01]
    r = rows(make(metrics="static, energy", samples=n, history={"kinetic_energy": np.array(turning), "strain_energy": np.full(n, 2.0)}))
    assert r["static", "kinetic_over_strain"] == pytest.approx(0.005) and r["kinetic_energy", "retained"] == pytest.approx(1e-4)


def test_static(make):
    n = 5
    r = rows(make(metrics="static", samples=n, history={
        "kinetic_energy": np.array([9, 9, 9, 9, 2.0]), "strain_energy": np.array([1, 1, 1, 1, 400.0]),
        "unbalanced_force": np.array([1, 1, 1, 1, 3e-4])}))
    assert r["static", "kinetic_over_strain"] == pytest.approx(0.005)
    assert r["static", "unbalanced"] == pytest.approx(3e-4)


@pytest.mark.parametrize("samples", [41, 83, 160])
def test_first_peak_between_samples(make, samples):
    r = rows(make(metrics="first_peak", samples=samples, overshoot=1.9))
    assert r["first_peak", "ratio"] == pytest.approx(1.9, rel=2e-4)
    assert r["first_peak", "time"] == pytest.approx(1.0, abs=2e-3)


def test_peak_is_the_first_not_the_highest():
    t = np.linspace(0, 4 * math.pi, 4001)
    time, value = metrics.peak(t, np.sin(t) ** 2 * (1 + 0.1 * t))
    assert time == pytest.approx(math.pi / 2, abs=0.15)
    assert value == pytest.approx(1 + 0.1 * time, rel=0.01)


def test_peak_of_a_parabola_is_exact_on_uneven_samples():
    t = np.array([0.0, 0.7, 1.1, 1.6, 2.5])
    assert metrics.peak(t, 3.0 - (t - 1.2) ** 2) == pytest.approx((1.2, 3.0))


def test_ripples_below_half_are_no_peak():
    t = np.linspace(0, 1.5 * math.pi, 2000)
    time, _ = metrics.peak(t, 1 - np.cos(t) + 0.05 * np.sin(60 * t) * (t < 0.8))
    assert time == pytest.approx(math.pi, abs=0.01)


def test_a_record_that_ends_too_early_has_no_peak(make):
    assert metrics.peak(np.arange(5.0), np.arange(5.0)) is None
    grades = metrics.grade(make(metrics="first_peak", samples=81, damping=-2.0, overshoot=-20.0))
    assert "does not turn back" in grades.errors[0]


def test_energy_drift_per_period(make):
    slope = 0.5  # J/m per second
    r = rows(make(metrics="energy", energy_slope=slope, samples=801))
    assert r["energy_drift", "per_period"] == pytest.approx(slope * PERIOD / 200.0, rel=1e-3)
    assert r["energy_gain", "max"] == pytest.approx(slope * 2 * PERIOD / 20.0, rel=1e-3)


def test_kinetic_energy_retained(make):
    r = rows(make(metrics="energy", samples=3, reference={"period": None}, history={
        "kinetic_energy": np.array([4.0, 9.0, 1.0])}))
    assert r["kinetic_energy", "retained"] == pytest.approx(0.25)


def test_energy_counts_the_work_of_gravity_as_lost_potential(make):
    result = make(metrics="energy")
    assert metrics.total_energy(result) == pytest.approx(np.full(81, 20.0))


def test_energy_needs_a_period_or_a_start(make):
    result = make(metrics="energy", reference={"period": None}, history={
        "kinetic_energy": np.zeros(81), "gravity_work": np.zeros(81), "strain_energy": np.linspace(0, 1, 81)})
    assert "report.reference.period" in metrics.grade(result).errors[0]


def test_momenta(make):
    r = rows(make(metrics="momentum,angular_momentum"))
    assert r["momentum", "error"] == pytest.approx(0.01)
    assert r["angular_momentum", "retained"] == pytest.approx(0.95)
    assert r["angular_momentum", "error"] == pytest.approx(0.05)


def test_spurious_stress_takes_the_softest_material(make):
    assert rows(make(metrics="spurious_stress"))["spurious_stress", "max"] == pytest.approx(0.2)


def test_performance_is_always_there(make):
    r = rows(make(metrics=""))
    assert r == {("particle_steps_per_second", ""): pytest.approx(80e3), ("bytes_per_point", ""): 200.0, ("solve_s", ""): 1.0}


@pytest.mark.parametrize("status", ["diverged", "time_limit"])
def test_a_run_that_did_not_complete_gives_nan(make, status):
    result = make(metrics="stress,displacement,settlement,first_peak,energy,static,momentum,angular_momentum,"
                          "spurious_stress", status=status)
    complete = make("b.h5", metrics=result.scene["metrics"], damping=1.0,
                    history={"strain_energy": np.linspace(0, 1, 81)})
    r, full = rows(result), rows(complete)
    assert set(full) == set(r)
    assert all(math.isnan(v) for key, v in r.items() if key[0] not in metrics.ALWAYS)


@pytest.mark.parametrize("group, drop, told", [
    ("stress", ["exact_stress"], "exact_stress"), ("displacement", ["initial_volume"], "initial_volume"),
    ("first_peak", ["history/probes/tip/displacement"], "tip"), ("energy", ["strain_energy"], "strain_energy"),
    ("settlement", ["exact_displacement"], "exact_displacement"), ("momentum", ["linear_momentum"], "linear_momentum")])
def test_missing_data_is_told_and_harms_nothing_else(make, group, drop, told):
    grades = metrics.grade(make(metrics=f"{group}, spurious_stress", drop=drop))
    assert len(grades.errors) == 1 and told in grades.errors[0]
    assert ("spurious_stress", "max") in grades.rows


def test_unknown_group_has_a_neighbour(make):
    assert "did you mean 'displacement'" in metrics.grade(make(metrics="displacment")).errors[0]


def test_reference_must_be_numbers(make):
    result = make(metrics="first_peak", scene_extra="")
    result.resolved["report"]["reference"]["static_displacement"] = "H"
    assert "report.reference.static_displacement" in metrics.grade(result).errors[0]


def test_seed_and_settings_are_read(make):
    assert make(seed=7).seed == 7 and make("b.h5").seed == ""
    assert make("c.h5").reference["static_displacement"] == TIP
    random = '[[material]]\nname = "soil"\n[material.random]\nseed = 3\n'
    assert make("d.h5", scene_extra=random).seed == 3
    assert make("e.h5", scene_extra="[other]\nseed = 1\n" + random).seed == 3  # that of the strength goes first


def test_reference_curves_are_read(make):
    x, y = make(scene_extra='[[report.curve]]\nname = "surface"\nx = [0, 1.5]\ny = [2.0, 0]\n').curves["surface"]
    assert x.tolist() == [0.0, 1.5] and y.tolist() == [2.0, 0.0]
    with pytest.raises(ResultError, match="'surface' needs x and y of one length"):
        make("b.h5", scene_extra='[[report.curve]]\nname = "surface"\nx = [0, 1.5]\ny = [2.0]\n').curves
    with pytest.raises(ResultError, match="'surface' needs lists of numbers"):
        make("c.h5", scene_extra='[[report.curve]]\nname = "surface"\nx = [0, 1]\ny = ["a", 1]\n').curves


@pytest.mark.parametrize("harm, told", [
    (lambda p: p.write_bytes(p.read_bytes()[:3000]), "cannot be read"),
    (lambda p: p.write_text("no"), "cannot be read"),
    (lambda p: p.unlink(), "cannot be read")])
def test_bad_files_raise_one_kind_of_error(tmp_path, harm, told):
    path = write_result(tmp_path / "bad.h5")
    harm(path)
    with pytest.raises(ResultError, match=told):
        Result(path)


def test_attributes_are_checked(tmp_path):
    import h5py
    path = write_result(tmp_path / "bad.h5")
    with h5py.File(path, "a") as file:
        file.attrs["format_version"] = 2
    with pytest.raises(ResultError, match="format_version 2"):
        Result(path)


def test_energy_lost_is_a_drift_too(make):
    r = rows(make(metrics="energy", energy_slope=-0.5, samples=801))
    assert r["energy_drift", "per_period"] == pytest.approx(0.5 * PERIOD / 200.0, rel=1e-3)


def test_scaled_displacement_is_weighted_by_volume(tmp_path):
    path = write_result(tmp_path / "r.h5", metrics="displacement", displacement_error=0.1, sealed=False)
    with h5py.File(path, "r+") as file:
        where = file["snapshots/0001"]
        volume = where["initial_volume"][()]
        high = where["initial_position"][()][:, 1] > 0.5 * H
        volume[high] *= 5.0
        where["initial_volume"][...] = volume
        error = np.linalg.norm(where["displacement"][()] - where["exact_displacement"][()], axis=1)
    expected = np.sqrt(np.sum(volume * error**2) / np.sum(volume)) / TIP
    assert rows(Result(path))["displacement", "rms_scaled"] == pytest.approx(expected, rel=1e-12)
    assert abs(np.sqrt(np.mean(error**2)) / TIP / expected - 1) > 0.05
