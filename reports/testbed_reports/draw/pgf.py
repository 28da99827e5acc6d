"""Figures as PGF: drawn by the LaTeX of the paper that takes them in, in its own fonts. Needs pdflatex."""
import logging
import shutil
import subprocess

from .style import plt

RC = {"pgf.texsystem": "pdflatex", "pgf.rcfonts": False}  # the paper's fonts, not the figure's


class PgfError(Exception):
    """No LaTeX, or it does not take a figure's words."""


def save_pgf(figure, path):
    """Writes path (.pgf), and pictures of maps beside it. Raises PgfError."""
    if not shutil.which("pdflatex"):
        raise PgfError("no PGF without pdflatex (Debian: texlive-latex-recommended, texlive-pictures)")
    logging.getLogger("matplotlib.backends.backend_pgf").setLevel(logging.ERROR)  # it says of each word that the font is the paper's
    try:
        with plt.rc_context(RC):
            figure.savefig(path, dpi=300)
    except (ValueError, RuntimeError, OSError, subprocess.SubprocessError) as error:
        raise PgfError(f"no PGF: {str(error).splitlines()[0] if str(error) else type(error).__name__}") from error
