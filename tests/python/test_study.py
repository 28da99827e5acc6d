"""`testbed study` with a stand-in for the solver: resume, failures, locks."""
import csv
import fcntl
import json
import os
import signal
import subprocess
import time

import pytest
from conftest import REPORTS
from synthetic import write_fake_testbed

STUDY = """\
title = "A study"
scene = "scene.toml"
[axes]
method = ["lpfdm", "mpm-linear"]
"grid.cell_size" = [2.0, 1.0]
[[target]]
label = "order"
quantity = "stress"
norm = "l2"
kind = "order_min"
value = 1.9
where = {variant = "lpfdm"}
"""


class Bench:
    """A folder with a scene, a study and a stand-in."""

    def __init__(self, folder):
        self.folder, self.bin, self.out = folder, folder / "bin", folder / "out" / "s"
        self.testbed = write_fake_testbed(self.bin)
        (folder / "scene.toml").write_text('method = "lpfdm"\n')
        self.write(STUDY)

    def write(self, text):
        (self.folder / "s.toml").write_text(text)

    def behave(self, **how):
        (self.bin / "behave.json").write_text(json.dumps(how))

    def command(self, *arguments):
        return [str(REPORTS / "testbed-study"), str(self.folder / "s.toml"), "-o", str(self.folder / "out"), *arguments]

    @property
    def environment(self):
        return {**os.environ, "TESTBED": str(self.testbed), "OMP_NUM_THREADS": "7"}

    def run(self, *arguments):
        return subprocess.run(self.command(*arguments), capture_output=True, text=True, env=self.environment)

    @property
    def calls(self):
        path = self.bin / "calls.txt"
        return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []

    @property
    def rows(self):
        with open(self.out / "metrics.csv", newline="") as file:
            return list(csv.DictReader(file))


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def test_runs_once_and_grades(bench):
    done = bench.run("-j", "2", "--check")
    assert done.returncode == 0, done.stderr
    assert len(bench.calls) == 4 and all(call[3] == "1" for call in bench.calls)
    assert "pass" in done.stdout and "order" in done.stdout
    header = (bench.out / "metrics.csv").read_text().splitlines()[0]
    assert header == "run_id,case,method,variant,L,ppc,dt,seed,quantity,norm,value,solve_s,particle_steps,status,soundness,cause,remedy"
    value = {(r["variant"], float(r["L"])): float(r["value"]) for r in bench.rows if (r["quantity"], r["norm"]) == ("stress", "l2")}
    assert value["lpfdm", 2.0] == pytest.approx(0.08) and value["mpm-linear", 1.0] == pytest.approx(0.02)
    assert all(r["seed"] == "" and r["status"] == "completed" for r in bench.rows)
    names = sorted(p.name for p in (bench.out / "runs").iterdir())
    assert names[0].startswith("lpfdm_L1_r1_")
    assert sorted(p.name for p in (bench.out / "runs" / names[0]).iterdir()) == ["log.txt", "result.h5"]
    assert len(done.stderr.splitlines()) == 5  # what is to do, and one line per run

    again = bench.run("--check")
    assert again.returncode == 0 and len(bench.calls) == 4 and "0 to do" in again.stderr


def test_failed_target_is_exit_code_1(bench):
    bench.write(STUDY.replace("1.9", "2.5"))
    done = bench.run("--check", "--quiet")
    assert done.returncode == 1 and "fail" in done.stdout and done.stderr == ""
    assert bench.run("--quiet").returncode == 0


def test_only_what_is_missing_runs(bench):
    bench.run("--quiet")
    runs = sorted((bench.out / "runs").iterdir())
    (runs[0] / "result.h5").rename(runs[0] / "result.h5.part")
    (runs[1] / "result.h5").write_bytes((runs[1] / "result.h5").read_bytes()[:2000])
    done = bench.run()
    assert done.returncode == 0 and len(bench.calls) == 6 and "2 to do" in done.stderr
    assert not (runs[0] / "result.h5.part").exists()


def test_changed_scene_executable_and_study_run_again(bench):
    bench.run("--quiet")
    (bench.folder / "scene.toml").write_text('method = "lpfdm"\n# changed\n')
    bench.run("--quiet")
    assert len(bench.calls) == 8
    bench.testbed.write_text(bench.testbed.read_text() + "# another build\n")
    done = bench.run("--keep")
    assert len(bench.calls) == 8 and "0 to do" in done.stderr
    bench.run("--quiet")
    assert len(bench.calls) == 12
    bench.write(STUDY.replace("[axes]", '[set]\n"time.cfl" = 0.5\n[axes]'))
    bench.run("--quiet", "--keep")
    assert len(bench.calls) == 16 and bench.calls[-1][2]["time.cfl"] == "0.5"
    assert len({r["run_id"] for r in bench.rows}) == 4  # the others are stale: there, but not counted
    assert len(list((bench.out / "runs").iterdir())) == 16


