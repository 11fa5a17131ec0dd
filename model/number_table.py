"""What every reader of tables returns: columns of floats, and what the file says about them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from model.array_types import Array
from model.errors import BadInput


@dataclass(frozen=True)
class Table:
    """Columns by name, the units that the file itself states, and what else there is to say.

    odd: what stood in a column's first cell that is no number, by column and row; notes: column and
    sentence on what was changed on the way; also: further spellings of columns ('Time (s)' of
    'Time'); twice: names that stood there more than once, with different values; breaks: rows
    before which the header stood again.
    """

    columns: Mapping[str, Array]
    units: Mapping[str, str]
    odd: Mapping[tuple[str, int], str]
    notes: tuple[tuple[str, str], ...] = ()
    also: Mapping[str, str] = field(default_factory=dict)
    twice: frozenset[str] = frozenset()
    breaks: tuple[int, ...] = ()

    @property
    def names(self) -> list[str]:
        """Return every spelling under which a column can be asked for."""
        return [*self.columns, *self.also]

    def key(self, name: str) -> str | None:
        """Return a column's own name for one of its spellings, None where there is none.

        Blanks at the ends and how many there are do not count.  BadInput for a name that means two
        columns.
        """
        found = name if name in self.columns else self.also.get(name)
        if found is None:
            plain = " ".join(name.split())
            found = next(
                (self.also.get(n, n) for n in self.names if " ".join(n.split()) == plain), None
            )
        if found in self.twice:
            raise BadInput(
                f"column '{found}' stands twice in the header; give each column its own name"
            )
        return found
