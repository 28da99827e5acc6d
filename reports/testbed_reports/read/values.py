"""Values of study files: nested tables, TOML syntax, equality, choice."""
import json
import math

NUMBER = (int, float)


def flatten(table, prefix=""):
    """Nested tables as one with dotted keys: `time.cfl = 1` and `"time.cfl" = 1` mean the same."""
    flat = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat.update(flatten(value, f"{prefix}{key}."))
        else:
            flat[prefix + key] = value
    return flat


def toml_value(value):
    """A value in TOML syntax, for `--set key=value`."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else str(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, list):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    raise ValueError(f"a value of type {type(value).__name__} cannot be set")


def same(a, b):
    """Equality of values; numbers to relative 1e-9."""
    numbers = isinstance(a, NUMBER) and isinstance(b, NUMBER) and not isinstance(a, bool) and not isinstance(b, bool)
    return math.isclose(a, b, rel_tol=1e-9) if numbers else a == b


def matches(values, where):
    """Whether `values` satisfies every key of `where`; a list means any of its members."""
    for key, wanted in where.items():
        options = wanted if isinstance(wanted, list) and not isinstance(values.get(key), list) else [wanted]
        has = [values.get(key)] + ([values.get("variant")] if key == "method" else [])
        if not any(same(h, o) for h in has for o in options):
            return False
    return True
