"""Makes the report package and the synthetic results importable."""
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
REPORTS = HERE.parents[1] / "reports"
sys.dont_write_bytecode = True
sys.path[:0] = [str(REPORTS), str(HERE)]


@pytest.fixture
def make(tmp_path):
    """make(name='result.h5', **changes) -> an opened synthetic result."""
    from synthetic import write_result
    from testbed_reports.read.results import Result

    def build(name="result.h5", **changes):
        return Result(write_result(tmp_path / name, **changes))

    return build
