"""A table: one shape for the page, for CSV and for LaTeX (booktabs)."""
import csv
import io
import math
import re
import unicodedata
from dataclasses import dataclass, field


@dataclass
class Table:
    """`header` and `rows` of strings; the first `text_columns` are words, the rest numbers. `folded`: the page shows it when asked to."""
    name: str
    title: str
    header: list
    rows: list
    text_columns: int = 1
    notes: list = field(default_factory=list)
    folded: bool = False


def as_csv(table):
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(table.header)
    writer.writerows(table.rows)
    return out.getvalue()


_LATEX = {"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_\allowbreak{}", "{": r"\{",
          "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "≤": r"$\le$", "≥": r"$\ge$",
          "−": "$-$", "µ": r"\textmu{}", "×": r"$\times$", "<": r"$<$", ">": r"$>$", "∞": r"$\infty$", "–": "--", "|": r"\textbar{}", "✓": r"$\checkmark$", "°": r"\textdegree{}",
          "†": r"$\dagger$", "‡": r"$\ddagger$", "±": r"$\pm$", "²": "$^2$", "τ": r"$\tau$", "√": r"$\surd$", "…": r"\ldots{}"}


def escape(text):
    """Text for LaTeX; whole numbers with an exponent become a product."""
    text = str(text)
    try:
        if "e" in text and math.isfinite(float(text)):
            mantissa, exponent = text.split("e")
            return rf"${mantissa}\times10^{{{int(exponent)}}}$"
    except ValueError:
        pass
    return "".join(_LATEX.get(c) or (c if c.isascii() else _other(c)) for c in text)


def _other(c):
    """Letters of Latin as they are, which LaTeX reads as UTF-8; Greek ones by their names; '?' for what has neither."""
    name = unicodedata.name(c, "")
    if name.startswith("LATIN "):
        return c
    greek = re.fullmatch(r"GREEK (SMALL|CAPITAL) LETTER ([A-Z]+)", name)
    word = greek and (greek[2].lower() if greek[1] == "SMALL" else greek[2].capitalize()).replace("lamda", "lambda").replace("Lamda", "Lambda")
    return rf"$\{word}$" if word in LETTERS else "?"


LETTERS = {*"alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi omega".split(),
           *"Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega".split()}  # that LaTeX has
LINE = 104  # characters of a line of 174 mm in \footnotesize
GAP = 3  # between two columns
ROWS = 50  # of a page
BROAD = 30  # a column of words that is broader than this is broken into lines


def _columns(table):
    """(specification, characters) of every column; those of words share what a line leaves them."""
    longest = [max((len(str(row[k])) for row in [table.header, *table.rows]), default=0) for k in range(len(table.header))]
    broad = [k for k in range(table.text_columns) if longest[k] > BROAD]
    rest = sum(longest[:table.text_columns]) - sum(longest[k] for k in broad) + GAP * table.text_columns
    numbers = sum(n + GAP for n in longest[table.text_columns:])
    room = max(LINE - rest - min(numbers, 2 * LINE // 3), 10 * len(broad))
    total = sum(longest[k] for k in broad)
    if total > room:
        for k in broad:
            word = max((len(w) for row in [table.header, *table.rows] for w in re.split(r"[\s_-]+", str(row[k]))), default=0)
            longest[k] = max(8, min(word + 1, BROAD), int(room * longest[k] / total))
    wrapped = r">{\raggedright\arraybackslash}p{%.2f\linewidth}"
    return [(wrapped % (n / (LINE + 4)) if k in broad else "l" if k < table.text_columns else "r", n) for k, n in enumerate(longest)]


def _blocks(table, columns):
    """Columns side by side that fit a line: every block begins with those of words."""
    words = list(range(table.text_columns))
    start = sum(columns[k][1] + GAP for k in words)
    blocks, used = [[]], start
    for k in range(table.text_columns, len(columns)):
        if blocks[-1] and used + columns[k][1] + GAP > LINE:
            blocks.append([])
            used = start
        blocks[-1].append(k)
        used += columns[k][1] + GAP
    return [words + block for block in blocks]


def as_latex(table):
    """A booktabs table for a line of 174 mm; columns that do not fit follow below, with the words repeated, and then the notes."""
    columns = _columns(table)
    kind = "longtable" if len(table.rows) > ROWS else "tabular"
    lines = [r"% needs \usepackage{array,booktabs,longtable}", r"{\footnotesize"]
    for block in _blocks(table, columns):
        lines += [rf"\begin{{{kind}}}{{@{{}}{''.join(columns[k][0] for k in block)}@{{}}}}", r"\toprule",
                  " & ".join(escape(table.header[k]) for k in block) + r" \\", r"\midrule"]
        lines += [" & ".join(escape(row[k]) for k in block) + r" \\" for row in table.rows]
        lines += [r"\bottomrule", rf"\end{{{kind}}}", "", r"\medskip"]
    notes = [r"\medskip", r"\noindent\parbox{\linewidth}{\raggedright " + " ".join(map(escape, table.notes)) + "}"] if table.notes else []
    return "\n".join(lines[:-1] + notes + ["}"]) + "\n" if notes else "\n".join(lines[:-2] + ["}"]) + "\n"
