"""The numbers in the words of a page: each with an id, so that it can be found again in metrics.csv."""
from string import Formatter

from ..draw.table import Table
from ..grade.numbers import Number, numbers_of


def plain(pieces):
    """Pieces of a text as one string, without their ids."""
    return "".join(piece if isinstance(piece, str) else piece[1].text for piece in pieces)


class Ledger:
    """Takes numbers in as they are shown. `missing`: [study, what, why] of those that a text names and no run gives."""

    def __init__(self):
        self.numbers, self.missing = [], []
        self._of = {}  # the [[number]]s of each study

    def shown(self, number):
        """(id, number): the piece of a text that the page makes a link of."""
        self.numbers.append(number)
        return f"n{len(self.numbers)}", number

    def pieces(self, *parts):
        """A text of strings and numbers, the numbers with ids."""
        return [self.shown(part) if isinstance(part, Number) else str(part) for part in parts]

    def text(self, study, text):
        """A text of a study file, each {name} the number of that name."""
        if study.folder not in self._of:
            self._of[study.folder] = numbers_of(study)
        parts = []
        for words, name, _, _ in Formatter().parse(text):
            parts += [words] if words else []
            if name is not None:
                found = self._of[study.folder][name]
                parts.append(found)
                if found.missing and not found.left_out:
                    self.missing.append([study.name, f"number {name}", found.missing])
        return self.pieces(*parts)

    def table(self):
        """All numbers: what was made of which metric of which runs."""
        header = ["id", "text", "low", "high", "study", "quantity", "norm", "take", "scale", "offset", "runs", "over"]
        rows = [[f"n{k}", n.text, *(repr(float(v)) for v in ((n.values[0], n.values[-1]) if n.values else (float("nan"),) * 2)), n.study, n.quantity,
                 n.norm, n.take, f"{n.scale:g}", f"{n.offset:g}", " ".join(n.runs), " ".join(n.over)] for k, n in enumerate(self.numbers, 1)]
        return Table("numbers", "Numbers in the words of this page", header, rows, 2)
