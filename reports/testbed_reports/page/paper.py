"""paper.tex: what the report shows, as a skeleton that latexmk turns into a PDF."""
from ..draw.table import escape
from ..grade.dataset import write_atomically
from .ledger import plain
from .names import slug
from .page import render

WIDTHS = {"column": "84mm", "page": "174mm"}


def _plain(pieces):
    """Pieces of a text without their ids, for LaTeX."""
    return escape(plain(pieces))


def _section(name, section):
    figures = [{"name": f["anchor"].removeprefix("figure-"), "width": WIDTHS[f["width"]],
                "caption": " ".join(filter(None, (escape(f["title"]) + ".", _plain(f["caption"]))))} for f in section["figures"] if f["image"]]
    tables = [f"{slug(name)}_{slug(t.name)}" for _, t in section["tables"] if not t.folded]
    return {"title": escape(section["title"]), "purpose": _plain(section["purpose"]), "figures": figures, "tables": tables}


def write_paper(out, title, first, sections, first_tables):
    """Writes out/paper.tex. `sections`: [(name of the study, section of the page)]; `first_tables`: files that stand with the findings."""
    text = render("paper.tex", autoescape=False, title=escape(title), compared=escape(first["compared"]), first_tables=first_tables,
                  sentences=[_plain(pieces) for pieces in first["sentences"]], sections=[_section(name, section) for name, section in sections])
    write_atomically(out / "paper.tex", text)
