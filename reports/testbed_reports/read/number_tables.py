"""The [[number]] and [[claim]] tables of a study file: numbers that its words name, and statements of a source that runs can test."""
import math
import re
from string import Formatter

from .values import same
from .study_reader import LIST, NUMBER, TABLE, TEXT, WHOLE

TAKES = ("every", "mean", "median", "min", "max", "order", "exponent")
NUMBER_KEYS = {"name": TEXT, "quantity": TEXT, "norm": TEXT, "where": TABLE, "take": TEXT, "over": TABLE, "scale": NUMBER, "offset": NUMBER,
               "digits": WHOLE}
DEFAULTS = {"norm": "", "where": {}, "take": "every", "scale": 1, "offset": 0, "digits": 3}
CLAIM_KEYS = {"name": TEXT, "words": TEXT, "source": TEXT, "note": TEXT, "test": LIST}
TEST_KEYS = {**{key: types for key, types in NUMBER_KEYS.items() if key != "name"}, "if": TEXT, "min": NUMBER, "max": NUMBER}


def names_in(text):
    """The names in braces of a text; raises ValueError for braces that do not close."""
    return [name for _, name, _, _ in Formatter().parse(text) if name is not None]


def _one(reader, entry, keys, table, index, columns):
    """A number with its defaults, checked."""
    reader.check(entry, keys, table, index)
    reader.need(entry, ("quantity",), table, index, "the number")
    for key, low, high in (("digits", 1, 12), ("scale", -1e300, 1e300), ("offset", -1e300, 1e300), ("min", -1e300, 1e300), ("max", -1e300, 1e300)):
        if key in entry and not low <= entry[key] <= high:
            reader.fail(f"'{key}' in [[{table}]] number {index + 1} must lie in {low:g}..{high:g}", key, table, index)
    if entry.get("min", -math.inf) > entry.get("max", math.inf):
        reader.fail(f"'min' in [[{table}]] number {index + 1} is above 'max'", "min", table, index)
    reader.choice(entry.get("take", "every"), TAKES, "take", table, index)
    for key in {"where", "over"} & set(entry):
        entry = {**entry, key: reader.where({"where": entry[key]}, table, index, columns)}
    if "over" in entry and all(k in entry.get("where", {}) and same(entry["where"][k], v) for k, v in entry["over"].items()):
        reader.fail(f"'over' in [[{table}]] number {index + 1} chooses the same runs: name a key and another value", "over", table, index)
    return {**DEFAULTS, **entry}


def read_numbers(reader, columns):
    """{name: number} of the [[number]]s."""
    found = {}
    for index, entry in reader.tables("number"):
        reader.need(entry, ("name",), "number", index, "the number")
        if not re.fullmatch(r"[A-Za-z]\w*", str(entry["name"])) or entry["name"] in found:
            reader.fail(f"'name' in [[number]] number {index + 1} must be a word of its own, not '{entry['name']}'", "name", "number", index)
        found[entry["name"]] = _one(reader, entry, NUMBER_KEYS, "number", index, columns)
    return found


def read_claims(reader, columns):
    """The [[claim]]s with their tests: numbers with `min`, `max`, and `if`, the condition under which the test looks at the claim."""
    found, counted = [], 0
    for index, entry in reader.tables("claim"):
        reader.check(entry, CLAIM_KEYS, "claim", index)
        reader.need(entry, ("name", "words", "source"), "claim", index, "the claim")
        if not entry["name"].strip():
            reader.fail(f"'name' in [[claim]] number {index + 1} is empty", "name", "claim", index)
        tests = []
        for k, test in reader.tables("test", entry):
            number = counted + k
            if not {"min", "max"} & set(test) or "if" not in test:
                reader.fail(f"[[claim.test]] number {number + 1} needs 'if' and 'min' or 'max'", "quantity", "claim.test", number)
            tests.append(_one(reader, test, TEST_KEYS, "claim.test", number, columns))
        if not tests and "note" not in entry:
            reader.fail(f"[[claim]] number {index + 1} has no [[claim.test]]: its 'note' must say why", "name", "claim", index)
        counted += len(tests)
        found.append({"note": "", **entry, "test": tests})
    return found


def check_texts(reader, data, numbers):
    """Every name in braces is that of a [[number]]; what a picture shows has no other number in it."""
    texts = [("", 0, "purpose", data)] + [("figure", k, key, figure) for k, figure in enumerate(data.get("figure", [])) for key in ("caption", "shows")]
    texts += [("claim", k, "note", claim) for k, claim in enumerate(data.get("claim", []))]
    for table, index, key, entry in texts:
        text, place = entry.get(key, ""), f"'{key}'" + (f" in [[{table}]] number {index + 1}" if table else "")
        try:
            names = names_in(text)
        except ValueError as error:
            reader.fail(f"{place}: {error}; a brace of its own is written twice", key, table, index)
        for name in names:
            if name not in numbers:
                reader.fail(f"{place} names the number '{name}', which no [[number]] defines", key, table, index)
