"""The stability matrix: case x method x parameter, one cell for the worst of its runs, as figure, page table, CSV and LaTeX."""
import math
from collections import Counter
from dataclasses import dataclass, field

from matplotlib.patches import Rectangle

from ..grade.targets import number
from ..grade.verdicts import LEVELS, WORDS, bound_text, of_case
from ..read.figure_tables import figure_kind
from ..read.study_file import same
from .drawing import Drawing, FigureError
from .style import WIDTH, plt
from .table import Table

# Light to dark also in grey; words and signs besides, so that no colour is needed.
FILL = {"sound": "#D3E7F5", "wrong": "#E6A532", "failed": "#7A2A00", "silent": "#E6A532", "none": "#FFFFFF"}
SIGN = {"sound": "✓", "wrong": "~", "failed": "✗", "silent": "‼", "none": "·"}
MEANING = {"sound": "sound", "wrong": "bounded but wrong, and the run says so", "failed": "failed",
           "silent": "sound-but-wrong: completed, not called suspect, and beyond the bound of its case", "none": "no run"}
CONSERVATIVE = 0.97  # a stated limit is held to this share


@dataclass
class Cell:
    """The runs of one method at one value of the parameter; `run` stands for them: the worst, the earliest of these."""
    kind: str = "none"
    runs: list = field(default_factory=list)
    run: object = None
    text: str = ""
    limit: object = None

    @property
    def counts(self):
        return Counter(kind_of(r.verdict) for r in self.runs)

    @property
    def told(self):
        """What hovering tells."""
        if self.limit:
            return self.limit.verdict or f"limit {number(self.limit.measured[0], 4)}"
        parts = [f"{n} {WORDS.get(kind, 'sound-but-wrong')}" for kind, n in self.counts.items()]
        verdict = self.run.verdict if self.run else None
        return ", ".join(parts) + (f"; {verdict.cause}" if verdict and verdict.cause else "")


@dataclass
class CaseMatrix:
    """`cells[method][value]` of one case."""
    case: object
    values: list
    methods: list
    cells: dict

    @property
    def parameter(self):
        return self.case.parameter.rsplit(".", 1)[-1].replace("_", " ")


def kind_of(verdict):
    """How a verdict is shown: what a run did not tell of itself is louder than its level."""
    return "silent" if verdict.silent else verdict.level


def _time(run):
    return run.verdict.time if math.isfinite(run.verdict.time) else math.inf


def _cell(runs, limits):
    """The cell of some runs; where they belong to searches, that of the limit that is least on the safe side."""
    found = [limit for limit in limits if any(run.search == limit.runs[0].search for run in runs if run.search)]
    if found:
        with_ratio = [limit for limit in found if limit.below is not None]
        limit = min(with_ratio, key=lambda li: li.ratio if math.isfinite(li.ratio) else math.inf) if with_ratio else found[0]
        if limit.below is None:
            return Cell("failed" if "not" in limit.verdict else "sound", runs, runs[-1], "–", limit)
        safe = not math.isfinite(limit.ratio) or limit.ratio >= CONSERVATIVE
        shown = limit.ratio if math.isfinite(limit.ratio) else limit.measured[0]
        return Cell("sound" if safe else "failed", runs, limit.below if safe else limit.above, number(shown, 3), limit)
    if not runs:
        return Cell()
    worst = max(run.verdict.rank for run in runs)
    run = min((r for r in runs if r.verdict.rank == worst), key=lambda r: (not r.verdict.silent, _time(r)))
    bad = sum(r.verdict.rank > 0 for r in runs)
    text = "" if len(runs) == 1 else f"{bad}/{len(runs)}" if bad else f"{len(runs)}"
    return Cell(kind_of(run.verdict), runs, run, text)


def build(study, where=None):
    """The matrices of all cases of a study."""
    matrices, order = [], study.variants()
    for case in study.spec.cases:
        runs = [r for r in study.select({**(where or {}), "case": case.name})]
        if not runs:
            continue
        axis = case.axes[case.parameter]
        values = axis if isinstance(axis, list) else [None]
        methods = sorted({r.name for r in runs}, key=order.index)
        limits = [limit for limit in study.limits if limit.case == case.name]
        cells = {m: [_cell([r for r in runs if r.name == m and (v is None or same(r.values.get(case.parameter), v))], limits)
                     for v in values] for m in methods}
        matrices.append(CaseMatrix(case, values, methods, cells))
    return matrices


