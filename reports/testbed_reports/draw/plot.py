"""`testbed plot`: pictures of single results, without a study."""
import argparse
import math
import sys
from pathlib import Path

from ..grade.loose import default_field, study_of
from ..read.figure_tables import FIGURE_KINDS
from ..read.results import ResultError
from ..read.study_file import StudyError
from .animation import animate
from .drawing import FigureError
from .style import RC, Style, plt

STILLS, MOVING = (".png", ".pdf", ".svg"), (".gif", ".mp4")


def _options(arguments):
    parser = argparse.ArgumentParser(prog="testbed plot", description="A picture of one result, or of several side by side on one scale: a map of a "
                                     "field (default), or with --history, --profile or --deformed what these say.")
    parser.add_argument("results", nargs="+", metavar="RESULT.h5")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--field", metavar="F", help="map of a field or component of the snapshots: stress_yy, mean_stress, velocity, displacement_y, "
                      "plastic_shear_strain, ... (default: plastic_shear_strain, else stress_yy)")
    what.add_argument("--deformed", action="store_true", help="map of stripes of the initial position, which show the motion")
    what.add_argument("--history", metavar="Q", help="a recorded quantity against time: kinetic_energy, ...; with --probe or --support displacement_y, "
                      "reaction_y, ...")
    what.add_argument("--profile", metavar="F", help="a field or component against the initial position, over the exact solution where there is one")
    parser.add_argument("--probe", metavar="NAME", help="with --history: of this probe")
    parser.add_argument("--support", metavar="NAME", help="with --history: of this support or wall")
    parser.add_argument("--along", choices=("x", "y"), default="y", help="with --profile (default y)")
    parser.add_argument("--time", type=float, metavar="T", help="the snapshot nearest to this time [s] (default: the last one)")
    parser.add_argument("--all", action="store_true", help="all snapshots: below each other, or as an animation (.gif, .mp4)")
    parser.add_argument("--range", type=float, nargs=2, metavar=("LOW", "HIGH"), help="of the colours, in the unit that is shown")
    parser.add_argument("--seconds", type=float, default=6.0, help="length of an animation (default 6)")
    parser.add_argument("-o", "--output", metavar="FILE", help=f"{', '.join(STILLS + MOVING)} (default: RESULT.png beside the first result)")
    options = parser.parse_args(arguments)
    suffix = Path(options.output).suffix if options.output else ".png"
    if suffix not in STILLS + MOVING:
        parser.error(f"-o must end in one of {', '.join(STILLS + MOVING)}")
    if suffix in MOVING and (options.history or options.profile):
        parser.error("an animation is of a map")
    if options.all and options.time is not None:
        parser.error("--all and --time exclude each other")
    if not 0 < options.seconds < math.inf:
        parser.error("--seconds must be positive")
    if options.time is not None and not math.isfinite(options.time):
        parser.error(f"--time must be a number of seconds, not {options.time:g}")
    if options.range and not -math.inf < options.range[0] < options.range[1] < math.inf:
        parser.error("--range needs two numbers, the lower one first")
    return options


def _entry(options, run):
    """What is drawn, as a [[figure]] would say it; `run` gives the defaults."""
    when = {"snapshot": -1 if options.time is None else float(options.time)}
    if options.history:
        of = {key: value for key, value in (("probe", options.probe), ("support", options.support)) if value}
        return {"kind": "history", "quantity": options.history, **of}
    if options.profile:
        return {"kind": "profile", "component": options.profile, "along": options.along, **when}
    if options.all and Path(options.output or "").suffix not in MOVING:
        when = {"snapshot": list(range(len(run.result.snapshots)))}
    if options.deformed:
        return {"kind": "field", "deformed_grid": True, **when}
    return {"kind": "field", "component": options.field or default_field(run.result), "error": False, **when, **({"range": options.range} if options.range else {})}


def main(arguments=None):
    """Entry of `testbed plot`; returns the exit code."""
    try:
        options = _options(sys.argv[1:] if arguments is None else arguments)
    except SystemExit as stop:
        return 1 if stop.code else 0
    path = Path(options.output) if options.output else Path(options.results[0]).with_suffix(".png")
    try:
        study = study_of(options.results)
        entry = {"where": {}, "series": ["variant"], "unfinished": True, "tell_time": True, "width": "page", **_entry(options, study.runs[0])}
        style = Style([run.name for run in study.runs])
        with plt.rc_context(RC):
            if path.suffix in MOVING:
                animate(study, entry, style, path, options.seconds)
            else:
                drawing = FIGURE_KINDS[entry["kind"]].draw(study, entry, style)
                drawing.figure.savefig(path, dpi=300)
                print(". ".join(note.rstrip(".") for note in drawing.notes if note), file=sys.stderr)
    except (FigureError, ResultError, StudyError, OSError) as error:
        print(f"testbed plot: {error}", file=sys.stderr)
        return 1
    print(path)
    return 0
