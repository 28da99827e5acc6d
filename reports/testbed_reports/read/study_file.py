"""The study file: strict reading of its keys; its axes become combinations."""
import re
from dataclasses import dataclass, field
from pathlib import Path

from .combinations import expand_axes
from .figure_tables import read_figures
from .number_tables import check_texts, read_claims, read_numbers
from .study_reader import FLAG, LIST, NUMBER, TABLE, TEXT, Reader, StudyError
from .spelling import did_you_mean
from .values import flatten, matches, same, toml_value  # noqa: F401 (offered here to others)

STUDY_KEYS = {"title": TEXT, "purpose": TEXT, "scene": TEXT, "repeats": (int,), "threads": (int,), "set": TABLE,
              "axes": TABLE, "exclude": LIST, "override": LIST, "case": LIST, "failure": LIST, "remedy": LIST, "target": LIST, "figure": LIST,
              "number": LIST, "claim": LIST}
CASE_KEYS = {"name": TEXT, "title": TEXT, "scene": TEXT, "purpose": TEXT, "parameter": TEXT, "set": TABLE, "axes": TABLE,
             "exclude": LIST, "override": LIST, "bound": LIST, "condition": FLAG}
BOUND_KEYS = {"quantity": TEXT, "norm": TEXT, "min": NUMBER, "max": NUMBER, "failed": NUMBER, "where": TABLE, "source": TEXT}
FAILURE_KEYS = {"name": TEXT, "title": TEXT, "text": TEXT, "where": TABLE, "component": TEXT, "snapshot": (int,), "range": LIST}
REMEDY_KEYS = {"failure": TEXT, "label": TEXT, "without": TABLE, "with": TABLE}

# What a `where` may choose runs by, besides the axes of the study.
COLUMNS = ("case", "method", "variant", "L", "ppc", "dt", "seed", "repeat", "bracket")

TARGET_KEYS = {"label": TEXT, "quantity": TEXT, "norm": TEXT, "where": TABLE, "kind": TEXT, "value": NUMBER,
               "low": NUMBER, "high": NUMBER, "L_from": NUMBER, "L_to": NUMBER, "source": TEXT, "known": TEXT}
# kind -> keys that it needs
TARGET_KINDS = {"value_max": ("value",), "value_min": ("value",), "value_between": ("low", "high"),
                "order_min": ("value",), "order_between": ("low", "high"), "not_converging": (),
                "exponent_max": ("value",), "exponent_between": ("low", "high")}


@dataclass
class Case:
    """One [[case]]: `parameter` is the axis whose values are the columns of the stability matrix, `bounds` what makes a run wrong, or, of
    a `condition`, what a search asks for, such as that a slope stands: beyond it nothing is wrong with the run."""
    name: str
    title: str
    scene: str
    purpose: str
    parameter: str
    axes: dict
    bounds: list
    condition: bool = False

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
    numbers: dict = field(default_factory=dict)
    claims: list = field(default_factory=list)

    @property
    def name(self):
        return self.path.stem


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
                          axes, _read_bounds(reader, entry, axes, bounds), entry.get("condition", False)))
        bounds += len(entry["bound"])
        combinations += own
        every.update(axes)
    return combinations, cases, every


def _read_failures(reader, cases, columns):
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
                entry = {**entry, key: reader.where({"where": entry[key]}, table, index, columns)}
            (failures if table == "failure" else remedies).append(entry)
    for index, entry in enumerate(remedies):
        reader.choice(entry["failure"], [f["name"] for f in failures], "failure", "remedy", index)
    return failures, remedies


def _read_targets(reader, columns):
    targets = []
    for index, entry in reader.tables("target"):
        reader.check(entry, TARGET_KEYS, "target", index)
        for key in ("label", "quantity", "kind"):
            if key not in entry:
                reader.fail(f"[[target]] number {index + 1} lacks the key '{key}'", "target")
        reader.choice(entry["kind"], TARGET_KINDS, "kind", "target", index)
        reader.need(entry, TARGET_KINDS[entry["kind"]], "target", index, f"the kind '{entry['kind']}'")
        for key in {"value", "low", "high"} & set(entry) - set(TARGET_KINDS[entry["kind"]]):
            reader.fail(f"'{key}' in [[target]] number {index + 1} means nothing for the kind '{entry['kind']}'",
                        key, "target", index)
        targets.append({**entry, "where": reader.where(entry, "target", index, columns)})
    return targets


def read_study(path, need_scene=True):
    """Reads and checks a study file; raises StudyError. `need_scene` = False for the copy in a study's folder."""
    reader = Reader(path)
    data = reader.data
    reader.check(data, STUDY_KEYS)
    if "title" not in data:
        raise StudyError(f"{path}: lacks the key 'title'")
    scenes = _scenes(reader, data, need_scene)
    for key, least in (("repeats", 1), ("threads", 1)):
        if data.get(key, least) < least:
            reader.fail(f"'{key}' must be at least {least}", key)

    threads = data.get("threads", 1)
    if "case" in data:
        combinations, cases, axes = _read_cases(reader, data, threads, need_scene)
    else:
        combinations, axes = expand_axes(reader, data, scenes, threads)
        cases = []
        searched = next((k for k, v in axes.items() if isinstance(v, dict)), None)
        if searched:
            reader.fail(f"axis '{searched}' can be searched in a [[case]] only, whose bounds say what is sound", searched, "axes")

    columns = set(COLUMNS) | set(axes)
    targets, figures = _read_targets(reader, columns), read_figures(reader, columns)
    failures, remedies = _read_failures(reader, cases, columns)
    numbers, claims = read_numbers(reader, columns), read_claims(reader, columns)
    check_texts(reader, data, numbers)
    return StudyFile(reader.path, data["title"], data.get("purpose", ""), data.get("repeats", 1),
                     combinations, targets, figures, cases, failures, remedies, numbers, claims)
