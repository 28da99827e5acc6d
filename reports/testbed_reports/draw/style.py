"""How figures look: one colour, marker and line per variant everywhere, readable in grey; 8 pt at print size."""
import itertools
import math

import matplotlib

matplotlib.use("Agg")
import numpy as np  # noqa: E402
from matplotlib import pyplot as plt  # noqa: E402

WIDTH = {"column": 3.4, "page": 7.0}  # inches
# Okabe and Ito's palette without its yellow, which is lost on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00", "#000000", "#7F7F7F")
MARKERS = ("o", "s", "^", "D", "v", "P", "<", "p", ">", "*")
LINES = ("-", "--", "-.", (0, (1, 1)), (0, (5, 1, 1, 1, 1, 1)))
# Variants that keep their look in every report, whatever else is in it; others follow.
KNOWN = ("lpfdm", "mpm-linear", "mpm-cpgimp", "fem-q2", "lpfdm-2000", "mpm-linear-bbar", "fem-q1", "mpm-bspline")
EXACT = {"color": "black", "linestyle": "-", "linewidth": 1.6, "alpha": 0.35, "label": "exact"}
RAIL = "0.45"

RC = {"font.size": 8, "font.family": "DejaVu Sans", "axes.labelsize": 8, "axes.titlesize": 8, "xtick.labelsize": 7,
      "ytick.labelsize": 7, "legend.fontsize": 7, "axes.linewidth": 0.6, "lines.linewidth": 1.1,
      "lines.markersize": 4, "xtick.direction": "in", "ytick.direction": "in", "xtick.major.width": 0.6,
      "ytick.major.width": 0.6, "xtick.minor.width": 0.4, "ytick.minor.width": 0.4, "axes.spines.top": False,
      "axes.spines.right": False, "legend.frameon": False, "mathtext.fontset": "dejavusans", "svg.fonttype": "path",
      "pdf.fonttype": 42, "svg.hashsalt": "testbed", "axes.axisbelow": True}


def gid_of(label):
    """The name of a series in a picture, by which a page finds its lines."""
    return f"series:{label}"


class Style:
    """Gives each label its colour, marker and line; the set of labels decides, so give all of a report at once."""

    def __init__(self, labels):
        self.labels = sorted(set(labels), key=_family_order)
        self.slots = {label: KNOWN.index(label) for label in self.labels if label in KNOWN}
        free = (k for k in itertools.count() if k not in set(self.slots.values()))
        self.slots.update({label: k for label, k in zip((v for v in self.labels if v not in KNOWN), free)})
        self.begin_figure()

    def begin_figure(self):
        """A variant with one setting looks in each figure as it does without."""
        self.kinds = {}  # of a variant: its labels with further settings, in the order in which they were asked for

    def slot(self, label):
        variant = str(label).split(",")[0]  # "lpfdm, ppc = 2" looks like lpfdm
        if variant in self.slots:
            return self.slots[variant]
        return self.slots.setdefault(label, max(self.slots.values(), default=-1) + 1)

    def rank(self, label):
        """Place of a label in legends."""
        variant = str(label).split(",")[0]
        return (self.labels.index(variant) if variant in self.labels else len(self.labels), str(label))

    def colour(self, label):
        return COLOURS[self.slot(label) % len(COLOURS)]

    def marker(self, label):
        return MARKERS[(self.slot(label) + 3 * self.kind(label)) % len(MARKERS)]

    def line(self, label):
        return LINES[(self.slot(label) + self.kind(label)) % len(LINES)]

    def kind(self, label):
        """Which of the labels of a variant this is: they share its colour, not its marker and line."""
        labels = self.kinds.setdefault(str(label).split(",")[0], [])
        if "," in str(label) and label not in labels:
            labels.append(label)
        return labels.index(label) if label in labels else 0

    def of(self, label):
        return {"color": self.colour(label), "marker": self.marker(label), "linestyle": self.line(label),
                "markerfacecolor": "white" if (self.slot(label) + self.kind(label)) % 2 else self.colour(label), "markeredgewidth": 0.9,
                "gid": gid_of(label)}


def _family_order(label):
    families = ("lpfdm", "mpm", "fem")
    family = str(label).split("-")[0]
    return (families.index(family) if family in families else len(families), str(label))


def frame(width, height, legend_rows=0, rows=1, columns=1, rails=0, left=0.55, right=0.08, gap=(0.45, 0.42), **kwargs):
    """A figure with room, in inches, for the axes, `rails` above them and a legend of so many rows below.

    `height` is that of one panel. Returns (figure, array of axes (rows, columns)).
    """
    top, bottom = 0.08 + 0.12 * rails, 0.42 + 0.137 * legend_rows + (0.06 if legend_rows else 0)
    total = rows * height + (rows - 1) * gap[1] + top + bottom
    figure = plt.figure(figsize=(width, total))
    panel = (width - left - right - (columns - 1) * gap[0]) / columns
    axes = np.empty((rows, columns), object)
    for r in range(rows):
        for c in range(columns):
            x, y = left + c * (panel + gap[0]), bottom + (rows - 1 - r) * (height + gap[1])
            share = {k: axes[0, 0] for k in ("sharex", "sharey") if kwargs.get(k) and (r or c)}
            axes[r, c] = figure.add_axes([x / width, y / total, panel / width, height / total], **share)
    return figure, axes


def legend_below(figure, handles, columns=1):
    if handles:
        figure.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.01, 0.0), ncol=columns, handlelength=2.8,
                      columnspacing=1.2, borderaxespad=0.3, labelspacing=0.35)


def legend_shape(labels, width):
    """(columns, rows) of a legend that fits the width."""
    if not labels:
        return 1, 0
    longest = max(len(str(label)) for label in labels) * 0.061 + 0.5
    columns = max(1, min(len(labels), int((width - 0.1) / longest)))
    return columns, math.ceil(len(labels) / columns)


def nice_unit(unit, largest):
    """(unit, factor) in which a value of SI `unit` reads well."""
    steps = {"Pa": (("GPa", 1e-9, 1e10), ("MPa", 1e-6, 1e7), ("kPa", 1e-3, 1e3)),
             "m": (("m", 1.0, 0.5), ("mm", 1e3, 1e-3), ("µm", 1e6, 1e-6)),
             "N/m": (("MN/m", 1e-6, 1e7), ("kN/m", 1e-3, 1e3)), "rad": (("°", 180.0 / math.pi, 0.0),),
             "J/m": (("MJ/m", 1e-6, 1e7), ("kJ/m", 1e-3, 1e4)),
             "m/s": (("m/s", 1.0, 0.1), ("mm/s", 1e3, 1e-4))}
    for name, factor, least in steps.get(unit, ()):
        if largest >= least:
            return name, factor
    return unit, 1.0
