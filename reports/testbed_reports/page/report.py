"""`testbed report`: pages, figures for print, tables for print, from the folders of studies."""
import argparse
import os
import shlex
import sys
from collections import Counter
from datetime import datetime, timezone
from pathlib import Path

from ..draw.drawing import label_of
from ..draw.style import RC, Style, plt
from ..draw.table import Table, as_csv
from ..grade.claims import judge_claims
from ..grade.dataset import read_study_folder, write_atomically
from ..grade.loose import study_of
from ..grade.metrics_csv import metrics_csv
from ..grade.scene_words import of_runs
from ..grade.targets import judge_all
from ..read.study_file import StudyError
from . import bench, findings
from .against import moved_table
from .crate import write_crate
from .ledger import Ledger, plain
from .names import slug, study_anchor
from .page import both_svgs, render, scripts
from .paper import write_paper
from .references import references
from .study_section import PRINT, study_section, write_table
from .tables import claims_table, questions_table, targets_table


def find_studies(folders):
    """Folders of studies: those given, or those inside a given one."""
    found = []
    for folder in map(Path, folders):
        if not folder.is_dir():
            raise StudyError(f"{folder}: no such folder")
        if (folder / "study.toml").is_file():
            inside = [folder]
        else:
            inside = sorted(p.parent for p in folder.glob("*/study.toml"))
            lost = sorted({p.parent.parent.parent for p in folder.glob("*/runs/*/result.h5")} - set(inside))
            lost += [folder] if any(folder.glob("runs/*/result.h5")) else []
            if lost:
                raise StudyError(f"{lost[0]}: holds results but no study.toml, which says what they are: write one (a title and an axis `scene` will "
                                 "do), or name the folders of the other studies")
        if not inside and not (folder / bench.FILE).is_file():
            raise StudyError(f"{folder}: holds no study (no study.toml)")
        found += inside
    return list(dict.fromkeys(p.resolve() for p in found))


def _unique(values):
    return [str(v) for v in dict.fromkeys(values) if v not in (None, "")]


