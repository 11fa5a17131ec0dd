"""Points for a search that looks at no recording."""

from dataclasses import dataclass
from types import SimpleNamespace

from model.errors import BadInput

NOWHERE = SimpleNamespace(campaign=SimpleNamespace(drive=SimpleNamespace(motor=None)))


@dataclass(frozen=True)
class Place:
    """A point of which nothing is asked but that it can be copied."""

    values: dict
    prepared: object


def nothing():
    """Tell no parameters."""
    raise BadInput("a table has none")
