"""Metric groups of soil tests on histories and points whose numbers are known."""
import math
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic_soil import lattice, toml_curves, vectors, write_soil
from testbed_reports.grade import metrics, soil_metrics
from testbed_reports.read.results import Result

SQUARE = lattice(1.0, 1.0, 0.25)


@pytest.fixture
def soil(tmp_path):
    def build(X=SQUARE, h=0.25, **changes):
        return Result(write_soil(tmp_path / f"{len(list(tmp_path.iterdir()))}.h5", X, h, **changes))
    return build


def rows(result):
    grades = metrics.grade(result)
    assert grades.errors == []
    return {key: value for key, value in grades.rows.items() if key[0] not in metrics.ALWAYS}


# A test with a linear rise to the peak, linear softening and a constant residual stress.
STRAIN, PEAK, AT_PEAK, AT_RESIDUAL, RESIDUAL = np.linspace(0.0, 0.1, 1001), 3.0e5, 0.02, 0.05, 1.2e5
STRESS = np.interp(STRAIN, [0.0, AT_PEAK, AT_RESIDUAL, 0.1], [0.0, PEAK, RESIDUAL, RESIDUAL])
HEIGHT, WIDTH, LATERAL = 2.0, 0.5, 5.0e4


def compression(soil, stress=STRESS, status="completed", **reference):
    return soil(metrics="compression", time=STRAIN, status=status, supports={
        "cap": {"displacement": vectors(y=-HEIGHT * STRAIN), "reaction": vectors(y=-WIDTH * (stress + LATERAL))},
        "base": {"reaction": vectors(x=7.0, y=WIDTH * (stress + LATERAL))}},
        reference={"height": HEIGHT, "width": WIDTH, "confinement": LATERAL, **reference})


def test_compression(soil):
    r = rows(compression(soil, plane_strain_modulus=2e7, peak_stress=2e5, residual_stress=1e5))
    falling = (AT_RESIDUAL - 2 * AT_PEAK) / (0.1 - 2 * AT_PEAK)  # share of the samples after twice the peak strain, on which the load falls
    fall = (PEAK - RESIDUAL) / (AT_RESIDUAL - AT_PEAK) * 1e-4
    assert r.pop(("curve", "roughness")) == pytest.approx(fall * math.sqrt(falling * (1 - falling)), rel=5e-3)
    assert r.pop(("curve", "secant")) == pytest.approx(1)
    assert r == pytest.approx({
        ("modulus", "initial"): 1.5e7, ("modulus", "ratio"): 0.75, ("peak", "stress"): PEAK, ("peak", "ratio"): 1.5,
        ("peak", "strain"): AT_PEAK, ("residual", "stress"): RESIDUAL, ("residual", "ratio"): 1.2})


def test_modulus_is_that_of_10_to_40_percent(soil):
    stress = np.interp(STRAIN, [0.0, 0.001, 0.004, 0.02, 0.1], [0.0, 1e4, 4e4, 1e5, 1e5])  # 10 MPa up to 40 % of the peak
    assert rows(compression(soil, stress))["modulus", "initial"] == pytest.approx(1e7)


def test_residual_is_the_mean_over_the_last_fifth_of_the_strain(soil):
    stress = np.interp(STRAIN, [0.0, 0.02, 0.08, 0.1], [0.0, 1e5, 1e5, 0.0])
    assert rows(compression(soil, stress))["residual", "stress"] == pytest.approx(5e4)


def test_a_stress_that_jumps_has_no_modulus(soil):
    grades = metrics.grade(compression(soil, np.where(STRAIN > 0, 1e5, 0.0)))
    assert "two samples between 10% and 40%" in grades.errors[0]


