"""What moved between two sets of studies: numbers whose ranges over repeats do not meet."""
import math

from ..draw.table import Table
from ..grade import metrics
from ..grade.targets import number

ROUNDING = 1e-9  # relative: below it two numbers are the same


def _held(study):
    """{(setting of a run without repeats, quantity, norm): values over repeats}."""
    found = {}
    for run in study.runs:
        setting = (run.name, *sorted(f"{k.rsplit('.', 1)[-1]} = {v}" for k, v in run.values.items()
                                     if k not in ("repeat", "dt", "method", "variant", "scene", "grid.cell_size", "bracket")))
        for key, value in run.rows.items():
            found.setdefault((setting, *key), []).append(value)
    return found


def _moved(old, new, floor):
    """Whether two lists of numbers have no value in common, rounding and what is below `floor` apart."""
    old, new = ([v for v in values if math.isfinite(v)] for values in (old, new))
    if not old or not new:
        return bool(old) != bool(new)
    gap = max(min(old) - max(new), min(new) - max(old))
    return gap > max(ROUNDING * max(map(abs, (*old, *new))), floor)


def _range(values):
    values = [v for v in values if math.isfinite(v)]
    return "none" if not values else number(values[0], 5) if min(values) == max(values) else f"{number(min(values), 4)} to {number(max(values), 4)}"


def moved_table(studies, others):
    """Numbers of both that differ, the largest change first; and what only one of them has."""
    rows, by_name = [], {study.name: study for study in others}
    rows += [(math.inf, [name, "the whole study", "", "there", "none", ""]) for name in by_name.keys() - {study.name for study in studies}]
    for study in studies:
        if study.name not in by_name:
            rows.append((math.inf, [study.name, "the whole study", "", "none", "there", ""]))
            continue
        now, before = _held(study), _held(by_name[study.name])
        for key in dict.fromkeys([*before, *now]):
            if key not in now or key not in before:
                rows.append((math.inf, [study.name, ", ".join(key[0]), " ".join(key[1:]).strip(), _range(before.get(key, [])), _range(now.get(key, [])), ""]))
            elif _moved(before[key], now[key], metrics.ROUNDING if metrics.is_error(*key[1:]) else 0.0):
                ends = [next((v for v in values if math.isfinite(v)), math.nan) for values in (before[key], now[key])]
                ratio = ends[1] / ends[0] if ends[0] else math.nan
                size = abs(math.log(ratio)) if ratio > 0 and math.isfinite(ratio) else math.inf
                rows.append((size, [study.name, ", ".join(key[0]), " ".join(key[1:]).strip(), _range(before[key]), _range(now[key]), number(ratio, 4)]))
    rows = [row for _, row in sorted(rows, key=lambda row: -row[0])]
    return Table("moved", "What moved", ["study", "run", "quantity", "before", "now", "now / before"], rows, 3,
                 ["Numbers whose ranges over repeats do not meet; times move with the machine and its load."])
