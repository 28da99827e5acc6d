"""The figures that a study declares, of the kinds that the modules beside this one draw.

What a run did not give is shown (top rail) or told in the notes, never dropped in silence.
"""
from ..read.figure_tables import FIGURE_KINDS
from ..read.results import ResultError
from .drawing import FigureError


def draw(study, entry, style):
    """Draws one declared figure; raises FigureError or ResultError with the reason when it cannot."""
    style.begin_figure()
    try:
        return FIGURE_KINDS[entry["kind"]].draw(study, entry, style)
    except (FigureError, ResultError):
        raise
    except Exception as error:  # odd data must not take the report with it
        raise FigureError(f"cannot be drawn: {type(error).__name__}: {error}") from error
