"""A drive of another size gives the same answers: a whole campaign scaled in time, current and
voltage, by powers of two, which round nothing.

What begins at a size of its own, in s or V, is left out (ABSOLUTE): a dead time is some
microseconds and a silicon device drops a volt, whatever the drive.
"""

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest

from sandbox.gap.diagnose import diagnosis_of
from sandbox.recordings.campaign import Campaign
from tests.sandbox.replay.benches import DRIVE, record

CASES = (("locked", 0.0), ("driven", 20.0), ("driven", 100.0), ("free", 0.0))
EFFECTS = {
    "flux_harmonics.psi_d6": 0.02 * DRIVE.motor.magnet_flux,
    "winding_asymmetry.delta_a": 0.2,
}
ABSOLUTE = (
    "current_filter",
    "current_sampling",
    "dc_link_ripple",
    "dead_time",
    "device_drop",
    "iron_loss",
    "shaft_compliance",
    "skin_effect",
)
STATED = {
    "current_gain": 1e-3,
    "current_offset": 5e-3,
    "encoder_offset": 2e-3,
    "dead_time": 5e-8,
    "load_torque_offset": 2e-3,
}


class Scale(NamedTuple):
    """Factors of time, current and voltage; those of other quantities follow."""

    time: float
    current: float
    voltage: float

    @property
    def flux(self):
        return self.voltage * self.time

    @property
    def torque(self):
        return self.flux * self.current

    def motor(self, m):
        """Return a motor of another size."""
        ohms = self.voltage / self.current
        factors = {
            "resistance": ohms,
            "magnet_flux": self.flux,
            "viscous_friction": self.torque * self.time,
        }
        factors |= dict.fromkeys(("inductance_d", "inductance_q"), ohms * self.time)
        factors |= {"inertia": self.torque * self.time**2, "rated_current": self.current}
        factors |= {"rated_torque": self.torque, "rated_speed_rpm": 1.0 / self.time}
        factors |= dict.fromkeys(("alpha_30", "alpha_12"), self.current / self.flux**2)
        factors |= dict.fromkeys(("alpha_40", "alpha_22", "alpha_04"), self.current / self.flux**3)
        return dataclasses.replace(m, **{k: f * getattr(m, k) for k, f in factors.items()})

    def converter(self, c):
        """Return its converter."""
        factors = {"sampling_period": self.time, "dc_bus_voltage": self.voltage}
        factors |= dict.fromkeys(("current_resolution", "current_noise"), self.current)
        more = {k: f * getattr(c, k) for k, f in factors.items()}
        if c.pwm_frequency is not None:
            more["pwm_frequency"] = c.pwm_frequency / self.time
        return dataclasses.replace(c, **more)

    def campaign(self, own):
        """Return a campaign of that drive."""
        i = own.drive.injection
        injection = dataclasses.replace(
            i, frequency=i.frequency / self.time, amplitude=i.amplitude * self.voltage
        )
        drive = dataclasses.replace(
            own.drive,
            motor=self.motor(own.drive.motor),
            converter=self.converter(own.drive.converter),
            injection=injection,
        )
        columns = {"t": self.time, "theta": 1.0, "load_torque": self.torque}
        columns |= dict.fromkeys(("u_alpha", "u_beta", "u_dc"), self.voltage)
        columns |= dict.fromkeys(("i_a", "i_b", "i_c"), self.current)
        recordings = tuple(
            dataclasses.replace(r, columns={k: columns[k] * v for k, v in r.columns.items()})
            for r in own.recordings
        )
        background = {k: v * BACKGROUND[k](self) for k, v in own.background.items()}
        return dataclasses.replace(own, drive=drive, recordings=recordings, background=background)


# what is ordinary of the bench, by the quantity
BACKGROUND = {
    "current_gain": lambda s: 1.0,
    "current_offset": lambda s: s.current,
    "encoder_offset": lambda s: 1.0,
    "dead_time": lambda s: s.time,
    "load_torque_gain": lambda s: 1.0,
    "load_torque_offset": lambda s: s.torque,
}
STATED = {"current_gain": 1e-3, "current_offset": 5e-3, "encoder_offset": 2e-3, "dead_time": 5e-8}


@pytest.fixture(scope="module")
def own():
    """Return a campaign of the switched bench with noise: two effects."""
    rng, noise = np.random.default_rng(5), DRIVE.converter.current_noise
    recordings = []
    for case in CASES:
        r = record(EFFECTS, *case)
        read = {
            k: r.columns[k] + noise * rng.standard_normal(len(r.t)) for k in ("i_a", "i_b", "i_c")
        }
        recordings.append(dataclasses.replace(r, columns=r.columns | read))
    return Campaign("own", DRIVE, tuple(recordings), {}, STATED, False)


def told(campaign):
    """Return the diagnosis of a campaign."""
    return diagnosis_of(campaign, exclude=ABSOLUTE, workers=1)


@pytest.mark.parametrize("scale", [Scale(0.25, 8.0, 2.0), Scale(2.0, 2.0**-7, 2.0**-4)])
def test_answers_scale_digit_by_digit(own, scale):
    """Recordings come in an order that their numbers decide, so sums over them round otherwise:
    1e-12 of J^2 times 1e4 readings is 1e-8 in the log of a chance."""
    one, other = told(own), told(scale.campaign(own))
    assert [h.effects for h in other.hypotheses[:9]] == [h.effects for h in one.hypotheses[:9]]
    for a, b in zip(one.hypotheses, other.hypotheses, strict=True):
        assert b.probability == pytest.approx(a.probability, abs=1e-8)
    assert (other.size.before, other.size.after) == pytest.approx(
        (one.size.before, one.size.after), rel=1e-9
    )
    assert other.simulations == one.simulations
