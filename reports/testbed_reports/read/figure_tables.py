"""The [[figure]] tables of a study file."""
from .study_reader import FLAG, LIST, NUMBER, TABLE, TEXT
from .spelling import did_you_mean

FIGURE_KEYS = {"kind": TEXT, "name": TEXT, "title": TEXT, "caption": TEXT, "where": TABLE, "width": TEXT,
               "series": TEXT + LIST, "paper": TEXT, "shows": TEXT}
# kind -> (keys that it needs, further keys)
FIGURE_KINDS = {
    "convergence": ({"quantity": TEXT}, {"norm": TEXT, "x": TEXT, "orders": LIST, "L_from": NUMBER, "L_to": NUMBER}),
    "power_law": ({"quantity": TEXT}, {"norm": TEXT, "L_from": NUMBER, "L_to": NUMBER}),
    "work_precision": ({"quantity": TEXT}, {"norm": TEXT, "x": TEXT, "y": TEXT, "exact": NUMBER}),
    "profile": ({"component": TEXT}, {"along": TEXT, "panels": TEXT, "L": NUMBER + LIST, "band": LIST,
                                      "snapshot": (int,)}),
    "field": ({}, {"component": TEXT, "L": NUMBER, "range": LIST, "error": FLAG, "columns": (int,), "snapshot": (int,) + LIST,
                   "inclusions": FLAG, "curves": LIST, "deformed_grid": FLAG, "pattern": TEXT, "spacing": NUMBER}),
    "curve": ({"x": TEXT, "y": TEXT}, {f"{key}{side}": kind for side in ("x", "y") for key, kind in (
        ("offset_", TEXT + NUMBER), ("scale_", TEXT + NUMBER))} | {
        f"{side}_{key}": TEXT for side in ("x", "y") for key in ("support", "probe", "label", "unit")} | {
        "L": NUMBER + LIST, "levels": LIST}),
    "history": ({"quantity": TEXT}, {"probe": TEXT, "support": TEXT, "L": NUMBER + LIST, "scale_x": TEXT + NUMBER,
                                     "scale_y": TEXT + NUMBER, "log": FLAG, "t_max": NUMBER}),
    "bars": ({"quantity": TEXT}, {"norm": TEXT, "L": NUMBER, "log": FLAG}),
    "stability_matrix": ({}, {}),
}
WIDTHS = ("column", "page")
PATTERNS = ("checker", "strata")


def _check_list(reader, entry, key, kinds, words, index):
    values = entry[key] if isinstance(entry.get(key), list) else []
    if any(not isinstance(v, kinds) or isinstance(v, bool) for v in values) or entry.get(key) == []:
        reader.fail(f"'{key}' in [[figure]] number {index + 1} must hold {words}", key, "figure", index)


def _check_work_precision(reader, entry, index):
    axes = (entry.get("x", "solve_s"), entry.get("y", "error"))
    if axes not in (("solve_s", "error"), ("dofs", "error"), ("dofs", "solve_s")):
        reader.fail(f"'x' and 'y' in [[figure]] number {index + 1} must be solve_s and error, dofs and error, or dofs and solve_s",
                    "x" if "x" in entry else "y", "figure", index)
    if entry.get("exact") == 0:
        reader.fail(f"'exact' in [[figure]] number {index + 1} must not be zero: errors are relative to it", "exact", "figure", index)


def _check_field(reader, entry, index):
    if ("component" in entry) == entry.get("deformed_grid", False):
        reader.fail(f"[[figure]] number {index + 1} needs either the key 'component' or 'deformed_grid = true'",
                    "kind", "figure", index)
    for key in {"pattern", "spacing"} & set(entry) if "component" in entry else ():
        reader.fail(f"'{key}' in [[figure]] number {index + 1} means nothing without 'deformed_grid = true'", key, "figure", index)
    reader.choice(entry.get("pattern", PATTERNS[0]), PATTERNS, "pattern", "figure", index)
    if entry.get("spacing", 1) <= 0:
        reader.fail(f"'spacing' in [[figure]] number {index + 1} must be positive", "spacing", "figure", index)


def _check_recorders(reader, entry, index):
    """A history is that of a support or of a probe."""
    for side in ("x", "y"):
        if f"{side}_support" in entry and f"{side}_probe" in entry:
            reader.fail(f"[[figure]] number {index + 1} takes '{side}' from a support or a probe, not both", f"{side}_probe",
                        "figure", index)
    if "support" in entry and "probe" in entry:
        reader.fail(f"[[figure]] number {index + 1} takes its quantity from a support or a probe, not both", "probe", "figure", index)


def _check_figure(reader, entry, index):
    """What one key asks of another."""
    if entry["kind"] == "work_precision":
        _check_work_precision(reader, entry, index)
    _check_list(reader, entry, "snapshot", int, "whole numbers", index)
    _check_list(reader, entry, "curves", TEXT, "names of [[report.curve]]", index)
    _check_list(reader, entry, "levels", TEXT + NUMBER, "numbers or names of report.reference", index)
    if entry["kind"] == "field":
        _check_field(reader, entry, index)
    _check_recorders(reader, entry, index)


def read_figures(reader, columns):
    """The [[figure]]s, whose runs are chosen and told apart by columns."""
    figures = []
    for index, entry in reader.tables("figure"):
        if "kind" not in entry:
            reader.fail(f"[[figure]] number {index + 1} lacks the key 'kind'", "figure")
        reader.choice(entry["kind"], FIGURE_KINDS, "kind", "figure", index)
        needed, further = FIGURE_KINDS[entry["kind"]]
        reader.check(entry, FIGURE_KEYS | needed | further, "figure", index)
        reader.need(entry, needed, "figure", index, f"the kind '{entry['kind']}'")
        if "width" in entry:
            reader.choice(entry["width"], WIDTHS, "width", "figure", index)
        _check_figure(reader, entry, index)
        series = entry.get("series", ["variant"])
        series = [series] if isinstance(series, str) else series
        for key in series:
            if key not in columns:
                reader.fail(f"unknown key '{key}' in 'series' of [[figure]] number {index + 1}{did_you_mean(key, columns)}",
                            "series", "figure", index)
        figures.append({**entry, "series": series, "where": reader.where(entry, "figure", index, columns)})
    return figures
