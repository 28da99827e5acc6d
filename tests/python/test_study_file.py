"""Study files: expansion, and messages for broken ones."""
import subprocess
from conftest import REPORTS

import pytest
from testbed_reports.read.study_file import StudyError, flatten, read_study, toml_value

BASE = 'title = "A"\nscene = "scene.toml"\n'
AXES = '[axes]\nmethod = ["a", "b", "fem-q2"]\n"grid.cell_size" = [1.0, 0.5]\n'


@pytest.fixture
def read(tmp_path):
    (tmp_path / "scene.toml").write_text("")

    def of(text):
        (tmp_path / "s.toml").write_text(text)
        return read_study(tmp_path / "s.toml")
    return of


def test_product_in_order(read):
    study = read(BASE + '[set]\n"time.cfl" = 0.5\ngravity.ramp = 2\n' + AXES)
    assert [(c.method, c.sets["grid.cell_size"]) for c in study.combinations] == [
        (m, L) for m in ("a", "b", "fem-q2") for L in (1.0, 0.5)]
    assert study.combinations[0].sets == {"time.cfl": 0.5, "gravity.ramp": 2, "grid.cell_size": 1.0}


def test_exclude_and_override(read):
    study = read(BASE + AXES + '[[exclude]]\nmethod = "fem-q2"\n"grid.cell_size" = 0.5\n'
                 '[[override]]\nwhen = {method = ["a", "fem-q2"]}\nset = {"time.end" = 1, "grid.x" = "H/2"}\n')
    assert len(study.combinations) == 5
    assert [c.sets.get("time.end") for c in study.combinations] == [1, 1, None, None, 1]


def test_no_axes_is_one_run(read):
    assert len(read(BASE).combinations) == 1


@pytest.mark.parametrize("value, text", [(True, "true"), (0.5, "0.5"), (3, "3"), ('a "b"', '"a \\"b\\""'), ([1, "x"], '[1, "x"]'),
                                         (float("inf"), "inf"), (1e-7, "1e-07")])
def test_values_in_toml(value, text):
    import tomllib
    assert toml_value(value) == text
    assert tomllib.loads(f"v = {text}")["v"] == value


def test_dotted_and_quoted_keys_are_one():
    assert flatten({"a": {"b": {"c": 1}}, "d.e": 2}) == {"a.b.c": 1, "d.e": 2}


TARGET = '[[target]]\nlabel = "t"\nquantity = "stress"\n'
BROKEN = [
    ('title = "A"\n', "lacks the key 'scene'"), (BASE + "repeat = 3\n", r"s.toml:3: unknown key 'repeat', did you mean 'repeats'"),
    (BASE + "repeats = 0\n", "s.toml:3: 'repeats' must be at least 1"), (BASE + "repeats = 1.5\n", "'repeats' must be a whole number"),
    (BASE + "repeats = true\n", "'repeats'"), (BASE + "title = 1\n", "s.toml: "), ('title = 3\nscene = "scene.toml"', "s.toml:1: 'title' must be a string"),
    ('title = "A"\nscene = "no.toml"\n', "s.toml:2: 'scene': no such file"),
    (BASE + '[axes]\nmethod = "a"\n', "s.toml:4: axis 'method' must be a list"),
    (BASE + "[axes]\nmethod = []\n", "axis 'method'"), (BASE + '[axes]\nmethod = ["a", "a"]\n', "holds a value twice"),
    (BASE + '[set]\n"grid.cell_size" = 1\n' + AXES, "s.toml:4: 'grid.cell_size' is set and is an axis"),
    (BASE + AXES + '[[exclude]]\nmetod = "a"\n', "s.toml:7: 'metod'.*did you mean 'method'"),
    (BASE + AXES + '[[exclude]]\nmethod = "c"\n', "s.toml:7: .*excludes nothing"),
    (BASE + '[axes]\nmethod = ["a"]\n[[exclude]]\nmethod = "a"\n', "every combination is excluded"),
    (BASE + AXES + '[[override]]\nwhen = {metod = "a"}\nset = {x = 1}\n', "s.toml:7: 'metod'.*not an axis"),
    (BASE + AXES + '[[override]]\nwhen = {method = "a"}\nset = {"grid.cell_size" = 1}\n', "is an axis"),
    (BASE + AXES + '[[override]]\nwhen = {method = "c"}\nset = {x = 1}\n', "applies to nothing"),
    (BASE + AXES + '[[override]]\nwhen = {method = "a"}\n', "lacks the key 'set'"),
    (BASE + TARGET, "lacks the key 'kind'"), (BASE + TARGET + 'kind = "value_mx"\n', "s.toml:6: unknown kind 'value_mx'.*did you mean 'value_max'"),
    (BASE + TARGET + 'kind = "value_max"\n', "lacks the key 'value'"),
    (BASE + TARGET + 'kind = "value_max"\nvalue = 1\nlow = 0\n', "s.toml:8: 'low'.*means nothing"),
    (BASE + TARGET + 'kind = "value_max"\nvalue = "1"\n', "s.toml:7: 'value'.*must be a number"),
    (BASE + TARGET + 'kind = "not_converging"\nwhere = {varant = "a"}\n', "s.toml:7: unknown key 'varant'.*'variant'"),
    (BASE + TARGET + 'kind = "exponent_max"\n', "lacks the key 'value'"),
    (BASE + TARGET + 'kind = "exponent_between"\nlow = 1\n', "lacks the key 'high'"),
    (BASE + '[[figure]]\nkind = "power_law"\n', "lacks the key 'quantity'"),
    (BASE + '[[figure]]\nkind = "convergnce"\n', "s.toml:4: unknown kind 'convergnce'.*'convergence'"),
    (BASE + '[[figure]]\nkind = "convergence"\n', "lacks the key 'quantity'"),
    (BASE + '[[figure]]\nkind = "bars"\nquantity = "stress"\norders = [1]\n', "s.toml:6: unknown key 'orders'"),
    (BASE + '[[figure]]\nkind = "bars"\nquantity = "stress"\nwidth = "wide"\n', "unknown width 'wide'"),
    (BASE + '[[figure]]\nkind = "bars"\nquantity = "stress"\nseries = "time.cfl"\n', "unknown key 'time.cfl' in 'series'"),
    (BASE + "[[figur]]\n", "s.toml:3: unknown key 'figur', did you mean 'figure'"), ("title = \n", "s.toml: ")]


