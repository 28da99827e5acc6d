"""Figures. A module that declares a kind of figure (figure_kind) is found by standing here."""
import importlib
import pkgutil

for _module in pkgutil.iter_modules(__path__, f"{__name__}."):
    importlib.import_module(_module.name)
