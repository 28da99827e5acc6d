"""Maps of fields and of the deformed grid, and curves: what is drawn, by the data of the drawn artists."""
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb
from matplotlib.patches import Rectangle
from synthetic_soil import lattice, vectors, write_soil_study
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.draw.drawing import FigureError
from testbed_reports.draw.figures import draw
from testbed_reports.draw.map_layers import stripe
from testbed_reports.draw.maps import INCLUSION
from testbed_reports.draw.style import Style
from testbed_reports.read.results import ResultError

WALL = '[[wall]]\nname = "cap"\nmin = [-1.0, 2.0]\nmax = [3.0, 2.5]\n'
X, H = lattice(1.0, 2.0, 0.1), 0.1
TIME = np.linspace(0.0, 4.0, 41)
BASE = {"X": X, "h": H, "time": TIME, "snapshots": 2, "scene_extra": WALL,
        "fields": {"plastic_shear_strain": X[:, 0] / 10, "softening_strain": X[:, 1], "body": (X[:, 1] > 1.5).astype(float),
                   "friction_angle": np.full(len(X), np.pi / 6)},
        "supports": {"cap": {"displacement": vectors(y=-0.05 * TIME), "reaction": vectors(y=-TIME)},
                     "base": {"reaction": vectors(y=3.0 * TIME)}}, "reference": {"height": 2.0, "width": 1.5}}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return read_study_folder(write_soil_study(tmp_path_factory.mktemp("m") / "soil", "", {
        "a": {**BASE, "variant": "lpfdm"}, "b": {**BASE, "variant": "mpm-linear"}}))


def drawn(study, **entry):
    entry = {"where": {}, "series": ["variant"], **entry}
    return draw(study, entry, Style(["lpfdm", "mpm-linear"]))


def panels(drawing):
    return [a for a in drawing.figure.axes if a.get_title()]


def numbers(collection):
    return np.asarray(collection.get_array())


def cells(axis):
    return [c for c in axis.collections if isinstance(c, PolyCollection)]


def test_a_field_without_an_exact_solution_has_no_error_panels(study):
    drawing = drawn(study, kind="field", component="plastic_shear_strain")
    assert [a.get_title() for a in panels(drawing)] == ["lpfdm", "mpm-linear"]
    below, soil, outline, grey = cells(panels(drawing)[0])
    assert len(numbers(soil)) == (X[:, 1] < 1.5).sum()
    assert numbers(soil) == pytest.approx(X[X[:, 1] < 1.5, 0] / 10)
    assert soil.get_clim()[0] == 0.0 and soil.get_cmap().name == "viridis"
    assert tuple(grey.get_facecolor()[0][:3]) == to_rgb(INCLUSION) and len(grey.get_paths()) == (X[:, 1] > 1.5).sum()
    assert drawing.figure.axes[-1].get_ylabel() == r"Plastic shear strain $\gamma^\mathrm{p}$"


def test_any_field_of_one_number_is_drawn_by_its_name(study):
    drawing = drawn(study, kind="field", component="softening_strain", inclusions=False)
    assert numbers(cells(panels(drawing)[0])[1]) == pytest.approx(X[:, 1])
    assert drawing.figure.axes[-1].get_ylabel().startswith("Softening strain")
    with pytest.raises(ResultError, match="lacks the field softning_strain; it has .*softening_strain"):
        drawn(study, kind="field", component="softning_strain")


def test_inclusions_may_be_coloured_too(study):
    drawing = drawn(study, kind="field", component="plastic_shear_strain", inclusions=False)
    assert len(numbers(cells(panels(drawing)[0])[1])) == len(X)


def test_angles_are_shown_in_degrees(study):
    drawing = drawn(study, kind="field", component="friction_angle")
    assert numbers(cells(panels(drawing)[0])[1]) == pytest.approx(np.full((X[:, 1] < 1.5).sum(), 30.0))
    assert "[°]" in drawing.figure.axes[-1].get_ylabel()


def test_snapshots_are_rows_with_their_times(study):
    drawing = drawn(study, kind="field", component="plastic_shear_strain", snapshot=[0, 1])
    axes = panels(drawing)
    assert [a.get_title() for a in axes] == ["lpfdm", "mpm-linear"] * 2
    assert axes[0].get_ylabel().startswith("(a) t = 2 s") and axes[2].get_ylabel().startswith("(b) t = 4 s")
    first, last = (cells(a)[1] for a in (axes[0], axes[2]))
    assert numbers(first) == pytest.approx(numbers(last) / 2)
    assert first.get_clim() == last.get_clim()


def test_walls_stand_where_they_have_moved_to(study):
    axes = panels(drawn(study, kind="field", component="plastic_shear_strain", snapshot=[0, 1]))
    bottoms = [next(p for p in a.patches if isinstance(p, Rectangle)).get_y() for a in (axes[0], axes[2])]
    assert bottoms == pytest.approx([2.0 - 0.1, 2.0 - 0.2])