def provenance(studies, command):
    """[(name, values)] over all results, and warnings about mixtures."""
    sources = [run.result.provenance for s in studies for run in s.runs if run.result is not None]
    rows, warnings = [], []
    for key, name in (("commit", "Commit"), ("compiler", "Compiler"), ("flags", "Flags"), ("build_type", "Build"),
                      ("cpu", "Processor"), ("threads", "Threads")):
        values = _unique(p.get(key) for p in sources)
        if values:
            rows.append((name, values))
        if len(values) > 1 and key in ("commit", "flags", "build_type", "cpu"):
            warnings.append(f"The runs come from different builds or machines: {name.lower()} {' and '.join(values)}.")
    started = sorted(_unique(p.get("started") for p in sources))
    if started:
        rows.append(("Runs started", [started[0]] if len(started) == 1 else [f"{started[0]} to {started[-1]}"]))
    rows.append(("Page made", [datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")]))
    rows.append(("Commands", _unique([s.plan.get("command") for s in studies] + [command])))
    return rows, warnings


def _figure_labels(studies):
    labels = []
    for study in studies:
        labels += study.variants()
        labels += [e.get("variant") for e in study.left_out]
        for entry in study.spec.figures:
            if entry["series"] != ["variant"]:
                labels += [label_of(run, entry) for run in study.select(entry["where"])]
    return [label for label in labels if label]


def _bench_labels(benches):
    labels = []
    for path in benches:
        try:
            labels += [row["method"] for row in bench.read_bench(path)[1]]
        except (OSError, bench.BenchError):
            continue  # told where its section is made
    return list(dict.fromkeys(labels))


def _bench_section(path, style, out, ledger, failures):
    """The section of one bench.csv; None when it cannot be used."""
    try:
        comment, rows = bench.read_bench(path)
    except (OSError, bench.BenchError) as error:
        failures.append([path.parent.name, bench.FILE, "unreadable", str(error).replace(str(path.parent) + os.sep, "")])
        return None
    own = f"{slug(path.parent.name)}_bench"
    with plt.rc_context(RC):
        figure = bench.rates_figure(rows, style)
        figure.savefig(out / "figures" / f"{own}_rates.pdf", **PRINT)
        image, svg = both_svgs(figure, own)
        caption = f"Fastest of ten slices; full lines one thread, thin lines more. {comment}. Made by: testbed bench"
        shown = {"title": "Particle-steps per second against the number of points", "image": image, "svg": svg, "points": [], "error": "", "width": "page",
                 "rem": 62, "anchor": f"figure-{own}_rates", "paper": "", "shows": [], "caption": [caption], "runs": []}
    plt.close("all")
    tables = [t for t in (bench.rates_table(rows), bench.kept_table(rows), bench.cost_table(rows)) if t]
    for table in tables:
        write_table(out, own, table)
    purpose = "The particle methods alone, in one process, beside the bandwidth of the memory." + (" Measured on a busy machine." if bench.is_busy(comment) else "")
    return {"anchor": f"bench-{slug(path.parent.name)}", "title": "Speed", "purpose": [purpose], "summary": f"{len(rows)} measurements.",
            "figures": [shown], "tables": [(f"table-{own}_{t.name}", t) for t in tables], "stability": None, "runs": []}


def _write_gallery(out, title, sections):
    """Writes gallery.html of the figures with words of a paper or of the study's author; False when there are none."""
    shown = [section | {"figures": [f for f in section["figures"] if f["paper"] or f["shows"]]} for section in sections]
    shown = [section for section in shown if section["figures"]]
    if shown:
        write_atomically(out / "gallery.html", render("gallery.html", title=title, studies=shown))
    else:
        (out / "gallery.html").unlink(missing_ok=True)  # of an earlier report
    return bool(shown)


def _read(folders, failures, unreadable):
    """The studies of folders and of result files."""
    files = [folder for folder in folders if folder.is_file()]
    studies = [study_of(files)] if files else []
    for folder in find_studies([folder for folder in folders if folder not in files]):
        try:
            studies.append(read_study_folder(folder))
        except StudyError as error:
            failures.append([folder.name, "the whole study", "unreadable", str(error).replace(str(folder) + os.sep, "")])
            unreadable.append(str(error))
    twice = next((name for name, n in Counter(slug(study.name) for study in studies).items() if n > 1), None)
    if twice:
        raise StudyError(f"two studies are called '{twice}', and so would be their figures and tables: report on one, and --against the other")
    for study in studies:
        failures += [[study.name, name, "of another code", "no run of the study's plan: its result lies in runs/ and is taken"] for name in study.outside]
        for run in study.runs:
            if (run.suspect or not run.completed) and not study.spec.cases:  # the matrix tells of these
                failures.append([study.name, run.id, run.label, run.told])
            if run.status == "unreadable" or run.status in ("missing", "interrupted") and study.plan.get("runs"):
                unreadable.append(f"{study.name}: {run.id}: " + ("" if run.status == "unreadable" else f"{run.status}: ") + run.reason)
            failures += [[study.name, run.id, "number missing", error] for error in run.errors]
    return studies


def _misnamed(studies, failures, unreadable):
    """What the scenes' [report] tables name and nothing reads, as notes at the top; misspelt names are failures, too."""
    notes = []
    for study in studies:
        misspelt, idle = of_runs(study.runs, study.spec.figures)
        failures += [[study.name, "scene", "misspelt", text] for text in misspelt]
        unreadable += [f"{study.name}: {text}" for text in misspelt]
        notes += [f"{study.name}: {text}." for text in misspelt + idle]
    return notes


def _claims(judged, ledger):
    """Claims as the template wants them."""
    for claim in judged:
        ledger.missing += [[t.study, f"claim {claim.name}: {t.when}", t.measured.missing] for t in claim.tests if t.verdict == "undecided"]
    return [{"name": claim.name, "words": claim.words, "source": claim.source, "verdict": claim.verdict, "conditions": claim.conditions,
             "notes": [ledger.text(study, text) for text, study in claim.notes],
             "tests": [{"when": t.when, "asked": t.asked, "measured": ledger.pieces(t.measured), "verdict": t.verdict,
                        "note": "; ".join(filter(None, (t.measured.missing, suspects(t.measured)))), "study": t.study} for t in claim.tests]} for claim in judged]


def suspects(number):
    """How many runs of a number are suspect, in words."""
    return f"{number.suspect} of {len(number.runs) + len(number.over)} runs suspect" if number.suspect else ""


def _lead(sections):
    """Two figures for the first screen: the first of error against time and of error against cell size that was drawn, or else the first two."""
    drawn = [f for section in sections for f in section["figures"] if f["image"]]
    chosen = [next((f for f in drawn if f.get("kind") == kind), None) for kind in ("work_precision", "convergence")]
    chosen = [f for f in chosen if f is not None]
    return chosen + [f for f in drawn if not any(f is c for c in chosen)][:2 - len(chosen)]


def _first_screen(studies, sections, claims, verdicts, ledger):
    """What stands above everything else."""
    rows = findings.questions(studies)
    said = [ledger.pieces(*parts) for parts in findings.sentences(studies, rows, claims)]
    variants = list(dict.fromkeys(v for row in rows for v in row.cells))
    matrix = [{"text": row.text, "anchor": row.anchor,
               "folded": row.goal == "value",
               "cells": [{"piece": ledger.pieces(row.cells.get(v, ""))[0], "best": v in row.best} for v in variants]} for row in rows]
    bad = [(study.name, run) for study in studies if not study.spec.cases for run in study.runs if run.suspect or not run.completed]
    silent = sum(run.verdict.silent and run.completed for study in studies if study.spec.cases for run in study.runs)
    return {"compared": findings.compared(studies) if studies else "", "sentences": said, "variants": variants, "matrix": matrix,
            "lead": _lead(sections), "targets": Counter(v.verdict for _, v in verdicts), "missed": [v for _, v in verdicts if v.verdict == "fail"],
            "claims": Counter(claim.verdict for claim in claims),
            "bad": Counter(run.status if not run.completed else "suspect" for _, run in bad),
            "which": list(dict.fromkeys(f"{run.name} ({run.values.get('case') or name})" if run.result is not None else run.id for name, run in bad)),
            "plain": sum(len(study.runs) for study in studies if not study.spec.cases), "silent": silent, "cases": [(study.spec.title, study_anchor(study)) for study in studies if study.spec.cases]}


def build(folders, out, command, unreadable=None, against=None, pgf=False):
    """Writes the report of studies into the folder `out`; returns the path of the page. `unreadable`: a list for what could not be read or
    made; `against`: a folder of studies to compare with; `pgf`: figures as PGF, too."""
    out, folders, failures, ledger = Path(out), [Path(folder) for folder in folders], [], Ledger()
    unreadable = [] if unreadable is None else unreadable
    others = [read_study_folder(folder) for folder in find_studies([against])] if against else []  # first: what cannot be read ends it
    studies = _read(folders, failures, unreadable)
    for name in ("figures", "tables"):
        (out / name).mkdir(parents=True, exist_ok=True)
    benches = [path for path in (folder / bench.FILE for folder in folders) if path.is_file()]
    style = Style(_figure_labels(studies) + _bench_labels(benches))
    verdicts = [(study, judge_all(study)) for study in studies]
    sections = [study_section(study, style, out, ledger, failures, pgf) for study in studies]
    for (study, judged), section in zip(verdicts, sections):
        for table in [t for _, t in section["tables"]] + ([targets_table(judged)] if judged else []):
            write_table(out, study.name, table)
    sections += [section for path in benches if (section := _bench_section(path, style, out, ledger, failures))]
    judged_claims = judge_claims(studies)
    claims, flat = _claims(judged_claims, ledger), [(study, v) for study, judged in verdicts for v in judged]
    if claims:
        write_table(out, "report", claims_table(claims))
    failures += [[study, what, "not made", why] for study, what, why in ledger.missing]
    unreadable += [f"{name}: {what}: {reason}" for name, what, how, reason in failures if how in ("not drawn", "not made")]
    rows, warnings = provenance(studies, command)
    warnings = _misnamed(studies, failures, unreadable) + warnings
    left_out = [[s.name, e.get("variant") or "", ", ".join(f"{k} = {v}" for k, v in e.get("axes", {}).items()),
                 e.get("reason", "")] for s in studies for e in s.left_out]
    titles = [section["title"] for section in sections]
    title = titles[0] if len(titles) == 1 else "Testbed report"
    moved = moved_table(studies, others) if against else None
    if moved:
        write_table(out, "report", moved)
    write_atomically(out / "references.bib", references(studies))
    first = _first_screen(studies, sections, judged_claims, flat, ledger)
    if first["matrix"]:
        write_table(out, "report", questions_table(first))
    (out / "metrics").mkdir(exist_ok=True)
    for study in studies:  # what the numbers of this page are taken from, whatever metrics.csv says that `testbed study` wrote
        write_atomically(out / "metrics" / f"{slug(study.name)}.csv", metrics_csv(study.runs))
    write_paper(out, title, first, list(zip([study.name for study in studies], sections)),
                [f"report_{name}" for name, there in (("questions", first["matrix"]), ("claims", claims)) if there])
    write_atomically(out / "numbers.csv", as_csv(ledger.table()))
    gallery = _write_gallery(out, title, sections)
    page = render("template.html", title=title, gallery=gallery, provenance=rows, warnings=warnings, first=first, claims=claims,
                  studies=sections, verdicts=[(study.name, v) for study, v in flat], numbers=ledger.table(), moved=moved, against=against,
                  scripts=scripts(),
                  failures=Table("failures", "Failures", ["study", "what", "status", "reason"], failures, 4),
                  left_out=Table("left_out", "Left out", ["study", "variant", "combination", "reason"], left_out, 4))
    write_atomically(out / "report.html", page)
    write_crate(out, title, studies, dict(rows).get("Commit", []), {study.name: plain(section["purpose"]) for study, section in zip(studies, sections)})
    return out / "report.html"


def main(arguments=None):
    """Entry of `testbed report`; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="testbed report", description="Page, figures and tables of studies, or of results.")
    parser.add_argument("folders", nargs="+", metavar="DIR", help="a study's folder, a folder of such, or a result file")
    parser.add_argument("-o", "--output", metavar="OUT", help="default: 'report' beside the first DIR")
    parser.add_argument("--against", metavar="DIR", help="studies of before: what moved beyond the range of its repeats")
    parser.add_argument("--pgf", action="store_true", help="figures as PGF, too, for a paper's LaTeX to set in its own fonts (needs pdflatex)")
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:
        return 1 if stop.code else 0
    out = Path(options.output) if options.output else Path(options.folders[0]).resolve().parent / "report"
    unreadable = []
    try:
        page = build(options.folders, out, shlex.join(["testbed", "report", *arguments]), unreadable, options.against, options.pgf)
    except (StudyError, OSError) as error:
        print(f"testbed report: {error}", file=sys.stderr)
        return 1
    print(os.path.relpath(page))
    if unreadable:
        more = f"\n  and {len(unreadable) - 20} more" if len(unreadable) > 20 else ""
        print("testbed report: these could not be read or made, the report goes without them:\n  " + "\n  ".join(unreadable[:20]) + more, file=sys.stderr)
    return 1 if unreadable else 0
