"""metrics.csv: every number of every run that has a finished result, one row each."""
import csv
import io
import math

from .dataset import NO_SERIES

RUN = ("run_id", "case", "method", "variant", "L", "ppc", "dt", "seed")
NUMBER = ("quantity", "norm", "value", "solve_s", "particle_steps", "status", "soundness", "cause", "remedy")


def _number(value):
    return repr(float(value)) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


def _count(value):
    return int(value) if isinstance(value, (int, float)) and math.isfinite(value) else value


def metrics_csv(runs):
    """The table as text: a column for each axis of the study that has none of its own."""
    axes = list(dict.fromkeys(key for run in runs for key in run.values if key not in NO_SERIES and key not in RUN))
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow([*RUN, *axes, *NUMBER])
    for run in runs:
        if run.result is None or not run.result.finished:
            continue
        performance = run.result.performance
        own = [run.id, run.values["case"], *((run.values["method"], run.values["variant"]) if run.outside else (run.result.method, run.result.variant)), _number(run.values["L"]), run.values["ppc"],
               _number(run.values["dt"]), run.values["seed"], *(run.values.get(key, "") for key in axes)]
        last = [_number(performance.get("solve_s", "")), _count(performance.get("particle_steps", "")), run.status, run.result.soundness,
                run.result.cause, run.result.remedy]
        for (quantity, norm), value in {**run.rows, **run.recorded}.items():
            writer.writerow([*own, quantity, norm, repr(float(value)), *last])
    return out.getvalue()
