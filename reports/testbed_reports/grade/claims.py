"""Claims of a source, judged by runs: holds, holds only if ..., refuted, not tested."""
import math
import re
from dataclasses import dataclass, field

from ..read.study_file import StudyError
from .numbers import Number, number_of


@dataclass
class Test:
    """One test of a claim: under the condition `when` the measured number must lie in `asked`. `verdict`: 'pass', 'fail', 'undecided' (runs are
    missing, or have no such number) or 'not run' (its method is not built)."""
    when: str
    asked: str
    measured: Number
    verdict: str
    study: str


@dataclass
class Claim:
    """What a source says, and what the runs say of it."""
    name: str
    words: str
    source: str
    notes: list = field(default_factory=list)  # texts with the names of numbers, and the study they are of
    tests: list = field(default_factory=list)

    @property
    def verdict(self):
        done = [test for test in self.tests if test.verdict != "not run"]
        held = [test for test in done if test.verdict == "pass"]
        failed = [test for test in done if test.verdict == "fail"]
        if not done:
            return "not tested"
        if held and failed:
            return "holds only if"
        return "undecided" if len(held) + len(failed) < len(done) else "holds" if held else "refuted"

    @property
    def conditions(self):
        """Under which it holds, of a claim that does not always: all of them if they are few."""
        held = [test.when for test in self.tests if test.verdict == "pass"] if self.verdict == "holds only if" else []
        return held if len(held) <= 3 else [f"in part, {len(held)} of {len(self.tests)} tests"]


def _judge(study, entry):
    measured = number_of(study, entry)
    low, high = entry.get("min", -math.inf), entry.get("max", math.inf)
    asked = " ".join(filter(None, (entry["quantity"], entry["norm"]))).replace("_", " ")
    asked = ("" if entry["take"] == "every" else f"{entry['take']} of ") + asked + (" over that of the other" if "over" in entry else "")
    asked = (f"{low:g} ≤ " if math.isfinite(low) else "") + asked + (f" ≤ {high:g}" if math.isfinite(high) else "")
    outside = any(not low <= v <= high for v in measured.values)
    if measured.left_out:
        verdict = "not run"
    elif outside or measured.failed:
        verdict = "fail"
    else:
        verdict = "undecided" if measured.missing else "pass"
    return Test(entry["if"], asked, measured, verdict, study.name)


def judge_claims(studies):
    """The claims of all studies; tests of one name in several studies belong to one claim."""
    found = {}
    for study in studies:
        for entry in study.spec.claims:
            claim = found.setdefault(entry["name"], Claim(entry["name"], entry["words"], entry["source"]))
            if (claim.words, claim.source) != (entry["words"], entry["source"]):
                raise StudyError(f"{study.spec.path}: the claim '{claim.name}' has other words or another source than in another study: give it a name of its own")
            claim.notes += [(entry["note"], study)] if entry["note"] else []
            claim.tests += [_judge(study, test) for test in entry["test"]]
    return sorted(found.values(), key=lambda claim: (not claim.name[:1].isdigit(), [int(n) for n in re.findall(r"\d+", claim.name)[:1]], claim.name if claim.name[:1].isdigit() else ""))
