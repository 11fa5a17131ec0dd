"""Drives of the withheld campaigns: families, a motor drawn around its family, the ordinary
deviations of its bench.

Truth and belief are separate motors: `draw_motor` gives the true one, `misjudge` what an
identification states of it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from model.drive_files import load_drive
from model.energy import SOLVED, flux_newton, is_convex_to
from model.errors import unknown
from model.mapped import ALPHAS, MappedMotor
from model.parameters import Drive, Motor
from sandbox.drive.record import UNCERTAINTY
from sandbox.switched.bench_numbers import SOFT_SIGN, SwitchedBench
from sandbox.withheld.making.map_motors import MAPS, changed

OWN = {name: Path(__file__).with_name(f"{name}.toml") for name in ("modern", *MAPS)}
FAMILIES = ("ipm", "ipm_exchanged", "spm_exchanged", "modern")
MODERN_RATES = (8000.0, 10000.0, 12500.0, 16000.0)  # Hz
SPREAD = {"magnet_flux": 0.06, "viscous_friction": 0.3}  # half width of a family, relative
USUAL_SPREAD = 0.1
DRAWN = (
    "resistance",
    "magnet_flux",
    "inductance_d",
    "inductance_q",
    *ALPHAS,
    "inertia",
    "viscous_friction",
)
KEPT = ("inductance_d", "inductance_q", *ALPHAS)
LINK_NOISE = 0.3  # V rms of one reading of the DC link
OFF = 2.0  # times: by how much stated deviations are misjudged at the most
# stated deviations; without this bound one bench in three would have a value beyond it
MOST_OFF = 3.0
# of a current's sign, as the switched bench counts them
SHAPES = {"linear": 0.0, "hard": 1.0, "tanh": 2.0}
VALID_TO = 2.2  # times rated current: a drawn motor's energy is convex up to here


@dataclass(frozen=True)
class BenchDeviations:
    """The ordinary deviations of one bench: [background] as stated, and what was drawn of it
    (SI)."""

    background: Mapping[str, float]
    gains: tuple[float, float, float]
    offsets: tuple[float, float, float]  # A
    encoder_offset: float  # rad, electrical
    dead_time: float  # s
    load_torque_offset: float  # N m


def family_drive(family: str) -> Drive:
    """Return a family's drive; BadInput with the nearest name for an unknown one, or where its flux
    map is missing."""
    if family not in (*FAMILIES, *OWN):
        raise unknown("family", family, (*FAMILIES, *OWN))
    return load_drive(OWN.get(family, family))


def draw_drive(family: str, rng: Generator, other_encoders: bool) -> Drive:
    """Return a drive around its family; other_encoders: other counts than the usual 4096, too."""
    base = family_drive(family)
    converter, injection = base.converter, base.injection
    if family == "modern":
        rate = float(rng.choice(MODERN_RATES))
        converter = dataclasses.replace(converter, sampling_period=1.0 / rate, pwm_frequency=rate)
        injection = dataclasses.replace(injection, frequency=rate / 8.0)
    counts = int(rng.choice([4096, 8192, 10000])) if other_encoders else 4096
    rated = base.motor.rated_current
    converter = dataclasses.replace(
        converter,
        current_noise=rated * float(np.exp(rng.uniform(np.log(0.001), np.log(0.0032)))),
        current_resolution=0.002 * rated,
        encoder_counts=counts,
    )
    return Drive(draw_motor(base.motor, rng), converter, injection, {})


def draw_motor(family: Motor, rng: Generator) -> Motor:
    """Return a motor around its family whose energy is convex as far as the campaign's currents go.

    A flux map stays as it was measured.
    """
    drawn = [n for n in DRAWN if not (isinstance(family, MappedMotor) and n in KEPT)]
    for _ in range(100):
        values = {
            name: getattr(family, name)
            * (1.0 + SPREAD.get(name, USUAL_SPREAD) * rng.uniform(-1.0, 1.0))
            for name in drawn
        }
        motor = dataclasses.replace(family, **values)
        if valid(motor):
            return motor
    raise AssertionError(f"no valid motor around {family.name} in 100 draws")


def valid(motor: Motor) -> bool:
    """Tell whether a motor's energy is convex and every current reached within VALID_TO of rated
    current."""
    m = motor.energy
    for angle in np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False):
        reached = [(0.0, 0.0)]
        for r in np.linspace(0.0, VALID_TO * motor.rated_current, 25)[1:]:
            d, q, status = flux_newton(
                m, float(r * np.cos(angle)), float(r * np.sin(angle)), *reached[-1]
            )
            if status != SOLVED:
                return False
            reached.append((d, q))
        if not is_convex_to(m, *np.transpose(reached[1:])).all():
            return False
    return True


def draw_bench(drive: Drive, rng: Generator, vary: bool = False) -> BenchDeviations:
    """Return a bench's ordinary deviations, drawn with the standard deviations that its campaign
    states.

    vary: with 1/OFF to OFF times them, see `deviation`.
    """
    rated = drive.motor.rated_current
    background = {
        "current_gain": 0.0015,
        "current_offset": 0.0008 * rated,
        "encoder_offset": 0.002,
        "dead_time": 4e-8,
        "load_torque_gain": 0.01,
        "load_torque_offset": 0.003 * drive.motor.rated_torque,
    }
    gains = 1.0 + background["current_gain"] * deviations(rng, vary, 3)
    offsets = background["current_offset"] * deviations(rng, vary, 3)
    return BenchDeviations(
        background,
        (float(gains[0]), float(gains[1]), float(gains[2])),
        (float(offsets[0]), float(offsets[1]), float(offsets[2])),
        float(background["encoder_offset"] * deviations(rng, vary)[0]),
        float(abs(background["dead_time"] * deviations(rng, vary)[0])),
        float(background["load_torque_offset"] * deviations(rng, vary)[0]),
    )


def misjudge(motor: Motor, rng: Generator, vary: bool = False) -> Motor:
    """Return a motor as its identification would state it: every value off by its uncertainty;
    vary: `deviations`."""
    off = {k: 1.0 + s * float(deviations(rng, vary)[0]) for k, s in uncertainty(motor).items()}
    return changed(motor, {k: getattr(motor, k) * x for k, x in off.items()})


def uncertainty(motor: Motor) -> dict[str, float]:
    """Return [uncertainty] as a campaign with such a nominal motor states it; a flux map has no
    alphas."""
    return {
        k: s for k, s in UNCERTAINTY.items() if not (isinstance(motor, MappedMotor) and k in ALPHAS)
    }


def deviations(rng: Generator, vary: bool, count: int = 1) -> NDArray[np.float64]:
    """Return how far ordinary values lie off (count,), in stated standard deviations: Gaussian.

    vary: somebody misjudged them, so that the real one is 1/OFF to OFF times the stated one, drawn;
    none further off than MOST_OFF, which by the campaign's own statement would be a gap and no
    ordinary deviation.
    """
    if not vary:
        return rng.standard_normal(count)
    times = OFF ** rng.uniform(-1.0, 1.0)
    out = times * rng.standard_normal(count)
    while np.any(far := np.abs(out) > MOST_OFF):
        out = np.where(far, times * rng.standard_normal(count), out)
    return out


def off_by(believed: Motor, stated: Motor, bench: BenchDeviations) -> dict[str, float]:
    """Return how far every ordinary value of a drive lies off, in stated standard deviations."""
    out = {
        k: (getattr(stated, k) / getattr(believed, k) - 1.0) / s
        for k, s in uncertainty(stated).items()
    }
    b = bench.background
    for x, gain, offset in zip("abc", bench.gains, bench.offsets, strict=True):
        out |= {
            f"gain_{x}": (gain - 1.0) / b["current_gain"],
            f"offset_{x}": offset / b["current_offset"],
        }
    return out | {
        k: getattr(bench, k) / b[k] for k in ("encoder_offset", "dead_time", "load_torque_offset")
    }


def sign_of(motor: Motor, rng: Generator) -> dict[str, float]:
    """Return how the sign of a current goes through zero on a bench, as fields of the switched
    bench.

    A shape of SHAPES and a width around the usual one.  A bench that knows the linear shape only
    has a tenth of the width for a hard sign, and the linear one for any other.
    """
    shape, width = (
        str(rng.choice(list(SHAPES))),
        SOFT_SIGN * float(2.0 ** rng.uniform(-1.0, 1.0)) * motor.rated_current,
    )
    if "sign_shape" in SwitchedBench._fields:
        return {"sign_shape": SHAPES[shape], "soft_current": width}
    return {"soft_current": 0.1 * width if shape == "hard" else width}
