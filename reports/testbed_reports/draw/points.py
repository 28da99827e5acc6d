"""Where the runs of a figure stand on it, so that a page can tell of each."""
import math

from .drawing import label_of
from .style import gid_of
from .work_precision import error_of


def _values(run, entry):
    """What the figure shows of a run on both axes; None for a kind whose marks are no runs."""
    quantity, norm = entry.get("quantity", ""), entry.get("norm", "")
    if entry["kind"] == "work_precision":
        held = {"solve_s": run.value("solve_s"), "error": error_of(run, entry), "dofs": run.result.performance.get("dofs", math.nan)}
        return held[entry.get("x", "solve_s")], held[entry.get("y", "error")]
    if entry["kind"] in ("convergence", "power_law"):
        x = run.values.get(entry.get("x", "L"), math.nan)
        return x if isinstance(x, (int, float)) else math.nan, abs(run.value(quantity, norm))
    return None


def points_of(drawing, entry):
    """[{x, y (shares of the picture, from its upper left), run, series, told, command}] of the runs of a drawing."""
    found, figure = [], drawing.figure
    if not figure.axes:
        return found
    figure.canvas.draw()
    axis, (width, height) = figure.axes[0], figure.canvas.get_width_height()
    for run in drawing.runs:
        at = _values(run, entry) if run.result is not None else None
        if at is None or not all(math.isfinite(v) and v > 0 for v in at):
            continue
        x, y = axis.transData.transform(at)
        label = label_of(run, entry)
        told = [f"{at[0]:.4g}, {at[1]:.4g}", run.label + (f", {run.result.soundness}" if run.completed and not run.suspect and run.result.soundness else ""), run.id]
        found.append({"x": round(x / width, 5), "y": round(1 - y / height, 5), "run": run.id, "series": label, "gid": gid_of(label), "told": told,
                      "command": run.command})
    return found
