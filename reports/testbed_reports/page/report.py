"""`testbed report`: pages, figures for print, tables for print, from the folders of studies."""
import argparse
import os
import re
import shlex
import sys
from collections import Counter
from datetime import datetime, timezone
from pathlib import Path

from ..draw.drawing import FigureError, label_of
from ..draw.figures import draw
from ..draw.style import RC, WIDTH, Style, plt
from ..draw.table import Table, as_csv, as_latex
from ..grade.dataset import read_study_folder, write_atomically
from ..grade.loose import study_of
from ..grade.targets import judge_all
from ..read.results import ResultError
from ..read.study_file import StudyError
from . import bench
from .page import inline_svg, render
from .stability_page import stability_section
from .tables import study_tables, targets_table


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


def slug(text):
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


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
    rows.append(("Made by", _unique([s.plan.get("command") for s in studies] + [command])))
    return rows, warnings


def caption(study, entry, drawing, command):
    """What is seen, then the runs, the commit and the command."""
    sentences = [entry.get("caption", "").strip().rstrip(".")] + [n.rstrip(".") for n in drawing.notes]
    sizes = sorted({r.values["L"] for r in drawing.runs if isinstance(r.values.get("L"), (int, float))}, reverse=True)
    sentences.append(f"Runs: study {study.name}" + (f", L = {', '.join(f'{s:g}' for s in sizes)} m" if sizes else ""))
    ratios = [r.value("static", "kinetic_over_strain") for r in drawing.runs]
    ratios = [r for r in ratios if r == r]
    if ratios:
        sentences.append(f"Kinetic/strain energy at the end at most {max(ratios):.2e}")
    commits = _unique(r.result.provenance.get("commit") for r in drawing.runs if r.result is not None)
    if commits:
        sentences.append(f"Commit {', '.join(commits)}")
    remade = "; ".join(filter(None, (study.plan.get("command"), command)))
    return ". ".join(filter(None, sentences)) + f". Made by: {remade}"


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


def _study_section(study, style, out, command, failures):
    figures, used = [], Counter()
    for entry in study.spec.figures:
        what = (entry.get("quantity") or entry.get("component") or " ".join(filter(None, (entry.get("y"), entry.get("x"))))
                or ("deformed_grid" if entry.get("deformed_grid") else ""))
        name = slug(entry.get("name") or "_".join(filter(None, (entry["kind"], what, entry.get("norm", "")))))
        used[name] += 1
        name = f"{slug(study.name)}_{name}" + (f"_{used[name]}" if used[name] > 1 else "")
        title = entry.get("title") or f"{entry['kind']}: {what} {entry.get('norm', '')}".replace("_", " ").strip()
        title = title[:1].upper() + title[1:]
        shown = {"title": title, "image": "", "caption": "", "error": "", "width": "column", "rem": 0, "anchor": f"figure-{name}",
                 "paper": entry.get("paper", "").strip(), "shows": entry.get("shows", "").strip()}
        try:
            with plt.rc_context(RC):
                drawing = draw(study, entry, style)
                drawing.figure.savefig(out / "figures" / f"{name}.pdf", dpi=300,
                                       metadata={"CreationDate": None, "Creator": None, "Producer": None})
                shown["image"] = inline_svg(drawing.figure)
                inches = drawing.figure.get_figwidth()
                shown["width"], shown["rem"] = "page" if inches > 1.05 * WIDTH["column"] else "column", round(62 / 7 * inches, 1)
                shown["caption"] = caption(study, entry, drawing, command)
        except (FigureError, ResultError) as error:
            shown["error"] = str(error)
            failures.append([study.name, f"figure {name}", "not drawn", str(error)])
        finally:
            plt.close("all")
        figures.append(shown)
    stability, files = None, []
    if study.spec.cases:
        stability, tables, files = stability_section(study, style, out, slug(study.name))
    else:
        tables = study_tables(study)
    for table in files:
        _write_table(out, study, table)
    counts = Counter("suspect" if run.suspect else run.status for run in study.runs)
    summary = f"{len(study.runs)} runs: " + ", ".join(f"{n} {status}" for status, n in counts.items()) + "."
    if study.left_out:
        summary += f" {len(study.left_out)} combinations left out."
    return {"anchor": f"study-{slug(study.name)}", "title": study.spec.title, "purpose": study.spec.purpose,
            "summary": summary, "figures": figures, "tables": tables, "stability": stability}


def _write_table(out, study, table):
    """A table for print and for other programs."""
    base = out / "tables" / f"{slug(study.name)}_{slug(table.name)}"
    write_atomically(base.with_suffix(".csv"), as_csv(table))
    write_atomically(base.with_suffix(".tex"), as_latex(table))


def _bench_section(path, style, out, failures):
    """The section of one bench.csv; None when it cannot be used."""
    try:
        comment, rows = bench.read_bench(path)
    except (OSError, bench.BenchError) as error:
        failures.append([path.parent.name, bench.FILE, "unreadable", str(error).replace(str(path.parent) + os.sep, "")])
        return None
    name = f"{slug(path.parent.name)}_bench_rates"
    with plt.rc_context(RC):
        figure = bench.rates_figure(rows, style)
        figure.savefig(out / "figures" / f"{name}.pdf", dpi=300, metadata={"CreationDate": None, "Creator": None, "Producer": None})
        shown = {"title": "Particle-steps per second against the number of points", "image": inline_svg(figure), "error": "", "width": "page",
                 "rem": 62, "anchor": f"figure-{name}", "paper": "", "shows": "",
                 "caption": f"Fastest of ten slices; full lines one thread, thin lines more. {comment}. Made by: testbed bench"}
    plt.close("all")
    tables = [t for t in (bench.rates_table(rows), bench.cost_table(rows)) if t]
    for table in tables:
        base = out / "tables" / f"{slug(path.parent.name)}_bench_{table.name}"
        write_atomically(base.with_suffix(".csv"), as_csv(table))
        write_atomically(base.with_suffix(".tex"), as_latex(table))
    return {"anchor": f"bench-{slug(path.parent.name)}", "title": "Speed", "purpose": "The particle methods alone, in one process, beside the "
            "bandwidth of the memory." + (" Measured on a busy machine." if bench.is_busy(comment) else ""), "summary": f"{len(rows)} measurements.",
            "figures": [shown], "tables": tables}


