"""Bands of known place, angle, shape and width in a plastic shear strain at points."""
import numpy as np
import pytest
from synthetic_soil import lattice
from testbed_reports.grade.shear_band import ESTIMATORS, Band, estimate_widths, find_bands, half_max_width, widths

SHAPES = {"uniform": lambda d, w: (np.abs(d) < w / 2) * 1.0,
          "cosine": lambda d, w: np.where(np.abs(d) < w / 2, 0.5 * (1.0 + np.cos(2.0 * np.pi * d / w)), 0.0),
          "triangle": lambda d, w: np.clip(1.0 - 2.0 * np.abs(d) / w, 0.0, None)}
# width over that of the support: sqrt(12) deviations, integral over maximum, half maximum
FACTORS = {"uniform": (1.0, 1.0, 1.0), "cosine": (2 * np.sqrt(3) * np.sqrt(1 / 12 - 1 / (2 * np.pi**2)), 0.5, 0.5),
           "triangle": (np.sqrt(0.5), 0.5, 0.5)}


def field(h, bands, background=0.02):
    """(x (N, 2), strain (N,)) of bands (shape, width, degrees, strain, centre) in a body of 1 m by 2 m; the larger one counts."""
    x, strain = lattice(1.0, 2.0, h)[:, :2], 0.0
    for shape, width, degrees, height, centre in bands:
        normal = np.array([-np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
        strain = np.maximum(strain, height * SHAPES[shape]((x - centre) @ normal, width))
    return x, background + strain


def find(h, bands, **options):
    x, strain = field(h, bands)
    return find_bands(x, strain, np.full(len(x), h * h), h, **options)


@pytest.mark.parametrize("shape", SHAPES)
def test_estimators_have_their_known_factors(shape):
    d = np.linspace(-1.0, 1.0, 4001)
    found = estimate_widths(d, SHAPES[shape](d - 0.1, 0.6))
    assert [found[name] / 0.6 for name in ESTIMATORS] == pytest.approx(FACTORS[shape], rel=2e-3)


def test_half_maximum_between_samples_and_cut_off():
    assert half_max_width(np.arange(5.0), np.array([0.0, 1.0, 4.0, 1.0, 0.0])) == pytest.approx(4.0 / 3.0)
    assert half_max_width(np.arange(3.0), np.array([4.0, 3.0, 1.0])) == pytest.approx(1.5)  # ends where the profile ends


def test_no_strain_has_no_width():
    assert all(np.isnan(v) for v in estimate_widths(np.arange(5.0), np.zeros(5)).values())


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("degrees", [0.0, 35.0, -55.0, 62.3, 90.0])
def test_one_band(shape, degrees):
    band, = find(0.0125, [(shape, 0.2, degrees, 0.3, (0.5, 1.1))])
    assert band.inclination == pytest.approx(abs(degrees), abs=0.2)
    assert band.distance(np.array([0.5, 1.1])) == pytest.approx(0.0, abs=0.004)
    assert [widths(band)[name] / 0.2 for name in ESTIMATORS] == pytest.approx(FACTORS[shape], rel=0.08)
    assert 0.27 < band.strength <= 0.3


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("width", [0.12, 0.2])
@pytest.mark.parametrize("degrees", [(60.0, -60.0), (-50.0, 62.0)])
def test_crossing_bands_do_not_disturb_each_other(shape, width, degrees):
    bands = find(0.0125, [(shape, width, degrees[0], 0.3, (0.5, 1.0)), (shape, width, degrees[1], 0.25, (0.5, 1.0))])
    assert [band.inclination for band in bands] == pytest.approx(np.abs(degrees), abs=0.3)  # the strongest first
    for band in bands:
        assert [widths(band)[name] / width for name in ESTIMATORS] == pytest.approx(FACTORS[shape], rel=0.09)


@pytest.mark.parametrize("shape, width", [("uniform", 0.35), ("cosine", 0.7), ("triangle", 0.7)])  # 0.35 at half maximum
def test_wide_bands_in_a_small_body_have_no_clear_normals_but_count(shape, width):
    strong, weak = (shape, width, 45.0, 0.3, (0.5, 1.35)), (shape, width, -45.0, 0.25, (0.5, 1.35))
    first, second = find(0.025, [strong, weak])
    assert not second.clear
    assert sorted([first.angle, second.angle]) == pytest.approx(np.radians([-45.0, 45.0]), abs=0.1)
    one, = find(0.025, [strong])
    assert one.inclination == pytest.approx(45.0, abs=3.0)


@pytest.mark.parametrize("shape", ["cosine", "triangle"])
def test_a_bulge_is_no_band(shape):
    assert find(0.025, [(shape, 1.8, 0.0, 0.3, (0.5, 1.0))]) == []


def test_a_spot_is_no_band():
    x = lattice(1.0, 2.0, 0.025)[:, :2]
    for area in (0.02, 0.1):
        strain = 0.02 + 0.3 * np.exp(-((x - (0.5, 1.0)) ** 2).sum(axis=1) / area)
        assert find_bands(x, strain, np.full(len(x), 0.025**2), 0.025) == []


@pytest.mark.parametrize("degrees", [35.0, 50.0, 65.0])
def test_a_band_one_point_wide_is_one(degrees):
    x = lattice(1.0, 2.0, 0.025)[:, :2]
    normal = np.array([-np.sin(np.radians(degrees)), np.cos(np.radians(degrees))])
    d = (x - (0.5, 1.0)) @ normal
    strain = 0.02 + 0.3 * 2.0 ** (-(2.0 * d / 0.025) ** 2)
    band, = find_bands(x, strain, np.full(len(x), 0.025**2), 0.025)
    assert band.inclination == pytest.approx(degrees, abs=1.0)  # it is resolved no better


@pytest.mark.parametrize("points", [1, 2, 50])
def test_too_few_points_have_no_band(points):
    x = np.stack([np.zeros(points), np.arange(points)], axis=1)
    assert find_bands(x, np.ones(points), np.ones(points), 1.0) == []


@pytest.mark.parametrize("second, distance", [(0.2, 0.8), (0.3, 0.3)])
def test_bands_that_do_not_cross(second, distance):
    centre = 1.0 - 0.5 * distance / np.cos(np.radians(50.0)), 1.0 + 0.5 * distance / np.cos(np.radians(50.0))
    bands = find(0.0125, [("cosine", 0.15, 50.0, 0.3, (0.5, centre[0])), ("cosine", 0.15, 50.0, second, (0.5, centre[1]))])
    assert [band.inclination for band in bands] == pytest.approx([50.0, 50.0], abs=0.2)
    assert [band.strength for band in bands] == pytest.approx([0.3, second], rel=0.03)


def test_two_cells_wide_is_enough_for_an_angle():
    band, = find(0.05, [("cosine", 0.2, 55.0, 0.3, (0.5, 1.0))])
    assert band.inclination == pytest.approx(55.0, abs=0.5)
    assert widths(band)["half_max"] == pytest.approx(0.1, rel=0.15)


def test_noise_and_gradients_are_no_bands():
    x, _ = field(0.025, [])
    rng, volume = np.random.default_rng(1), np.full(len(x), 0.025**2)
    assert find_bands(x, 0.02 * (1.0 + 0.3 * rng.standard_normal(len(x))), volume, 0.025) == []
    assert find_bands(x, 0.1 * x[:, 1], volume, 0.025) == []
    assert find_bands(x, np.zeros(len(x)), volume, 0.025) == []


def test_a_weak_band_does_not_count():
    bands = [("cosine", 0.15, 50.0, 0.3, (0.5, 1.0)), ("cosine", 0.15, -50.0, 0.03, (0.5, 1.0))]
    assert len(find(0.0125, bands)) == 1
    assert len(find(0.0125, bands, share=0.05)) == 2
    assert len(find(0.0125, bands, share=0.05, most=1)) == 1


def test_noise_on_a_band():
    x, strain = field(0.0125, [("cosine", 0.2, 55.0, 0.3, (0.5, 1.0))])
    strain = strain + 0.01 * np.random.default_rng(2).standard_normal(len(x))
    band, = find_bands(x, strain, np.full(len(x), 0.0125**2), 0.0125)
    assert band.inclination == pytest.approx(55.0, abs=0.3)
    assert widths(band)["half_max"] == pytest.approx(0.1, rel=0.1)


def test_one_odd_normal_does_not_change_the_width():
    d = np.linspace(-1.0, 1.0, 401)
    band = Band(0.0, 0.0, 1.0, d=d, normals=np.array([np.where(np.abs(d) < 0.1, 1.0, 0.0)] * 4 + [np.where(np.abs(d) < 0.8, 1.0, 0.0)]))
    assert widths(band)["half_max"] == pytest.approx(0.2, abs=0.01)
