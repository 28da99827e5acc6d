"""Names in the [report] table of a scene that nothing reads: metric groups, and keys of report.reference."""
from difflib import get_close_matches

from ..read.spelling import did_you_mean
from .metrics import GROUPS

LIKE = 0.8  # as alike as that, a name is another one misspelt
FIGURE_KEYS = ("scale_x", "scale_y", "offset_x", "offset_y")


def named_by(figures):
    """Names of report.reference that [[figure]]s ask for."""
    values = [value for figure in figures for value in (*(figure.get(key) for key in FIGURE_KEYS), *figure.get("levels", []))]
    return {value.removeprefix("-") for value in values if isinstance(value, str)}


def misnamed(groups, reference, figures):
    """(misspelt, idle): sentences on names that nothing knows, and on keys that no metric and no figure reads though they may be meant for one of another study."""
    read = {key for _, _, keys in GROUPS.values() for key in keys}
    misspelt, idle = [f"report.metrics: there is no metric group '{group}'{did_you_mean(group, GROUPS)}" for group in groups if group not in GROUPS], []
    for key in reference:
        if key in read | named_by(figures):
            continue
        near = get_close_matches(key, sorted(read - set(reference)), n=1, cutoff=LIKE)
        if near:
            misspelt.append(f"report.reference.{key}: no metric reads it, did you mean '{near[0]}'?")
        else:
            idle.append(f"report.reference.{key}: no metric and no figure reads it")
    return misspelt, idle


def of_scene(resolved, figures):
    """The same of a resolved scene; what is no list or table there is told elsewhere."""
    report = resolved.get("report", {})
    groups, reference = report.get("metrics", []), report.get("reference", {})
    return misnamed([g for g in groups if isinstance(g, str)] if isinstance(groups, list) else [], reference if isinstance(reference, dict) else {}, figures)


def of_runs(runs, figures):
    """The same of the results of some runs, each sentence once."""
    found = [misnamed(run.result.metrics, run.result.resolved.get("report", {}).get("reference", {}), figures) for run in runs if run.result is not None]
    return tuple(list(dict.fromkeys(text for pair in found for text in pair[k])) for k in (0, 1))
