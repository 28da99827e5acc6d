"""The measurements of `testbed bench` as a section of the report: tables, rates against size, and exponents of the cost."""
import csv
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


class BenchError(Exception):
    """A bench.csv that cannot be used; the message names the file."""


def read_bench(path):
    """(comment line, rows as dicts with numbers) of a bench.csv. @raises BenchError"""
    lines = Path(path).read_text(encoding="utf-8").splitlines()
    comment = lines[0].lstrip("# ") if lines and lines[0].startswith("#") else ""
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    try:
        return comment, [{**row, **{key: float(row[key]) for key in NUMBERS}} for row in rows]
    except (KeyError, TypeError, ValueError) as error:
        raise BenchError(f"{path}: not written by testbed bench: {error!r}") from error


def rates_table(rows):
    table = [[r["method"], r["law"], f"{r['points']:.0f}", f"{r['threads']:.0f}", f"{1e-6 * r['particle_steps_per_second']:.1f}",
              f"{1e-6 * r['points'] / r['fastest_seconds_per_step']:.1f}", f"{r['bytes_per_point']:.0f}", f"{r['traffic_bytes_per_point']:.0f}",
              f"{r['share_of_traffic_bound']:.2f}", number(r["setup_seconds"], 2), r["phases"].replace(": ", " ")] for r in rows]
    bandwidth = {f"{r['threads']:.0f}": 1e-9 * r["triad_bytes_per_second"] for r in rows}
    notes = ["Triad bandwidth: " + ", ".join(f"{v:.1f} GB/s with {k} thread" + ("s" if k != "1" else "") for k, v in bandwidth.items()) + ".",
             "Of bound: bytes that a step must read and write once, times the rate, over the triad bandwidth; above 1 where points stay in a cache. "
             "Median and fastest of ten slices of the run; phases in seconds per step."]
    return Table("rates", "Particle-steps per second", ["method", "law", "points", "threads", "median [10⁶/s]", "fastest [10⁶/s]", "B/point",
                                                       "traffic [B/point]", "of bound", "set-up [s]", "phases"], table, 2, notes)


def cost_table(rows):
    """Exponents of the time per step and of the set-up in the number of points and of cells, one thread. None with fewer than three sizes."""
    table = []
    for method, law in dict.fromkeys((r["method"], r["law"]) for r in rows):
        own = [r for r in rows if (r["method"], r["law"], r["threads"]) == (method, law, 1.0)]
        if len({r["points"] for r in own}) < 3:
            continue
        fits = [fit_power([r[size] for r in own], [r[cost] for r in own]).q for size in ("points", "cells") for cost in ("fastest_seconds_per_step", "setup_seconds")]
        per_point = [1e9 * r["fastest_seconds_per_step"] / r["points"] for r in own]
        table.append([method, law, *(f"{f.order:.2f} [{f.low:.2f}, {f.high:.2f}]" for f in fits), f"{min(per_point):.1f}–{max(per_point):.1f}"])
    return Table("cost", "Cost against size, one thread", ["method", "law", "step ~ points^q", "set-up ~ points^q", "step ~ cells^q", "set-up ~ cells^q",
                                                           "ns per point-step"], table, 2, ["Fastest of ten slices; 95 % intervals."]) if table else None


def rates_figure(rows, style):
    """Rate against points, a panel per law; full lines one thread, thin ones more."""
    laws, methods = list(dict.fromkeys(r["law"] for r in rows)), list(dict.fromkeys(r["method"] for r in rows))
    columns, lines = legend_shape(methods, WIDTH["page"])
    figure, axes = frame(WIDTH["page"], 2.3, lines, columns=len(laws), rails=1, left=0.62, right=0.12, sharey=True)
    for axis, law in zip(axes[0], laws):
        for method in methods:
            for threads in sorted({r["threads"] for r in rows}):
                own = sorted((r["points"], 1e-6 * r["points"] / r["fastest_seconds_per_step"]) for r in rows
                             if (r["method"], r["law"], r["threads"]) == (method, law, threads))
                if own:
                    axis.plot(*zip(*own), **{**style.of(method), **({} if threads == 1 else {"linewidth": 0.6, "markersize": 2.5})})
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_title(law.replace("_", "-").title(), fontsize=8, pad=3)
        axis.yaxis.set_minor_formatter(NullFormatter())
        axis.set_xlabel("Points")
    axes[0, 0].set_ylabel("Particle-steps per second [10⁶/s]")
    legend_below(figure, [Line2D([], [], **style.of(m), label=m) for m in methods], columns)
    return figure


def is_busy(comment):
    """Whether the machine was busy when the measurement began."""
    return comment.endswith("busy")

