"""Reading one result file (docs/file_formats.md), checked, with errors that name the file and what it lacks."""
import math
import tomllib
from pathlib import Path

import h5py
import numpy as np

from .guarded import DamagedError, has_checksum, open_file, plain

FINISHED = ("completed", "diverged", "time_limit")
STATUSES = FINISHED + ("interrupted",)
SECONDS = ("setup_s", "solve_s", "forcing_s", "output_s", "guards_s")
FORMAT, VERSION = "testbed-result", 1

# Columns of a symmetric tensor in a file: the order of XDMF's Tensor6.
TENSOR = {"xx": 0, "xy": 1, "xz": 2, "yy": 3, "yz": 4, "zz": 5}
VECTOR = {"x": 0, "y": 1, "z": 2}


class ResultError(Exception):
    """A result file that cannot be read, or lacks something that was asked of it."""


def _attributes(node):
    return {key: plain(value) for key, value in node.attrs.items()}


def _is_number(value):
    return isinstance(value, (int, float)) and not isinstance(value, bool)


# What the tables of a resolved scene are, as far as they are read: a table, or a list of tables.
SCENE_TABLES = {"grid": dict, "report": dict, "probe": list, "wall": list, "material": list, "body": list}


class Snapshot:
    """One snapshot: `time` [s], `step`, and its fields as arrays whose row n is material point n. `constant`: names of those that stand
    for all snapshots; the first one has them."""

    def __init__(self, result, name, attributes, fields):
        self.result, self.name, self.fields = result, name, fields
        self.time, self.step = attributes.get("time"), attributes.get("step")
        self.constant = str(attributes.get("constant", "")).split()
        self._cache = {}

    def _home(self, field):
        """Name of the snapshot that holds a field: the first one those that do not change; '' when there is none."""
        if field in self.fields:
            return self.name
        first = self.result.snapshots[0]
        return first.name if field in first.constant and field in first.fields else ""

    def __contains__(self, field):
        return self._home(field) != ""

    def __getitem__(self, field):
        """The field as a float array: (N,), (N, 3) or (N, 6)."""
        if field not in self._cache:
            self._cache[field] = self.result.dataset(f"snapshots/{self._home(field) or self.name}/{field}")
        return self._cache[field]

    def unit(self, field):
        return self.result.unit(f"snapshots/{self._home(field) or self.name}/{field}")


