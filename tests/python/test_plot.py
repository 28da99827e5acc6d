"""`testbed plot` on synthetic results."""
import os
import shutil
import subprocess
import sys

import pytest
from conftest import REPORTS
from PIL import Image
from synthetic import write_result


def plot(*arguments):
    return subprocess.run([str(REPORTS / "testbed-plot"), *map(str, arguments)], capture_output=True, text=True)


@pytest.fixture
def results(tmp_path):
    """Two methods on two cell sizes."""
    return [write_result(tmp_path / f"{variant}.h5", variant=variant, L=L) for variant, L in (("lpfdm", 1.0), ("mpm-linear", 0.5))]


@pytest.mark.parametrize("what", [(), ("--field", "stress_yy"), ("--field", "displacement_y", "--time", "0"), ("--deformed",), ("--all",),
                                  ("--profile", "stress_yy"), ("--history", "kinetic_energy"), ("--history", "displacement_y", "--probe", "tip")])
def test_pictures(results, tmp_path, what):
    for suffix in ("png", "pdf"):
        done = plot(*results, *what, "-o", tmp_path / f"a.{suffix}")
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == str(tmp_path / f"a.{suffix}")
    assert min(Image.open(tmp_path / "a.png").size) > 300


def test_the_picture_stands_beside_the_result(results):
    assert plot(results[0]).returncode == 0 and results[0].with_suffix(".png").is_file()


def test_a_run_that_diverged_is_drawn(tmp_path):
    path = write_result(tmp_path / "a.h5", variant="lpfdm", status="diverged", reason="too fast")
    assert plot(path).returncode == 0 and plot(path, "--history", "kinetic_energy").returncode == 0


def test_animation(results, tmp_path):
    done = plot(*results, "-o", tmp_path / "a.gif", "--seconds", "1")
    assert done.returncode == 0, done.stderr
    assert Image.open(tmp_path / "a.gif").n_frames > 1


@pytest.mark.parametrize("options, told", [(("--range", "1", "0"), "the lower one first"), (("--range", "nan", "1"), "the lower one first"), (("--range", "1", "1"), "the lower one first"),
                                           (("--time", "nan"), "--time must be a number"), (("--time", "inf"), "--time must be a number"), (("--seconds", "nan"), "must be positive"),
                                           (("--field", "banana"), "mpm-linear.h5: snapshot"), (("--profile", "banana"), ".h5: snapshot")])
def test_what_cannot_be_drawn_is_told(results, tmp_path, options, told):
    done = plot(results[1], *options, "-o", tmp_path / "a.png")
    assert done.returncode == 1 and told in done.stderr and "Traceback" not in done.stderr and not (tmp_path / "a.png").exists()


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="ffmpeg is not installed")
def test_animation_as_mp4(results, tmp_path):
    done = plot(*results, "-o", tmp_path / "a.mp4", "--seconds", "1")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.mp4").read_bytes()[4:8] == b"ftyp"


def test_an_mp4_without_ffmpeg_says_what_lacks(results, tmp_path):
    done = subprocess.run([sys.executable, str(REPORTS / "testbed-plot"), str(results[0]), "-o", str(tmp_path / "a.mp4")], capture_output=True,
                          text=True, env={**os.environ, "PATH": str(tmp_path)})
    assert done.returncode == 1 and "needs ffmpeg" in done.stderr


@pytest.mark.parametrize("arguments, told", [
    (("--field", "nonsense"), "lacks the field nonsense"), (("-o", "a.xyz"), "must end in"), (("--history", "nothing"), "nothing"),
    (("--all", "--time", "1"), "exclude"), (("--history", "kinetic_energy", "-o", "a.gif"), "is of a map"), (("--seconds", "0"), "positive")])
def test_what_cannot_be_drawn_is_told(results, arguments, told):
    done = plot(results[0], *arguments)
    assert done.returncode == 1 and told in done.stderr and "Traceback" not in done.stderr


def test_files_that_are_no_results(tmp_path):
    (tmp_path / "a.h5").write_text("no HDF5")
    assert plot(tmp_path / "a.h5").returncode == 1
    missing = plot(tmp_path / "b.h5")
    assert missing.returncode == 1 and "no such file" in missing.stderr


def test_a_report_takes_results(results, tmp_path):
    done = subprocess.run([str(REPORTS / "testbed-report"), *map(str, results), "-o", str(tmp_path / "out")], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "out" / "report.html").read_text()
    assert page.count("data:image") >= 3 and "Not drawn" not in page