def _write_gallery(out, title, sections):
    """Writes gallery.html of the figures with words of a paper or of the study's author; False when there are none."""
    shown = [section | {"figures": [f for f in section["figures"] if f["paper"] or f["shows"]]} for section in sections]
    shown = [section for section in shown if section["figures"]]
    if shown:
        write_atomically(out / "gallery.html", render("gallery.html", title=title, studies=shown))
    else:
        (out / "gallery.html").unlink(missing_ok=True)  # of an earlier report
    return bool(shown)


def build(folders, out, command, unreadable=None):
    """Writes the report of studies into the folder `out`; returns the path of the page. `unreadable`: a list for what could not be read or
    drawn."""
    out = Path(out)
    studies, failures = [], []
    unreadable = [] if unreadable is None else unreadable
    files = [folder for folder in map(Path, folders) if folder.is_file()]
    folders = [folder for folder in folders if Path(folder) not in files]
    if files:
        studies.append(study_of(files))
    for folder in find_studies(folders):
        try:
            studies.append(read_study_folder(folder))
        except StudyError as error:
            failures.append([folder.name, "the whole study", "unreadable",
                             str(error).replace(str(folder) + os.sep, "")])
            unreadable.append(str(error))
    for name in ("figures", "tables"):
        (out / name).mkdir(parents=True, exist_ok=True)
    for study in studies:
        failures += [[study.name, name, "of another code", "no run of the study's plan: its result lies in runs/ and is taken"] for name in study.outside]
        for run in study.runs:
            if (run.suspect or not run.completed) and not study.spec.cases:  # the matrix tells of these
                failures.append([study.name, run.id, run.label, run.told])
            if run.status == "unreadable":
                unreadable.append(f"{study.name}: {run.id}: {run.reason}")
            failures += [[study.name, run.id, "number missing", error] for error in run.errors]
    benches = [path for path in (Path(folder) / bench.FILE for folder in folders) if path.is_file()]
    style = Style(_figure_labels(studies) + _bench_labels(benches))
    verdicts = [(study, judge_all(study)) for study in studies]
    sections = [_study_section(study, style, out, command, failures) for study in studies]
    unreadable += [f"{name}: {what}: {reason}" for name, what, how, reason in failures if how == "not drawn"]
    for (study, judged), section in zip(verdicts, sections):
        for table in section["tables"] + ([targets_table(judged)] if judged else []):
            _write_table(out, study, table)
    sections += [section for path in benches if (section := _bench_section(path, style, out, failures))]
    rows, warnings = provenance(studies, command)
    flat = [(study.name, v) for study, judged in verdicts for v in judged]
    counted = Counter(v.verdict for _, v in flat)
    left_out = [[s.name, e.get("variant") or "", ", ".join(f"{k} = {v}" for k, v in e.get("axes", {}).items()),
                 e.get("reason", "")] for s in studies for e in s.left_out]
    titles = [section["title"] for section in sections]
    title = titles[0] if len(titles) == 1 else "Testbed report"
    gallery = _write_gallery(out, title, sections)
    page = render("template.html", title=title, gallery=gallery, provenance=rows, warnings=warnings,
                  studies=sections, verdicts=flat,
                  counts=", ".join(f"{counted[k]} {k}" for k in ("pass", "fail", "known", "not run") if counted[k]) + ".",
                  failures=Table("failures", "Failures", ["study", "what", "status", "reason"], failures, 4),
                  left_out=Table("left_out", "Left out", ["study", "variant", "combination", "reason"], left_out, 4))
    write_atomically(out / "report.html", page)
    return out / "report.html"


def main(arguments=None):
    """Entry of `testbed report`; returns the exit code."""
    arguments = sys.argv[1:] if arguments is None else arguments
    parser = argparse.ArgumentParser(prog="testbed report", description="Page, figures and tables of studies, or of results.")
    parser.add_argument("folders", nargs="+", metavar="DIR", help="a study's folder, a folder of such, or a result file")
    parser.add_argument("-o", "--output", metavar="OUT", help="default: 'report' beside the first DIR")
    try:
        options = parser.parse_args(arguments)
    except SystemExit as stop:
        return 1 if stop.code else 0
    out = Path(options.output) if options.output else Path(options.folders[0]).resolve().parent / "report"
    unreadable = []
    try:
        page = build(options.folders, out, shlex.join(["testbed", "report", *arguments]), unreadable)
    except (StudyError, OSError) as error:
        print(f"testbed report: {error}", file=sys.stderr)
        return 1
    print(os.path.relpath(page))
    if unreadable:
        more = f"\n  and {len(unreadable) - 20} more" if len(unreadable) > 20 else ""
        print("testbed report: these could not be read or drawn, the report goes without them:\n  " + "\n  ".join(unreadable[:20]) + more, file=sys.stderr)
    return 1 if unreadable else 0
