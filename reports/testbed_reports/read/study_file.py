"""The study file: strict reading of its keys; its axes become combinations."""
import re
import tomllib
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from .combinations import expand_axes
from .spelling import did_you_mean
from .values import flatten, matches, same, toml_value  # noqa: F401 (offered here to others)

NUMBER, TEXT, LIST, TABLE, FLAG = (int, float), (str,), (list,), (dict,), (bool,)
TYPE_NAMES = {NUMBER: "a number", TEXT: "a string", LIST: "a list", TABLE: "a table", FLAG: "true or false",
              (int,): "a whole number", (int,) + LIST: "a whole number or a list of such", TEXT + LIST: "a string or a list of strings",
              NUMBER + LIST: "a number or a list of numbers", TEXT + NUMBER: "a string or a number"}

STUDY_KEYS = {"title": TEXT, "purpose": TEXT, "scene": TEXT, "repeats": (int,), "threads": (int,), "set": TABLE,
              "axes": TABLE, "exclude": LIST, "override": LIST, "case": LIST, "failure": LIST, "remedy": LIST, "target": LIST, "figure": LIST}
CASE_KEYS = {"name": TEXT, "title": TEXT, "scene": TEXT, "purpose": TEXT, "parameter": TEXT, "set": TABLE, "axes": TABLE,
             "exclude": LIST, "override": LIST, "bound": LIST}
BOUND_KEYS = {"quantity": TEXT, "norm": TEXT, "min": NUMBER, "max": NUMBER, "failed": NUMBER, "where": TABLE, "source": TEXT}
FAILURE_KEYS = {"name": TEXT, "title": TEXT, "text": TEXT, "where": TABLE, "component": TEXT, "snapshot": (int,), "range": LIST}
REMEDY_KEYS = {"failure": TEXT, "label": TEXT, "without": TABLE, "with": TABLE}

# What a `where` may choose runs by, besides the axes of the study.
COLUMNS = ("case", "method", "variant", "L", "ppc", "dt", "seed", "repeat", "bracket")

TARGET_KEYS = {"label": TEXT, "quantity": TEXT, "norm": TEXT, "where": TABLE, "kind": TEXT, "value": NUMBER,
               "low": NUMBER, "high": NUMBER, "L_from": NUMBER, "L_to": NUMBER, "source": TEXT}
# kind -> keys that it needs
TARGET_KINDS = {"value_max": ("value",), "value_min": ("value",), "value_between": ("low", "high"),
                "order_min": ("value",), "order_between": ("low", "high"), "not_converging": (),
                "exponent_max": ("value",), "exponent_between": ("low", "high")}

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


class StudyError(Exception):
    """A study file that cannot be used; the message names the file, the line and the key."""


@dataclass
class Case:
    """One [[case]]: `parameter` is the axis whose values are the columns of the stability matrix, `bounds` what makes a run wrong."""
    name: str
    title: str
    scene: str
    purpose: str
    parameter: str
    axes: dict
    bounds: list

    @property
    def axis_keys(self):
        return list(self.axes)


@dataclass
class StudyFile:
    """A checked study file."""
    path: Path
    title: str
    purpose: str
    repeats: int
    combinations: list
    targets: list = field(default_factory=list)
    figures: list = field(default_factory=list)
    cases: list = field(default_factory=list)
    failures: list = field(default_factory=list)
    remedies: list = field(default_factory=list)

    @property
    def name(self):
        return self.path.stem