def value_text(value):
    if value is None:
        return "limit"
    return f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)


def bounds_text(case, variants):
    """What makes a run of a case wrong, in words; other bounds of some runs behind it."""
    general = of_case([b for b in case.bounds if not b.get("where")], {})
    text = "; ".join(bound_text(b) + (f" ({b['source']})" if b.get("source") else "") for b in general)
    special = [f"{', '.join(f'{k} = {v}' for k, v in b['where'].items())}: {bound_text(b)}" + (f" ({b['source']})" if b.get("source") else "")
               for b in case.bounds if b.get("where")]
    return "; ".join(filter(None, [text, *special]))


def matrix_tables(matrices):
    """Tables for CSV and LaTeX: rows are cases and methods, columns the values of the parameter in their order."""
    most = max((len(m.values) for m in matrices), default=0)
    rows = []
    for m in matrices:
        rows.append([m.case.title, m.parameter] + [value_text(v) for v in m.values] + [""] * (most - len(m.values)))
        for method in m.methods:
            cells = [WORDS.get(c.kind, "sound-but-wrong" if c.kind == "silent" else "no run") + (f" ({c.text})" if c.text else "")
                     for c in m.cells[method]]
            rows.append(["", method] + cells + [""] * (most - len(cells)))
    header = ["case", "method"] + [f"value {k + 1}" for k in range(most)]
    return Table("stability_matrix", "Stability matrix", header, rows, len(header),
                 ["n/m: n of m runs are not sound; a limit stands as measured over stated."])


def summary_table(study):
    """Counts of verdicts by method."""
    rows = []
    for name in study.variants():
        own = [r for r in study.runs if r.name == name]
        counts = Counter(r.verdict.level for r in own)
        rows.append([name, str(len(own)), *(str(counts[level]) for level in LEVELS),
                     str(sum(r.verdict.silent for r in own if r.completed)), str(sum(r.verdict.warned for r in own))])
    return Table("verdicts", "Verdicts by method", ["method", "runs", *(WORDS[level] for level in LEVELS), "sound-but-wrong", "warned though within bounds"],
                 rows, notes=["Sound-but-wrong: completed beyond the bound of its case without being called suspect. Runs of searches beyond "
                              "a limit are among the failed ones: a search needs them."])


def time_table(study):
    """Runs and time by case."""
    rows, total = [], [0, 0.0]
    for case in study.spec.cases:
        own = [r.result.performance for r in study.runs if r.values.get("case") == case.name and r.result is not None]
        seconds = sum(float(p.get("setup_s", 0)) + float(p.get("solve_s", 0)) + float(p.get("output_s", 0)) for p in own)
        total = [total[0] + len(own), total[1] + seconds]
        rows.append([case.title, str(len(own)), number(seconds), number(max((float(p.get("steps", 0)) for p in own), default=0.0))])
    rows.append(["all", str(total[0]), number(total[1]), ""])
    return Table("time", "Runs and time by case", ["case", "runs", "time in the solver [s]", "most steps"], rows,
                 notes=["Set-up, steps and output, without the start of programs."])


def limit_table(study, matrix):
    """Measured and stated limits of a searched case: rows methods, columns values of the parameter. None for other cases."""
    limits = [limit for limit in study.limits if limit.case == matrix.case.name]
    if not limits:
        return None
    sharp = any(math.isfinite(limit.sharp) for limit in limits)
    rows = []
    for method in matrix.methods:
        row = [method]
        for cell in matrix.cells[method]:
            limit = cell.limit
            if limit is None or limit.below is None:
                row.append(limit.verdict if limit else "")
            elif math.isfinite(limit.ratio):
                known = (sum(limit.step) / 2, limit.sharp, limit.stated) if sharp else (sum(limit.step) / 2, limit.stated)
                row.append(" | ".join(number(dt, 4) if math.isfinite(dt) else "–" for dt in known))
            else:
                row.append(f"{number(limit.measured[0], 4)}–{number(limit.measured[1], 4)}")
        rows.append(row)
    step = any(math.isfinite(limit.ratio) for limit in limits)
    key = limits[0].key
    what = f"{key}: last bracket"
    if step:
        predicted = " | predicted for these points" if sharp else ""
        what = f"time step over L/c_p: measured (middle of the last bracket){predicted} | stated by the solver"
    return Table(f"limits_{matrix.case.name}", f"Limits, {matrix.case.title}: {what}",
                 ["method", *(f"{matrix.parameter} = {value_text(v)}" for v in matrix.values)], rows)


