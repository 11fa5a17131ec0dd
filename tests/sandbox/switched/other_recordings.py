"""Campaigns of the plant of other structure, and what a replay misses of them."""

import math

import numpy as np

from model.parameters import Converter, Drive, Injection, Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.replay.replay import prepare, replay
from tests.sandbox.switched.other_plant import Other

MOTOR = Motor("plain", 3, 3.6, 0.545, 0.036, 0.051, 0.015, 6.1, 14.0, 1500.0)
NOMINAL, N, SOFT = 540.0, 800, 0.015 * 6.1
# A rms: what the replay is told to be from an independent bench (CHANGELOG, plant_against_bench)
CLOSE = 2e-5 * 6.1


def commands(period: float, rate: float = 40.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the angle (rad) of a rotor that turns at rate (Hz, electrical) and commands (V) for a
    current of some ampere."""
    t = period * np.arange(N)
    theta = rate * math.tau * t + 0.3
    ripple = 60.0 * np.sign(np.sin(math.tau * (t / (8.0 * period) + 1e-3)))
    turn = np.exp(1j * theta)
    u = (
        ripple + 10.0 * np.sin(30.0 * t) + 1j * (0.545 * rate * math.tau + 18.0 * np.cos(23.0 * t))
    ) * turn
    return theta, u.real, u.imag


def duties(u_alpha, u_beta, link) -> np.ndarray:
    """Return centred duties, written out phase by phase."""
    legs = np.stack(
        [(u_alpha + 1j * u_beta) * np.exp(-2j * math.pi * k / 3.0) for k in range(3)], axis=1
    ).real
    middle = 0.5 * (legs.max(axis=1) + legs.min(axis=1))
    return 0.5 + (legs - middle[:, None]) / np.asarray(link)[:, None]


def recorded(
    plant: Other, says: dict, *, link=None, read=None, divide=None, columns=None, rate=40.0
) -> Campaign:
    """Return a campaign of one driven recording: link: V, true (n,); read: as u_dc has it; divide:
    by what the drive divides its commands; columns: others than commanded volts; rate: Hz."""
    theta, u_alpha, u_beta = commands(plant.period, rate)
    link = np.full(N, NOMINAL) if link is None else link
    read = link if read is None else read
    divide = read if divide is None else divide
    i = plant.run(duties(u_alpha, u_beta, divide), link, theta)
    t = plant.period * np.arange(N)
    own = {
        "t": t,
        "u_alpha": u_alpha,
        "u_beta": u_beta,
        "i_a": i[:, 0],
        "i_b": i[:, 1],
        "i_c": i[:, 2],
        "theta": theta,
    }
    own |= {"u_dc": read, **(columns(u_alpha, u_beta) if columns else {})}
    converter = Converter(
        plant.period, NOMINAL, 0.0, 0.01, **{"pwm_frequency": 1.0 / plant.period, **says}
    )
    drive = Drive(MOTOR, converter, Injection(1.0 / (8.0 * plant.period), 60.0), {})
    return Campaign(
        "other", drive, (CampaignRecording("run.parquet", "driven", "d", own),), {}, {}, False
    )


def missed(campaign: Campaign, values: dict | None = None) -> float:
    """Return the rms (A) by which a replay with so many values misses the currents, the start left
    out."""
    prepared = prepare(campaign, steps=4)
    found = replay(prepared, [{"bench.soft_current": SOFT, **(values or {})}]).currents[0][:, :, 0]
    return float(np.sqrt(np.mean((found - prepared.recordings[0].read)[40:] ** 2)))


def plant(**changes) -> Other:
    """Return the other plant of the same motor at 4 kHz."""
    return Other(3.6, 0.036, 0.051, 0.545, **{"period": 250e-6, "soft": SOFT, **changes})


def waves() -> np.ndarray:
    """Return a rectified link (V): 300 Hz, 5 % of nominal, and a slow sag."""
    t = 250e-6 * np.arange(N)
    return NOMINAL * (1.0 + 0.05 * np.sin(math.tau * 300.0 * t) - 0.1 * t / t[-1])
