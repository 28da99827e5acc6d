"""Each kind of target, passing and failing."""
from types import SimpleNamespace

import pytest
from synthetic import write_study
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.grade.targets import as_text, judge, mean_by_size, number


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    def change(variant, L, repeat):
        if variant == "mpm-cpgimp" and L == 0.25:
            return {"status": "diverged", "reason": "too fast"}
        return {}
    return read_study_folder(write_study(tmp_path_factory.mktemp("s") / "column", metrics="stress", change=change,
                                         left_out=["fem-q2"]))


def verdict(study, kind, where=None, **keys):
    where = {"variant": "lpfdm"} if where is None else where
    return judge({"label": "x", "quantity": "stress", "norm": "l2", "kind": kind, "where": where, **keys}, study)


AT = {"variant": "lpfdm", "L": 0.5}  # error 0.005


@pytest.mark.parametrize("kind, where, keys, expected", [
    ("value_max", AT, {"value": 0.0051}, "pass"), ("value_max", AT, {"value": 0.0049}, "fail"),
    ("value_min", AT, {"value": 0.0049}, "pass"), ("value_min", AT, {"value": 0.0051}, "fail"),
    ("value_between", AT, {"low": 0.004, "high": 0.006}, "pass"),
    ("value_between", AT, {"low": 0.001, "high": 0.004}, "fail"),
    ("value_between", AT, {"low": 0.006, "high": 0.008}, "fail"),
    ("order_min", None, {"value": 1.9}, "pass"), ("order_min", None, {"value": 2.1}, "fail"),
    ("order_between", None, {"low": 1.9, "high": 2.1}, "pass"),
    ("order_between", None, {"low": 1.0, "high": 1.9}, "fail"),
    ("order_between", None, {"low": 2.1, "high": 3.0}, "fail"),
    ("not_converging", {"variant": "mpm-linear"}, {}, "pass"), ("not_converging", None, {}, "fail"),
    ("exponent_max", None, {"value": 2.1}, "pass"), ("exponent_max", None, {"value": 1.9}, "fail"),
    ("exponent_between", None, {"low": 1.9, "high": 2.1}, "pass"), ("exponent_between", None, {"low": 2.1, "high": 3.0}, "fail"),
    ("exponent_between", None, {"low": 1.0, "high": 1.9}, "fail"), ("exponent_max", {"variant": "mpm-linear"}, {"value": -0.9}, "pass"),
    ("exponent_max", {"variant": "mpm-cpgimp"}, {"value": 9.0}, "fail"),  # a lost run
    ("exponent_max", {"variant": "lpfdm", "L": 0.5}, {"value": 9.0}, "fail"),  # one cell size
    # several runs: all must satisfy it
    ("value_max", {"variant": "lpfdm"}, {"value": 0.05}, "fail"), ("value_max", {"variant": "lpfdm"}, {"value": 0.1}, "pass"),
    # a diverged run gives no number
    ("value_max", {"variant": "mpm-cpgimp", "L": 0.25}, {"value": 1.0}, "fail"),
    ("order_min", {"variant": "mpm-cpgimp"}, {"value": 0.5}, "fail"),
    ("order_min", {"variant": "mpm-cpgimp"}, {"value": 0.9, "L_from": 2.0, "L_to": 0.5}, "pass"),
    ("not_converging", {"variant": "mpm-cpgimp"}, {}, "pass"),
    # absent runs, and those left out
    ("value_max", {"variant": "lpfdm-9"}, {"value": 1.0}, "fail"),
    ("value_max", {"method": "fem-q2"}, {"value": 1.0}, "not run"),
    ("value_max", {"variant": "fem-q2", "L": 0.5}, {"value": 1.0}, "not run"),
    ("order_min", {"method": "fem"}, {"value": 1.0}, "not run")])
def test_kinds(study, kind, where, keys, expected):
    v = verdict(study, kind, where, **keys)
    assert v.verdict == expected, v


def test_reasons_are_told(study):
    assert verdict(study, "value_max", {"variant": "lpfdm-9"}, value=1.0).note == "no run"
    assert "diverged at L = 0.25" in verdict(study, "order_min", {"variant": "mpm-cpgimp"}, value=0.5).note
    assert "no nothing" in judge({"label": "x", "quantity": "nothing", "kind": "value_max", "value": 1, "where": AT}, study).note
    assert verdict(study, "order_min", value=1.9).measured.startswith("2.00 [2.00, 2.00]")
    assert verdict(study, "value_max", AT, value=1).measured == "0.00500"
    text = as_text([verdict(study, "order_min", value=1.9)])
    assert "asked" in text and "pass" in text


