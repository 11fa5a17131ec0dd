"""What other installed packages bring, named by the entry points of their installation.

    [project.entry-points."sensorless.estimators"]
    mine = "my_package.observer:ESTIMATOR"   # the estimator's name; an `Estimator`
    [project.entry-points."sensorless.effects"]
    fan = "my_package.effects"               # an effect's name; a module with its cards in EFFECTS
    [project.entry-points."sensorless.presets"]
    logger = "my_package.presets"            # a preset's name; the package that holds logger.toml

They are found by name without importing them; a name of our own is never given away.
"""

from __future__ import annotations

import logging
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from model.errors import BadInput, raised

GROUP = "sensorless.{}"


@cache
def brought(kind: str) -> dict[str, EntryPoint]:
    """Return what installed packages bring of a kind ('estimators', 'effects', 'presets'), by
    name."""
    return {point.name: point for point in sorted(entry_points(group=GROUP.format(kind)))}


def line_of(point: EntryPoint) -> str:
    """Return one line for a list: what the package says of itself, its name and version."""
    package = point.dist
    if package is None:
        return "of another package"
    return (
        f"{package.metadata['Summary'] or 'no summary'} (package {package.name} {package.version})"
    )


def load(point: EntryPoint) -> Any:
    """Return the object that an entry point names; BadInput where it cannot be imported."""
    try:
        return point.load()
    except (Exception, SystemExit) as error:  # whatever another package raises is its own to mend
        raise BadInput(
            f"'{point.name}' of another package cannot be loaded: {raised(error)}; {_mend(point)}"
        ) from error


def place_of(point: EntryPoint) -> Path:
    """Return the file of the module that an entry point names, not imported; BadInput where there
    is none."""
    try:
        spec = find_spec(point.module)
    except Exception as error:  # of the packages above it
        raise BadInput(
            f"'{point.name}' of another package cannot be found: {raised(error)}; {_mend(point)}"
        ) from error
    if spec is None or spec.origin is None:
        raise BadInput(
            f"'{point.name}' names the module '{point.module}', which is no file; {_mend(point)}"
        )
    return Path(spec.origin)


def warn(error: BadInput) -> None:
    """Say why a package's part is left out."""
    logging.getLogger("sensorless").warning("%s", error)


def _mend(point: EntryPoint) -> str:
    named = point.dist.name if point.dist else point.value
    return f"mend or uninstall '{named}'"
