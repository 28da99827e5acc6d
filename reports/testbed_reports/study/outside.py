"""`testbed import`: whether a result of another code can be used, what it lacks, and into which study it goes."""
import argparse
import contextlib
import re
import shutil
import sys
from pathlib import Path

import numpy as np

from ..grade import metrics
from ..grade.dataset import OWN_RUN, read_plan
from ..grade.foreign import faults, outside_name
from ..grade.scene_words import misnamed
from ..read.results import Result, ResultError
from ..read.study_file import StudyError

# What a report shows of a run, beside its metrics: attributes or fields, and what goes without them.
WANTED = {"performance": {"solve_s": "error against run time", "particle_steps_per_second": "the table of performance", "bytes_per_point": "the table of performance",
                          "dofs": "error against unknowns"},
          "provenance": {"commit": "where the numbers come from", "cpu": "where the numbers come from", "threads": "where the numbers come from"},
          "fields": {"position": "maps", "displacement": "maps and errors", "stress": "maps, profiles and errors", "initial_position": "maps and shear bands",
                     "initial_volume": "every norm", "volume": "fronts and areas"}}
STRAIN = {"shear_band", "shear_layer", "inclusion"}  # groups that need plastic_shear_strain


def _lacks(result):
    """Sentences on what is not there, and what goes without it."""
    told = [f"/performance lacks {name}: no {what}" for name, what in WANTED["performance"].items() if name not in result.performance]
    told += [f"/provenance lacks {name}: the page does not say {what}" for name, what in WANTED["provenance"].items() if name not in result.provenance]
    if not result.snapshots:
        return told + ["no snapshots: no maps, profiles and norms"]
    told += [f"the last snapshot lacks {name}: no {what}" for name, what in WANTED["fields"].items() if name not in result.final]
    if STRAIN & set(result.metrics) and "plastic_shear_strain" not in result.final:
        told.append("the last snapshot lacks plastic_shear_strain: no shear bands")
    if not result.metrics:
        told.append("/scene names no metrics: nothing is graded (copy the attribute from a run of the same case)")
    return told


def _own_results(folder, like):
    """Results of the study's plan with the case and the cell size of another one."""
    for entry in read_plan(folder).get("runs", []):
        path = folder / "runs" / entry["id"] / "result.h5"
        if path.is_file() and entry.get("L") in (None, like.cell_size):
            with contextlib.suppress(ResultError):  # of a damaged one the report tells
                yield Result(path)


def examine(path, study=None):
    """(what it is, wrong, lacking): wrong sentences keep it from being used. `study`: the folder that it is for. Raises ResultError."""
    result = Result(path)
    what = f"{result.variant} on {result.case}, {result.status}, L = {result.cell_size:g} m, {len(result.snapshots)} snapshots"
    grades = metrics.grade(result)
    numbers = [" ".join(key).strip() for key, value in grades.rows.items() if key[0] not in metrics.ALWAYS and np.isfinite(value)]
    what += f"; graded: {', '.join(numbers)}" if numbers else "; nothing graded"
    if outside_name(result.variant) != result.variant:
        what += f"; beside runs of a study it is called '{outside_name(result.variant)}'"
    missing = [f"not graded: {error}" for error in grades.errors if "/performance" not in error and "unknown metric" not in error]
    missing += [text for part in misnamed(result.metrics, result.resolved.get("report", {}).get("reference", {}), []) for text in part]
    cases = {entry.get("case", result.case) for entry in read_plan(study)["runs"]} if study else set()
    if cases and result.case not in cases:
        missing.append(f"the study has no case '{result.case}' (it has {', '.join(sorted(cases))}): nothing to compare it with")
    return what, faults(result, _own_results(study, result) if study else ()), _lacks(result) + missing


def main(arguments=None):
    """Entry of `testbed import`; returns the exit code."""
    parser = argparse.ArgumentParser(prog="testbed import", description="Check a result file of another code, and put it into a study.")
    parser.add_argument("result", metavar="RESULT.h5")
    parser.add_argument("--study", metavar="DIR", help="the folder of a study that was run: the file is copied to DIR/runs/NAME/result.h5")
    parser.add_argument("--name", help="default: the file's name")
    try:
        options = parser.parse_args(sys.argv[1:] if arguments is None else arguments)
    except SystemExit as stop:
        return 1 if stop.code else 0
    name = options.name or Path(options.result).stem
    try:
        folder = Path(options.study) if options.study else None
        if folder and not (folder / "study.toml").is_file():
            raise ResultError(f"{folder}: no folder of a study (no study.toml)")
        what, wrong, lacking = examine(options.result, folder)
        print(f"{options.result}: {what}")
        for sentence in lacking:
            print(f"  lacks: {sentence}")
        if wrong:
            raise ResultError("\n".join(wrong))
        if folder:
            if OWN_RUN.search(name[-14:]) or not re.fullmatch(r"[\w+=-][\w.+=-]*", name):
                raise ResultError(f"--name {name}: must be letters, digits and . _ + = -, and not end as those of the study's own runs")
            home = folder / "runs" / name
            if home.exists():
                raise ResultError(f"{home}: is there already; take it away, or give another --name")
            home.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(options.result, home / "result.h5")
            print(f"{home / 'result.h5'}")
    except (ResultError, StudyError, OSError) as error:
        print(f"testbed import: {error}", file=sys.stderr)
        return 1
    return 0
