"""Components of fields by name: 'stress_yy', 'displacement_y', 'velocity', 'mean_stress'."""
import numpy as np

from . import norms
from .results import TENSOR, VECTOR, ResultError

SYMBOLS = {"stress": r"\sigma", "displacement": "u", "velocity": "v", "position": "x", "kinetic_energy": None}


def split(component):
    """(field, part) of a component's name; part '' is the magnitude."""
    if component == "mean_stress":
        return "stress", "mean"
    for name in ("stress", "displacement", "velocity", "position"):
        if component == name:
            return name, ""
        if component.startswith(name + "_"):
            part = component[len(name) + 1:]
            if part in (TENSOR if name == "stress" else VECTOR):
                return name, part
    raise ResultError(f"unknown component '{component}' (such as stress_yy, mean_stress, displacement_y, velocity)")


def pick(values, name, part):
    """(N,) from a field (N, 3) or (N, 6)."""
    if name == "stress":
        if part == "mean":
            return values[:, [TENSOR["xx"], TENSOR["yy"], TENSOR["zz"]]].mean(axis=1)
        return values[:, TENSOR[part]] if part else norms.frobenius(values)
    return values[:, VECTOR[part]] if part else norms.length(values)


def default_unit(name):
    return {"stress": "Pa", "displacement": "m", "velocity": "m/s", "position": "m"}[name]


def symbol(component):
    """What an axis is called: words and the symbol."""
    name, part = split(component)
    if part == "mean":
        return r"Mean stress $\sigma_\mathrm{m}$"
    words = {"stress": "Stress", "displacement": "Displacement", "velocity": "Velocity", "position": "Position"}[name]
    return f"{words} ${SYMBOLS[name]}_{{{part}}}$" if part else f"{words} $|{SYMBOLS[name]}|$"


def of_snapshot(snapshot, component, exact=False):
    """(N,) of a snapshot in SI units."""
    name, part = split(component)
    field = f"exact_{name}" if exact else name
    if field not in snapshot:
        raise ResultError(f"{snapshot.result.path.parent.name}: snapshot {snapshot.name} lacks the field {field}")
    return np.asarray(pick(snapshot[field], name, part))


def has_exact(snapshot, component):
    return f"exact_{split(component)[0]}" in snapshot
