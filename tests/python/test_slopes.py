"""Orders and exponents on the first screen: of which runs they are, and whose are best."""
import csv
import re

from synthetic import write_study
from test_findings import questions
from testbed_reports.draw.convergence import convergence
from testbed_reports.draw.power_law import power_law
from testbed_reports.draw.style import Style
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.grade.numbers import Number
from testbed_reports.page.report import build
from testbed_reports.page.slopes import _best

TARGET = '[[target]]\nlabel = "x"\nquantity = "stress"\nnorm = "l2"\nkind = "{}"\nvalue = 0.1\n'
FIGURE = '[[figure]]\nkind = "power_law"\nquantity = "stress"\nnorm = "l2"\n'


def seeds_lost(folder, lost):
    """Three seeds at three sizes; those of (variant, L) in `lost` completed and have no number, but for the last so many."""
    return write_study(folder, TARGET.format("exponent_max") + FIGURE, sizes=(2.0, 1.0, 0.5), repeats=3, metrics="stress",
                       models={"lpfdm": lambda L: 0.01 * L, "mpm-linear": lambda L: 0.02 * L},
                       change=lambda v, L, r: {"seed": r, "drop": ("exact_stress",) if r <= lost.get((v, L), 0) else ()})


def test_an_exponent_says_of_how_many_runs_it_is(tmp_path):
    folder = seeds_lost(tmp_path / "s", {("mpm-linear", 2.0): 3, ("mpm-linear", 1.0): 1})
    page = build([folder], tmp_path / "out", "c").read_text()
    cells = next(cells for text, cells in questions(page).items() if text.startswith("Exponent"))
    assert "1.00 * (5 of 9 runs)" in cells[1] and "*" not in cells[0]
    used = {row["text"]: row["runs"].split() for row in csv.DictReader(open(tmp_path / "out" / "numbers.csv", newline=""))}
    assert len(used["1.00 * (5 of 9 runs)"]) == 5 and not any(run.startswith(("mpm-linear_L2", "mpm-linear_L1_r1")) for run in used["1.00 * (5 of 9 runs)"])
    rows = list(csv.reader(open(tmp_path / "out" / "tables" / "s_power_law_stress.csv", newline="")))
    assert [row[-1] for row in rows if row[:2] == ["mpm-linear", "l2"]] == ["5 of 9"]


def test_a_caption_tells_a_lost_seed_from_a_lost_size(tmp_path):
    study = read_study_folder(seeds_lost(tmp_path / "s", {("mpm-linear", 2.0): 3, ("mpm-linear", 1.0): 1}))
    entry = {"quantity": "stress", "norm": "l2", "where": {}, "series": ["variant"]}
    for draw in (power_law, convergence):
        notes = draw(study, entry, Style(study.variants())).notes
        assert "mpm-linear gave no number at L = 2 m, 1 m (1 of 3 seeds)" in notes and not any("lpfdm gave" in note for note in notes)


def test_an_exact_method_without_one_of_its_runs_is_exact_still(tmp_path):
    """Its order would be one of rounding; it is marked, and not the best."""
    folder = write_study(tmp_path / "s", TARGET.format("order_min"), sizes=(2.0, 1.0, 0.5), metrics="stress",
                         models={"lpfdm": lambda L: 0.01 * L, "fem-q2": lambda L: 1e-14 / L**2}, change=lambda v, L, r: None if (v, L) == ("fem-q2", 0.5) else {})
    cells = next(cells for text, cells in questions(build([folder], tmp_path / "out", "c").read_text()).items() if text.startswith("Order"))
    assert re.search(r">exact \* \(2 of 3 runs\)<", cells[1]) and "best" not in cells[1] and "best" in cells[0]


def test_the_best_order_of_several_settings():
    """1.18 to 1.20 lies within 0.05 of the lower end of 1.22 to 1.27 and not of the upper one."""
    def order(low, high, text=""):
        return Number(f"{low} to {high}{text}", (low, high), "s", "stress")
    assert _best({"a": order(1.22, 1.27), "b": order(1.18, 1.20)}) == ["a"]
    assert _best({"a": order(1.22, 1.27), "b": order(1.18, 1.23), "c": order(0.2, 2.3), "d": order(1.9, 2.0, " ‡")}) == ["a", "b"]
    assert _best({"a": order(1.22, 1.27), "b": "exact"}) == ["b"] and _best({"a": "n/a"}) == []
