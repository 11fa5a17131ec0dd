"""Conventions whose factor one value of a drive may be off by, but not several: rms, line to line,
power-invariant, in a log and in [motor]."""

import dataclasses
import functools
import math

import pytest

from sandbox.recordings.campaign import read_folder
from sandbox.recordings.checks.balance import PHASES, VOLTAGES
from sandbox.recordings.checks.factors import conventions_off
from tests.data import recordings_folder

RMS, LINE = math.sqrt(2.0), math.sqrt(3.0)
WINDING = ("resistance", "inductance_d", "inductance_q")


@functools.cache
def bench(name):
    """Some recordings of the bench: at locked rotor, under load, at speed, and coasting."""
    campaign = read_folder(recordings_folder() / "practice" / name)
    kept = (campaign[n] for n in ("locked_q_inject_d", "run_slow", "run_fast", "coast_down"))
    return tuple(_first(r) for r in kept), campaign.drive


def _first(r):
    return dataclasses.replace(r, columns={n: x[:3000] for n, x in r.columns.items()})


def told(name, current=1.0, voltage=1.0, **factors):
    """What is said of recordings whose currents, voltages and [motor] values are some times what
    they are."""
    recordings, drive = bench(name)
    scale = {**dict.fromkeys(PHASES, current), **dict.fromkeys(VOLTAGES, voltage)}
    own = [
        dataclasses.replace(r, columns={n: scale.get(n, 1.0) * x for n, x in r.columns.items()})
        for r in recordings
    ]
    values = {n: f * getattr(drive.motor, n) for n, f in factors.items()}
    drive = dataclasses.replace(drive, motor=dataclasses.replace(drive.motor, **values))
    return " ".join(f.text.partition(" if ")[2] for f in conventions_off(own, drive))


MADE = {
    "currents are rms values": {"current": 1.0 / RMS},
    "voltages are rms values": {"voltage": 1.0 / RMS},
    "currents are rms values, not peak: rms for peak and voltages are rms": {
        "current": 1.0 / RMS,
        "voltage": 1.0 / RMS,
    },
    "voltages are between two phases": {"voltage": LINE},
    "resistance, inductance_d and inductance_q are those between two terminals": dict.fromkeys(
        WINDING, 2.0
    ),
    "resistance, inductance_d and inductance_q are those between one terminal and": dict.fromkeys(
        WINDING, 1.5
    ),
    "inductance_d and inductance_q are those between two": dict.fromkeys(WINDING[1:], 2.0),
    "magnet_flux is an rms value; then multiply magnet_flux by sqrt(2) in": {
        "magnet_flux": 1.0 / RMS
    },
    "magnet_flux is an rms value between two": {"magnet_flux": LINE / RMS},
    "magnet_flux is that between two": {"magnet_flux": LINE},
    "two terminals and magnet_flux is an rms value between two terminals; then halve": {
        **dict.fromkeys(WINDING, 2.0),
        "magnet_flux": LINE / RMS,
    },
}


@pytest.mark.parametrize("name", ["p01", "p02"])
@pytest.mark.parametrize("words", MADE)
def test_a_convention_is_told(name, words):
    """p01 is as stated, p02 has ordinary deviations and a dead time of 1.2 us."""
    assert words in told(name, **MADE[words])


def test_one_change_is_told_once():
    """R, and L_d with L_q, between two terminals are the whole data sheet between two terminals."""
    assert told("p01", **dict.fromkeys(WINDING, 2.0)).count("between two terminals") == 1


@pytest.mark.parametrize(
    "factors",
    [{}, {"resistance": 0.75}, {"magnet_flux": 1.1}, {"inductance_d": 1.2, "inductance_q": 1.2}],
)
@pytest.mark.parametrize("name", ["p01", "p02", "p08"])
def test_what_a_hot_drive_or_saturation_makes_is_no_convention(name, factors):
    """A winding 85 K warmer than stated, a magnet of ferrite 50 K warmer, L of small signals."""
    assert told(name, **factors) == ""