def test_order_over_a_range_of_sizes(study):
    v = verdict(study, "order_min", value=1.9, L_from=0.5, L_to=0.5)
    assert v.verdict == "fail" and "two cell sizes" in v.note


def test_method_means_family_or_variant(study):
    assert verdict(study, "value_max", {"method": "mpm-linear", "L": 2.0}, value=0.031).verdict == "pass"
    assert verdict(study, "value_max", {"method": "mpm", "L": 2.0}, value=0.031).verdict == "fail"
    assert verdict(study, "value_max", {"variant": ["lpfdm", "mpm-linear"], "L": 1.0}, value=0.06).verdict == "pass"


@pytest.mark.parametrize("value, text", [(0.0123456, "0.0123"), (1.0, "1.00"), (123.4, "123"), (9.999, "10.0"), (2e-9, "2.00e-09"),
                                         (0.0, "0"), (float("nan"), "n/a"), (4567.0, "4570")])
def test_three_digits(value, text):
    assert number(value) == text


def test_an_exponent_is_fitted_to_every_run_not_to_means(tmp_path):
    """Seeds 1 and e^2 times apart at one size: the mean of the logarithms is not the logarithm of the mean."""
    factor = {(1.0, 1): 1.0, (1.0, 2): 7.38905609893065, (2.0, 1): 2.0, (2.0, 2): 2.0}
    folder = write_study(tmp_path / "p", repeats=2, metrics="stress", models={"lpfdm": lambda L: 1.0}, sizes=(2.0, 1.0),
                         change=lambda v, L, r: {"stress_error": 0.01 * factor[L, r], "seed": r})
    measured = verdict(read_study_folder(folder), "exponent_max", value=9.0).measured
    assert measured.startswith(f"{1.0 - 1.0 / 0.6931471805599453:.2f} [")


def test_a_range_of_sizes_with_one_end(study):
    """`L_from` is where a range begins as cells become smaller, `L_to` where it ends."""
    assert verdict(study, "value_max", value=0.021, L_from=1.0).verdict == "pass"  # 0.02 at 1, less below
    assert verdict(study, "value_min", value=0.019, L_from=1.0).verdict == "fail"
    assert verdict(study, "value_min", value=0.019, L_to=1.0).verdict == "pass"  # 0.02 at 1, more above
    assert verdict(study, "value_max", value=0.021, L_to=1.0).verdict == "fail"


def test_convergence_that_ends_is_none(tmp_path):
    """The finer half of the sizes counts."""
    stays = {2.0: 0.4, 1.0: 0.1, 0.5: 0.02, 0.25: 0.02}
    found = read_study_folder(write_study(tmp_path / "column", metrics="stress", models={"lpfdm": stays.__getitem__}))
    assert verdict(found, "not_converging").verdict == "pass"
    assert verdict(found, "order_min", value=1.0).verdict == "pass"


def test_a_size_counts_with_the_mean_of_its_runs():
    """Of offsets of points from the lattice, say: one that lies far out counts, and one without a number is told."""
    class Run:
        def __init__(self, size, value):
            self.values, self._value = {"L": size}, value

        def value(self, quantity, norm):
            return self._value

    runs = [Run(0.5, v) for v in (1.0, 1.0, 4.0)] + [Run(0.25, 3.0), Run(0.25, float("nan")), Run("none", 1.0)]
    sizes, means, lost = mean_by_size(runs, "stress", "max")
    assert sizes.tolist() == [0.25, 0.5] and means.tolist() == [3.0, 2.0]
    assert lost == [runs[4]]


def test_a_known_failure_is_told_and_its_end_is_a_failure(study):
    known = verdict(study, "value_max", AT, value=0.001, known="the law makes it")
    assert known.verdict == "known" and known.note.startswith("the law makes it")
    gone = verdict(study, "value_max", AT, value=1.0, known="the law makes it")
    assert gone.verdict == "fail" and "passes, although" in gone.note
    assert verdict(study, "value_max", {"variant": "fem-q2"}, value=1.0, known="x").verdict == "not run"
