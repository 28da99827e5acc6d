"""Pictures of the modes that `testbed modes` finds."""
import argparse
import math
import sys

import h5py
import numpy as np

from .style import COLOURS, RC, WIDTH, plt

TITLES = {"unstable": "unstable, {growth:.5g} a step", "hourglass": "hourglass, no resistance", "null": "no resistance",
          "swinging": "{frequency:.4g} Hz, {growth:.6g} a step"}


def _text(value):
    return value.decode() if isinstance(value, bytes) else str(value)


def read(path):
    """(attributes, positions (K, 2) [m], points (N, 2) [m], modes) of a file of modes.

    A mode is a dict with `kind`, `growth`, `frequency` [Hz] and `velocity` (K, 2), complex, its largest one of size 1.
    """
    with h5py.File(path, "r") as file:
        if _text(file.attrs.get("format", "")) != "testbed-modes":
            raise ValueError(f"{path} is not a file of modes")
        modes = [{"kind": _text(group.attrs["kind"]), "growth": float(group.attrs["growth_per_step"]),
                  "frequency": float(group.attrs["frequency"]),
                  "velocity": group["velocity_real"][()] + 1j * group["velocity_imaginary"][()]}
                 for _, group in sorted(file.get("modes", {}).items())]
        return dict(file.attrs), file["places/velocities"][()], file["places/points"][()], modes


def draw(attributes, position, points, modes):
    """A panel per mode: the points, the lattice, arrows of the velocity in its two phases."""
    columns = min(3, max(1, len(modes)))
    rows = max(1, math.ceil(len(modes) / columns))
    size = float(attributes["cell_size"])
    origin = np.asarray(attributes["cell_origin"], float)[:2]
    every = np.concatenate([position, points])
    low, high = every.min(axis=0) - 0.8 * size, every.max(axis=0) + 0.8 * size
    panel = (WIDTH["page"] - 0.2) / columns
    height = min(3.0, panel * (high[1] - low[1]) / (high[0] - low[0]))
    with plt.rc_context(RC):
        figure, axes = plt.subplots(rows, columns, figsize=(WIDTH["page"], rows * (height + 0.25) + 0.05), squeeze=False)
        for axis in axes.flat:
            axis.set_axis_off()
        for axis, mode in zip(axes.flat, modes):
            for k in range(2):
                lines = origin[k] + size * np.arange(math.ceil((low[k] - origin[k]) / size), math.floor((high[k] - origin[k]) / size) + 1)
                (axis.vlines if k == 0 else axis.hlines)(lines, low[1 - k], high[1 - k], color="0.88", linewidth=0.5, zorder=0)
            axis.plot(*points.T, linestyle="none", marker=".", markersize=2, color="0.6", zorder=1)
            for phase, colour in ((mode["velocity"].real, COLOURS[0]), (mode["velocity"].imag, COLOURS[1])):
                if np.abs(phase).max(initial=0.0) > 0.02:
                    axis.quiver(*position.T, *phase.T, color=colour, angles="xy", scale_units="xy", scale=1.4 / size, width=0.006,
                                zorder=2)
            axis.set_title(TITLES[mode["kind"]].format(**mode), pad=3)
            axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        if not modes:
            axes[0, 0].text(0.5, 0.5, "no mode is left", ha="center")
        figure.tight_layout(pad=0.3)
    return figure


def main(argv=None):
    parser = argparse.ArgumentParser(prog="testbed modes-plot", description=__doc__)
    parser.add_argument("modes", help="file that `testbed modes -o NAME.h5` wrote")
    parser.add_argument("picture", help="to be drawn (.png, .pdf, .svg)")
    given = parser.parse_args(argv)
    try:
        draw(*read(given.modes)).savefig(given.picture, dpi=200)
    except (OSError, KeyError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0
