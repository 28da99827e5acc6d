"""Costs, fronts and what reaches an accuracy; the section of testbed bench."""
from types import SimpleNamespace

import pytest
from synthetic import write_study
from testbed_reports.page import bench
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.page.report import build
from testbed_reports.draw.figures import draw
from testbed_reports.draw.style import Style
from testbed_reports.draw.work_precision import Cost, cheapest, costs_of, error_of, front, is_busy, reach
from testbed_reports.read.study_file import StudyError

FIGURES = """
[[figure]]
kind = "work_precision"
quantity = "stress"
norm = "l2"
[[figure]]
kind = "work_precision"
quantity = "stress"
norm = "l2"
x = "dofs"
[[figure]]
kind = "work_precision"
quantity = "stress"
norm = "l2"
x = "dofs"
y = "solve_s"
"""


PEERS = """
[[figure.peer]]
series = "lpfdm"
L = [2.0, 1.0, 0.125]
error = [0.1, 0.1, 0.1]
seconds = [{seconds}, {seconds}, 9.0]
[[figure.peer]]
name = "other 1.0, static"
L = [1.0, 0.5]
error = [0.3, 0.1]
seconds = [2.0, 8.0]
"""


def test_other_codes_are_scaled_by_the_rows_measured_beside_them(tmp_path):
    figure = FIGURES.split("[[figure]]")[1]
    plain = read_study_folder(write_study(tmp_path / "a", "[[figure]]" + figure, sizes=(2.0, 1.0), change=lambda *_: {"solve_s": 3.0}))
    assert not draw(plain, plain.spec.figures[0], Style(["lpfdm"])).notes[-1].startswith("Brown")
    study = read_study_folder(write_study(tmp_path / "b", "[[figure]]" + figure + PEERS.format(seconds=2.0), sizes=(2.0, 1.0), change=lambda *_: {"solve_s": 3.0}))
    drawing = draw(study, study.spec.figures[0], Style(["lpfdm"]))
    assert any("scaled by 1.5," in note for note in drawing.notes)
    (line,) = [line for line in drawing.figure.axes[0].lines if list(line.get_ydata()) == [0.3, 0.1]]
    assert list(line.get_xdata()) == [3.0, 12.0]
    assert "other 1.0, static" in [text.get_text() for text in drawing.figure.legends[0].get_texts()]
    low, high = drawing.figure.axes[0].get_xlim()
    assert low < 3.0 and high > 12.0


@pytest.mark.parametrize("text, told", [(PEERS.replace('series = "lpfdm"', 'name = "x"'), "lack a row of this testbed"), (PEERS.replace("[2.0, 8.0]", "[2.0]"), "of one length"),
                                        (PEERS.replace("[2.0, 8.0]", "[2.0, 0.0]"), "above zero"), (PEERS.replace("name =", "nome ="), "nome")])
def test_peers_that_say_too_little_are_refused(tmp_path, text, told):
    with pytest.raises(StudyError, match=told):
        read_study_folder(write_study(tmp_path / "a", "[[figure]]" + FIGURES.split("[[figure]]")[1] + text.format(seconds=2.0), sizes=(1.0,)))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return read_study_folder(write_study(tmp_path_factory.mktemp("wp") / "column", FIGURES, sizes=(2.0, 1.0, 0.5)))


def test_front_keeps_what_nothing_beats():
    assert front([(1, 5), (2, 6), (3, 2), (4, 2), (5, 1)]) == [(1, 5), (3, 2), (5, 1)]


def cost(error, seconds, busy=False):
    return Cost(1.0, {}, error, seconds, seconds, seconds, 10.0, busy, [])


def test_cheapest_is_the_fastest_that_is_good_enough():
    costs = [cost(0.02, 1.0), cost(0.009, 3.0), cost(0.005, 2.0), cost(0.004, 5.0)]
    assert cheapest(costs, 0.01).solve_s == 2.0
    assert cheapest(costs, 0.001) is None


def test_error_from_an_exact_value(study):
    run = next(r for r in study.runs if r.completed)
    entry = {"quantity": "stress", "norm": "l2"}
    assert error_of(run, entry) == run.value("stress", "l2")
    assert error_of(run, {**entry, "exact": 2 * run.value("stress", "l2")}) == pytest.approx(0.5)


def test_repeats_are_one_cost_with_the_median_time(study):
    runs = [r for r in study.runs if r.name == "lpfdm"]
    costs, lost = costs_of(runs, {"quantity": "stress", "norm": "l2"})
    assert len(costs) == 3 and not lost
    assert all(c.least_s <= c.solve_s <= c.most_s and c.dofs > 0 for c in costs)
    assert [c.L for c in costs] == [2.0, 1.0, 0.5]


