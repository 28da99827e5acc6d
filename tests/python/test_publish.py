"""What a paper needs: an installed program, references, a paper, what moved since before, results of other codes."""
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from conftest import REPORTS
from synthetic import write_result, write_study
from testbed_reports.draw.table import escape
from testbed_reports.grade import metrics
from testbed_reports.page.report import build, main
from testbed_reports.page.study_section import core_hours
from testbed_reports.read.results import Result
from testbed_reports.study.outside import main as bring

TESTBED = os.environ.get("TESTBED", "")
ROOT = REPORTS.parent
BUILT = pytest.mark.skipif(not TESTBED, reason="no executable")


@BUILT
def test_installed_program_needs_no_sources(tmp_path):
    """Installed to a prefix, it runs a case, reports on it and draws it; nothing of it is asked from the folder of the sources."""
    build_folder = Path(TESTBED).resolve().parents[1]
    done = subprocess.run(["cmake", "--install", build_folder, "--prefix", tmp_path / "prefix"], capture_output=True, text=True)
    if done.returncode and "testbed-fem" in done.stderr:
        pytest.skip("the FEM reference is configured and not built")
    assert done.returncode == 0, done.stderr
    share = tmp_path / "prefix" / "share" / "testbed"
    environment = {"PATH": f"{tmp_path / 'prefix' / 'bin'}:/usr/bin:/bin", "HOME": str(tmp_path)}

    def run(*command):
        done = subprocess.run(["testbed", *command], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, (command, done.stderr)
        return done.stdout + done.stderr

    assert re.match(r"testbed \d+\.\d+\.\d+ \(", run("--version"))
    scene = share / "benchmarks" / "elastic" / "elastic_column" / "scene.toml"
    run("run", scene, "--set", "grid.cell_size=2.0", "-o", "r.h5", "--quiet")
    run("report", "r.h5", "-o", "page")
    run("plot", "r.h5", "-o", "r.png")
    assert "lpfdm on elastic_column" in run("import", "r.h5")
    (tmp_path / "s.toml").write_text(f'title = "s"\nscene = "{scene}"\n[axes]\n"grid.cell_size" = [2.0]\n')
    run("study", "s.toml", "-o", "studies")
    text = "".join(path.read_text(errors="ignore") for path in (tmp_path / "prefix").rglob("*") if path.is_file() and path.suffix in (".py", ".toml", ".html"))
    assert str(ROOT) not in text


def test_paper(tmp_path):
    folder = write_study(tmp_path / "column", '[[figure]]\nkind = "convergence"\nquantity = "stress"\nnorm = "l2"\ncaption = "50 % of a_b & more."\n',
                         sizes=(1.0, 0.5), metrics="stress")
    out = build([folder], tmp_path / "out", "testbed report column").parent
    text = (out / "paper.tex").read_text()
    assert text.isascii() and r"\input{tables/report_questions}" in text and r"50 \% of a\_\allowbreak{}b \& more" in text
    for name in re.findall(r"\\includegraphics\[[^]]*\]\{(.*?)\}", text):
        assert (out / "figures" / f"{name}.pdf").is_file()
    for name in re.findall(r"\\input\{(.*?)\}", text):
        assert (out / f"{name}.tex").is_file()
    bib = (out / "references.bib").read_text()
    assert "konagai2000" in bib and "sulsky1994" in bib and "griffiths1999" not in bib
    if shutil.which("latexmk") and shutil.which("bibtex"):
        done = subprocess.run(["latexmk", "-pdf", "-interaction=nonstopmode", "paper.tex"], cwd=out, capture_output=True, text=True)
        log = (out / "paper.log").read_text(errors="ignore")
        assert done.returncode == 0, log[-2000:]
        assert not [float(n) for n in re.findall(r"Overfull \\hbox \(([\d.]+)pt", log) if float(n) > 1]


def test_words_for_latex():
    assert escape("† ‡ ± ² τ") == r"$\dagger$ $\ddagger$ $\pm$ $^2$ $\tau$" and escape("…") == r"\ldots{}"
    assert escape("Müller σ → Δ λ") == r"Müller $\sigma$ ? $\Delta$ $\lambda$"


def test_marks_of_a_latex_table_have_a_legend(tmp_path):
    """A lost run and a suspect one, each with its sign and what it means, and no sign that does not occur."""
    target = '[[target]]\nlabel = "x"\nquantity = "stress"\nnorm = "l2"\nkind = "order_min"\nvalue = 0\n'
    doubtful = {"attributes": {"soundness": "suspect", "suspect": "noise: much"}}
    folder = write_study(tmp_path / "s", target, sizes=(2.0, 1.0, 0.5), metrics="stress", models={"lpfdm": lambda L: L**2, "mpm-linear": lambda L: L},
                         change=lambda v, L, r: {("lpfdm", 0.5): None, ("mpm-linear", 0.5): doubtful}.get((v, L), {}))
    build([folder], tmp_path / "out", "c")
    text = (tmp_path / "out" / "tables" / "report_questions.tex").read_text()
    rows, legend = text.split(r"\end{tabular}")
    assert r"\noindent\parbox" in legend  # an indent would leave the line
    assert r"* (2 of 3 runs)" in rows and r"$\ddagger$" in rows and "?" not in rows
    assert "*: some of the runs gave no number" in legend and r"$\ddagger$: some of the runs are suspect" in legend and r"$\dagger$" not in legend


def test_two_studies_of_one_name(tmp_path, capsys):
    folders = [write_study(tmp_path / name / "column", sizes=(2.0, 1.0), metrics="stress") for name in ("a", "b")]
    assert main([*map(str, folders), "-o", str(tmp_path / "out")]) == 1
    assert "two studies are called 'column'" in capsys.readouterr().err


def test_what_moved(tmp_path, capsys):
    """One run has another error, one is new; times of repeats overlap."""
    old = write_study(tmp_path / "old" / "column", sizes=(2.0, 1.0), metrics="stress", repeats=2)
    new = write_study(tmp_path / "new" / "column", sizes=(2.0, 1.0), metrics="stress", repeats=2,
                      change=lambda v, L, r: {"stress_error": 0.5} if (v, L) == ("lpfdm", 1.0) else {"solve_s": 1.05 * L**-3 * (1 + 0.1 * r)} if v == "lpfdm" else {})
    page = build([new], tmp_path / "out", "c", against=old.parent).read_text()
    part = re.sub(r"<[^>]+>", " ", page[page.index('id="moved"'):page.index('id="failures"')])
    assert "stress l2" in part and "lpfdm" in part and "mpm-linear" not in part and "solve" not in part
    more = write_study(tmp_path / "old" / "gone", sizes=(2.0, 1.0), metrics="stress")
    page = build([old], tmp_path / "gone", "c", against=more.parent).read_text()
    assert re.search(r"gone\s*the whole study\s*there\s*none", re.sub(r"<[^>]+>", " ", page))
    same = build([old], tmp_path / "same", "c", against=old).read_text()
    assert "Nothing: every number lies within" in same
    assert main([str(new), "-o", str(tmp_path / "x"), "--against", str(tmp_path / "none")]) == 1
    assert "no such folder" in capsys.readouterr().err


def test_import_says_what_lacks(tmp_path, capsys):
    path = write_result(tmp_path / "mine.h5", variant="my-code", sealed=False)
    with h5py.File(path, "a") as file:
        del file["performance"].attrs["solve_s"]
    assert bring([str(path)]) == 0
    told = capsys.readouterr().out
    assert "my-code on column, completed" in told and "stress l2" in told and "/performance lacks solve_s: no error against run time" in told
    with h5py.File(path, "a") as file:
        name = f"snapshots/{sorted(file['snapshots'])[-1]}/stress"
        values = file[name][()]
        del file[name]
        file[name] = values[:-1]
    assert bring([str(path)]) == 1
    assert "differ in their number of points" in capsys.readouterr().err


def test_import_into_a_study(tmp_path, capsys):
    folder = write_study(tmp_path / "column", sizes=(2.0, 1.0), metrics="stress")
    path = write_result(tmp_path / "mine.h5", variant="my-code")
    assert bring([str(path), "--study", str(folder), "--name", "mine"]) == 0
    page = build([folder], tmp_path / "out", "c").read_text()
    assert "my-code" in page and "of another code" in page
    for bad in (["--study", str(tmp_path)], ["--study", str(folder), "--name", "x_0123abcd-0123"], ["--study", str(folder), "--name", "../x"], ["--study", str(folder), "--name", ".."],
                ["--study", str(folder), "--name", "my result"], ["--study", str(folder), "--name", "mine"]):
        assert bring([str(path), *bad]) == 1
    assert bring([str(tmp_path / "none.h5")]) == 1 and bring([]) == 1
    assert "Traceback" not in capsys.readouterr().err


@BUILT
def test_worked_example(tmp_path):
    """docs/examples/outside_result.py, as its text says."""
    scene = ROOT / "benchmarks" / "elastic" / "elastic_column" / "scene.toml"
    subprocess.run([TESTBED, "run", scene, "--set", "grid.cell_size=2.0", "-o", "r.h5", "--quiet"], cwd=tmp_path, check=True)
    subprocess.run([sys.executable, ROOT / "docs" / "examples" / "outside_result.py", "r.h5", "mine.h5"], cwd=tmp_path, check=True)
    done = subprocess.run([TESTBED, "import", "mine.h5"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and "my-code on elastic_column" in done.stdout and "displacement l2" in done.stdout, done.stderr


def test_what_another_code_writes_oddly_is_no_traceback(tmp_path, capsys):
    path = write_result(tmp_path / "mine.h5", variant="my-code", sealed=False, probes=())
    with h5py.File(path, "a") as file:
        file["history/probes/tip/displacement"] = [0.0, 1.0]
        name = sorted(file["snapshots"])[-1]
        file[f"snapshots/{name}/odd"] = 1.0
    assert bring([str(path)]) == 1 and "single number" in capsys.readouterr().err
    with h5py.File(path, "a") as file:
        del file[f"snapshots/{name}/odd"]
        file["scene"].attrs["resolved"] = "damping = 0.5\n" + file["scene"].attrs["resolved"]
    build([path], tmp_path / "out", "c")


def test_crate_names_what_is_there(tmp_path):
    """Every file of the report is in the RO-Crate, every id that is referred to has an entity, and a second report counts no crate as a file of its own."""
    write_study(tmp_path / "study")
    for _ in range(2):
        build([tmp_path / "study"], tmp_path / "out", "testbed report")
    graph = json.loads((tmp_path / "out" / "ro-crate-metadata.json").read_text())["@graph"]
    ids = {e["@id"]: e for e in graph}
    root = ids["./"]
    files = {p.relative_to(tmp_path / "out").as_posix() for p in (tmp_path / "out").rglob("*") if p.is_file()} - {"ro-crate-metadata.json"}
    assert {part["@id"] for part in root["hasPart"]} == files and "report.html" in files
    references = [value["@id"] for e in graph for value in e.values() if isinstance(value, dict) and e["@id"] != "ro-crate-metadata.json"]
    assert set(references) <= set(ids)
    assert ids["report.html"]["encodingFormat"] == "text/html"
    assert [ids[m["@id"]]["@type"] for m in root["mentions"]] == ["CreateAction"]


def test_crate_has_the_numbers_in_its_words(tmp_path):
    text = '[[number]]\nname = "e"\nquantity = "stress"\nnorm = "l2"\nwhere = {variant = "lpfdm", L = 1.0}\n'
    folder = write_study(tmp_path / "s", text, sizes=(2.0, 1.0), metrics="stress")
    path = folder / "study.toml"
    path.write_text(path.read_text().replace("Known orders.", "An error of {e} in {{braces}}."))
    build([folder], tmp_path / "out", "c")
    graph = json.loads((tmp_path / "out" / "ro-crate-metadata.json").read_text())["@graph"]
    assert [e["disambiguatingDescription"] for e in graph if "disambiguatingDescription" in e] == ["An error of 0.0200 in {braces}."]


FIGURE = '[[figure]]\nkind = "convergence"\nquantity = "stress"\nnorm = "l2"\ncaption = "50 % of a_b & more."\n'


@pytest.mark.skipif(not shutil.which("pdflatex"), reason="no pdflatex")
def test_figures_as_pgf(tmp_path):
    """LaTeX sets the words: they stand in the file as text."""
    write_study(tmp_path / "study", FIGURE)
    assert main([str(tmp_path / "study"), "-o", str(tmp_path / "out"), "--pgf"]) == 0
    pictures = sorted((tmp_path / "out" / "figures").glob("*.pgf"))
    assert [p.stem for p in pictures] == [p.stem for p in sorted((tmp_path / "out" / "figures").glob("*.pdf"))] != []
    assert all("pgfpicture" in p.read_text() for p in pictures)


def test_pgf_without_latex_is_told(tmp_path):
    write_study(tmp_path / "study", FIGURE)
    done = subprocess.run([sys.executable, REPORTS / "testbed-report", tmp_path / "study", "-o", tmp_path / "out", "--pgf"], env={"PATH": str(tmp_path), "HOME": str(tmp_path)},
                          capture_output=True, text=True)
    assert done.returncode == 1 and "no PGF" in done.stderr, done.stderr
    assert (tmp_path / "out" / "report.html").is_file()


def test_core_hours():
    """Solving, setting up and writing, times threads."""
    class Run:
        def __init__(self, threads, **seconds):
            self.result = type("Result", (), {"performance": seconds, "provenance": {"threads": threads}})

    class Lost:
        result = None

    assert core_hours([Run(2, solve_s=1800.0, setup_s=300.0), Run(1, solve_s=1800.0, output_s=1800.0), Lost]) == pytest.approx(2 * 2100 / 3600 + 1)


def _cb_geo(path, order, position, stress, volume):
    """Points as CB-Geo writes them: a table, in any order."""
    names = ["mass", "volume", "coord_x", "coord_y", "coord_z", "velocity_x", "velocity_y", "velocity_z", "stress_xx", "stress_yy", "stress_zz", "tau_xy", "tau_yz", "tau_xz"]
    table = np.zeros(len(order), dtype=[("id", "u8"), *((name, "f8") for name in names)])
    table["id"], table["mass"], table["volume"] = order, 2.0, volume[order]
    table["coord_x"], table["coord_y"] = position[order, 0], position[order, 1]
    for column, name in enumerate(("stress_xx", "tau_xy", "tau_xz", "stress_yy", "tau_yz", "stress_zz")):
        table[name] = stress[order, column]
    with h5py.File(path, "w") as file:
        file["table"] = table


def test_result_of_cb_geo(tmp_path, capsys):
    """Converted, points in another order, it is graded as the run that its numbers are from; points elsewhere are refused."""
    run = write_result(tmp_path / "r.h5", stress_error=0.02, displacement_error=0.01)
    with h5py.File(run) as file:
        last = file["snapshots"][max(file["snapshots"])]
        X, x, stress, V = (last[name][()] if name in last else file["snapshots/0000"][name][()] for name in ("initial_position", "position", "stress", "initial_volume"))
    shuffled = np.random.default_rng(1).permutation(len(X))
    _cb_geo(tmp_path / "first.h5", np.arange(len(X)), X, 0 * stress, V)
    _cb_geo(tmp_path / "last.h5", shuffled, x, stress, V)
    command = [sys.executable, ROOT / "docs" / "examples" / "cb_geo_result.py", "r.h5", "first.h5", "last.h5", "mine.h5", "--seconds", "3"]
    subprocess.run(command, cwd=tmp_path, check=True)
    assert bring([str(tmp_path / "mine.h5")]) == 0
    assert "cb-geo on column, completed" in capsys.readouterr().out
    own, other = metrics.grade(Result(tmp_path / "mine.h5")).rows, metrics.grade(Result(run)).rows
    for key in (("stress", "l2"), ("stress", "linf"), ("displacement", "l2")):
        assert own[key] == pytest.approx(other[key], rel=1e-12) and own[key] > 0.009
    _cb_geo(tmp_path / "first.h5", np.arange(len(X)), X + 0.01, 0 * stress, V)
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 1 and "same sampling" in done.stderr
