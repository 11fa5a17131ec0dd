"""A simulated run as a campaign in the recording format: what an engineer's bench would have written of it."""

from __future__ import annotations

import numpy as np

from model.errors import BadInput
from model.parameters import Drive
from sandbox.campaign import Campaign, CampaignRecording
from sandbox.recording import Recording
from sandbox.scenario import Scenario


def campaign_of(drive: Drive, scenario: Scenario, recording: Recording, name: str) -> Campaign:
    """Return a campaign of one recording: readings, commands and the nominal model; nothing of the truth.

    The angle is the encoder's reading, u_dc the controller's, load_torque what is asked of the load machine of a
    free rotor; theta_hat is the estimator's.  BadInput where samples were left out (stride > 1).
    """
    period = drive.converter.sampling_period
    if recording.t.size > 1 and abs(recording.t[1] - recording.t[0] - period) > 1e-6 * period:
        raise BadInput("a campaign needs every sample; simulate with stride = 1")
    columns = {c: np.array(getattr(recording, c)) for c in ("t", "u_alpha", "u_beta", "i_a", "i_b", "i_c")}
    columns["theta"] = np.array(recording.theta_read)
    columns["u_dc"] = np.full(recording.t.size, drive.converter.dc_bus_voltage)
    if scenario.rotor == "free":
        columns["load_torque"] = np.array(recording.load_torque)
    columns["theta_hat"] = np.array(recording.theta_hat)
    one = CampaignRecording(f"{scenario.name}.parquet", scenario.rotor, "d", columns)
    return Campaign(name, drive, (one,), {}, {}, False)
