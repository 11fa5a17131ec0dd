"""A simulated run as a campaign in the recording format: what an engineer's bench would have
written of it."""

from __future__ import annotations

import dataclasses

import numpy as np

from estimators.contract import Estimator
from model.drive_files import all_stated
from model.errors import BadInput
from model.frames import wrapped
from model.parameters import Drive
from sandbox.drive.recording import Recording
from sandbox.drive.scenario import Scenario
from sandbox.recordings.campaign import Campaign, CampaignRecording

COUNTS = 4096  # a mechanical turn, of a bench whose drive file names none
LINK_NOISE = 7.5e-4  # of the nominal link voltage, rms of its reading, likewise
# relative standard deviations as a motor's identification states them; the simulated plant has none
UNCERTAINTY = {
    "resistance": 0.01,
    "magnet_flux": 0.01,
    "inductance_d": 0.015,
    "inductance_q": 0.015,
    "alpha_30": 0.03,
    "alpha_12": 0.04,
    "alpha_40": 0.04,
    "alpha_22": 0.05,
    "alpha_04": 0.04,
    "inertia": 0.03,
    "viscous_friction": 0.15,
}


def bench_of(
    drive: Drive, estimator: Estimator | None = None, scenario: Scenario | None = None
) -> Drive:
    """Return the drive as it is run for a recording: an encoder with counts, a link voltage read
    with noise.

    What the drive file states stays; the same numbers act in the run and stand in the campaign.
    BadInput for an estimator with which the recording would not be what the format says.
    """
    if estimator is not None and estimator.inside:
        raise BadInput(
            f"estimator '{estimator.name}' shifts the pulses inside the PWM period, recordings are "
            "of centred ones; record with another estimator"
        )
    if scenario is not None and any(s.blocked for s in scenario.segments):
        raise BadInput(
            f"scenario '{scenario.name}' blocks the gates, and recordings are of legs that switch "
            "as commanded; record one without blocked = true"
        )
    c = drive.converter
    counts = COUNTS if c.encoder_counts is None else c.encoder_counts
    noise = c.link_noise or LINK_NOISE * c.dc_bus_voltage
    return dataclasses.replace(
        drive, converter=dataclasses.replace(c, encoder_counts=counts, link_noise=noise)
    )


def background_of(drive: Drive) -> dict[str, float]:
    """Return the standard deviations of a bench's ordinary deviations, as stated; a simulated bench
    has none of them.

    current_gain relative, current_offset A, encoder_offset rad, dead_time s, load_torque_gain
    relative, load_torque_offset N m.
    """
    motor = drive.motor
    return {
        "current_gain": 0.0015,
        "current_offset": 8e-4 * motor.rated_current,
        "encoder_offset": 0.002,
        "dead_time": 4e-8,
        "load_torque_gain": 0.01,
        "load_torque_offset": 3e-3 * motor.rated_torque,
    }


def injection_axis(recording: Recording) -> str:
    """Return the axis of the measured rotor frame, 'd' or 'q', near which the injection lay.

    The loop injects along the estimate's d axis (while starting up along alpha, beta and then the
    axis found).
    """
    off = wrapped(recording.theta_hat - recording.theta_read)
    return "d" if float(np.mean(np.cos(off) ** 2)) >= 0.5 else "q"


def campaign_of(
    drive: Drive, scenario: Scenario, recording: Recording, name: str, pulsates: bool = True
) -> Campaign:
    """Return a campaign of one recording: readings, commands and the nominal model; nothing of the
    truth.

    drive: the one that was run (`bench_of`); pulsates: whether the estimator injects along an axis.
    The angle is the encoder's reading, u_dc the controller's, load_torque what is asked of the load
    machine of a free rotor; theta_hat is the estimator's.  BadInput where samples were left out
    (stride > 1).
    """
    period = drive.converter.sampling_period
    if recording.t.size > 1 and abs(recording.t[1] - recording.t[0] - period) > 1e-6 * period:
        raise BadInput("a campaign needs every sample; simulate with stride = 1")
    columns = {
        c: np.array(getattr(recording, c))
        for c in ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c", "u_dc")
    }
    columns["theta"] = np.array(recording.theta_read)
    if scenario.rotor == "free":
        columns["load_torque"] = np.array(recording.load_torque)
    columns["theta_hat"] = np.array(recording.theta_hat)
    axis = injection_axis(recording) if pulsates else "none"
    drive = dataclasses.replace(drive, provenance=all_stated(drive.provenance))
    one = CampaignRecording(f"{scenario.name}.parquet", scenario.rotor, axis, columns)
    return Campaign(name, drive, (one,), UNCERTAINTY, background_of(drive), False)