_HEADER = re.compile(r"^\s*\[\[?\s*([\w.\"' -]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"^\s*([\w.\"'-]+?)\s*=")


def line_of(text, key, table="", index=0):
    """Line (from 1) on which `key` is set in the index-th `table`, None when it is not found."""
    current, seen = "", Counter()
    for number, line in enumerate(text.splitlines(), 1):
        header = _HEADER.match(line)
        if header:
            current = header.group(1)
            seen[current] += 1
            if not table and current.strip("\"'") == key:
                return number
            continue
        match = _KEY.match(line)
        if match and match.group(1).strip("\"'") == key and current == table and max(seen[current] - 1, 0) == index:
            return number
    inline = re.compile(r"(^|[{,\s])[\"']?" + re.escape(key) + r"[\"']?\s*=")
    for number, line in enumerate(text.splitlines(), 1):
        if inline.search(line):
            return number
    return None


class _Reader:
    """Checks one file, with messages that carry the line."""

    def __init__(self, path):
        self.path = Path(path)
        try:
            self.text = self.path.read_text(encoding="utf-8")
            self.data = tomllib.loads(self.text)
        except (OSError, UnicodeDecodeError) as error:
            raise StudyError(f"{path}: cannot be read: {error}") from error
        except tomllib.TOMLDecodeError as error:
            raise StudyError(f"{path}: {error}") from error

    def fail(self, message, key, table="", index=0):
        line = line_of(self.text, key, table, index)
        where = f"{self.path}:{line}" if line else f"{self.path}"
        raise StudyError(f"{where}: {message}")

    def check(self, data, keys, table="", index=0):
        """Only known keys, of the right type."""
        place = f" in [[{table}]] number {index + 1}" if table else ""
        for key, value in data.items():
            if key not in keys:
                self.fail(f"unknown key '{key}'{place}{did_you_mean(key, keys)}", key, table, index)
            types = keys[key]
            if not isinstance(value, types) or (isinstance(value, bool) and bool not in types):
                self.fail(f"'{key}'{place} must be {TYPE_NAMES.get(types, 'of another type')}, not {value!r}",
                          key, table, index)

    def need(self, data, keys, table, index, what):
        for key in keys:
            if key not in data:
                self.fail(f"{what} in [[{table}]] number {index + 1} lacks the key '{key}'", "kind", table, index)

    def choice(self, value, known, key, table, index):
        if value not in known:
            self.fail(f"unknown {key} '{value}' in [[{table}]] number {index + 1}{did_you_mean(value, known)}",
                      key, table, index)

    def tables(self, name, block=None):
        """(index, table) of [[name]] in the file, or in a block of it."""
        for index, entry in enumerate((self.data if block is None else block).get(name, [])):
            if not isinstance(entry, dict):
                self.fail(f"'{name}' must be tables: [[{name}]]", name)
            yield index, entry


def _scenes(reader, data, need_scene):
    """The scenes of the study; none where its cases name them."""
    scenes = data.get("axes", {}).get("scene", [data["scene"]] if "scene" in data else [])
    if "case" in data and scenes:
        reader.fail("'scene' is given, and [[case]]s name theirs, too", "scene")
    if not scenes and "case" not in data:
        raise StudyError(f"{reader.path}: lacks the key 'scene' (or an axis 'scene')")
    if "scene" in data and "scene" in data.get("axes", {}):
        reader.fail("'scene' is given and is an axis, too", "scene")
    for name in scenes if isinstance(scenes, list) else []:
        if not isinstance(name, str) or need_scene and not (reader.path.parent / name).is_file():
            reader.fail(f"'scene': no such file: {name}", "scene", "" if "scene" in data else "axes")
    return scenes


def _read_bounds(reader, case, axes, counted):
    bounds = []
    for index, entry in reader.tables("bound", case):
        number = counted + index
        reader.check(entry, BOUND_KEYS, "case.bound", number)
        if "quantity" not in entry or not {"min", "max"} & set(entry):
            reader.fail(f"[[case.bound]] number {number + 1} needs 'quantity' and 'min' or 'max'", "bound", "case.bound", number)
        where = flatten(entry.get("where", {}))
        for key in where:
            if key not in set(COLUMNS) | set(axes):
                reader.fail(f"unknown key '{key}' in 'where' of [[case.bound]] number {number + 1}{did_you_mean(key, axes)}", key,
                            "case.bound", number)
        bounds.append({**entry, "where": where})
    return bounds


def _read_cases(reader, data, threads, need_scene):
    """(combinations, cases, axes of all) of a study of [[case]]s, which share its [axes] and [set]."""
    for key in ("exclude", "override"):
        if key in data:
            reader.fail(f"[[{key}]] belongs to a case here: [[case.{key}]]", key)
    common_axes, common_sets = flatten(data.get("axes", {})), flatten(data.get("set", {}))
    combinations, cases, every, bounds = [], [], {}, 0
    for index, entry in reader.tables("case"):
        reader.check(entry, CASE_KEYS, "case", index)
        reader.need(entry, ("name", "scene", "parameter", "bound"), "case", index, "the case")
        name = entry["name"]
        if not re.fullmatch(r"\w+", name) or any(case.name == name for case in cases):
            reader.fail(f"'name' in [[case]] number {index + 1} must be a word of its own, not '{name}'", "name", "case", index)
        if need_scene and not (reader.path.parent / entry["scene"]).is_file():
            reader.fail(f"'scene': no such file: {entry['scene']}", "scene", "case", index)
        own, axes = expand_axes(reader, entry, [entry["scene"]], threads, name, common_axes, common_sets)
        if entry["parameter"] not in axes:
            reader.fail(f"'parameter' of case '{name}' is not an axis{did_you_mean(entry['parameter'], axes)}", "parameter", "case", index)
        cases.append(Case(name, entry.get("title", name.replace("_", " ")), entry["scene"], entry.get("purpose", ""), entry["parameter"],
                          axes, _read_bounds(reader, entry, axes, bounds)))
        bounds += len(entry["bound"])
        combinations += own
        every.update(axes)
    return combinations, cases, every


def _read_failures(reader, cases, check_where):
    """([[failure]] classes, [[remedy]] tables) of a study of cases."""
    failures, remedies = [], []
    for table, keys, needed in (("failure", FAILURE_KEYS, ("name", "title", "text", "where", "component")),
                                ("remedy", REMEDY_KEYS, ("failure", "label", "without", "with"))):
        for index, entry in reader.tables(table):
            if not cases:
                reader.fail(f"[[{table}]] belongs to a study of [[case]]s", table)
            reader.check(entry, keys, table, index)
            reader.need(entry, needed, table, index, f"the {table}")
            for key in {"where", "without", "with"} & set(entry):
                entry = {**entry, key: check_where({"where": entry[key]}, table, index)}
            (failures if table == "failure" else remedies).append(entry)
    for index, entry in enumerate(remedies):
        reader.choice(entry["failure"], [f["name"] for f in failures], "failure", "remedy", index)
    return failures, remedies


def read_study(path, need_scene=True):
    """Reads and checks a study file; raises StudyError. `need_scene` = False for the copy in a study's folder."""
    reader = _Reader(path)
    data, fail = reader.data, reader.fail
    reader.check(data, STUDY_KEYS)
    if "title" not in data:
        raise StudyError(f"{path}: lacks the key 'title'")
    scenes = _scenes(reader, data, need_scene)
    for key, least in (("repeats", 1), ("threads", 1)):
        if data.get(key, least) < least:
            fail(f"'{key}' must be at least {least}", key)

    threads = data.get("threads", 1)
    if "case" in data:
        combinations, cases, axes = _read_cases(reader, data, threads, need_scene)
    else:
        combinations, axes = expand_axes(reader, data, scenes, threads)
        cases = []
        searched = next((k for k, v in axes.items() if isinstance(v, dict)), None)
        if searched:
            fail(f"axis '{searched}' can be searched in a [[case]] only, whose bounds say what is sound", searched, "axes")

    columns = set(COLUMNS) | set(axes)

    def check_where(entry, table, index):
        where = flatten(entry.get("where", {}))
        for key in where:
            if key not in columns:
                fail(f"unknown key '{key}' in 'where' of [[{table}]] number {index + 1}{did_you_mean(key, columns)}",
                     key, table, index)
        return where

    def check_list(entry, key, kinds, words, index):
        values = entry[key] if isinstance(entry.get(key), list) else []
        if any(not isinstance(v, kinds) or isinstance(v, bool) for v in values) or entry.get(key) == []:
            fail(f"'{key}' in [[figure]] number {index + 1} must hold {words}", key, "figure", index)

    def check_figure(entry, index):
        """What one key asks of another."""
        if entry["kind"] == "work_precision":
            axes = (entry.get("x", "solve_s"), entry.get("y", "error"))
            if axes not in (("solve_s", "error"), ("dofs", "error"), ("dofs", "solve_s")):
                fail(f"'x' and 'y' in [[figure]] number {index + 1} must be solve_s and error, dofs and error, or dofs and solve_s",
                     "x" if "x" in entry else "y", "figure", index)
            if entry.get("exact") == 0:
                fail(f"'exact' in [[figure]] number {index + 1} must not be zero: errors are relative to it", "exact", "figure", index)
        check_list(entry, "snapshot", int, "whole numbers", index)
        check_list(entry, "curves", TEXT, "names of [[report.curve]]", index)
        check_list(entry, "levels", TEXT + NUMBER, "numbers or names of report.reference", index)
        if entry["kind"] == "field":
            if ("component" in entry) == entry.get("deformed_grid", False):
                fail(f"[[figure]] number {index + 1} needs either the key 'component' or 'deformed_grid = true'",
                     "kind", "figure", index)
            for key in {"pattern", "spacing"} & set(entry) if "component" in entry else ():
                fail(f"'{key}' in [[figure]] number {index + 1} means nothing without 'deformed_grid = true'", key, "figure", index)
            reader.choice(entry.get("pattern", PATTERNS[0]), PATTERNS, "pattern", "figure", index)
            if entry.get("spacing", 1) <= 0:
                fail(f"'spacing' in [[figure]] number {index + 1} must be positive", "spacing", "figure", index)
        for side in ("x", "y"):
            if f"{side}_support" in entry and f"{side}_probe" in entry:
                fail(f"[[figure]] number {index + 1} takes '{side}' from a support or a probe, not both", f"{side}_probe",
                     "figure", index)
        if "support" in entry and "probe" in entry:
            fail(f"[[figure]] number {index + 1} takes its quantity from a support or a probe, not both", "probe", "figure", index)

    targets, figures = [], []
    for index, entry in reader.tables("target"):
        reader.check(entry, TARGET_KEYS, "target", index)
        for key in ("label", "quantity", "kind"):
            if key not in entry:
                fail(f"[[target]] number {index + 1} lacks the key '{key}'", "target")
        reader.choice(entry["kind"], TARGET_KINDS, "kind", "target", index)
        reader.need(entry, TARGET_KINDS[entry["kind"]], "target", index, f"the kind '{entry['kind']}'")
        for key in {"value", "low", "high"} & set(entry) - set(TARGET_KINDS[entry["kind"]]):
            fail(f"'{key}' in [[target]] number {index + 1} means nothing for the kind '{entry['kind']}'",
                 key, "target", index)
        targets.append({**entry, "where": check_where(entry, "target", index)})
    for index, entry in reader.tables("figure"):
        if "kind" not in entry:
            fail(f"[[figure]] number {index + 1} lacks the key 'kind'", "figure")
        reader.choice(entry["kind"], FIGURE_KINDS, "kind", "figure", index)
        needed, further = FIGURE_KINDS[entry["kind"]]
        reader.check(entry, FIGURE_KEYS | needed | further, "figure", index)
        reader.need(entry, needed, "figure", index, f"the kind '{entry['kind']}'")
        if "width" in entry:
            reader.choice(entry["width"], WIDTHS, "width", "figure", index)
        check_figure(entry, index)
        series = entry.get("series", ["variant"])
        series = [series] if isinstance(series, str) else series
        for key in series:
            if key not in columns:
                fail(f"unknown key '{key}' in 'series' of [[figure]] number {index + 1}{did_you_mean(key, columns)}",
                     "series", "figure", index)
        figures.append({**entry, "series": series, "where": check_where(entry, "figure", index)})

    failures, remedies = _read_failures(reader, cases, check_where)
    return StudyFile(reader.path, data["title"], data.get("purpose", ""), data.get("repeats", 1),
                     combinations, targets, figures, cases, failures, remedies)