@pytest.mark.parametrize("text, told", BROKEN)
def test_broken_files_name_line_and_key(read, text, told):
    with pytest.raises(StudyError, match=told):
        read(text)


def test_exit_code_of_a_broken_file(tmp_path):
    (tmp_path / "s.toml").write_text(BASE + "repeat = 3\n")
    done = subprocess.run([REPORTS / "testbed-study", tmp_path / "s.toml"], capture_output=True, text=True)
    assert done.returncode == 1 and "'repeat'" in done.stderr and "s.toml:3" in done.stderr and "Traceback" not in done.stderr
    assert subprocess.run([REPORTS / "testbed-study"], capture_output=True).returncode == 1
    assert subprocess.run([REPORTS / "testbed-study", "-j", "0", "x"], capture_output=True).returncode == 1


FIELD, CURVE = '[[figure]]\nkind = "field"\n', '[[figure]]\nkind = "curve"\n'


@pytest.mark.parametrize("text, told", [
    (FIELD, "s.toml:4: .*either the key 'component' or 'deformed_grid = true'"),
    (FIELD + 'component = "stress_yy"\ndeformed_grid = true\n', "either the key 'component'"),
    (FIELD + 'component = "stress_yy"\npattern = "strata"\n', "s.toml:6: 'pattern'.*without 'deformed_grid = true'"),
    (FIELD + 'deformed_grid = true\npattern = "strat"\n', "unknown pattern 'strat'.*did you mean 'strata'"),
    (FIELD + "deformed_grid = true\nspacing = 0\n", "s.toml:6: 'spacing'.*positive"),
    (FIELD + "deformed_grid = true\nsnapshot = [0, 1.5]\n", "s.toml:6: 'snapshot'.*whole numbers"),
    (FIELD + "deformed_grid = true\nsnapshot = []\n", "'snapshot'.*whole numbers"),
    (FIELD + "deformed_grid = true\ncurves = [1]\n", "s.toml:6: 'curves'.*names of"),
    (CURVE + 'x = "time"\n', "lacks the key 'y'"),
    (CURVE + 'x = "time"\ny = "reaction_y"\ny_support = "a"\ny_probe = "b"\n', "s.toml:8: .*'y' from a support or a probe"),
    (CURVE + 'x = "time"\ny = "max_stress"\nlevels = [true]\n', "s.toml:7: 'levels'.*numbers or names"),
    (CURVE + 'x = "time"\ny = "max_stress"\nscale = 1\n', "s.toml:7: unknown key 'scale'"),
    ('[[figure]]\nkind = "history"\nquantity = "reaction_y"\nsupport = "a"\nprobe = "b"\n', "from a support or a probe")])
def test_broken_figures_name_line_and_key(read, text, told):
    with pytest.raises(StudyError, match=told):
        read(BASE + text)


def test_figures_of_soil_tests(read):
    study = read(BASE + FIELD + 'deformed_grid = true\npattern = "strata"\nspacing = 0.1\nsnapshot = [0, -1]\n'
                 + CURVE + 'x = "displacement_y"\nx_support = "cap"\nscale_x = "-height"\ny = "reaction_y"\ny_support = "base"\n'
                 'scale_y = 1.0\ny_unit = "Pa"\nlevels = [1, "peak_stress"]\n')
    assert [f["kind"] for f in study.figures] == ["field", "curve"]