def test_a_flow_along_a_known_surface(soil):
    """Columns of falling height on a lattice, and one point that was thrown out."""
    X = lattice(0.8, 1.0, 0.1)
    heap = X[X[:, 1] < 1.0 - 0.2 * np.floor(X[:, 0] / 0.2 + 1e-9)]
    X = np.vstack([heap, [[1.55, 0.05, 0.0]]])
    moved = vectors(x=np.where(X[:, 1] > 0.4, 0.3, 1e-4))
    curves = toml_curves(surface=([0.0, 0.1, 0.3, 0.5, 0.7, 0.8], [1.1, 1.1, 0.9, 0.7, 0.5, 0.5]),
                         failure=([0.0, 0.4], [0.3, 0.3]))
    result = soil(X - moved, 0.1, displacement=moved, metrics="runout", scene_extra=curves, reference={"runout": 0.5})
    assert rows(result) == pytest.approx({("runout", "front"): 0.8, ("runout", "ratio"): 1.6, ("surface", "rms"): 0.1,
                                          ("failure_line", "rms"): 0.1})


def test_a_heap_on_a_layer_begins_at_the_base(soil):
    X = lattice(3.0, 1.0, 0.1)
    X = X[(X[:, 1] < 0.5) | (X[:, 0] < 0.8)]
    curves = toml_curves(surface=([0.0, 1.0], [0.9, 0.9]))
    r = rows(soil(X, 0.1, metrics="runout", scene_extra=curves, reference={"base": 0.5}))
    assert r["runout", "front"] == pytest.approx(0.8)
    assert r["surface", "rms"] == pytest.approx(math.sqrt((4 * 0.1**2 + 0.4**2) / 5))  # the last column holds none above the base
    assert rows(soil(X, 0.1, metrics="runout"))["runout", "front"] == pytest.approx(3.0)
    assert rows(soil(X, 0.1, metrics="runout", reference={"front_height": 0.6}))["runout", "front"] == pytest.approx(0.8)
    assert "above report.reference.base" in metrics.grade(soil(X, 0.1, metrics="runout", reference={"base": 2.0})).errors[0]


def test_surface_beyond_the_measured_front_is_above_the_base(soil):
    X = lattice(0.8, 0.3, 0.1)
    curves = toml_curves(surface=([0.0, 0.4], [0.3, 0.3]))
    r = rows(soil(X, 0.1, metrics="runout", scene_extra=curves))
    assert r["surface", "rms"] == pytest.approx(0.3 * math.sqrt(0.5))  # two of four columns lie where nothing was measured


def test_material_that_hardly_moved_is_still(soil):
    X = lattice(0.4, 1.0, 0.1)
    curves = toml_curves(failure=([0.0, 0.4], [0.5, 0.5]))
    moved = vectors(x=0.02 * X[:, 1])
    limits = {None: 0.5, 0.015: 0.7}  # 1 % of the height is reached at 0.5, so no point above 0.45 counts; 0.015 at 0.75
    for still, top in limits.items():
        r = rows(soil(X, 0.1, displacement=moved, metrics="runout", scene_extra=curves, reference={"still": still}))
        assert r["failure_line", "rms"] == pytest.approx(top - 0.5, abs=1e-9)


G = np.linspace(0.0, 1.0, 401)
CREST = 1e-3 * 10.0 * G + 0.05 * np.clip(10.0 * G - 6.0, 0.0, None) ** 2


def collapse(soil, crest=CREST, **reference):
    return soil(metrics="collapse_load", time=G, history={"gravity_factor": G}, probes={"crest": vectors(x=-0.6 * crest, y=-0.8 * crest)},
                reference={"full_load": 10.0, "collapse_displacement": 0.0125, **reference})


def test_collapse_load(soil):
    r = rows(collapse(soil))
    assert r["collapse_load", "first"] == pytest.approx(6.5, abs=2e-3)
    assert r["collapse_load", "second"] == pytest.approx(6.0 + math.sqrt(0.5), abs=2e-3)


def test_no_collapse_is_told(soil):
    r = rows(collapse(soil, CREST * (G < 0.67) + 0.01 * G * (G >= 0.67)))  # passes the first threshold only
    assert r["collapse_load", "first"] == pytest.approx(6.5, abs=2e-3) and math.isnan(r["collapse_load", "second"])
    assert "stays within 0.0125 m" in metrics.grade(collapse(soil, 0.01 * G)).errors[0]


