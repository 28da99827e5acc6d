"""Results of other codes in a figure of error against run time: measured elsewhere, scaled by rows of this testbed measured beside them."""
import math
from dataclasses import dataclass

import numpy as np
from matplotlib.lines import Line2D

from ..grade.targets import number
from ..read.study_reader import LIST, TEXT

KEYS = {"name": TEXT, "series": TEXT, "error": LIST, "seconds": LIST, "L": LIST}
MARKERS = ("x", "+", "1", "2", "3", "4", "d", "h")


@dataclass
class Peers:
    """`lines`: (name, seconds (K,), errors (K,)) of other codes, scaled by `factor`, which is nan where nothing tells it."""
    lines: list
    factor: float
    notes: list

    @property
    def seconds(self):
        return [t for _, seconds, _ in self.lines for t in seconds]

    @property
    def errors(self):
        return [e for _, _, errors in self.lines for e in errors]

    def handles(self):
        return [Line2D([], [], **_look(k), label=name) for k, (name, _, _) in enumerate(self.lines)]

    def draw(self, axis):
        for k, (_, seconds, errors) in enumerate(self.lines):
            axis.plot(seconds, errors, **_look(k))


def _look(k):
    return {"color": "#A6761D", "linewidth": 0.6, "marker": MARKERS[k % len(MARKERS)], "markersize": 4.5, "linestyle": ("-", (0, (1, 1)))[k // len(MARKERS) % 2], "zorder": 1}


def check_peers(reader, entry, index):
    """[[figure.peer]]: `name`, or `series` of a row of this testbed, with `L`, `error` and `seconds`, lists of one length."""
    for peer in entry.get("peer", []):
        reader.check(peer, KEYS, "figure", index)
        lists = [peer.get(key) for key in ("L", "error", "seconds")]
        if ("name" in peer) == ("series" in peer) or any(not isinstance(v, list) or len(v) != len(lists[0]) or not v for v in lists):
            reader.fail(f"a peer of [[figure]] number {index + 1} needs 'name' or 'series', and lists 'L', 'error' and 'seconds' of one length", "peer", "figure", index)
        if any(isinstance(v, bool) or not isinstance(v, (int, float)) or not v > 0 for values in lists for v in values):
            reader.fail(f"'L', 'error' and 'seconds' of a peer of [[figure]] number {index + 1} must be above zero", "peer", "figure", index)
    if entry.get("peer") and not any("series" in peer for peer in entry["peer"]):
        reader.fail(f"the peers of [[figure]] number {index + 1} lack a row of this testbed ('series'), by which their seconds are scaled", "peer", "figure", index)


def peers_of(entry, series):
    """The peers of a figure whose own costs are `series`, {label: [Cost]}; without lines where no own run is like a row of the testbed in them."""
    given = entry.get("peer", [])
    ratios = [cost.solve_s / seconds for peer in given if "series" in peer for size, seconds in zip(peer["L"], peer["seconds"])
              for cost in series.get(peer["series"], []) if math.isclose(cost.L or 0.0, size, rel_tol=1e-9)]
    if not given:
        return Peers([], math.nan, [])
    if not ratios:
        return Peers([], math.nan, ["Other codes are not shown: no run is like those of this testbed that were measured beside them"])
    factor = float(np.median(ratios))
    lines = [(peer["name"], [factor * t for t in peer["seconds"]], peer["error"]) for peer in given if "name" in peer]
    return Peers(lines, factor, [f"Brown: other codes, measured on another machine; their seconds are scaled by {number(factor, 2)}, the median of what this testbed takes here over what an "
                                 "earlier version took there, so that what it has become faster since counts in their favour"])
