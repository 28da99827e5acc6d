"""An axis that is searched instead of listed: halves a range until the value is bracketed at which runs change their verdict.

The values asked for depend on the verdicts of earlier ones alone, so an interrupted search goes on from the runs on disk.
"""
import math
from dataclasses import dataclass

NEEDED = {"bisect", "until", "tolerance"}
UNTIL = ("sound", "bounded")


@dataclass(frozen=True)
class Bisection:
    """Searches `key` in low..high; a value holds when its run is sound (`until` = "sound"), or bounded ("bounded": sound or
    wrong, but not failed). `tolerance`: width of the last bracket over its larger end."""
    key: str
    low: float
    high: float
    until: str
    tolerance: float

    def holds(self, level):
        return level == "sound" or (self.until == "bounded" and level == "wrong")


def problem_of(table):
    """Why a table is no bisection; '' when it is one."""
    if set(table) != NEEDED:
        return "needs the keys bisect = [low, high], until, tolerance, and no others"
    ends, number = table["bisect"], lambda v: isinstance(v, (int, float)) and not isinstance(v, bool)
    if not (isinstance(ends, list) and len(ends) == 2 and all(map(number, ends)) and ends[0] < ends[1]):
        return "'bisect' must be [low, high] with low < high"
    if table["until"] not in UNTIL:
        return f"'until' must be one of {', '.join(UNTIL)}"
    if not (number(table["tolerance"]) and 1e-9 <= table["tolerance"] < 1):
        return "'tolerance' must lie between 1e-9 and 1"
    return ""


def between(low, high, tolerance):
    """A value between two others: their geometric mean where both are positive, with no more digits than the tolerance asks."""
    middle = math.sqrt(low * high) if low > 0 else 0.5 * (low + high)
    digits = math.ceil(-math.log10(tolerance)) + 2
    short = float(f"{middle:.{digits}g}")
    return short if low < short < high else middle


def bracket(search, held):
    """(low, high) of neighbouring values between which runs change, from `held`: value -> whether it held; None while an end
    is unknown or when both ends agree. Runs that change more than once are bracketed at the first change from below."""
    if search.low not in held or search.high not in held:
        return None
    known = sorted(held)
    return next(((a, b) for a, b in zip(known, known[1:]) if held[a] != held[b]), None)


def next_values(search, held):
    """Values that must run next; empty when the search is over."""
    ends = [v for v in (search.low, search.high) if v not in held]
    if ends:
        return ends
    found = bracket(search, held)
    if found is None or found[1] - found[0] <= search.tolerance * max(map(abs, found)):
        return []
    return [between(*found, search.tolerance)]
