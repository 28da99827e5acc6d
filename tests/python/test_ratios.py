"""Ratios of runs to their partners: those at the same settings."""
import json
import shutil

import pytest
from synthetic import write_study
from test_findings import LPFDM, claim, number
from testbed_reports.grade.claims import judge_claims
from testbed_reports.grade.dataset import read_study_folder
from testbed_reports.grade.numbers import numbers_of


def without(folder, *ids):
    """The study as if these had never been planned."""
    plan = json.loads((folder / "plan.json").read_text())
    plan["runs"] = [run for run in plan["runs"] if run["id"] not in ids]
    (folder / "plan.json").write_text(json.dumps(plan))
    for name in ids:
        shutil.rmtree(folder / "runs" / name)


def test_a_run_without_a_partner_is_told(tmp_path):
    """mpm-linear has no run at 0.5 m: a ratio is of 2 m and 1 m, says so, and a claim on it is undecided; one that the pairs break is refuted."""
    over = 'over = {variant = "mpm-linear"}'
    text = number("every", where='{variant = "lpfdm"}', over='{variant = "mpm-linear"}') + number("mean", where='{variant = "lpfdm"}', over='{variant = "mpm-linear"}', take='"mean"')
    text += claim("Half", ("x", f"{LPFDM}\n{over}\nmax = 0.6")) + claim("Tenth", ("x", f"{LPFDM}\n{over}\nmax = 0.1"))
    folder = write_study(tmp_path / "s", text, sizes=(2.0, 1.0, 0.5), metrics="stress", models={"lpfdm": lambda L: 0.01 * L, "mpm-linear": lambda L: 0.02 * L})
    without(folder, "mpm-linear_L0.5_r1_0")
    study = read_study_folder(folder)
    for name in ("every", "mean"):
        found = numbers_of(study)[name]
        assert found.values == (pytest.approx(0.5),) and found.missing == "no partner at the settings of lpfdm_L0.5_r1_0"
        assert found.runs == ["lpfdm_L2_r1_0", "lpfdm_L1_r1_0"] and found.over == ["mpm-linear_L2_r1_0", "mpm-linear_L1_r1_0"]
    assert {c.name: c.verdict for c in judge_claims([study])} == {"Half": "undecided", "Tenth": "refuted"}


def test_runs_of_other_sizes_are_no_partners(tmp_path):
    """With one size each, not the same, there is no ratio; over another size there is when that is asked."""
    text = number("other", where='{variant = "lpfdm"}', over='{variant = "mpm-linear"}') + number("coarse", where='{variant = "lpfdm", L = 1.0}', over="{L = 2.0}")
    folder = write_study(tmp_path / "s", text, sizes=(2.0, 1.0), metrics="stress", models={"lpfdm": lambda L: 0.01 * L, "mpm-linear": lambda L: 0.02 * L})
    without(folder, "mpm-linear_L2_r1_0")
    assert numbers_of(read_study_folder(folder))["coarse"].values == (pytest.approx(0.5),)
    without(folder, "lpfdm_L1_r1_0")
    found = numbers_of(read_study_folder(folder))["other"]
    assert not found.values and "no partner at the settings of lpfdm_L2_r1_0, mpm-linear_L1_r1_0" in found.missing


def test_settings_beside_the_method_must_agree(tmp_path):
    """A run of another value of an axis is no partner; an option of the other method alone belongs to that method."""
    folder = write_study(tmp_path / "s", number("r", where='{variant = "lpfdm"}', over='{variant = "mpm-linear"}'), sizes=(1.0,), metrics="stress",
                         models={"lpfdm": lambda L: 0.01, "mpm-linear": lambda L: 0.02})
    for key, told in (("constants.ppc", "no partner"), ("mpm.flip", "")):
        plan = json.loads((folder / "plan.json").read_text())
        for k, run in enumerate(plan["runs"]):
            run["axes"] = {**{axis: run["axes"][axis] for axis in ("method", "grid.cell_size")}, key: k}
        (folder / "plan.json").write_text(json.dumps(plan))
        found = numbers_of(read_study_folder(folder))["r"]
        assert (told in found.missing) if told else (found.values == (pytest.approx(0.5),) and not found.missing)
