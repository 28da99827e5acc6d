"""The [[figure]] tables of a study file, and the kinds of figures, which the modules of draw/ declare."""
from dataclasses import dataclass
from typing import Callable

from .study_reader import FLAG, LIST, NUMBER, TABLE, TEXT
from .spelling import did_you_mean

FIGURE_KEYS = {"kind": TEXT, "name": TEXT, "title": TEXT, "caption": TEXT, "where": TABLE, "width": TEXT,
               "series": TEXT + LIST, "paper": TEXT, "shows": TEXT}
WIDTHS = ("column", "page")


@dataclass(frozen=True)
class FigureKind:
    """draw(study, entry, style) returns a Drawing; check(reader, entry, index) says what one key asks of another."""
    draw: Callable
    needs: dict
    takes: dict
    check: Callable


FIGURE_KINDS = {}  # by the name that a study calls it


def figure_kind(name, needs=None, takes=None, check=lambda reader, entry, index: None):
    """Declares the decorated function as the kind `name` of figures, with the keys that it needs and further ones, and their types."""
    def add(draw):
        FIGURE_KINDS[name] = FigureKind(draw, needs or {}, takes or {}, check)
        return draw
    return add


def _check_list(reader, entry, key, kinds, words, index):
    values = entry[key] if isinstance(entry.get(key), list) else []
    if any(not isinstance(v, kinds) or isinstance(v, bool) for v in values) or entry.get(key) == []:
        reader.fail(f"'{key}' in [[figure]] number {index + 1} must hold {words}", key, "figure", index)


def _check_lists(reader, entry, index):
    _check_list(reader, entry, "snapshot", int, "whole numbers", index)
    _check_list(reader, entry, "curves", TEXT, "names of [[report.curve]]", index)
    _check_list(reader, entry, "levels", TEXT + NUMBER, "numbers or names of report.reference", index)


def read_figures(reader, columns):
    """The [[figure]]s, whose runs are chosen and told apart by columns."""
    figures = []
    for index, entry in reader.tables("figure"):
        if "kind" not in entry:
            reader.fail(f"[[figure]] number {index + 1} lacks the key 'kind'", "figure")
        reader.choice(entry["kind"], FIGURE_KINDS, "kind", "figure", index)
        kind = FIGURE_KINDS[entry["kind"]]
        reader.check(entry, FIGURE_KEYS | kind.needs | kind.takes, "figure", index)
        reader.need(entry, kind.needs, "figure", index, f"the kind '{entry['kind']}'")
        if "width" in entry:
            reader.choice(entry["width"], WIDTHS, "width", "figure", index)
        _check_lists(reader, entry, index)
        kind.check(reader, entry, index)
        series = entry.get("series", ["variant"])
        series = [series] if isinstance(series, str) else series
        for key in series:
            if key not in columns:
                reader.fail(f"unknown key '{key}' in 'series' of [[figure]] number {index + 1}{did_you_mean(key, columns)}",
                            "series", "figure", index)
        figures.append({**entry, "series": series, "where": reader.where(entry, "figure", index, columns)})
    return figures