# A layer of 1 m, G = 1 MPa, a band of 0.25 m that softens by k = 200 kPa from 40 kPa to 10 kPa (k above G L / H would snap back).
TAU_P, TAU_R, SOFT, BAND, STIFF = 4.0e4, 1.0e4, 2.0e5, 0.25, 1.0e6


LAYER = (np.array([0.0, TAU_P / STIFF, TAU_P / STIFF + (TAU_P - TAU_R) * (BAND / SOFT - 1.0 / STIFF), 0.2]),
         np.array([0.0, TAU_P, TAU_R, TAU_R]))


def layer(soil, way=1.0, curve=LAYER, **changes):
    u, tau = curve
    at = np.sort(np.concatenate([np.linspace(0.0, u[-1], 2001), u[1:-1]]))
    X, tau = lattice(0.25, 1.0, 0.0625), np.interp(at, u, tau)
    return soil(X, 0.0625, metrics="shear_layer", time=at, supports={
        "top": {"displacement": vectors(x=way * at), "reaction": vectors(x=way * 0.25 * tau, y=3.0)}},
        fields={"plastic_shear_strain": np.where(np.abs(X[:, 1] - 0.5) < BAND / 2, 0.3, 0.001)},
        **{"reference": {"width": 0.25}, **changes})


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_shear_layer(soil, way):
    slope, loss = BAND / SOFT - 1.0 / STIFF, BAND * (TAU_P - TAU_R) ** 2 / (2.0 * SOFT)
    r = rows(layer(soil, way, reference={"width": 0.25, "postpeak_slope": -slope, "dissipation": loss / 2, "band_width": 0.5,
                                         "peak_stress": TAU_P}))
    assert r == pytest.approx({
        ("peak", "stress"): TAU_P, ("peak", "ratio"): 1.0, ("slope", "postpeak"): slope, ("slope", "ratio"): 1.0,
        ("dissipation", "total"): loss, ("dissipation", "ratio"): 2.0, ("band_width", "exact_support"): BAND,
        ("band_width", "ratio"): 0.5, ("band_width", "std"): BAND, ("band_width", "integral"): BAND,
        ("band_width", "half_max"): BAND}, rel=5e-3)


def test_slope_is_that_between_90_and_15_percent_of_the_drop_to_come(soil):
    tau = TAU_R + (TAU_P - TAU_R) * np.array([0.92, 0.12])  # slow at first and at last
    curve = np.array([0.0, 0.04, 0.05, 0.05 + 1e-6 * (tau[0] - tau[1]), 0.15, 0.2]), np.array([0.0, TAU_P, *tau, TAU_R, TAU_R])
    assert rows(layer(soil, curve=curve))["slope", "postpeak"] == pytest.approx(1e-6)


def test_shear_band_rows(soil):
    X = lattice(1.0, 2.0, 0.025)
    d = (X[:, 0] - 0.5) * -math.sin(math.radians(55.0)) + (X[:, 1] - 1.0) * math.cos(math.radians(55.0))
    r = rows(soil(X, 0.025, metrics="shear_band", fields={"plastic_shear_strain": 0.3 * (np.abs(d) < 0.1)}))
    assert r["band_count", ""] == 1 and r["band_angle", "first"] == pytest.approx(55.0, abs=0.5)
    assert math.isnan(r["band_angle", "second"])
    for name in ("std", "integral", "half_max"):
        assert r["band_width", name] == pytest.approx(0.2, rel=0.03)
        assert r["band_width_cells", name] == pytest.approx(4.0, rel=0.03)


def test_no_band_is_a_count_of_zero(soil):
    r = rows(soil(metrics="shear_band", fields={"plastic_shear_strain": np.zeros(len(SQUARE))}))
    assert r["band_count", ""] == 0 and math.isnan(r["band_width", "std"])