def test_reach_names_the_fastest(study):
    header, rows, _ = reach(study, study.spec.figures[0])
    assert len(header) == 9
    ratios = [float(row[4]) for row in rows if row[4]]
    assert min(ratios) == 1.0
    assert all(row[2].startswith("best ") or row[2] == "no number" for row in rows if row[1] == "not reached")


def bench_csv(folder, comment="# cpu, 2 cores, busy"):
    rows = [f"lpfdm,{law},{n},{n // 16},{threads},100,{1e-8 * n},{0.9e-8 * n},1e8,90,112,1e10,0.5,{1e-7 * n},\"a: 1; b: 2\""
            for law in ("elastic", "mohr_coulomb") for n in (10000, 100000, 1000000) for threads in (1, 2)]
    folder.mkdir(exist_ok=True)
    (folder / "bench.csv").write_text("\n".join([comment, "method,law," + ",".join(bench.NUMBERS) + ",phases", *rows]) + "\n")
    return folder


def test_bench_in_a_report(tmp_path):
    page = build([bench_csv(tmp_path / "b")], tmp_path / "out", "testbed report b").read_text()
    assert "Measured on a busy machine" in page and "Triad bandwidth: 10.0 GB/s with 1 thread, 10.0 GB/s with 2 threads" in page
    assert (tmp_path / "out/figures/b_bench_rates.pdf").is_file() and (tmp_path / "out/tables/b_bench_cost.csv").is_file()
    table = bench.cost_table(bench.read_bench(tmp_path / "b/bench.csv")[1])
    assert table.rows[0][:3] == ["lpfdm", "block", "4 × 4"] and table.rows[0][3].startswith("1.00") and table.rows[0][4].startswith("1.00")


def test_what_few_points_keep_of_the_rate(tmp_path):
    """Seconds a step: 2e-8 a point at 4 x 4, four times that at 2 x 2; half of the rate at 300 points."""
    line = "lpfdm,elastic,{n},9,1,100,1,{s},1,90,112,1e10,0.5,1,\"a: 1\",block,{c}"
    rows = [line.format(n=n, s=2e-8 * n * factor, c=c) for n, c, factor in ((300, 4, 2), (10000, 4, 1), (324, 2, 8), (9900, 2, 4))]
    (tmp_path / "bench.csv").write_text("\n".join(["method,law," + ",".join(bench.NUMBERS) + ",phases,scene,points_per_cell", *rows]) + "\n")
    _, read = bench.read_bench(tmp_path / "bench.csv")
    table = bench.kept_table(read)
    assert table.header[2:] == ["2 × 2, 300 points", "2 × 2, 10000 points", "4 × 4, 300 points over 10000 points"]
    assert table.rows == [["lpfdm", "block", "0.25", "0.25", "0.50"]]
    assert bench.kept_table([r for r in read if r["threads"] > 1]) is None
    figure = bench.rates_figure(read, Style(["lpfdm"]))
    assert [axis.get_title() for axis in figure.axes if axis.get_visible()] == ["Block, 4 × 4", "Block, 2 × 2"]


def test_a_broken_bench_is_told(tmp_path):
    folder = bench_csv(tmp_path / "b")
    (folder / "bench.csv").write_text("method,law\nlpfdm,elastic\n")
    page = build([folder], tmp_path / "out", "testbed report b").read_text()
    assert "not written by testbed bench" in page


def test_repeats_count_by_the_mean_of_their_errors_and_the_median_of_their_times():
    def run(repeat, error, seconds):
        values = {"L": 0.5, "variant": "lpfdm", "repeat": repeat, "seed": repeat}
        rows = {("stress", "l2"): error, ("solve_s", ""): seconds}
        return SimpleNamespace(values={k: v for k, v in values.items() if k != "seed"}, completed=True, value=lambda q, n="": rows[q, n],
                               result=SimpleNamespace(performance={"dofs": 8}, provenance={"load_average": 0.1}))
    (only,), lost = costs_of([run(1, 0.1, 1.0), run(2, 0.2, 9.0), run(3, 0.6, 2.0)], {"quantity": "stress", "norm": "l2"}, 2)
    assert not lost and only.error == pytest.approx(0.3)
    assert (only.least_s, only.solve_s, only.most_s) == (1.0, 2.0, 9.0)


@pytest.mark.parametrize("provenance, busy", [({"load_average": 1.0}, False), ({"load_average": 2.5}, True), ({"load_average": 9.0, "others_running": 1}, False),
                                              ({"load_average": 0.1, "others_running": 2}, True), ({"load_average": 9.0, "others_running": -1}, True), ({}, False)])
def test_busy_is_who_runs_now(provenance, busy):
    """A build that has just ended leaves a load average, but no one that runs."""
    assert is_busy(SimpleNamespace(result=SimpleNamespace(provenance=provenance)), 2) is busy
