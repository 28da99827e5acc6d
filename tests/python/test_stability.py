"""Cases with bounds: searches, verdicts, limits, the stability matrix and what the page says of failures."""
import csv
import json
import math
import re
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import write_result
from test_study import Bench
from testbed_reports.read.bisection import Bisection, bracket, next_values, problem_of
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.page.failures import cheapest, costs
from testbed_reports.grade.limits import find_limits
from testbed_reports.draw.matrix import build as build_matrices
from testbed_reports.grade.metrics import grade
from testbed_reports.page.report import build
from testbed_reports.read.results import Result
from testbed_reports.read.study_file import StudyError, read_study


def search_all(search, threshold):
    """Runs a search against 'holds up to the threshold'; returns what was asked, in order."""
    held = {}
    while values := next_values(search, held):
        assert not set(values) & set(held) and len(held) < 60
        held.update({v: v <= threshold for v in values})
    return held


@pytest.mark.parametrize("low, high, threshold", [(0.1, 3.0, 1.015), (0.1, 3.0, 0.1004), (1e-6, 1.0, 3e-5), (-0.9, 0.5, 0.2), (0.0, 1.0, 0.7)])
def test_search_brackets_a_threshold(low, high, threshold):
    search = Bisection("time.cfl", low, high, "sound", 0.01)
    held = search_all(search, threshold)
    a, b = bracket(search, held)
    assert a <= threshold < b and b - a <= 0.01 * max(abs(a), abs(b))
    # halving costs the logarithm of the range; positive ranges are halved in proportion
    ratio = math.log(high / low) / math.log(1.01) if low > 0 else (high - low) / (0.01 * max(abs(a), abs(b)))
    assert len(held) <= 4 + math.log2(ratio)


@pytest.mark.parametrize("threshold", [0.05, 9.0])
def test_search_without_a_change_stops_at_its_ends(threshold):
    search = Bisection("time.cfl", 0.1, 3.0, "sound", 0.01)
    held = search_all(search, threshold)
    assert sorted(held) == [0.1, 3.0] and bracket(search, held) is None


def test_search_asks_the_same_again():
    search = Bisection("k", 0.1, 3.0, "sound", 0.01)
    whole = search_all(search, 1.0)
    part = dict(list(whole.items())[:4])
    assert next_values(search, part) == [list(whole)[4]]


def test_until_bounded_takes_wrong_for_holding():
    assert Bisection("k", 0, 1, "bounded", 0.1).holds("wrong") and not Bisection("k", 0, 1, "sound", 0.1).holds("wrong")
    assert not Bisection("k", 0, 1, "bounded", 0.1).holds("failed")


@pytest.mark.parametrize("change, told", [({"bisect": [3.0, 1.0]}, "low < high"), ({"until": "good"}, "until"), ({"tolerance": 0}, "tolerance"),
                                          ({"more": 1}, "no others")])
def test_what_is_no_search(change, told):
    assert told in problem_of({"bisect": [0.1, 3.0], "until": "sound", "tolerance": 0.01, **change})


SEARCH = """\
title = "Searched"
[axes]
method = ["lpfdm", "mpm-linear"]
[[case]]
name = "fine"
scene = "scene.toml"
parameter = "grid.cell_size"
[case.axes]
"grid.cell_size" = {bisect = [0.5, 4.0], until = "sound", tolerance = 0.05}
[[case.bound]]
quantity = "stress"
norm = "l2"
max = 0.1
"""


def test_a_study_searches_resumes_and_marks_the_bracket(tmp_path):
    bench = Bench(tmp_path)  # its stand-in has a stress error of 0.02 L^2: 0.1 at L = 2.236
    bench.write(SEARCH)
    done = bench.run("-j", "2")
    assert done.returncode == 0, done.stderr
    calls = len(bench.calls)
    assert 2 * 5 <= calls <= 2 * 9
    study = read_study_folder(bench.out)
    assert len(study.limits) == 2
    for limit in study.limits:
        low, high = limit.measured
        assert low <= math.sqrt(5) <= high <= low * 1.06
        assert limit.below.values["bracket"] == "below" and limit.above.values["bracket"] == "above"
        assert limit.below.value("limit", "measured") == low
    # a lost run in the middle of the search is run again, and nothing else
    middle = study.limits[0].below
    (middle.folder / "result.h5").unlink()
    again = bench.run()
    assert again.returncode == 0 and len(bench.calls) == calls + 1
    assert json.loads((bench.out / "plan.json").read_text())["runs"][0]["command"].startswith("testbed run ")


