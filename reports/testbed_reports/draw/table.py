"""A table: one shape for the page, for CSV and for LaTeX (booktabs)."""
import csv
import io
import math
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


_LATEX = {"\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{",
          "}": r"\}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "≤": r"$\le$", "≥": r"$\ge$",
          "−": "$-$", "µ": r"\textmu{}", "×": r"$\times$", "<": r"$<$", ">": r"$>$", "∞": r"$\infty$", "–": "--", "|": r"\textbar{}", "✓": r"$\checkmark$", "°": r"\textdegree{}"}


def escape(text):
    """Text for LaTeX; whole numbers with an exponent become a product."""
    text = str(text)
    try:
        if "e" in text and math.isfinite(float(text)):
            mantissa, exponent = text.split("e")
            return rf"${mantissa}\times10^{{{int(exponent)}}}$"
    except ValueError:
        pass
    text = "".join(_LATEX.get(c, c) for c in text)
    return text.encode("ascii", "replace").decode() if not text.isascii() else text


def as_latex(table):
    columns = "l" * table.text_columns + "r" * (len(table.header) - table.text_columns)
    lines = [r"% needs \usepackage{booktabs}", rf"\begin{{tabular}}{{{columns}}}", r"\toprule",
             " & ".join(escape(h) for h in table.header) + r" \\", r"\midrule"]
    lines += [" & ".join(escape(c) for c in row) + r" \\" for row in table.rows]
    return "\n".join(lines + [r"\bottomrule", r"\end{tabular}"]) + "\n"
