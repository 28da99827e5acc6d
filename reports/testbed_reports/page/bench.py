"""The measurements of `testbed bench` as a section of the report: tables, rates against size, and exponents of the cost."""
import csv
import math
from pathlib import Path

from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from ..draw.style import WIDTH, frame, legend_below, legend_shape
from ..draw.table import Table
from ..grade.convergence import fit_power
from ..grade.targets import number

FILE = "bench.csv"
NUMBERS = ("points", "cells", "threads", "steps", "seconds_per_step", "fastest_seconds_per_step", "particle_steps_per_second", "bytes_per_point",
           "traffic_bytes_per_point", "triad_bytes_per_second", "share_of_traffic_bound", "setup_seconds")


SCENES = {"elastic": "block", "mohr_coulomb": "cliff"}  # of files that tell the law alone


class BenchError(Exception):
    """A bench.csv that cannot be used; the message names the file."""


def read_bench(path):
    """(comment line, rows as dicts with numbers) of a bench.csv. @raises BenchError"""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    comment = lines[0].lstrip("# ") if lines and lines[0].startswith("#") else ""
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    try:
        return comment, [{**row, **{key: float(row[key]) for key in NUMBERS}, "scene": row.get("scene") or SCENES[row["law"]],
                          "a_cell": int(row.get("points_per_cell") or 4)} for row in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise BenchError(f"{path}: not written by testbed bench: {error!r}") from error


def by(a_cell):
    """Points of a cell, as they stand in it."""
    return f"{a_cell} × {a_cell}"


def rates_table(rows):
    table = [[r["method"], r["scene"].replace("_", " "), by(r["a_cell"]), f"{r['points']:.0f}", f"{r['threads']:.0f}", f"{1e-6 * r['particle_steps_per_second']:.1f}",
              f"{1e-6 * r['points'] / r['fastest_seconds_per_step']:.1f}", f"{r['bytes_per_point']:.0f}", f"{r['traffic_bytes_per_point']:.0f}",
              f"{r['share_of_traffic_bound']:.2f}", number(r["setup_seconds"], 2), r["phases"].replace(": ", " ")] for r in rows]
    bandwidth = {f"{r['threads']:.0f}": 1e-9 * r["triad_bytes_per_second"] for r in rows}
    notes = ["Triad bandwidth: " + ", ".join(f"{v:.1f} GB/s with {k} thread" + ("s" if k != "1" else "") for k, v in bandwidth.items()) + ".",
             "Of bound: bytes that a step must read and write once, times the rate, over the triad bandwidth; above 1 where points stay in a cache. "
             "Median and fastest of ten slices of the run; phases in seconds per step."]
    return Table("rates", "Particle-steps per second", ["method", "scene", "a cell", "points", "threads", "median [10⁶/s]", "fastest [10⁶/s]", "B/point",
                                                       "traffic [B/point]", "of bound", "set-up [s]", "phases"], table, 3, notes)


def cost_table(rows):
    """Exponents of the time per step and of the set-up in the number of points and of cells, one thread. None with fewer than three sizes."""
    table = []
    for method, scene, a_cell in dict.fromkeys((r["method"], r["scene"], r["a_cell"]) for r in rows):
        own = [r for r in rows if (r["method"], r["scene"], r["a_cell"], r["threads"]) == (method, scene, a_cell, 1.0)]
        if len({r["points"] for r in own}) < 3:
            continue
        fits = [fit_power([r[size] for r in own], [r[cost] for r in own]).q for size in ("points", "cells") for cost in ("fastest_seconds_per_step", "setup_seconds")]
        per_point = [1e9 * r["fastest_seconds_per_step"] / r["points"] for r in own]
        table.append([method, scene.replace("_", " "), by(a_cell), *(f"{f.order:.2f} [{f.low:.2f}, {f.high:.2f}]" for f in fits), f"{min(per_point):.1f}–{max(per_point):.1f}"])
    return Table("cost", "Cost against size, one thread", ["method", "scene", "a cell", "step ~ points^q", "set-up ~ points^q", "step ~ cells^q", "set-up ~ cells^q",
                                                           "ns per point-step"], table, 3, ["Fastest of ten slices; 95 % intervals."]) if table else None


def kept_table(rows):
    """What is kept of the rate at 4 x 4 points per cell with fewer, and at the smallest size of that at 1e4 points; one thread. None without such pairs."""
    one = [r for r in rows if r["threads"] == 1.0]
    counts = [c for c in sorted({r["a_cell"] for r in one}) if c < 4]
    rate = {(r["method"], r["scene"], r["a_cell"], _size(r)): 1.0 / r["fastest_seconds_per_step"] * r["points"] for r in one}
    sizes = sorted({size for method, scene, count, size in rate if count < 4 and (method, scene, 4, size) in rate})
    if not sizes:
        return None
    table = []
    for method, scene in dict.fromkeys((r["method"], r["scene"]) for r in one):
        ratio = lambda count, size, of, at: (f"{rate[method, scene, count, size] / rate[method, scene, of, at]:.2f}"  # noqa: E731
                                             if {(method, scene, count, size), (method, scene, of, at)} <= rate.keys() else "")
        cells = [ratio(c, size, 4, size) for c in counts for size in sizes] + [ratio(4, sizes[0], 4, 4)]
        if any(cells):
            table.append([method, scene.replace("_", " "), *cells])
    header = [f"{by(c)}, {_points(size)}" for c in counts for size in sizes] + [f"{by(4)}, {_points(sizes[0])} over {_points(4)}"]
    return Table("kept", "Share of the rate that is kept", ["method", "scene", *header], table, 2,
                 ["Rate over that at 4 × 4 points per cell and as many points; last column: the smallest size over 10000 points. Fastest of ten slices, one thread."]) if table else None


def _size(row):
    """The number of points as a power of ten, to the half."""
    return round(2 * math.log10(row["points"])) / 2


def _points(size):
    return f"{float(f'{10 ** size:.1g}'):g} points"


def rates_figure(rows, style):
    """Rate against points, a panel per scene and points per cell that have several sizes; full lines one thread, thin ones more."""
    sizes = {}
    for r in rows:
        sizes.setdefault((r["scene"], r["a_cell"]), set()).add(r["points"])
    panels = [key for key, points in sizes.items() if len(points) > 1] or list(sizes)
    methods = list(dict.fromkeys(r["method"] for r in rows))
    columns, lines = legend_shape(methods, WIDTH["page"])
    across = min(2, len(panels))
    figure, axes = frame(WIDTH["page"], 2.3, lines, rows=-(-len(panels) // across), columns=across, rails=1, left=0.62, right=0.12, gap=(0.45, 0.62), sharey=True)
    for axis in axes.flat[len(panels):]:
        axis.set_visible(False)
    for axis, (scene, a_cell) in zip(axes.flat, panels):
        for method in methods:
            for threads in sorted({r["threads"] for r in rows}):
                own = sorted((r["points"], 1e-6 * r["points"] / r["fastest_seconds_per_step"]) for r in rows
                             if (r["method"], r["scene"], r["a_cell"], r["threads"]) == (method, scene, a_cell, threads))
                if own:
                    axis.plot(*zip(*own), **{**style.of(method), **({} if threads == 1 else {"linewidth": 0.6, "markersize": 2.5})})
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_title(f"{scene.replace('_', ' ').capitalize()}, {by(a_cell)}", fontsize=8, pad=3)
        axis.yaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel("Points")
    for axis in axes[:, 0]:
        axis.set_ylabel("Particle-steps per second [10⁶/s]")
    legend_below(figure, [Line2D([], [], **style.of(m), label=m) for m in methods], columns)
    return figure


def is_busy(comment):
    """Whether the machine was busy when the measurement began."""
    return comment.endswith("busy")