def test_repeats(bench):
    bench.write(STUDY.replace("[axes]", "repeats = 3\n[axes]", 1))
    assert bench.run("--quiet").returncode == 0
    assert len(bench.calls) == 12 and len({r["run_id"] for r in bench.rows}) == 12


@pytest.mark.parametrize("how, told", [("kill", "killed by signal 9 (SIGKILL)"), ("internal", "exit code 4: something broke"),
                                       ("nothing", "no result.h5"), ("interrupt", "interrupted")])
def test_a_failing_run_is_told_and_the_rest_goes_on(bench, how, told):
    bench.behave(**{"lpfdm": how})
    done = bench.run()
    assert done.returncode == 4 and done.stderr.count(told) == 4  # as it happens, and in the list at the end
    assert {r["variant"] for r in bench.rows} == {"mpm-linear"}
    bench.behave()
    assert bench.run("--quiet").returncode == 0
    assert len(bench.calls) == 6 and len({r["run_id"] for r in bench.rows}) == 4


@pytest.mark.parametrize("how, status", [("diverge", "diverged"), ("limit", "time_limit")])
def test_failure_of_a_method_is_data(bench, how, status):
    bench.behave(**{"lpfdm": how})
    assert bench.run("--quiet").returncode == 0
    assert bench.run("--quiet").returncode == 0 and len(bench.calls) == 4
    rows = [r for r in bench.rows if r["variant"] == "lpfdm" and r["quantity"] == "stress"]
    assert len(rows) == 6 and all(r["value"] == "nan" and r["status"] == status for r in rows)


def test_fem_is_left_out_when_it_is_not_built(bench):
    bench.write(STUDY.replace('"mpm-linear"', '"fem-q2"').replace('"lpfdm"}', '"fem-q2"}'))
    done = bench.run("--check")
    assert done.returncode == 0 and len(bench.calls) == 2 and "left out" in done.stderr and "not run" in done.stdout
    assert len((bench.out / "left_out.txt").read_text().splitlines()) == 2
    (bench.bin / "testbed-fem").write_text("built")
    bench.run("--quiet")
    assert len(bench.calls) == 4 and not (bench.out / "left_out.txt").exists()
    (bench.bin / "testbed-fem").write_text("built again")
    bench.run("--quiet")
    assert len(bench.calls) == 6


def test_a_scene_that_check_refuses_runs_nothing(bench):
    bench.write(STUDY.replace("grid.cell_size", "grid.cel_size"))
    done = bench.run()
    assert done.returncode == 1 and "grid.cel_size" in done.stderr and not bench.calls


def test_one_wrong_key_is_told_once(bench):
    bench.write(STUDY.replace("[axes]", '[set]\n"grid.cel_size" = 1.0\n[axes]'))
    done = bench.run()
    assert done.returncode == 1 and done.stderr.count("unknown key") == 1 and "and 3 more combinations" in done.stderr


def test_combinations_that_mean_one_scene_are_refused(bench):
    (bench.folder / "twin.toml").write_text((bench.folder / "scene.toml").read_text())
    bench.write(STUDY.replace('scene = "scene.toml"\n', "").replace("[axes]", '[axes]\nscene = ["scene.toml", "twin.toml"]'))
    done = bench.run()
    assert done.returncode == 1 and "the same scene" in done.stderr and "scene.toml and twin.toml" in done.stderr and not bench.calls


def test_a_constant_is_set_in_the_scenes_that_have_it(bench):
    (bench.folder / "grain.toml").write_text('method = "lpfdm"\n[constants]\ndepth = 1.0\n')
    study = STUDY.replace('scene = "scene.toml"\n', "").replace("[axes]", '[axes]\nscene = ["scene.toml", "grain.toml"]\n"constants.depth" = [1.0, 2.0]')
    bench.write(study)
    refused = bench.run()  # the scene without it would run twice
    assert refused.returncode == 1 and "constants.depth = 1.0 and 2.0 are the same scene" in refused.stderr and not bench.calls
    bench.write(study + '[[exclude]]\nscene = "scene.toml"\n"constants.depth" = 2.0\n')
    assert bench.run("--quiet").returncode == 0
    assert sorted(call[2].get("constants.depth", "") for call in bench.calls) == [""] * 4 + ["1.0"] * 4 + ["2.0"] * 4


def test_scenes_of_one_folder_are_cases_of_their_own(bench):
    (bench.folder / "soft.toml").write_text('method = "lpfdm"\n# soft\n')
    bench.write(STUDY.replace('scene = "scene.toml"\n', "").replace("[axes]", '[axes]\nscene = ["scene.toml", "soft.toml"]'))
    assert bench.run("--quiet").returncode == 0
    folder = bench.folder.name
    assert {row["case"] for row in bench.rows} == {folder, f"{folder}-soft"}


