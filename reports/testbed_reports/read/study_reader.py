"""A study file with the checks that all of its tables share, and messages that carry the line."""
import re
import tomllib
from collections import Counter
from pathlib import Path

from .spelling import did_you_mean
from .values import flatten

NUMBER, WHOLE, TEXT, LIST, TABLE, FLAG = (int, float), (int,), (str,), (list,), (dict,), (bool,)
TYPE_NAMES = {NUMBER: "a number", TEXT: "a string", LIST: "a list", TABLE: "a table", FLAG: "true or false",
              WHOLE: "a whole number", WHOLE + LIST: "a whole number or a list of such", TEXT + LIST: "a string or a list of strings",
              NUMBER + LIST: "a number or a list of numbers", TEXT + NUMBER: "a string or a number"}


class StudyError(Exception):
    """A study file that cannot be used; the message names the file, the line and the key."""


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


class Reader:
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

    def where(self, entry, table, index, columns):
        """The `where` of a table, with dotted keys; it chooses by known columns."""
        where = flatten(entry.get("where", {}))
        for key in where:
            if key not in columns:
                self.fail(f"unknown key '{key}' in 'where' of [[{table}]] number {index + 1}{did_you_mean(key, columns)}",
                          key, table, index)
        return where

    def tables(self, name, block=None):
        """(index, table) of [[name]] in the file, or in a block of it."""
        for index, entry in enumerate((self.data if block is None else block).get(name, [])):
            if not isinstance(entry, dict):
                self.fail(f"'{name}' must be tables: [[{name}]]", name)
            yield index, entry