def test_a_search_treats_a_run_without_a_file_as_failed(tmp_path):
    bench = Bench(tmp_path)
    bench.write(SEARCH)
    bench.behave(**{"mpm-linear": "kill"})
    done = bench.run("--quiet")
    assert done.returncode == 4
    limits = {limit.runs[0].name: limit for limit in read_study_folder(bench.out).limits}
    assert limits["mpm-linear"].below is None and "not sound at either end" in limits["mpm-linear"].verdict
    assert limits["lpfdm"].below is not None


def test_a_limit_of_the_time_step_stands_beside_the_stated_and_the_sharp_one():
    """dt c_p / L of the last bracket, with c_p = 20 m/s and L = 0.5 m, over what the runs know of both; without either, no number."""
    def run(cfl, level, **known):
        result = SimpleNamespace(performance={"dt": 0.01 * cfl, **known}, cell_size=0.5,
                                 materials={"soil": {"constrained_modulus": 4e5, "density": 1e3}})
        return SimpleNamespace(result=result, values={"time.cfl": cfl, "case": "c", "nu": 0.3}, search="s", rows={},
                               verdict=SimpleNamespace(level=level, rank=0))

    def limits(more=(), **known):
        search = Bisection("time.cfl", 1.0, 2.0, "sound", 0.1)
        study = SimpleNamespace(spec=SimpleNamespace(combinations=[SimpleNamespace(case="c", bisection=search)]),
                                runs=[run(1.0, "sound", **known), run(1.5, "sound", **known), run(1.6, "failed", **known), run(2.0, "failed", **known), *more],
                                case=lambda name: SimpleNamespace(axis_keys=["nu", "time.cfl"]))
        (limit,) = find_limits(study)
        return limit

    for more in ([run(1.2, "failed"), run(1.2, "sound")], [run(1.2, "sound"), run(1.2, "failed")]):  # of repeats the worst counts
        assert limits(more).measured == (1.0, 1.2)
    limit = limits(dt_critical=0.01, dt_sharp=0.0125)
    assert limit.step == pytest.approx((0.6, 0.64)) and (limit.stated, limit.sharp) == pytest.approx((0.4, 0.5))
    assert limit.below.rows == pytest.approx({("limit", "measured"): 1.5, ("limit", "ratio"): 1.55, ("limit", "sharp_ratio"): 1.24})
    assert set(limits(dt_critical=0.01).below.rows) == {("limit", "measured"), ("limit", "ratio")}


CASES = """\
title = "Cases"
[axes]
method = ["lpfdm", "mpm-linear"]
[[case]]
name = "column"
title = "A column"
scene = "../column/scene.toml"
purpose = "Why."
parameter = "constants.k"
[case.axes]
"constants.k" = [1.0, 2.0, 3.0]
[[case.bound]]
quantity = "stress"
norm = "l2"
max = 0.1
failed = 10.0
source = "by hand"
[[case.bound]]
quantity = "stress"
norm = "l2"
max = 0.5
where = {variant = "mpm-linear", "constants.k" = 3.0}
[[failure]]
name = "stiff"
title = "Too stiff"
text = "It is. It stays."
where = {case = "column"}
component = "stress_yy"
[[remedy]]
failure = "stiff"
label = "the other method"
without = {variant = "lpfdm", "constants.k" = 2.0}
with = {variant = "mpm-linear", "constants.k" = 2.0}
[[figure]]
kind = "stability_matrix"
name = "matrix"
"""

