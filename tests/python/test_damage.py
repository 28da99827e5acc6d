"""Damaged files are told of in words: no traceback, no crash, no hang. DAMAGED=10000 in the environment damages more."""
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from damage import damaged_copies
from synthetic import seal, write_result, write_study
from testbed_reports.read import guarded
from testbed_reports.grade.dataset import read_run, read_study_folder
from testbed_reports.page.report import main as report
from testbed_reports.read.results import Result, ResultError

COUNT = int(os.environ.get("DAMAGED", "200"))
ROOT = Path(__file__).resolve().parents[2]
COMMAND = ROOT / "reports" / "testbed-report"


def declared(path):
    """With the attribute that says so a checksum must be there."""
    with h5py.File(path, "a") as file:
        file.attrs["checksum"] = "crc32 at the end of the file"
    return seal(path)


def read_everything(path):
    """What a report reads of a file: its grades, all arrays. Raises ResultError alone."""
    run = read_run(path.parent, {"id": "run"})
    if run.result is None:
        raise ResultError(run.reason)
    result = run.result
    for name in result.histories:
        result.history(name)
    for snapshot in result.snapshots:
        for field in snapshot.fields:
            snapshot[field]
    return run


def test_files_of_other_codes_are_read_or_refused(tmp_path):
    """Without a checksum a changed number cannot be told from another; whatever else is wrong is told."""
    metrics = "stress, displacement, settlement, static, energy, spurious_stress"
    whole, bad = write_result(tmp_path / "whole.h5", metrics=metrics, sealed=False), tmp_path / "result.h5"
    read, refused = 0, 0
    for what, data in damaged_copies(whole, COUNT, seed=1):
        bad.unlink(missing_ok=True)
        bad.write_bytes(data)
        try:
            read_everything(bad)
            read += 1
        except ResultError as error:
            assert len(str(error)) < 2000, what
            refused += 1
        except Exception as error:
            raise AssertionError(f"{what}: {type(error).__name__}: {error}") from error
    assert read > COUNT // 20 and refused > COUNT // 10


def test_what_is_no_longer_there_takes_no_memory(tmp_path, monkeypatch):
    monkeypatch.setattr(guarded, "_copies", {})
    monkeypatch.setattr(guarded, "MOST_FILES", 3)
    paths = [write_result(tmp_path / f"{k}.h5", sealed=False) for k in range(5)]
    for count, path in enumerate(paths, start=1):
        Result(path)
        assert len(guarded._copies) == (count - 1) % 3 + 1
    for _ in range(3):
        paths[-1].touch()
        Result(paths[-1])
        assert sum(key[0] == str(paths[-1].resolve()) for key in guarded._copies) == 1


def test_files_of_the_testbed_are_refused(tmp_path):
    """With a checksum no change goes through: not of a number, not a cut of a single byte."""
    whole, bad = declared(write_result(tmp_path / "whole.h5", sealed=False)), tmp_path / "result.h5"
    assert Result(whole).status == "completed"
    data = whole.read_bytes()
    cuts = [(f"cut by {n}", data[:-n]) for n in (1, 20, 40, 41, 100)]
    for what, data in [*damaged_copies(whole, COUNT, seed=2), *cuts]:
        bad.unlink(missing_ok=True)
        bad.write_bytes(data)
        with pytest.raises(ResultError):
            pytest.fail(f"{what}: {Result(bad).status}")


def test_a_library_that_crashes_hangs_or_wants_all_memory(tmp_path, monkeypatch):
    path = write_result(tmp_path / "result.h5", sealed=False)
    for harm, told in ((lambda path: os.abort(), "crashes on it (SIGABRT)"), (_for_ever, "takes for ever"),
                       (lambda path: np.ones(1 << 40), "MemoryError")):
        monkeypatch.setattr(guarded, "_read_all", harm)
        monkeypatch.setattr(guarded, "SECONDS", 1)
        monkeypatch.setattr(guarded, "_copies", {})
        with pytest.raises(ResultError, match=re.escape(told)):
            Result(path)


def _for_ever(_):
    while True:
        pass


