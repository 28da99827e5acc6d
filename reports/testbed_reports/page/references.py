"""BibTeX of the methods, options and data that the runs of a report use."""
import re
from pathlib import Path

LIST = Path(__file__).with_name("references.bib")


def used(run):
    """What a run uses, in the keywords of the list: method, variant, options of it, case, kinds of damping, nonlocal softening."""
    scene = run.result.resolved
    words = {"" if run.outside else run.result.method, run.name.split("[")[0], str(run.values.get("case", "")), *re.findall(r"[\[,]\s*\w+\s*=\s*(\w+)", run.name)}
    damping = scene.get("damping")
    if isinstance(damping, dict):
        words |= {f"{kind} damping" for kind in ("local", "kinetic") if damping.get(kind)}
    softening = [m.get("softening") for m in scene.get("material", []) if isinstance(m.get("softening"), dict)]
    return words | ({"nonlocal"} if any("length" in table for table in softening) else set())


def references(studies):
    """The entries, as text, in the order of the list."""
    words = set().union(*(used(run) for study in studies for run in study.runs if run.result is not None), set())
    entries = re.split(r"^(?=@)", LIST.read_text(encoding="utf-8"), flags=re.M)[1:]
    return "".join(entry for entry in entries if words & {k.strip() for k in re.search(r"keywords = \{(.*)\}", entry).group(1).split(",")})
