"""Studies, metrics, figures and reports of the testbed; solvers are met only in result files."""