@figure_kind("stability_matrix")
def stability_matrix(study, entry, style):
    """The whole matrix on one picture: cases down, methods across, in each place one square for each value of the parameter."""
    if not study.spec.cases:
        raise FigureError("the study has no [[case]]")
    matrices = build(study, entry["where"])
    if not matrices:
        raise FigureError("no run of the study is chosen by 'where'")
    methods = sorted({m for matrix in matrices for m in matrix.methods}, key=style.rank)
    width, label, line, top, foot = WIDTH["page"], 2.35, 0.185, 0.62, 0.42
    height = top + line * len(matrices) + foot
    figure = plt.figure(figsize=(width, height))
    axis = figure.add_axes([0, 0, 1, 1])
    axis.set_xlim(0, width)
    axis.set_ylim(height, 0)
    axis.axis("off")
    place = (width - label - 0.08) / len(methods)
    most = max(len(m.values) for m in matrices)
    side = min(line - 0.045, (place - 0.08) / most)
    for k, method in enumerate(methods):
        axis.text(label + k * place, top - 0.08, method, rotation=28, ha="left", va="bottom", fontsize=7)
    for row, matrix in enumerate(matrices):
        y = top + row * line
        if row % 2:
            axis.add_patch(Rectangle((0, y), width, line, facecolor="0.965", linewidth=0))
        axis.text(0.05, y + line / 2, matrix.case.title, va="center", fontsize=6.6)
        axis.text(label - 0.08, y + line / 2, matrix.parameter, va="center", ha="right", fontsize=5.6, color="0.4")
        for k, method in enumerate(methods):
            for j, cell in enumerate(matrix.cells.get(method, [])):
                _square(axis, label + k * place + j * side, y + (line - side) / 2, side, cell.kind)
    x = 0.05
    for kind in ("sound", "wrong", "silent", "failed"):
        _square(axis, x, height - 0.27, 0.14, kind)
        words = {"wrong": "bounded but wrong", "silent": "sound-but-wrong"}.get(kind, kind)
        axis.text(x + 0.19, height - 0.20, words, va="center", fontsize=7)
        x += 0.42 + 0.062 * len(words)
    counts = Counter(kind_of(r.verdict) for m in matrices for cells in m.cells.values() for c in cells for r in c.runs)
    notes = ["Each square is the worst run at one value of the parameter, whose values rise to the right",
             ", ".join(f"{counts[k]} {w}" for k, w in (("sound", "runs sound"), ("wrong", "bounded but wrong"),
                                                      ("silent", "sound-but-wrong"), ("failed", "failed")))]
    return Drawing(figure, [r for m in matrices for cells in m.cells.values() for c in cells for r in c.runs], notes)


def _square(axis, x, y, side, kind):
    pad = 0.09 * side
    axis.add_patch(Rectangle((x + pad / 2, y + pad / 2), side - pad, side - pad, facecolor=FILL[kind],
                             edgecolor="black" if kind == "silent" else "0.55", linewidth=0.9 if kind == "silent" else 0.3))
    left, right, low, high = x + 0.28 * side, x + 0.72 * side, y + 0.28 * side, y + 0.72 * side
    if kind == "failed":
        axis.plot([left, right], [low, high], color="white", linewidth=0.8)
        axis.plot([left, right], [high, low], color="white", linewidth=0.8)
    elif kind == "wrong":
        axis.plot([left, right], [high, low], color="black", linewidth=0.7)
    elif kind == "silent":
        for at in (0.36, 0.64):
            axis.plot([x + at * side] * 2, [y + 0.2 * side, y + 0.58 * side], color="black", linewidth=0.9)
            axis.plot([x + at * side] * 2, [y + 0.72 * side, y + 0.8 * side], color="black", linewidth=0.9)
