"""The section of a study on the page: figures, tables, runs with their commands; and its files for print."""
from collections import Counter

from ..draw.drawing import FigureError
from ..draw.figures import draw
from ..draw.pgf import PgfError, save_pgf
from ..draw.points import points_of
from ..draw.style import RC, WIDTH, plt
from ..draw.table import as_csv, as_latex
from ..grade.dataset import write_atomically
from ..read.results import ResultError
from .names import figure_anchor, figure_names, slug, study_anchor, subject, table_anchor
from .page import both_svgs
from .stability_page import stability_section
from .tables import study_tables

PRINT = {"dpi": 300, "metadata": {"CreationDate": None, "Creator": None, "Producer": None}}


def _caption(study, entry, drawing, ledger):
    """What is seen, and the runs, as pieces."""
    notes = [n.rstrip(".") for n in drawing.notes]
    sizes = sorted({r.values["L"] for r in drawing.runs if isinstance(r.values.get("L"), (int, float))}, reverse=True)
    notes.append(f"{len(drawing.runs)} run{'s' if len(drawing.runs) != 1 else ''}" + (f", L = {', '.join(f'{s:g}' for s in sizes)} m" if sizes else ""))
    ratios = [r.value("static", "kinetic_over_strain") for r in drawing.runs]
    ratios = [r for r in ratios if r == r]
    if ratios:
        notes.append(f"Kinetic/strain energy at the end at most {max(ratios):.2e}")
    own = entry.get("caption", "").strip().rstrip(".")
    return ledger.text(study, own) + [(". " if own else "") + ". ".join(notes) + "."]


def _figure(study, entry, name, style, out, ledger, failures, pgf):
    """One figure as the template wants it; drawn for print, too."""
    what = subject(entry)
    title = entry.get("title") or f"{entry['kind']}: {what} {entry.get('norm', '')}".replace("_", " ").strip(" :")
    shown = {"title": title[:1].upper() + title[1:], "kind": entry["kind"], "image": "", "caption": [],
             "svg": "", "points": [], "error": "", "width": "column", "rem": 0, "runs": [],
             "anchor": figure_anchor(name), "paper": entry.get("paper", "").strip(), "shows": ledger.text(study, entry.get("shows", "").strip())}
    try:
        with plt.rc_context(RC):
            drawing = draw(study, entry, style)
            drawing.figure.savefig(out / "figures" / f"{name}.pdf", **PRINT)
            if pgf:
                save_pgf(drawing.figure, out / "figures" / f"{name}.pgf")
            shown["image"], shown["svg"] = both_svgs(drawing.figure, name)
            shown["points"] = points_of(drawing, entry)
            inches = drawing.figure.get_figwidth()
            shown["width"], shown["rem"] = "page" if inches > 1.05 * WIDTH["column"] else "column", round(62 / 7 * inches, 1)
            shown["caption"] = _caption(study, entry, drawing, ledger)
            shown["runs"] = [run.id for run in drawing.runs]
    except (FigureError, ResultError, PgfError) as error:
        shown["error"] = str(error)
        failures.append([study.name, f"figure {name}", "not drawn", str(error)])
    finally:
        plt.close("all")
    return shown


def core_hours(runs):
    """Time on cores of runs that left a result."""
    own = [run.result for run in runs if run.result is not None]
    return sum(float(r.performance.get(part, 0)) * float(r.provenance.get("threads", 1)) for r in own for part in ("solve_s", "setup_s", "output_s")) / 3600


def _summary(study):
    counts = Counter("suspect" if run.suspect else run.status for run in study.runs)
    text = f"{len(study.runs)} runs: " + ", ".join(f"{n} {status}" for status, n in counts.items()) + f". {core_hours(study.runs):.2g} core hours."
    return text + (f" {len(study.left_out)} combinations left out." if study.left_out else "")


def _settings(run):
    """What a run is, in a line."""
    parts = [run.name] + [f"{key.rsplit('.', 1)[-1]} = {run.values[key]:g}" if isinstance(run.values[key], float) else f"{key.rsplit('.', 1)[-1]} = {run.values[key]}"
                          for key in run.values if key not in ("scene", "method", "variant", "dt", "ppc", "seed", "grid.cell_size")]
    return ", ".join(parts)


def study_section(study, style, out, ledger, failures, pgf=False):
    """The content of the section, and the files of its pictures and tables; `pgf`: figures as PGF, too."""
    figures = [_figure(study, entry, name, style, out, ledger, failures, pgf) for entry, name in zip(study.spec.figures, figure_names(study))]
    stability, files, runs = None, [], []
    if study.spec.cases:
        stability, tables, files = stability_section(study, style, out, slug(study.name))
    else:
        tables = study_tables(study)
        runs = [{"anchor": f"run-{run.id}", "id": run.id, "told": _settings(run), "label": run.label, "command": run.command} for run in study.runs]
    for table in files:
        write_table(out, study.name, table)
    return {"anchor": study_anchor(study), "title": study.spec.title, "purpose": ledger.text(study, study.spec.purpose), "summary": _summary(study),
            "figures": figures, "tables": [(table_anchor(study, t.name), t) for t in tables], "stability": stability, "runs": runs}


def write_table(out, name, table):
    """A table for other programs and, unless the page folds it away, for print."""
    base = out / "tables" / f"{slug(name)}_{slug(table.name)}"
    write_atomically(base.with_suffix(".csv"), as_csv(table))
    base.with_suffix(".tex").unlink(missing_ok=True)  # of an earlier report
    if not table.folded:
        write_atomically(base.with_suffix(".tex"), as_latex(table))
