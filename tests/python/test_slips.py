"""The list of slips of the mutation run (tests/mutation): it must fit the sources, whatever was moved in them."""
import sys

import pytest
from conftest import HERE

sys.path.insert(0, str(HERE.parent / "mutation"))
from slips import SlipError, check, put_in, read_slips  # noqa: E402


def test_every_slip_stands_once_in_its_file_and_there_are_enough_of_them():
    slips = read_slips()
    check(slips)
    assert len(slips) >= 150
    assert len({s.file for s in slips}) >= 50


def test_a_slip_that_no_longer_fits_is_told(tmp_path):
    slip = read_slips()[0]
    (tmp_path / slip.file).parent.mkdir(parents=True)
    (tmp_path / slip.file).write_text("nothing of the kind")
    with pytest.raises(SlipError, match="stands 0 times"):
        check([slip], tmp_path)


def test_slips_of_one_place_are_switched_one_by_one(tmp_path):
    (tmp_path / "slips.toml").write_text('["a.py"]\nslips = [["y = «x»", "-x"], ["y = «x»", "2 * x"]]\n["b.cpp"]\nslips = [["{ «f()»; }", ""]]\n')
    (tmp_path / "a.py").write_text('"""Words."""\nimport math\ny = x\n')
    (tmp_path / "b.cpp").write_text("{ f(); }")
    put_in(read_slips(tmp_path / "slips.toml"), tmp_path)
    text = (tmp_path / "a.py").read_text()
    assert text.index("_slip") < text.index("import math")
    body = text.split("import math\n")[1]
    found = {}
    for on in (0, 1, 2):
        scope = {"x": 3, "_slip": lambda n, on=on: n == on}
        exec(body, scope)
        found[on] = scope["y"]
    assert found == {0: 3, 1: -3, 2: 6}
    assert (tmp_path / "b.cpp").read_text() == "{ (::slip::is(3) ? void() : void(f())); }"
