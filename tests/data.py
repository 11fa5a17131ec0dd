"""Where data that are not part of the repository lie; a test that needs absent ones is skipped with
the reason."""

import os
from pathlib import Path

import pytest

SHARED = Path(__file__).resolve().parents[1].parent / "shared"


def _folder(variable, name):
    path = Path(os.environ.get(variable) or SHARED / name)
    if not path.is_dir():
        pytest.skip(f"no folder '{path}': set {variable} to the data")
    return path


def real_data():
    """Return the folder of third-party machine data (`SENSORLESS_DATA`)."""
    return _folder("SENSORLESS_DATA", "realdata")


def recordings_folder():
    """Return the folder of bench campaigns (`SENSORLESS_RECORDINGS`)."""
    return _folder("SENSORLESS_RECORDINGS", "recordings")


def cases_folder():
    """Return the folder of what users met in practice (`SENSORLESS_CASES`)."""
    return _folder("SENSORLESS_CASES", "cases")
