"""The product of the axes of a study, or of one of its cases."""
import itertools
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

from .bisection import Bisection, problem_of
from .spelling import did_you_mean
from .values import flatten, matches, same

# Axes that are not settings of the scene.
NO_SETTING = ("scene", "method", "threads")


@dataclass
class Combination:
    """One member of the product of the axes: what it sets, before repeats. With `bisection` a value of its key is still to be chosen."""
    axes: dict
    sets: dict
    scene: Path
    method: str | None
    threads: int
    case: str = ""
    bisection: Bisection | None = None

    def at(self, value):
        """The combination with a value of the key that is searched."""
        key = self.bisection.key
        return replace(self, axes={**self.axes, key: value}, sets={**self.sets, key: value})


def flat_axes(table, prefix=""):
    """Axes with dotted keys; a table that holds `bisect` is one axis."""
    flat = {}
    for key, value in table.items():
        if isinstance(value, dict) and "bisect" not in value:
            flat.update(flat_axes(value, f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat


def _check_axes(reader, axes, own_sets, place):
    for key, values in axes.items():
        if isinstance(values, dict):
            if key in NO_SETTING or problem_of(values):
                reader.fail(f"axis '{key}' " + (problem_of(values) or "cannot be searched"), key, place + "axes")
            continue
        if not isinstance(values, list) or not values:
            reader.fail(f"axis '{key}' must be a list with at least one value", key, place + "axes")
        if any(same(a, b) for a, b in itertools.combinations(values, 2)):
            reader.fail(f"axis '{key}' holds a value twice", key, place + "axes")
        if key == "method" and not all(isinstance(v, str) for v in values):
            reader.fail("axis 'method' must hold names of variants", key, place + "axes")
        if key in own_sets:
            reader.fail(f"'{key}' is set and is an axis, too", key, place + "set")
    if sum(isinstance(v, dict) for v in axes.values()) > 1:
        reader.fail("only one axis can be searched", "bisect", place + "axes")


def _read_excludes(reader, block, axes, place):
    excludes = []
    for index, entry in reader.tables("exclude", block):
        excludes.append(flatten(entry))
        for key in excludes[-1]:
            if key not in axes or isinstance(axes[key], dict):
                reader.fail(f"'{key}' in [[{place}exclude]] number {index + 1} is not an axis{did_you_mean(key, axes)}",
                            key, place + "exclude", index)
    return excludes


def _read_overrides(reader, block, axes, place):
    overrides, name = [], place + "override"
    for index, entry in reader.tables("override", block):
        reader.check(entry, {"when": (dict,), "set": (dict,)}, name, index)
        for key in ("when", "set"):
            if key not in entry:
                reader.fail(f"[[{name}]] number {index + 1} lacks the key '{key}'", "override")
        when, changes = flatten(entry["when"]), flatten(entry["set"])
        for key in when:
            if key not in axes or isinstance(axes[key], dict):
                reader.fail(f"'{key}' in 'when' of [[{name}]] number {index + 1} is not an axis{did_you_mean(key, axes)}",
                            key, name, index)
        for key in changes:
            if key in axes:
                reader.fail(f"'{key}' in 'set' of [[{name}]] number {index + 1} is an axis", key, name, index)
        overrides.append((when, changes))
    return overrides


def expand_axes(reader, block, scenes, threads, case="", common_axes=None, common_sets=None):
    """(combinations, axes) of a block with the tables axes, set, exclude, override: the study, or one of its [[case]]s, which takes
    over the study's axes and settings and may replace them."""
    place = "case." if case else ""
    own_axes, own_sets = flat_axes(block.get("axes", {})), flatten(block.get("set", {}))
    axes = {k: v for k, v in {**(common_axes or {}), **own_axes}.items() if k not in own_sets or k in own_axes}
    _check_axes(reader, axes, own_sets, place)
    sets = {**{k: v for k, v in (common_sets or {}).items() if k not in axes}, **own_sets}
    excludes, overrides = _read_excludes(reader, block, axes, place), _read_overrides(reader, block, axes, place)
    searched = [Bisection(k, *map(float, v["bisect"]), v["until"], float(v["tolerance"])) for k, v in axes.items() if isinstance(v, dict)]
    listed = {k: v for k, v in axes.items() if isinstance(v, list)}

    combinations, excluded, overridden = [], Counter(), Counter()
    for values in itertools.product(*listed.values()):
        chosen = dict(zip(listed, values))
        out = [i for i, e in enumerate(excludes) if matches(chosen, e)]
        excluded.update(out)
        if out:
            continue
        combined = dict(sets)
        combined.update({k: v for k, v in chosen.items() if k not in NO_SETTING})
        for i, (when, changes) in enumerate(overrides):
            if matches(chosen, when):
                overridden[i] += 1
                combined.update(changes)
        method = combined.pop("method", None)
        own_threads = combined.pop("threads", threads)
        scene = reader.path.parent / chosen.get("scene", scenes[0])
        combinations.append(Combination(chosen, combined, scene, chosen.get("method", method), chosen.get("threads", own_threads),
                                        case, searched[0] if searched else None))
    for i in range(len(excludes)):
        if not excluded[i]:
            reader.fail(f"[[{place}exclude]] number {i + 1}" + (f" of case '{case}'" if case else "") + " excludes nothing",
                        next(iter(excludes[i]), "exclude"), place + "exclude", i)
    for i, (when, _) in enumerate(overrides):
        if not overridden[i]:
            reader.fail(f"[[{place}override]] number {i + 1}" + (f" of case '{case}'" if case else "") + " applies to nothing",
                        next(iter(when), "when"), place + "override", i)
    if not combinations:
        reader.fail("every combination is excluded" + (f" in case '{case}'" if case else ""), "exclude", place + "exclude")
    return combinations, axes
