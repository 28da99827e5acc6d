"""The section of a study with cases on the page: matrix with links, classes of failure, and a run for each cell."""
import math
from pathlib import Path

from ..draw import matrix
from ..draw.style import RC, plt
from ..draw.table import Table
from ..grade.targets import number
from ..grade.verdicts import HOLDS, WORDS
from . import failures
from .page import inline_svg


def anchor(run):
    return f"run-{run.id}"


def _cell(cell, value):
    """A cell as the template wants it."""
    return {"kind": cell.kind, "sign": matrix.SIGN[cell.kind], "text": cell.text, "told": f"{matrix.value_text(value)}: {cell.told}",
            "link": anchor(cell.run) if cell.run else ""}


def _matrices(matrices, variants):
    return [{"name": m.case.name, "title": m.case.title, "purpose": m.case.purpose, "parameter": m.parameter,
             "readme": "/".join(Path(m.case.scene).parts[-3:-1]) if m.case.scene.startswith("../") and len(Path(m.case.scene).parts) > 3 else "", "asked": "Holds while" if m.case.condition else "Sound", "bounds": matrix.bounds_text(m.case, variants),
             "columns": [matrix.value_text(v) for v in m.values],
             "rows": [{"method": method, "cells": [_cell(c, v) for c, v in zip(m.cells[method], m.values)]} for method in m.methods]}
            for m in matrices]


def _since(run):
    return f"{number(run.verdict.time)} s" if run.verdict.level != "sound" and math.isfinite(run.verdict.time) else ""


def _told(run, case):
    """One run in the list that the cells link to."""
    v = run.verdict
    axes = ", ".join(f"{k.rsplit('.', 1)[-1]} = {run.values[k]:g}" if isinstance(run.values[k], float) else f"{k.rsplit('.', 1)[-1]} = {run.values[k]}"
                     for k in case.axis_keys if k in run.values and k != "method")
    words = "sound-but-wrong" if v.silent else (HOLDS if case.condition else WORDS)[v.level]
    return {"anchor": anchor(run), "case": case.title, "method": run.name, "axes": axes, "kind": matrix.kind_of(v), "verdict": words,
            "warned": v.warned, "cause": v.cause, "since": _since(run), "held": v.held, "beyond": "; ".join(v.beyond), "command": run.command}


def _shown_runs(matrices, further):
    """The runs that cells stand for, and those of pictures, in the order of the matrix."""
    runs = {}
    for m in matrices:
        for method in m.methods:
            for cell in m.cells[method]:
                if cell.run is not None:
                    runs[cell.run.id] = cell.run
    for run in further:
        runs.setdefault(run.id, run)
    return list(runs.values())


def verdicts_table(study):
    """All runs with their verdicts, for CSV."""
    rows = [[r.id, r.values.get("case", ""), r.name, WORDS[r.verdict.level], str(int(r.verdict.silent)), str(int(r.verdict.warned)),
             r.verdict.cause, _since(r), r.verdict.held, r.command] for r in study.runs]
    header = ["run", "case", "method", "verdict", "silent", "warned", "cause", "since", "held", "command"]
    return Table("runs", "Runs and their verdicts", header, rows, len(header), folded=True)


def stability_section(study, style, out, prefix):
    """(content for the template, tables of the section) of a study with cases; writes the pictures for print to out/figures."""
    matrices = matrix.build(study)
    kinds, pictured = [], []
    for entry, run, drawing, error, remedy, affected in failures.classes(study, style):
        image = ""
        if drawing is not None:
            with plt.rc_context(RC):
                drawing.figure.savefig(out / "figures" / f"{prefix}_failure_{entry['name']}.pdf", dpi=300,
                                       metadata={"CreationDate": None, "Creator": None, "Producer": None})
                image = inline_svg(drawing.figure)
            plt.close("all")
            pictured.append(run)
        kinds.append({"name": entry["name"], "title": entry["title"], "text": entry["text"].strip(), "image": image, "error": error,
                      "remedy": remedy, "affected": affected, "run": anchor(run) if run is not None else "",
                      "label": _told(run, study.case(run.values["case"])) if run is not None else None})
    runs = [_told(r, study.case(r.values["case"])) for r in _shown_runs(matrices, pictured)]
    silent = sum(r.verdict.silent and r.completed for r in study.runs)
    tables = [matrix.summary_table(study), failures.cost_table(study), matrix.time_table(study), *(matrix.limit_table(study, m) for m in matrices)]
    files = [matrix.matrix_tables(matrices), verdicts_table(study)]
    content = {"matrices": _matrices(matrices, study.variants()), "classes": kinds, "runs": runs, "silent": silent,
               "signs": [(k, matrix.SIGN[k], matrix.MEANING[k]) for k in ("sound", "wrong", "silent", "failed")]}
    return content, [t for t in tables if t], files
