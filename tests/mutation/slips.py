"""The list of slips, and the sources with all of them in, each switched on by its number in the variable TESTBED_SLIP."""
import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]


class SlipError(Exception):
    """An entry that does not fit the sources."""


@dataclass
class Slip:
    """`of` becomes `to`; `before` and `after` are the text around it, by which its place is found. `harmless`: why no result shows it."""
    number: int
    file: str
    before: str
    of: str
    after: str
    to: str
    harmless: str

    @property
    def told(self):
        return f"{self.number:3d} {self.file}: {self.of} -> {self.to or '(nothing)'}"


def read_slips(path=HERE / "slips.toml"):
    slips = []
    for file, table in tomllib.loads(Path(path).read_text(encoding="utf-8")).items():
        for entry in table["slips"]:
            place, to, harmless = entry if len(entry) == 3 else (*entry, "")
            parts = re.fullmatch(r"([^«]*)«([^»]+)»([^«»]*)", place)
            if not parts:
                raise SlipError(f"{file}: the place of a slip is marked by « and »: {place}")
            slips.append(Slip(len(slips) + 1, file, *parts.groups(), to, harmless))
    return slips


def _place(text, slip):
    """Where the text that a slip replaces begins and ends."""
    whole = slip.before + slip.of + slip.after
    if text.count(whole) != 1:
        raise SlipError(f"{slip.told}: stands {text.count(whole)} times in the file, not once")
    begin = text.index(whole) + len(slip.before)
    return begin, begin + len(slip.of)


def check(slips, root=ROOT):
    """Raises SlipError if a slip does not fit."""
    for slip in slips:
        _place((root / slip.file).read_text(encoding="utf-8"), slip)


def _cpp(of, slips):
    """An expression that is one of several by number; a statement may be left out."""
    for s in slips:
        of = f"(::slip::is({s.number}) ? ({s.to}) : ({of}))" if s.to else f"(::slip::is({s.number}) ? void() : void({of}))"
    return of


def _python(of, slips):
    for s in slips:
        of = f"(({s.to}) if _slip({s.number}) else ({of}))"
    return of


def put_in(slips, root):
    """Changes the sources under `root`."""
    for file in dict.fromkeys(s.file for s in slips):
        path = root / file
        text = path.read_text(encoding="utf-8")
        places = {}
        for s in slips:
            if s.file == file:
                places.setdefault(_place(text, s), []).append(s)
        for begin, end in sorted(places, reverse=True):
            own = places[begin, end]
            text = text[:begin] + (_python if file.endswith(".py") else _cpp)(own[0].of, own) + text[end:]
        if file.endswith(".py"):
            text = re.sub(r"^(?=import |from )", "from testbed_reports._slip import is_on as _slip\n", text, count=1, flags=re.M)
        path.write_text(text, encoding="utf-8")