def test_a_column_for_each_axis_and_rows_of_what_was_recorded(bench):
    bench.write(STUDY.replace("[axes]", '[axes]\n"damping.local" = [0.1, 0.2]'))
    assert bench.run("--quiet").returncode == 0
    assert {row["damping.local"] for row in bench.rows} == {"0.1", "0.2"}
    ends = {row["norm"] for row in bench.rows if row["quantity"] == "displacement_end"}
    assert {"tip.x", "tip.y"} <= ends


def test_a_result_of_another_code_in_the_folder_is_taken(bench):
    bench.run("--quiet")
    ours = next((bench.out / "runs").iterdir())
    (bench.out / "runs" / "other_code").mkdir()
    (bench.out / "runs" / "other_code" / "result.h5").write_bytes((ours / "result.h5").read_bytes())
    done = bench.run()
    assert "results that this study did not run are taken: other_code" in done.stderr
    assert "other_code" in {row["run_id"] for row in bench.rows}


def test_interruption_leaves_a_folder_to_go_on_from(bench):
    bench.behave(**{"mpm-linear": "sleep"})
    process = subprocess.Popen(bench.command("-j", "2"), env=bench.environment, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 20
    while not (bench.bin / "sleeping").exists() and time.monotonic() < end:
        time.sleep(0.05)
    time.sleep(0.2)
    assert bench.run("--quiet").returncode == 1  # the folder is taken
    process.send_signal(signal.SIGINT)
    _, told = process.communicate(timeout=20)
    assert process.returncode == 130 and "goes on from here" in told
    assert {r["variant"] for r in bench.rows} == {"lpfdm"}
    bench.behave()
    before = len(bench.calls)
    assert bench.run("--quiet").returncode == 0 and len(bench.calls) == before + 2


def test_a_folder_has_one_worker(bench):
    bench.out.mkdir(parents=True)
    with open(bench.out / ".lock", "w") as lock:
        fcntl.lockf(lock, fcntl.LOCK_EX)
        done = bench.run()
    assert done.returncode == 1 and "another study process" in done.stderr and not bench.calls


def test_no_executable(bench):
    done = subprocess.run(bench.command(), capture_output=True, text=True, env={**os.environ, "TESTBED": "/nowhere/testbed"})
    assert done.returncode == 1 and "TESTBED" in done.stderr


def test_threads_of_the_study(bench):
    bench.write(STUDY.replace("[axes]", "threads = 2\n[axes]", 1))
    bench.run("--quiet")
    assert {call[3] for call in bench.calls} == {"2"}


def test_a_killed_study_takes_its_children_along(bench):
    bench.behave(**{"lpfdm": "sleep"})
    process = subprocess.Popen(bench.command("--quiet"), env=bench.environment)
    end = time.monotonic() + 20
    while not (bench.bin / "sleeping").exists() and time.monotonic() < end:
        time.sleep(0.05)
    children = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process.pid)], capture_output=True, text=True).stdout.split()
    process.kill()
    process.wait()
    time.sleep(0.5)
    def gone(pid):
        try:
            with open(f"/proc/{pid}/stat") as file:
                return file.read().rsplit(")", 1)[1].split()[0] == "Z"
        except OSError:
            return True
    assert children and all(gone(pid) for pid in children)


def test_a_lost_run_counts_against_targets_of_its_family_and_case(bench):
    bench.write(f"""
title = "Lost"
scene = "scene.toml"
[axes]
method = ["lpfdm-2000", "lpfdm"]
[[target]]
label = "all of the family"
quantity = "stress"
norm = "l2"
where = {{method = "lpfdm"}}
kind = "value_max"
value = 1.0
[[target]]
label = "all of the case"
quantity = "stress"
norm = "l2"
where = {{case = ["column", "{bench.folder.resolve().name}"]}}
kind = "value_max"
value = 1.0
""")
    bench.behave(**{"lpfdm-2000": "kill"})
    done = bench.run("--check")
    told = [line for line in done.stdout.splitlines() if line.startswith("all of the")]
    assert len(told) == 2 and all("fail" in line and "lpfdm-2000" in line for line in told), done.stdout


def test_a_seed_is_known_before_the_run(tmp_path, monkeypatch):
    """A run that is lost keeps its seed, and seeds make no lines of their own."""
    from testbed_reports.grade import dataset
    from testbed_reports.study import study
    from testbed_reports.read.study_file import read_study
    bench = Bench(tmp_path)
    bench.write('title = "A"\nscene = "scene.toml"\n[axes]\n"material.soil.random.seed" = [0, 3]\n')
    monkeypatch.setattr(study, "resolve", lambda _, c: (
        str(c.axes), {"material": [{"name": "soil", "random": {"seed": c.axes["material.soil.random.seed"]}}]}))
    spec = read_study(tmp_path / "s.toml")
    entries, _, _ = study.expand(spec, spec.combinations, bench.testbed, bench.out, False, 1)
    runs = [dataset.read_run(bench.out / entry["id"], entry) for entry in entries]
    assert [run.values["seed"] for run in runs] == [0, 3]
    assert [len(own) for own in dataset.groups(runs).values()] == [2]