def test_an_open_door_is_a_gap(study, monkeypatch):
    floor = {"name": "floor", "min": [0.0, -1.0], "max": [1.0, 0.0], "door": [0.4, 0.6], "door_opens": 3.0}
    monkeypatch.setitem(study.runs[0].result.resolved, "wall", [floor])
    axes = panels(drawn(study, kind="field", component="plastic_shear_strain", snapshot=[0, 1], where={"variant": "lpfdm"}))
    assert [len(a.patches) for a in axes] == [1, 2]
    assert [(p.get_x(), p.get_x() + p.get_width()) for p in axes[1].patches] == [(-0.0, 0.4), (0.6, 1.0)]


def test_a_measured_surface_is_drawn_over_the_points(study, monkeypatch):
    for run in study.runs:
        monkeypatch.setitem(run.result.resolved["report"], "curve", [{"name": "surface", "x": [0.0, 1.0], "y": [2.0, 1.0]}])
    drawing = drawn(study, kind="field", component="plastic_shear_strain", curves=["surface"])
    assert [a.lines[0].get_ydata().tolist() for a in panels(drawing)] == [[2.0, 1.0]] * 2
    assert "Broken lines: reference surface" in drawing.notes
    with pytest.raises(FigureError, match="no .*'surfac', did you mean 'surface'"):
        drawn(study, kind="field", component="plastic_shear_strain", curves=["surfac"])


@pytest.mark.parametrize("pattern, same", [("checker", lambda i, j: (i + j) % 2), ("strata", lambda i, j: j % 2)])
def test_deformed_grid_colours_by_initial_position(study, pattern, same):
    drawing = drawn(study, kind="field", deformed_grid=True, pattern=pattern, spacing=0.5)
    own = X[X[:, 1] < 1.5]
    dark = cells(panels(drawing)[0])[1].get_facecolor()[:, 0] < 0.6
    assert (dark == (same(*(own[:, :2] // 0.5).T) == 1)).all()


@pytest.mark.parametrize("points, expected", [(80, 16), (20, 4), (24, 4), (23, 4), (3, 1)])
def test_default_stripes_hold_whole_points(points, expected):
    assert stripe(points * 0.05, 0.05) == pytest.approx(expected * 0.05)


def test_a_field_that_does_not_change_is_found_in_the_first_snapshot(study):
    assert "friction_angle" not in study.runs[0].result.snapshots[1].fields
    assert study.runs[0].result.snapshots[1]["friction_angle"][0] == pytest.approx(np.pi / 6)


def test_no_such_snapshot_is_told(study):
    with pytest.raises(FigureError, match="has no snapshot 7"):
        drawn(study, kind="field", component="plastic_shear_strain", snapshot=[0, 7])


STRESS_STRAIN = dict(kind="curve", x="displacement_y", x_support="cap", scale_x="-height", y="reaction_y", y_support="base",
                     scale_y="width", x_label="Axial strain", y_label="Axial stress", y_unit="Pa")


def test_stress_against_strain(study):
    axis = drawn(study, **STRESS_STRAIN).figure.axes[0]
    x, y = axis.lines[0].get_data()
    assert x == pytest.approx(0.025 * TIME) and y == pytest.approx(2.0 * TIME)
    assert axis.get_xlabel() == "Axial strain" and axis.get_ylabel() == "Axial stress [Pa]"


def test_levels_and_offsets(study):
    axis = drawn(study, **STRESS_STRAIN, levels=[5, "width"], offset_y=3.0).figure.axes[0]
    assert axis.lines[0].get_ydata() == pytest.approx(2.0 * TIME - 2.0)
    assert [line.get_ydata()[0] for line in axis.lines[-2:]] == [5.0, 1.5]
    assert [t.get_text() for t in axis.texts] == ["5", "width"]


def test_a_curve_without_words_names_its_quantities(study):
    axis = drawn(study, kind="curve", x="time", y="reaction_y", y_support="base").figure.axes[0]
    assert axis.get_xlabel() == "Time $t$ [s]" and axis.get_ylabel() == "Reaction $R_{y}$ [N/m]"


def test_history_of_a_support(study):
    axis = drawn(study, kind="history", quantity="reaction_y", support="cap").figure.axes[0]
    assert axis.lines[0].get_ydata() == pytest.approx(-TIME)


def test_a_missing_support_or_number_is_told(study):
    with pytest.raises(Exception, match="lacks /history/supports/lid/reaction"):
        drawn(study, kind="curve", x="time", y="reaction_y", y_support="lid")
    with pytest.raises(FigureError, match="lacks report.reference.depth"):
        drawn(study, kind="curve", x="time", y="reaction_y", y_support="base", scale_y="depth")
