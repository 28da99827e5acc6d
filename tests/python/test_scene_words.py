"""Names in the [report] table of a scene: what nothing reads is told, what is misspelt is refused."""
import os
import re
import tomllib
from types import SimpleNamespace

import pytest
from conftest import REPORTS
from synthetic import write_result, write_study
from testbed_reports.grade.metrics import GROUPS
from testbed_reports.grade.scene_words import misnamed, of_scene
from testbed_reports.page.report import main
from testbed_reports.read.study_file import StudyError, read_study
from testbed_reports.study.outside import main as bring
from testbed_reports.study.resolve import refuse_misspelt
from testbed_reports.study.study import main as study_main

STUDIES = sorted((REPORTS.parent / "benchmarks" / "studies").glob("*.toml"))
READS = (r'(?:numbers|reference)(?:\.get\(|\[)"(\w+)"', r'"(\w+)" in (?:numbers|result\.reference|r\.reference)\b', r'need\([\w.]+, "(\w+)"', r'_ratio\(rows, .*, numbers, "(\w+)"\)')


def test_groups_name_the_keys_that_they_read():
    """What a group reads of report.reference stands in its row, or its users are told that nothing reads it."""
    text = "\n".join(path.read_text() for path in (REPORTS / "testbed_reports" / "grade").glob("*metrics.py"))
    read = {key for pattern in READS for key in re.findall(pattern, text)}
    assert len(read) > 30 and read <= {key for _, _, keys in GROUPS.values() for key in keys}


@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_shipped_scenes_name_nothing_idle(path):
    study = read_study(path)
    for scene in {c.scene for c in study.combinations}:
        assert of_scene(tomllib.loads(scene.read_text()), study.figures) == ([], [])


def test_what_is_misspelt():
    misspelt, idle = misnamed(["stress", "energi"], {"stress_scle": 1, "period": 1, "depth_of_all": 1, "peak": 1}, [{"scale_x": "-peak", "levels": [1.0]}])
    assert misspelt == ["report.metrics: there is no metric group 'energi', did you mean 'energy'?", "report.reference.stress_scle: no metric reads it, did you mean 'stress_scale'?"]
    assert idle == ["report.reference.depth_of_all: no metric and no figure reads it"]


def test_a_report_tells_at_its_top(tmp_path, capsys):
    folder = write_study(tmp_path / "s", sizes=(2.0, 1.0), metrics="stress", reference={"stress_scle": 1.0, "depth_of_all": 1.0})
    assert main([str(folder), "-o", str(tmp_path / "out")]) == 1
    assert "did you mean 'stress_scale'?" in capsys.readouterr().err
    page = (tmp_path / "out" / "report.html").read_text()
    top = page[:page.index('<h2 id="study')] if '<h2 id="study' in page else page[:page.index("<section>")]
    assert "report.reference.stress_scle" in top and "report.reference.depth_of_all" in top
    path = write_result(tmp_path / "one.h5", metrics="stress, energi")
    assert main([str(path), "-o", str(tmp_path / "out")]) == 1 and "metric group 'energi'" in capsys.readouterr().err
    assert bring([str(path)]) == 0 and "metric group 'energi'" in capsys.readouterr().out


def test_a_study_refuses_before_it_runs():
    scene = {"report": {"metrics": ["stress"], "reference": {"stress_scle": 1.0}}}
    with pytest.raises(StudyError, match="scene.toml: report.reference.stress_scle.*stress_scale"):
        refuse_misspelt(SimpleNamespace(figures=[]), [(SimpleNamespace(scene="scene.toml"), "lpfdm")], [("", scene)])


@pytest.mark.skipif(not os.environ.get("TESTBED"), reason="no executable")
def test_a_study_of_the_program_refuses(tmp_path, capsys):
    column = (REPORTS.parent / "benchmarks" / "elastic" / "elastic_column" / "scene.toml").read_text()
    (tmp_path / "scene.toml").write_text(column.replace("stress_scale", "stress_scle"))
    (tmp_path / "s.toml").write_text('title = "s"\nscene = "scene.toml"\n[axes]\nmethod = ["lpfdm"]\n"grid.cell_size" = [2.0]\n')
    assert study_main([str(tmp_path / "s.toml"), "-o", str(tmp_path / "out")]) == 1
    assert "did you mean 'stress_scale'?" in capsys.readouterr().err and not (tmp_path / "out" / "s" / "runs").exists()
