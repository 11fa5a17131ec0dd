"""Shared fixtures: one short comparison for everything that only needs some runs, and the shared data folder."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from model.parameters import load_drive
from sandbox.compare import compare
from sandbox.scenario import Scenario, Segment


@pytest.fixture(scope="session")
def small_comparison():
    """Two estimators on a two-step staircase, both beliefs, closed and open."""
    segments = (Segment(0.2), Segment(0.3, 1.0, ramp=0.05))
    scenario = Scenario("two_steps", segments, settle=0.15)
    return compare(load_drive("ipm_exchanged"), scenario, ("qnull", "ekf"), seed=3)


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder of reference programs and data beside the checkout; skips where it is not."""
    folder = Path(os.environ.get("SENSORLESS_SHARED") or Path(__file__).resolve().parents[2] / "shared")
    if not folder.is_dir():
        pytest.skip(f"needs the shared data folder, not found at {folder}")
    return folder
