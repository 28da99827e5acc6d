"""The searches of a study: which runs a bisection still needs, from the verdicts of those that are there."""
import json

from ..grade.dataset import read_run
from ..grade.verdicts import judge_run
from ..read.bisection import next_values


class Searches:
    """All combinations of a study with an axis that is searched. `entries`: those of the plan, with `search` and `value`."""

    def __init__(self, study, folder):
        self.folder = folder
        self.bounds = {case.name: case.bounds for case in study.cases}
        self.combinations = {name_of(c): c for c in study.combinations if c.bisection}
        self.levels = {}

    def _level(self, entry):
        """The verdict on a run; a run that left no file has failed."""
        if entry["id"] not in self.levels:
            run = read_run(self.folder / "runs" / entry["id"], entry)
            self.levels[entry["id"]] = judge_run(run, self.bounds[entry["case"]]).level
        return self.levels[entry["id"]]

    def forget(self, left_out):
        """Does not wait for combinations that cannot be run."""
        for entry in left_out:
            self.combinations.pop(entry["search"], None)

    def next(self, entries):
        """Combinations that must run now, given the plan's entries so far; empty when all are bracketed."""
        held = {name: {} for name in self.combinations}
        for entry in entries:
            if entry.get("search") in held:
                search = self.combinations[entry["search"]].bisection
                value = float(entry["axes"][search.key])
                # of repeats the worst counts
                held[entry["search"]][value] = held[entry["search"]].get(value, True) and search.holds(self._level(entry))
        return [c.at(value) for name, c in self.combinations.items() for value in next_values(c.bisection, held[name])]


def name_of(combination):
    """What is common to all runs of one search, '' for a combination that is not searched."""
    if not combination.bisection:
        return ""
    fixed = {k: v for k, v in combination.axes.items() if k != combination.bisection.key}
    return json.dumps([combination.case, str(combination.method), fixed], sort_keys=True)
