"""Comparisons made of chosen numbers, nothing simulated."""

import numpy as np

from model.drive_files import load_drive
from sandbox.drive.recording import CHANNELS, Recording
from sandbox.drive.scenario import load_scenario
from sandbox.evaluation.compare import Comparison, Run
from sandbox.evaluation.score import ErrorDeg, Row

NO_ERROR = ErrorDeg(None, None, None, None)


def recording_of(channels):
    """Return a recording of some channels (n,); the others are zero."""
    n = len(next(iter(channels.values()))) if channels else 0
    return Recording(np.column_stack([channels.get(name, np.zeros(n)) for name in CHANNELS]))


def row_of(belief, closed, load, error, **changes):
    """Return a row of qnull; t_start, t_end, speed_rpm, predicted_mean_deg, lost_lock: as given, or
    plain."""
    own = {"speed_rpm": 60.0, "predicted_mean_deg": None, "lost_lock": False}
    own |= {"t_start": 0.0, "t_end": 0.1, **changes}
    return Row("qnull", belief, closed, load, error_deg=error, **RESTS, **own)


RESTS = {"transient_max_deg": None, "reference_held": True}


def run_of(belief, closed, rows, estimator="qnull", recording=None):
    """Return a run of these rows."""
    own = recording_of({}) if recording is None else recording
    return Run(estimator, belief, closed, own, tuple(rows), 0.0)


def comparison_of(runs, **properties):
    """Return a comparison of runs on a staircase of `ipm_exchanged`."""
    return Comparison(
        load_drive("ipm_exchanged"), load_scenario("staircase"), tuple(runs), properties
    )
