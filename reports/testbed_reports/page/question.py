"""A question of the first screen, and how it is worded."""
from dataclasses import dataclass, field

from ..draw.drawing import name_of

BY_METHOD = ("method", "variant")


@dataclass
class Question:
    """One row of the matrix. `cells`: variant -> Number or a word; `best`: the variants that answer it best. `about`: what it compares, in
    a few words; `goal`: what the numbers are."""
    text: str
    about: str
    goal: str
    anchor: str
    cells: dict = field(default_factory=dict)
    best: list = field(default_factory=list)


def words(quantity, norm):
    """What a quantity is called, without mathematics."""
    name = name_of(quantity, norm)
    for sign, plain in (("$", ""), (", ", " "), ("_\\infty", "∞"), ("_", ""), ("\\mathrm{d}", "d"), ("\\tau", "τ"), ("\\sqrt{12}", "√12")):
        name = name.replace(sign, plain)
    return name[:1].lower() + name[1:]


def by_variant(runs):
    found = {}
    for run in runs:
        found.setdefault(run.name, []).append(run)
    return found


def about_of(study, where, quantity, norm):
    """'stress l2, column' and the choice beside the methods, as far as there is one."""
    def value(v):
        return " and ".join(map(value, v)) if isinstance(v, list) else f"{v:g}" if isinstance(v, float) else str(v)

    choice = ", ".join(f"{k.rsplit('.', 1)[-1]} {value(v)}" for k, v in where.items() if k not in (*BY_METHOD, "case"))
    case = where.get("case") if isinstance(where.get("case"), str) else study.name
    case = case if case in study.name or study.name in case else f"{case} in {study.name}"
    return f"{words(quantity, norm)}, {case.replace('_', ' ')}" + (f" ({choice})" if choice else "")


def marks(runs, used):
    """Signs after a number that is made of the runs `used`: * where others gave none, and how many did; ‡ where some are suspect."""
    return (f" * ({len(used)} of {len(runs)} runs)" if len(used) < len(runs) else "") + (" ‡" if any(run.suspect for run in runs) else "")


def is_whole(cell):
    """Whether every run gave its number, and none is suspect."""
    return not any(sign in str(cell) for sign in "*‡")
