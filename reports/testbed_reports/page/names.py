"""Names of files and anchors of what a study shows."""
import re
from collections import Counter


def slug(text):
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def study_anchor(study):
    return f"study-{slug(study.name)}"


def table_anchor(study, name):
    return f"table-{slug(study.name)}_{slug(name)}"


def subject(entry):
    """What a [[figure]] is of."""
    return (entry.get("quantity") or entry.get("component") or " ".join(filter(None, (entry.get("y"), entry.get("x"))))
            or ("deformed_grid" if entry.get("deformed_grid") else ""))


def figure_names(study):
    """The name of each figure of a study: of its file, and of its anchor."""
    names, used = [], Counter()
    for entry in study.spec.figures:
        name = slug(entry.get("name") or "_".join(filter(None, (entry["kind"], subject(entry), entry.get("norm", "")))))
        used[name] += 1
        names.append(f"{slug(study.name)}_{name}" + (f"_{used[name]}" if used[name] > 1 else ""))
    return names


def figure_anchor(name):
    return f"figure-{name}"