class Result:
    """One result file. Attributes are read at once, arrays when asked for.

    `own`: whether the testbed wrote it. `root`, `scene`, `provenance`, `performance`: attributes as dictionaries; `phases`: seconds by phase name;
    `materials`: attributes by material name; `resolved`: the resolved scene, parsed; `snapshots`: by rising number.
    """

    def __init__(self, path):
        self.path = Path(path)
        try:
            self.own = has_checksum(self.path)
            with open_file(self.path) as file:
                self.root = _attributes(file)
                if self.root.get("format") != FORMAT:
                    raise ResultError(f"{self.path}: not a testbed result (attribute 'format')")
                if self.root.get("format_version") != VERSION:
                    raise ResultError(f"{self.path}: format_version {self.root.get('format_version')}, "
                                      f"this program reads {VERSION}")
                for name in ("case", "title", "method", "variant", "kinematics", "status", "reason"):
                    if not isinstance(self.root.get(name, ""), str):
                        raise ResultError(f"{self.path}: the attribute '{name}' is no text")
                for name in ("case", "method", "variant", "status"):
                    if name not in self.root:
                        raise ResultError(f"{self.path}: lacks the attribute '{name}'")
                if self.root["status"] not in STATUSES:
                    raise ResultError(f"{self.path}: unknown status '{self.root['status']}'")
                for name in ("scene", "performance"):
                    if name not in file:
                        raise ResultError(f"{self.path}: lacks the group '/{name}'")
                self.scene = _attributes(file["scene"])
                self.performance = _attributes(file["performance"])
                self.provenance = _attributes(file["provenance"]) if "provenance" in file else {}
                self.phases = _attributes(file["performance/phases"]) if "performance/phases" in file else {}
                self.materials = {name: _attributes(node) for name, node in file.get("materials", {}).items()}
                self.probes = sorted(file["history/probes"]) if "history/probes" in file else []
                self.supports = sorted(file["history/supports"]) if "history/supports" in file else []
                self.histories = [name for name, node in file.get("history", {}).items()
                                  if isinstance(node, h5py.Dataset)]
                self.snapshots = [Snapshot(self, name, _attributes(node), set(node))
                                  for name, node in sorted(file.get("snapshots", {}).items(), key=lambda item: (len(item[0]), item[0]))]
        except ResultError:
            raise
        except DamagedError as error:
            raise ResultError(f"{self.path}: {error}") from error
        except Exception as error:  # h5py raises many kinds for a damaged file
            raise ResultError(f"{self.path}: cannot be read: {error}") from error
        self._check_numbers()
        self.resolved = self._read_scene()

    def _check_numbers(self):
        """What is counted with must be a number."""
        for group, attributes in (("performance", self.performance), ("performance/phases", self.phases)):
            for name, value in attributes.items():
                if not _is_number(value):
                    raise ResultError(f"{self.path}: the attribute '{name}' of /{group} is no number")
        for name in () if self.own else SECONDS:
            if not self.performance.get(name, 0) >= 0:
                raise ResultError(f"{self.path}: the attribute '{name}' of /performance is {self.performance[name]:g}: no seconds")
        threads = self.provenance.get("threads", 1)
        if not _is_number(threads) or not 1 <= threads < math.inf:
            raise ResultError(f"{self.path}: the attribute 'threads' of /provenance is {threads!r}")
        for snapshot in self.snapshots:
            if not _is_number(snapshot.time) or not math.isfinite(snapshot.time):
                raise ResultError(f"{self.path}: snapshot {snapshot.name} has no time")
        for name in ("metrics", "resolved"):
            if not isinstance(self.scene.get(name, ""), str):
                raise ResultError(f"{self.path}: the attribute '{name}' of /scene is no text")
        points = self.scene.get("points_per_cell", 1)
        if not _is_number(points) or not 1 <= points < 1e6:
            raise ResultError(f"{self.path}: the attribute 'points_per_cell' of /scene is {points!r}")
        for material, attributes in self.materials.items():
            for name in ("density", "youngs_modulus", "poissons_ratio", "constrained_modulus"):
                if not _is_number(attributes.get(name, 0)):
                    raise ResultError(f"{self.path}: the attribute '{name}' of material '{material}' is no number")

    def _read_scene(self):
        """The resolved scene, parsed."""
        try:
            scene = tomllib.loads(self.scene.get("resolved", ""))
        except (tomllib.TOMLDecodeError, RecursionError) as error:
            raise ResultError(f"{self.path}: the resolved scene is not TOML: {error}") from error
        report = scene.get("report")
        tables = [(name, kind, scene.get(name, kind())) for name, kind in SCENE_TABLES.items()]
        if isinstance(report, dict):
            tables += [(f"report.{name}", kind, report.get(name, kind())) for name, kind in (("reference", dict), ("curve", list))]
        for name, kind, value in tables:
            if not isinstance(value, kind) or (kind is list and not all(isinstance(v, dict) for v in value)):
                raise ResultError(f"{self.path}: '{name}' of the resolved scene is no {'table' if kind is dict else 'list of tables'}")
        return scene

    # What a run is called in tables.
    case = property(lambda self: self.root["case"])
    method = property(lambda self: self.root["method"])
    variant = property(lambda self: self.root["variant"])
    status = property(lambda self: self.root["status"])
    reason = property(lambda self: self.root.get("reason", ""))
    # What the guards of the run said; files of other codes, and older ones, say nothing.
    suspect = property(lambda self: [line for line in self.root.get("suspect", "").splitlines() if line])
    cause = property(lambda self: self.root.get("cause", ""))
    remedy = property(lambda self: self.root.get("remedy", ""))

    @property
    def soundness(self):
        """'sound', 'suspect: CODE, ...', or '' where the file does not tell."""
        told = self.root.get("soundness", "")
        codes = ", ".join(dict.fromkeys(line.split(":")[0] for line in self.suspect))
        return f"{told}: {codes}" if told == "suspect" and codes else told

    @property
    def finished(self):
        return self.status in FINISHED

    @property
    def cell_size(self):
        """Cell size L [m]."""
        if "cell_size" not in self.scene:
            raise ResultError(f"{self.path}: lacks the attribute 'cell_size' of /scene")
        size = self.scene["cell_size"]
        if not _is_number(size) or not math.isfinite(size) or not size > 0:
            raise ResultError(f"{self.path}: the attribute 'cell_size' of /scene is {size!r}, not a length")
        return float(size)

    @property
    def metrics(self):
        """Metric groups that the scene asks for."""
        return [name.strip() for name in str(self.scene.get("metrics", "")).split(",") if name.strip()]

    @property
    def reference(self):
        """Named numbers of the scene's [report.reference], SI units."""
        table = self.resolved.get("report", {}).get("reference", {})
        numbers = {}
        for key, value in table.items():
            try:
                numbers[key] = float(value)
            except (TypeError, ValueError):
                raise ResultError(f"{self.path}: report.reference.{key} is not a number: {value!r}") from None
        return numbers

    @property
    def curves(self):
        """Reference curves of the scene's [[report.curve]]: name -> (x (K,), y (K,)), SI units."""
        found = {}
        for table in self.resolved.get("report", {}).get("curve", []):
            name = table.get("name", "")
            try:
                x, y = (np.array(table[key], dtype=float) for key in ("x", "y"))
            except (KeyError, TypeError, ValueError):
                raise ResultError(f"{self.path}: [[report.curve]] '{name}' needs lists of numbers x and y") from None
            if x.ndim != 1 or x.shape != y.shape or len(x) < 2:
                raise ResultError(f"{self.path}: [[report.curve]] '{name}' needs x and y of one length, at least 2")
            found[name] = (x, y)
        return found

    @property
    def seed(self):
        """The scene's random seed, '' when it has none."""
        return seed_of(self.resolved)

    def dataset(self, name):
        """A dataset as a float array."""
        try:
            with open_file(self.path) as file:
                if name not in file:
                    raise ResultError(f"{self.path}: lacks /{name}")
                return np.asarray(file[name][()], dtype=float)
        except ResultError:
            raise
        except Exception as error:
            raise ResultError(f"{self.path}: /{name} cannot be read: {error}") from error

    def unit(self, name):
        """The unit of a dataset, '' when it is not given."""
        try:
            with open_file(self.path) as file:
                return str(plain(file[name].attrs.get("unit", ""))) if name in file else ""
        except Exception as error:
            raise ResultError(f"{self.path}: /{name} cannot be read: {error}") from error

    def history(self, name):
        """A global history: (M,) or (M, 3)."""
        return self.dataset(f"history/{name}")

    def probe(self, probe, name):
        """A history of a probe: (M, 3) or (M, 6)."""
        return self.dataset(f"history/probes/{probe}/{name}")

    def support(self, support, name):
        """A history of a support: `reaction` on the soil or `displacement`, (M, 3)."""
        return self.dataset(f"history/supports/{support}/{name}")

    def has(self, name):
        try:
            with open_file(self.path) as file:
                return name in file
        except Exception as error:
            raise ResultError(f"{self.path}: cannot be read: {error}") from error

    @property
    def final(self):
        if not self.snapshots:
            raise ResultError(f"{self.path}: lacks snapshots")
        return self.snapshots[-1]


def seed_of(resolved):
    """The seed of a resolved scene: that of the first material with a random strength, else any; '' when there is none."""
    materials = [m["random"] for m in resolved.get("material", []) if isinstance(m.get("random"), dict)]
    return _find(materials, "seed") if _find(materials, "seed") != "" else _find(resolved, "seed")


def _find(table, key):
    """The first value of `key` anywhere in nested tables, '' when absent."""
    if isinstance(table, dict):
        if key in table and not isinstance(table[key], (dict, list)):
            return table[key]
        table = table.values()
    if isinstance(table, (list, type({}.values()))):
        for value in table:
            found = _find(value, key)
            if found != "":
                return found
    return ""


def is_finished(path):
    """Whether a readable file with its final name and a finished status is there."""
    try:
        return Path(path).is_file() and Result(path).finished
    except ResultError:
        return False
