"""What is chosen, and by which number: remedies, cells of the matrix, medians, orders, ranges."""
from types import SimpleNamespace

import numpy as np
import pytest
from synthetic import write_study
from testbed_reports.grade import components
from testbed_reports.page import failures, tables
from testbed_reports.draw import matrix
from testbed_reports.read.bisection import Bisection, next_values
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.draw.figures import draw
from testbed_reports.study.search import Searches
from testbed_reports.draw.style import Style
from testbed_reports.read.values import same
from testbed_reports.draw.work_precision import reach

FIGURE = """
[[figure]]
kind = "work_precision"
quantity = "stress"
norm = "l2"
"""


def test_the_cheapest_remedy_is_the_fastest_of_those_that_help():
    def remedy(label, without, with_it, time, memory=1.0):
        return failures.RemedyCost(label, "f", without, with_it, time, memory)
    found = [remedy("slow", (0, 3), (3, 3), 5.0), remedy("fast", (0, 3), (3, 3), 2.0, 3.0), remedy("idle", (3, 3), (3, 3), 0.5), remedy("half", (0, 3), (1, 3), 0.1)]
    assert failures.cheapest(found, "f").startswith("fast: 3 of 3")
    assert failures.cheapest(found[2:], "f").startswith("none tried here cures all of it; the best, half")


def test_a_cost_is_a_ratio_of_medians():
    assert failures._ratio(float, [2.0, 2.0, 90.0], [1.0, 1.0, 50.0]) == 2.0


def test_a_table_shows_medians():
    assert tables._range([1.0, 2.0, 9.0]) == "2.00 [1.00–9.00]"


def test_orders_of_a_table_fall_with_the_cell_size(tmp_path):
    study = read_study_folder(write_study(tmp_path / "column", metrics="stress"))
    row = next(r for r in tables.convergence_table(study, "stress", "l2").rows if r[0] == "lpfdm")
    assert row[3] == row[5] == row[7] == "2.00"


def test_each_accuracy_has_its_own_fastest(tmp_path):
    folder = write_study(tmp_path / "column", FIGURE, sizes=(2.0, 1.0, 0.5), metrics="stress", change=lambda variant, L, repeat: {"solve_s": 8.0 / L**3})
    study = read_study_folder(folder)
    _, rows, _ = reach(study, study.spec.figures[0])
    for column in (4, 8):
        assert min(float(row[column]) for row in rows if row[column]) == 1.0


def test_a_bracket_is_measured_by_its_larger_end():
    search = Bisection("k", 0.9, 1.0, "sound", 0.1)
    assert next_values(search, {0.9: True, 1.0: False}) == []
    assert next_values(Bisection("k", 0.9, 1.0, "sound", 0.095), {0.9: True, 1.0: False}) != []


def test_a_cell_stands_for_the_limit_that_is_least_safe():
    def limit(name, ratio):
        ends = [SimpleNamespace(search=name, end=end) for end in ("below", "above")]
        return SimpleNamespace(runs=ends, below=ends[0], above=ends[1], ratio=ratio, measured=(1.0, 1.1), verdict="")
    limits = [limit("a", 1.3), limit("b", 0.98), limit("c", 1.1)]
    cell = matrix._cell([run for each in limits for run in each.runs], limits)
    assert (cell.kind, cell.text, cell.run.end) == ("sound", "0.980", "below")
    limits.append(limit("d", 0.9))
    cell = matrix._cell([run for each in limits for run in each.runs], limits)
    assert (cell.kind, cell.text, cell.run.end) == ("failed", "0.900", "above")


def test_mean_stress_is_of_three_components():
    stress = np.array([[1.0, 50.0, 50.0, 2.0, 50.0, 6.0]])  # xx, xy, xz, yy, yz, zz
    assert components.pick(stress, *components.split("mean_stress")) == pytest.approx([3.0])


def test_numbers_are_the_same_to_rounding_only():
    assert same(0.3, 0.1 + 0.2) and not same(1.0, 1.0001)


def test_a_power_law_is_fitted_over_the_sizes_asked_for(tmp_path):
    folder = write_study(tmp_path / "column", metrics="stress", models={"lpfdm": lambda L: 0.02 * L**2 if L > 0.6 else 0.02})
    study = read_study_folder(folder)
    entry = {"kind": "power_law", "quantity": "stress", "norm": "l2", "where": {}, "series": ["variant"], "L_from": 2.0, "L_to": 1.0}
    figure = draw(study, entry, Style(study.variants())).figure
    assert "q = 2.00" in " ".join(text.get_text() for legend in figure.legends for text in legend.get_texts())


def test_of_repeats_in_a_search_the_worst_counts():
    search = Searches.__new__(Searches)
    search.combinations = {"s": SimpleNamespace(bisection=Bisection("k", 1.0, 2.0, "sound", 0.1), at=lambda value: value)}
    search.levels = {"a": "sound", "b": "sound", "c": "failed", "d": "sound", "e": "failed"}
    entries = [{"id": name, "search": "s", "axes": {"k": k}} for name, k in (("a", 1.0), ("b", 1.0), ("c", 1.5), ("d", 1.5), ("e", 2.0))]
    for order in (entries, entries[::-1]):
        (value,) = search.next(order)
        assert 1.0 < value < 1.5
