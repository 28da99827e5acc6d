"""Studies, metrics, figures and reports of the testbed; solvers are met only in result files."""
from . import draw  # noqa: F401 (kinds of figures declare themselves)
