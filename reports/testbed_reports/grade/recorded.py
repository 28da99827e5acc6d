"""What a run recorded last, beside what is graded: rows of metrics.csv, and of numbers and targets that ask for them."""
from ..read.results import ResultError

QUANTITIES = ("displacement_end", "reaction_end", "unknowns")


def recorded(result):
    """{(quantity, norm): value}: `displacement_end` of probes and walls and `reaction_end` of supports by NAME.x and NAME.y, and the
    unknowns."""
    rows = {}
    for kind, names, quantity in ((result.probe, result.probes, "displacement"), (result.support, result.supports, "displacement"),
                                  (result.support, result.supports, "reaction")):
        for name in names:
            try:
                values = kind(name, quantity)
            except ResultError:  # a support has no displacement, an outside code may record less
                continue
            if values.ndim != 2 or not len(values):
                continue
            last = values[-1]
            rows.update({(f"{quantity}_end", f"{name}.{axis}"): float(value) for axis, value in zip("xy", last)})
    if "unknowns" in result.performance:
        rows["unknowns", ""] = float(result.performance["unknowns"])
    return rows
