"""Results of other codes: what cannot be in them keeps them out, and none is pooled with runs of the testbed."""
import shutil

import h5py
import numpy as np
import pytest
from synthetic import PERIOD, TIP, column, write_result, write_study
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.grade.metrics_csv import metrics_csv
from testbed_reports.grade.sampling import sampling
from testbed_reports.page.report import build
from testbed_reports.page.study_section import core_hours
from testbed_reports.study.outside import main as bring

SCENE = f"""
[time]
end = {2 * PERIOD!r}
[gravity]
ramp = 0.1
[grid]
origin = [0.0, 0.0]
size = [4.0, 12.0]
cell_size = 1.0
[[body]]
name = "column"
shape = "box"
min = [0.0, 0.0]
max = [2.0, 10.0]
points_per_cell = 2
[report.reference]
displacement_scale = {TIP!r}
[[probe]]
name = "tip"
"""
LAST = "snapshots/0001"


def put(file, name, values):
    del file[f"{LAST}/{name}"]
    file[f"{LAST}/{name}"] = values


def halve(file):
    for name in list(file[LAST]):
        put(file, name, file[f"{LAST}/{name}"][: len(file[f"{LAST}/{name}"]) // 2])


def set_time(file, name, value):
    file[f"snapshots/{name}"].attrs["time"] = value


FAULTS = {
    "scene puts its points": lambda f: put(f, "initial_position", f[f"{LAST}/initial_position"][()] + [0.05, 0.05, 0.0]),
    "points, the scene 80": halve,
    "initial_volume: not that of": lambda f: put(f, "initial_volume", 2 * f[f"{LAST}/initial_volume"][()]),
    "initial_volume is not positive": lambda f: put(f, "initial_volume", -f[f"{LAST}/initial_volume"][()]),
    "volume is not positive": lambda f: put(f, "volume", 0 * f[f"{LAST}/volume"][()]),
    "not (N, 6)": lambda f: put(f, "stress", f[f"{LAST}/stress"][:, :3]),
    "not finite": lambda f: put(f, "stress", np.nan * f[f"{LAST}/stress"][()]),
    "cell_size = 0.3, its scene 1": lambda f: f["scene"].attrs.__setitem__("cell_size", 0.3),
    "points_per_cell = 3, its scene 2": lambda f: f["scene"].attrs.__setitem__("points_per_cell", 3),
    "the scene ends at": lambda f: [set_time(f, "0000", 0.001), set_time(f, "0001", 0.01)],
    "do not ascend": lambda f: set_time(f, "0000", 2 * PERIOD),
    "'solve_s' of /performance is -3": lambda f: f["performance"].attrs.__setitem__("solve_s", -3.0),
    "'setup_s' of /performance is nan": lambda f: f["performance"].attrs.__setitem__("setup_s", float("nan")),
    "'threads' of /provenance is -2": lambda f: f["provenance"].attrs.__setitem__("threads", -2),
    "exact_stress: not that of the scene": lambda f: put(f, "exact_stress", f[f"{LAST}/stress"][()]),
}


def study_of_one(root):
    return write_study(root / "column", sizes=(1.0,), metrics="stress", models={"lpfdm": lambda L: 0.02, "mpm-linear": lambda L: 0.03}, resolved_text=SCENE)


def mine(path, **changes):
    return write_result(path, **{"variant": "my-code", "method": "other", "metrics": "stress", "stress_error": 0.01, "resolved_text": SCENE, "sealed": False, **changes})


@pytest.mark.parametrize("told", FAULTS)
def test_what_cannot_be_is_refused(tmp_path, capsys, told):
    """By the import, and by a report of a study into which it was copied by hand; it has no part in any number there."""
    folder, path = study_of_one(tmp_path), mine(tmp_path / "mine.h5")
    assert bring([str(path), "--study", str(folder), "--name", "good"]) == 0, capsys.readouterr().err
    with h5py.File(path, "a") as file:
        FAULTS[told](file)
    assert bring([str(path), "--study", str(folder), "--name", "bad"]) == 1 and told in capsys.readouterr().err
    (folder / "runs" / "bad").mkdir()
    shutil.copyfile(path, folder / "runs" / "bad" / "result.h5")
    problems = []
    build([folder], tmp_path / "out", "c", problems)
    assert len(problems) == 1 and told in problems[0]
    study = read_study_folder(folder)
    assert study.outside == ["good"] and core_hours(study.runs) > 0 and "bad" not in metrics_csv(study.runs)


def test_points_in_another_order_are_the_same(tmp_path, capsys):
    path = mine(tmp_path / "mine.h5")
    with h5py.File(path, "a") as file:
        for name in list(file[LAST]):
            put(file, name, file[f"{LAST}/{name}"][()][::-1])
    assert bring([str(path), "--study", str(study_of_one(tmp_path))]) == 0, capsys.readouterr().err


def test_the_name_of_a_method_of_the_testbed(tmp_path, capsys):
    """A result of another code that calls itself lpfdm is no run of lpfdm, wherever it lies."""
    folder, path = study_of_one(tmp_path), mine(tmp_path / "mine.h5", variant="lpfdm", method="lpfdm", stress_error=0.5)
    assert bring([str(path), "--study", str(folder)]) == 0 and "'lpfdm (outside)'" in capsys.readouterr().out
    study = read_study_folder(folder)
    for where in ({"variant": "lpfdm"}, {"method": "lpfdm"}):
        assert [run.id for run in study.select(where)] == ["lpfdm_L1_r1_0"]
    assert [run.id for run in study.select({"variant": "lpfdm (outside)"})] == ["mine"]
    assert "mine,column,lpfdm (outside),lpfdm (outside)," in metrics_csv(study.runs)
    planned = folder / "runs" / "mpm-linear_L1_r1_0" / "result.h5"
    shutil.copyfile(mine(tmp_path / "other.h5", variant="mpm-linear"), planned)  # in the place of a run of the plan
    assert not read_study_folder(folder).select({"variant": "mpm-linear"})
    assert "lpfdm (outside)" in build([path], tmp_path / "out", "c").read_text()


def test_an_early_end_is_lawful_at_rest(tmp_path, capsys):
    for least, code in ((0.2, 0), (0.05, 1)):
        path = mine(tmp_path / f"{least}.h5", resolved_text=SCENE.replace("[gravity]", "stop_unbalanced = 1e-8\n[gravity]"))
        with h5py.File(path, "a") as file:
            set_time(file, "0000", 0.01)
            set_time(file, "0001", least)
        assert bring([str(path)]) == code
    assert "or at rest after 0.1 s" in capsys.readouterr().err


def test_sampling_of_a_scene():
    """A column as written by the testbed; a disk in a box leaves its place to itself; a triangle; what is no scene has none."""
    box = {"name": "a", "shape": "box", "min": [0.0, 0.0], "max": [2.0, 10.0], "points_per_cell": 2}
    grid = {"origin": [0.0, 0.0], "size": [4.0, 12.0], "cell_size": 1.0}
    X, V = column(1.0, 2)
    assert np.allclose(sampling({"grid": grid, "body": [box]}), np.column_stack([X[:, :2], V]))
    disk = {"name": "b", "shape": "disk", "center": [1.0, 5.0], "radius": 0.5, "inside": "a", "points_per_cell": 4}
    both = sampling({"grid": grid, "body": [box, disk]})
    assert len(both) == 80 and (np.hypot(*(both[-4:, :2] - [1.0, 5.0]).T) < 0.5).all() and (np.hypot(*(both[:-4, :2] - [1.0, 5.0]).T) > 0.5).all()
    triangle = {"name": "c", "shape": "polygon", "vertices": [[0.0, 0.0], [4.0, 0.0], [0.0, 4.0]], "points_per_cell": 1}
    assert len(sampling({"grid": grid, "body": [triangle]})) == 6
    assert sampling({}) is None and sampling({"grid": grid, "body": [{"shape": "blob"}]}) is None
    assert sampling({"grid": {**grid, "cell_size": 1e-9}, "body": [box]}) is None
