"""Result files that no study has made, as a study of their own."""
from pathlib import Path

from ..read.study_file import StudyError, StudyFile
from .dataset import Study, read_run
from .foreign import faults

TOLD = ("variant", "case", "L")  # what tells results apart in a picture, as far as it differs


def _labels(runs, paths):
    """A name for each: its variant, and further what differs; the file's where that is not enough."""
    def text(run, key):
        value = run.values.get(key, "")
        return f"L = {value:g}" if key == "L" and isinstance(value, float) else str(value)

    keys = [key for key in TOLD if key == "variant" or len({text(run, key) for run in runs}) > 1]
    labels = [", ".join(text(run, key) for key in keys) for run in runs]
    return labels if len(set(labels)) == len(labels) else [f"{label}, {path.stem if path.stem != 'result' else path.parent.name}"
                                                           for label, path in zip(labels, paths)]


def default_field(result):
    """What a map of a result shows if nothing is asked."""
    strain = "plastic_shear_strain"
    return strain if result.snapshots and strain in result.final else "stress_yy"


def figures_of(result):
    """The [[figure]]s of a report on results that no study tells of."""
    figures = [{"kind": "field", "component": default_field(result), "title": "The end"}, {"kind": "history", "quantity": "kinetic_energy"},
               {"kind": "history", "quantity": "strain_energy"}]
    if result.snapshots and "exact_stress" in result.final:
        figures.append({"kind": "profile", "component": "stress_yy"})
    return [figure for figure in figures if figure["kind"] != "history" or figure["quantity"] in result.histories]


def study_of(paths, title="Results", figures=figures_of):
    """A study of the runs in some result files, each a variant of its own, with the [[figure]] tables figures(first result).

    Raises StudyError when a file cannot be read."""
    paths = [Path(path) for path in dict.fromkeys(map(str, paths))]
    runs = [read_run(path.parent, {"id": path.stem}, path.name) for path in paths]
    for run, path in zip(runs, paths):
        if run.result is None:
            raise StudyError(f"{path}: {run.reason}" if path.is_file() else f"{path}: no such file")
    for run in runs:
        if not run.result.own:
            run.errors += faults(run.result)
    for run, label in zip(runs, _labels(runs, paths)):
        run.values["variant"] = label
    whole = [{"where": {}, "series": ["variant"], "unfinished": True, **figure} for figure in figures(runs[0].result)]
    spec = StudyFile(paths[0], title, "", 1, [], figures=whole)
    return Study(paths[0].parent, spec, {"runs": []}, runs, [])