def test_reaction_of_walls(soil):
    t = np.linspace(0.0, 1.0, 11)
    r = rows(soil(metrics="reaction", time=t, supports={
        "pile": {"reaction": vectors(3.0 * t * (1.6 - t), -4.0 * t * (1.6 - t)), "displacement": vectors(0.1 * t)},
        "base": {"reaction": vectors(9.0 + t)}}))
    assert set(r) == {("reaction_max", "pile"), ("reaction_end", "pile")}
    assert r["reaction_end", "pile"] == pytest.approx(5.0 * 0.6)
    assert r["reaction_max", "pile"] == pytest.approx(5.0 * 0.64)


@pytest.mark.parametrize("group, told", [
    ("compression", "history/supports/cap/displacement"), ("shear_band", "plastic_shear_strain"),
    ("collapse_load", "report.reference.full_load"), ("shear_layer", "history/supports/top/displacement"),
    ("reaction", "lacks a support")])
def test_missing_data_is_told(soil, group, told):
    grades = metrics.grade(soil(metrics=group + ", runout"))
    assert len(grades.errors) == 1 and told in grades.errors[0]
    assert ("runout", "front") in grades.rows


@pytest.mark.parametrize("status", ["diverged", "time_limit"])
def test_a_run_that_did_not_complete_gives_nan(soil, status):
    """The same rows as a run that completed."""
    wall = '[[wall]]\nname = "pile"\n'
    t = np.linspace(0.0, 1.0, 3)
    curves = toml_curves(surface=([0.0, 1.0], [1.0, 1.0]), failure=([0.0, 1.0], [1.0, 1.0]))
    pile = {"pile": {"reaction": vectors(t), "displacement": vectors(t)}}
    for build in (lambda s: compression(soil, status=s, peak_stress=1.0, residual_stress=1.0, plane_strain_modulus=1.0),
                  lambda s: layer(soil, status=s), lambda s: collapse(soil) if s == "completed" else soil(
                      metrics="collapse_load", status=s),
                  lambda s: soil(metrics="reaction,shear_band,runout", time=t, supports=pile, scene_extra=wall + curves, status=s,
                                 reference={"runout": 1.0}, fields={"plastic_shear_strain": SQUARE[:, 0]})):
        lost, full = rows(build(status)), rows(build("completed"))
        assert set(lost) == set(full)
        assert all(math.isnan(v) for v in lost.values())


def test_a_crumb_on_the_layer_is_no_part_of_the_heap(soil):
    X = lattice(3.0, 1.0, 0.1)
    X = X[(X[:, 1] < 0.5) | (X[:, 0] < 0.8)]
    X = np.vstack([X, [[2.05, 0.55, 0.0]]])
    assert rows(soil(X, 0.1, metrics="runout", reference={"base": 0.5, "front_height": 0.2}))["runout", "front"] == pytest.approx(0.8)


def test_the_elastic_share_of_the_load_is_that_of_the_scene(soil):
    crest = 1e-3 * 10.0 * G + 2e-3 * np.clip(10.0 * G - 1.0, 0.0, None) + 0.05 * np.clip(10.0 * G - 6.0, 0.0, None) ** 2

    def first(share):
        load = 10.0 * G
        early = load <= share * load.max()
        excess = crest - np.polyval(np.polyfit(load[early], crest[early], 1), load)
        k = np.flatnonzero(excess > 0.0125)[0]
        return np.interp(0.0125, excess[k - 1:k + 1], load[k - 1:k + 1])

    for share in (0.2, 0.5):
        assert rows(collapse(soil, crest, elastic_share=share))["collapse_load", "first"] == pytest.approx(first(share), abs=1e-9)
    assert abs(first(0.2) - first(0.5)) > 0.05


def test_a_row_of_a_layer_is_weighted_by_volume():
    final = {"initial_position": np.array([[0.0, 0.5, 0.0], [1.0, 0.5, 0.0], [0.0, 1.5, 0.0]]),
             "initial_volume": np.array([1.0, 3.0, 1.0]), "plastic_shear_strain": np.array([0.4, 0.0, 0.2])}
    y, strain, height = soil_metrics.layer_profile(SimpleNamespace(final=final))
    assert y == pytest.approx([0.5, 1.5]) and strain == pytest.approx([0.1, 0.2]) and height == pytest.approx(1.0)