# (method, k) -> what the run is
RUNS = {("lpfdm", 1.0): {"attributes": {"soundness": "sound"}},
        ("lpfdm", 2.0): {"stress_error": 0.2, "attributes": {"soundness": "sound"}, "solve_s": 2.0},
        ("lpfdm", 3.0): {"status": "diverged", "reason": "the box of point 3 has collapsed", "attributes": {"cause": "sliver", "remedy": "time.cfl = 0.1"}},
        ("mpm-linear", 1.0): {"stress_error": 0.2, "attributes": {"soundness": "suspect", "suspect": "energy: it grew\noutside: 3 points"}},
        ("mpm-linear", 2.0): {"solve_s": 3.0},
        ("mpm-linear", 3.0): {"stress_error": 0.2, "attributes": {"soundness": "suspect", "suspect": "volume: it shrank"}}}


def write_cases(folder, runs=RUNS, text=CASES):
    entries = []
    for (method, k), how in runs.items():
        name = f"column_{method}_k{k:g}_r1"
        entries.append({"id": name, "case": "column", "method": method.split("-")[0], "variant": method, "L": 1.0, "axes": {"method": method, "constants.k": k},
                        "repeat": 1, "command": f"testbed run scene.toml --method {method} --set constants.k={k}"})
        write_result(folder / "runs" / name / "result.h5", variant=method, **how)
    (folder / "study.toml").write_text(text)
    (folder / "plan.json").write_text(json.dumps({"runs": entries, "left_out": [], "command": "testbed study cases.toml"}))
    return folder


@pytest.fixture(scope="module")
def cases(tmp_path_factory):
    return write_cases(tmp_path_factory.mktemp("cases") / "cases")


@pytest.fixture(scope="module")
def verdicts(cases):
    return {(r.name, r.values["constants.k"]): r.verdict for r in read_study_folder(cases).runs}


def test_levels(verdicts):
    levels = {key: v.level for key, v in verdicts.items()}
    assert levels == {("lpfdm", 1.0): "sound", ("lpfdm", 2.0): "wrong", ("lpfdm", 3.0): "failed", ("mpm-linear", 1.0): "wrong",
                      ("mpm-linear", 2.0): "sound", ("mpm-linear", 3.0): "sound"}  # the last by a bound of its own


def test_only_a_run_that_says_nothing_is_silent(verdicts):
    assert [key for key, v in verdicts.items() if v.silent] == [("lpfdm", 2.0)]
    assert [key for key, v in verdicts.items() if v.warned] == [("mpm-linear", 3.0)]


def test_a_file_without_soundness_is_silent_when_wrong(tmp_path):
    folder = write_cases(tmp_path / "s", {("lpfdm", 1.0): {"stress_error": 0.2}})
    assert read_study_folder(folder).runs[0].verdict.silent


def test_causes_and_what_held(verdicts):
    failed = verdicts["lpfdm", 3.0]
    assert failed.cause == "node with little mass" and failed.held == "time.cfl = 0.1" and failed.time == pytest.approx(2 * 1.2649, rel=1e-3)
    assert verdicts["lpfdm", 2.0].cause == "stress l2 0.2" and verdicts["lpfdm", 2.0].held == "constants.k = 1.0"
    assert verdicts["mpm-linear", 1.0].held == "constants.k = 2.0"


def test_not_finite_and_far_beyond_are_failures(tmp_path):
    runs = {("lpfdm", 1.0): {"stress_error": 20.0}, ("lpfdm", 2.0): {"stress_error": math.nan}, ("lpfdm", 3.0): {"drop": ("exact_stress",)}}
    study = read_study_folder(write_cases(tmp_path / "s", runs))
    assert [r.verdict.level for r in study.runs] == ["failed"] * 3
    assert study.runs[2].verdict.cause == "no number: stress l2"


def test_rows_for_targets(cases):
    run = next(r for r in read_study_folder(cases).runs if r.verdict.silent)
    assert run.value("verdict", "silent") == 1 and run.value("verdict", "level") == 1


@pytest.fixture(scope="module")
def page(cases, tmp_path_factory):
    out = tmp_path_factory.mktemp("report")
    return build([cases], out, "testbed report cases")


