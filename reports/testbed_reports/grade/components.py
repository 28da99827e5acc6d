"""Components of fields by name: 'stress_yy', 'displacement_y', 'velocity', 'mean_stress', 'plastic_shear_strain'."""
import numpy as np

from ..read.results import TENSOR, VECTOR, ResultError
from . import norms

# Fields with components: name -> (what an axis is called, symbol, unit)
FIELDS = {"stress": ("Stress", r"\sigma", "Pa"), "displacement": ("Displacement", "u", "m"),
          "velocity": ("Velocity", "v", "m/s"), "position": ("Position", "x", "m"), "reaction": ("Reaction", "R", "N/m")}
# Fields of one number per point that have a symbol; others that a snapshot holds go by their name
SCALARS = {"plastic_shear_strain": ("Plastic shear strain", r"\gamma^\mathrm{p}", ""), "cohesion": ("Cohesion", "c", "Pa"),
           "friction_angle": ("Friction angle", r"\varphi", "rad")}


def split(component):
    """(field, part) of a component's name; part '' is the magnitude, or a field of one number."""
    if component == "mean_stress":
        return "stress", "mean"
    if component in SCALARS or component in FIELDS:
        return component, ""
    name, _, part = component.rpartition("_")
    if name in FIELDS and part in (TENSOR if name == "stress" else VECTOR):
        return name, part
    return component, ""


def pick(values, name, part):
    """(N,) from a field (N,), (N, 3) or (N, 6)."""
    if name not in FIELDS:
        return values
    if name == "stress":
        if part == "mean":
            return values[:, [TENSOR["xx"], TENSOR["yy"], TENSOR["zz"]]].mean(axis=1)
        return values[:, TENSOR[part]] if part else norms.frobenius(values)
    return values[:, VECTOR[part]] if part else norms.length(values)


def default_unit(name):
    return (FIELDS | SCALARS).get(name, ("", "", ""))[2]


def symbol(component):
    """What an axis is called: words and the symbol."""
    name, part = split(component)
    if name not in FIELDS | SCALARS:
        return name.replace("_", " ").capitalize()
    words, letter, _ = (FIELDS | SCALARS)[name]
    if part == "mean":
        return r"Mean stress $\sigma_\mathrm{m}$"
    if name in SCALARS:
        return f"{words} ${letter}$"
    return f"{words} ${letter}_{{{part}}}$" if part else f"{words} $|{letter}|$"


def of_snapshot(snapshot, component, exact=False):
    """(N,) of a snapshot in SI units."""
    name, part = split(component)
    field = f"exact_{name}" if exact else name
    if field not in snapshot:
        path = snapshot.result.path  # that of a run goes by the run's folder
        raise ResultError(f"{path.parent.name if path.name == 'result.h5' else path}: snapshot {snapshot.name} lacks the field {field}; it has "
                          f"{', '.join(sorted(snapshot.fields))}, and components such as stress_yy, mean_stress, displacement_y")
    values = np.asarray(pick(snapshot[field], name, part))
    if values.ndim > 1:
        raise ResultError(f"{field} has several components")
    return values


def has_exact(snapshot, component):
    return f"exact_{split(component)[0]}" in snapshot