@pytest.mark.parametrize("group, name, value, told", [
    ("scene", "cell_size", float("nan"), "cell_size"), ("scene", "cell_size", -1.0, "cell_size"), ("scene", "cell_size", "1 m", "cell_size"),
    ("scene", "cell_size", [1.0, 2.0], "cell_size"), ("/", "status", 3, "status"), ("/", "case", [1.0, 2.0], "case"),
    ("performance", "solve_s", "quick", "solve_s"), ("performance", "dt", [1.0, 2.0], "dt"), ("scene", "resolved", 5, "resolved"),
    ("scene", "resolved", "report = 3", "report"), ("scene", "resolved", "[report]\nreference = 1", "reference"),
    ("scene", "resolved", "probe = [1]", "probe"), ("scene", "metrics", 1.5, "metrics"), ("scene", "points_per_cell", float("nan"), "points_per_cell"),
    ("materials/soil", "youngs_modulus", "stiff", "youngs_modulus"), ("snapshots/0001", "time", "late", "0001")])
def test_attributes_of_the_wrong_kind(tmp_path, group, name, value, told):
    folder = write_study(tmp_path / "s", sizes=(1.0,), models={"lpfdm": lambda L: 0.1})
    path = next((folder / "runs").glob("*/result.h5"))
    with h5py.File(path, "a") as file:
        file[group].attrs[name] = value
    run = read_study_folder(folder).runs[0]
    assert run.status == "unreadable" and told in run.reason


def test_report_goes_on_and_exits_1(tmp_path, capsys):
    folder = write_study(tmp_path / "s", sizes=(1.0,), metrics="stress")
    path = next((folder / "runs").glob("lpfdm*/result.h5"))
    path.write_bytes(path.read_bytes()[:-3000])
    assert report([str(folder), "-o", str(tmp_path / "out")]) == 1
    said = capsys.readouterr().err
    assert "lpfdm_L1_r1_0" in said and "Traceback" not in said and (tmp_path / "out" / "report.html").is_file()


def test_command_on_damaged_files(tmp_path):
    folder = write_study(tmp_path / "s", sizes=(1.0,), models={"lpfdm": lambda L: 0.1}, metrics="stress")
    path = next((folder / "runs").glob("*/result.h5"))
    declared(path)
    whole = path.with_name("whole")
    path.rename(whole)
    for what, data in damaged_copies(whole, max(4, COUNT // 100), seed=3):
        path.write_bytes(data)
        done = subprocess.run([sys.executable, COMMAND, folder, "-o", tmp_path / "out"], capture_output=True, text=True, timeout=300)
        assert done.returncode == 1 and "Traceback" not in done.stderr, (what, done.stderr)
        assert done.stderr.startswith("testbed report: "), what


@pytest.mark.parametrize("command", ["report", "plot"])
def test_commands_on_a_damaged_result_file(tmp_path, command):
    path = write_result(tmp_path / "a.h5")
    program, out = COMMAND.with_name(f"testbed-{command}"), tmp_path / ("out" if command == "report" else "out.png")
    ask = [sys.executable, program, path, "-o", out]
    assert subprocess.run(ask, capture_output=True, timeout=300).returncode == 0
    declared(path)
    whole = path.with_name("whole")
    path.rename(whole)
    for what, data in damaged_copies(whole, max(4, COUNT // 100), seed=4):
        path.write_bytes(data)
        done = subprocess.run(ask, capture_output=True, text=True, timeout=300)
        assert done.returncode == 1 and "Traceback" not in done.stderr, (what, done.stderr)
        assert done.stderr.startswith(f"testbed {command}: "), (what, done.stderr)


@pytest.mark.parametrize("plan", ["[1]", "{\"runs\": [1]}", "{\"runs\": [{\"id\": 3}]}", "{\"runs\": 3}", "{", "[" * 100000])
def test_plans_that_are_none(tmp_path, plan, capsys):
    folder = write_study(tmp_path / "s", sizes=(1.0,), models={"lpfdm": lambda L: 0.1})
    (folder / "plan.json").write_text(plan)
    assert report([str(folder), "-o", str(tmp_path / "out")]) == 1
    assert "plan.json" in capsys.readouterr().err


def test_an_array_may_be_there_twice(tmp_path):
    path = write_result(tmp_path / "result.h5", drop=("snapshots/0001/volume",))
    with h5py.File(path, "a") as file:
        file["snapshots/0001/volume"] = file["snapshots/0000/volume"]
    result = Result(path)
    assert np.array_equal(result.snapshots[0]["volume"], result.snapshots[1]["volume"])


def test_a_link_and_a_loop_are_refused(tmp_path):
    for harm in (lambda f: f.__setitem__("scene/loop", f["/scene"]), lambda f: f.__setitem__("scene/out", h5py.ExternalLink("/etc/passwd", "/"))):
        path = write_result(tmp_path / "result.h5")
        with h5py.File(path, "a") as file:
            harm(file)
        with pytest.raises(ResultError, match="is refused"):
            Result(path)