class Links(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.ids, self.cells = set(), []
        self.open = None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.ids |= {attributes["id"]} if "id" in attributes else set()
        if tag == "td" and "cell" in attributes.get("class", ""):
            self.open = [attributes["class"].split()[-1], "", ""]
            self.cells.append(self.open)
        if tag == "a" and self.open:
            self.open[1] = attributes["href"].lstrip("#")

    def handle_endtag(self, tag):
        self.open = None if tag == "td" else self.open

    def handle_data(self, data):
        if self.open:
            self.open[2] += data


def test_every_cell_leads_to_its_run_and_command(page):
    text = page.read_text()
    links = Links(text)
    assert [(kind, sign.strip()) for kind, _, sign in links.cells] == [("v-sound", "✓"), ("v-silent", "‼"), ("v-failed", "✗"), ("v-wrong", "~"),
                                                                      ("v-sound", "✓"), ("v-sound", "✓")]
    for _, target, _ in links.cells:
        assert target in links.ids
        told = text[text.index(f'id="{target}"'):]
        method, k = re.match(r"run-column_(.*)_k(\d)_r1", target).groups()
        assert f"testbed run scene.toml --method {method} --set constants.k={k}.0" in told[:told.index("</p>")]


def test_page_is_loud_about_silent_runs_and_tells_causes(page):
    text = page.read_text()
    assert "1 runs are sound-but-wrong" in text
    assert "node with little mass" in text and "time.cfl = 0.1" in text and "Cheapest remedy" in text
    assert "It is. It stays." in text and 'alt="Too stiff"' in text


def test_matrix_for_print(page):
    tables = page.parent / "tables"
    with open(tables / "cases_stability_matrix.csv", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[1] == ["A column", "k", "1", "2", "3"]
    assert rows[2] == ["", "lpfdm", "sound", "sound-but-wrong", "failed"]
    assert r"\toprule" in (tables / "cases_stability_matrix.tex").read_text()
    assert (page.parent / "figures" / "cases_matrix.pdf").stat().st_size > 2000
    assert (page.parent / "figures" / "cases_failure_stiff.pdf").stat().st_size > 2000
    with open(tables / "cases_runs.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 6


def test_cost_beside_remedy(cases):
    study = read_study_folder(cases)
    cost = costs(study)[0]
    assert cost.without == (0, 1) and cost.with_it == (1, 1) and cost.time == pytest.approx(1.5) and cost.memory == 1.0
    assert "at 1.50 times the time" in cheapest([cost], "stiff")
    assert cheapest([], "stiff") == "none tried here."
    cost.without = (1, 1)
    assert cheapest([cost], "stiff").startswith("not needed")


def test_the_worst_run_stands_for_a_cell(tmp_path):
    text = CASES.replace('"constants.k" = [1.0, 2.0, 3.0]', '"constants.k" = [1.0, 2.0, 3.0]\n"constants.n" = [1, 2]')
    folder = write_cases(tmp_path / "s", text=text)
    plan = json.loads((folder / "plan.json").read_text())
    for entry in plan["runs"]:
        entry["axes"]["constants.n"] = 1
    extra = {**plan["runs"][0], "id": "column_lpfdm_k1_n2_r1", "axes": {"method": "lpfdm", "constants.k": 1.0, "constants.n": 2}}
    write_result(folder / "runs" / extra["id"] / "result.h5", variant="lpfdm", stress_error=0.3)
    (folder / "plan.json").write_text(json.dumps({**plan, "runs": plan["runs"] + [extra]}))
    cell = build_matrices(read_study_folder(folder))[0].cells["lpfdm"][0]
    assert cell.kind == "silent" and cell.text == "1/2" and cell.run.id == extra["id"]


@pytest.mark.parametrize("old, new, told", [
    ('parameter = "constants.k"', 'parameter = "constants.j"', "not an axis"),
    ('max = 0.1\n', "", "'min' or 'max'"),
    ('name = "column"', 'name = "a column"', "must be a word"),
    ('"constants.k" = [1.0, 2.0, 3.0]', '"constants.k" = {bisect = [2, 1], until = "sound", tolerance = 0.1}', "low < high"),
    ('failure = "stiff"', 'failure = "stif"', "did you mean 'stiff'"),
    ('title = "Cases"', 'title = "Cases"\nscene = "x"', "[[case]]s name theirs"),
    ('{variant = "mpm-linear", "constants.k" = 3.0}', '{varint = "mpm-linear"}', "unknown key 'varint'"),
    ('component = "stress_yy"', "", "lacks the key 'component'")])
def test_what_a_study_of_cases_refuses(tmp_path, old, new, told):
    path = tmp_path / "s.toml"
    assert old in CASES
    path.write_text(CASES.replace(old, new, 1))
    with pytest.raises(StudyError, match=re.escape(told)):
        read_study(path, need_scene=False)


def test_a_case_takes_over_and_replaces_what_the_study_sets(tmp_path):
    path = tmp_path / "s.toml"
    path.write_text(CASES.replace("[axes]", '[set]\n"time.cfl" = 0.3\n"constants.k" = 7.0\n[axes]', 1).replace(
        "[case.axes]", '[case.set]\n"constants.m" = 1\n[case.axes]\nmethod = ["lpfdm"]', 1))
    study = read_study(path, need_scene=False)
    assert [c.sets for c in study.combinations] == [{"time.cfl": 0.3, "constants.m": 1, "constants.k": k} for k in (1.0, 2.0, 3.0)]
    assert {c.method for c in study.combinations} == {"lpfdm"} and {c.case for c in study.combinations} == {"column"}


TIME = np.linspace(0.0, 1.0, 101)


def energies(make, total, reference, **further):
    """A result whose total energy runs like this."""
    zero = np.zeros_like(TIME)
    return make(metrics="stability", reference=reference, samples=101,
                history={"time": TIME, "kinetic_energy": total, "strain_energy": zero, "gravity_work": zero, **further})


def test_energy_gain_is_over_what_was_put_in(make):
    total = 90.0 + 15.0 * TIME
    rows = grade(energies(make, total, {"energy_scale": 100.0, "energy_start": 100.0})).rows
    assert rows["energy_gain", "scaled"] == pytest.approx(0.05)
    assert grade(energies(make, total, {"energy_scale": 100.0})).rows["energy_gain", "scaled"] == pytest.approx(0.15)


def test_all_work_counts_where_it_is_given_and_energy_of_points_does_not(make):
    """The points are looked at in some samples only."""
    rows = grade(energies(make, 100 + 30 * TIME, {"energy_scale": 100.0}, kinetic_energy_points=1e5 * TIME, external_work=20 * TIME)).rows
    assert rows["energy_gain", "scaled"] == pytest.approx(0.1)


def test_a_number_that_is_not_finite_is_not_passed_over(make):
    total = np.where(TIME == 0.5, math.nan, 1.0)
    assert math.isnan(grade(energies(make, total, {"energy_scale": 1.0})).rows["energy_gain", "scaled"])


def test_first_time_beyond(tmp_path):
    text = CASES.replace('quantity = "stress"\nnorm = "l2"\nmax = 0.1\nfailed = 10.0', 'quantity = "energy_gain"\nnorm = "scaled"\nmax = 0.1')
    zero = np.zeros_like(TIME)
    how = {"metrics": "stability", "reference": {"energy_scale": 100.0}, "samples": 101,
           "history": {"time": TIME, "kinetic_energy": 100.0 + 50.0 * TIME, "strain_energy": zero, "gravity_work": zero}}
    run = read_study_folder(write_cases(tmp_path / "s", {("lpfdm", 1.0): how}, text)).runs[0]
    assert run.verdict.level == "wrong" and run.verdict.time == pytest.approx(0.21)


def test_drift_of_the_mean(make):
    """A settlement that swings about a mean which grows by a tenth over the record."""
    time = np.linspace(0.0, 100.0, 20001)
    result = make(metrics="stability", samples=20001, reference={"window": 5.0}, snapshots=2, history={
        "time": time, "kinetic_energy": 0 * time + 1, "strain_energy": 0 * time, "gravity_work": 0 * time})
    import h5py
    with h5py.File(result.path, "r+") as file:
        u = np.zeros((len(time), 3))
        u[:, 1] = -(1.0 + 0.1 * time / 100.0 + np.sin(2 * math.pi * time))
        file["history/probes/tip/displacement"][...] = u
    drift = grade(Result(result.path)).rows["settlement_drift", "tip"]
    assert drift == pytest.approx(0.1 * 0.95 / (1 + 0.1 * 0.025), rel=1e-3)
