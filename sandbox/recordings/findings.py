"""What is said of recordings on the way in: findings, doubts, and what cannot be right."""

from __future__ import annotations

import math
from dataclasses import dataclass

from model.errors import BadInput, shown


@dataclass(frozen=True)
class Finding:
    """Something suspicious, or changed on the way in: file, column and row (None: the whole of it),
    one sentence.

    files: all that it holds of, where it is not that one alone; rereads: parts of a log
    (`checks.changes`) of which it says that another factor, or another zero of the angle, is right;
    left: the share of the voltage that stays unexplained if it is right (nan: it says none).
    """

    file: str
    column: str
    row: int | None
    text: str
    files: tuple[str, ...] = ()
    rereads: frozenset[str] = frozenset()
    left: float = math.nan

    def __post_init__(self) -> None:
        # it holds names of columns as other programs wrote them
        object.__setattr__(self, "text", shown(self.text))


class Refused(BadInput):
    """What cannot be right in a recording, as a finding."""

    def __init__(self, finding: Finding) -> None:
        super().__init__(finding.text)
        self.finding = finding

    def __reduce__(self) -> tuple[type[Refused], tuple[Finding]]:
        """Let it cross from one process to another."""
        return type(self), (self.finding,)


class Doubt(Finding):
    """A finding on the way in that a person should look at before going on."""


class Unanswered(Finding):
    """A recording that contradicts the nominal model by no mistake that is known: a diagnosis may
    explain it."""
