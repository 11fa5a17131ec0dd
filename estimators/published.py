"""Gains of tracking loops that open firmwares publish as their defaults, in the units of
`tracking.correct`.

VESC (bldc: foc_hfi_adjust_angle of motor/foc_math.c; foc_hfi_gain = 0.3 of motor/mcconf_default.h,
commit 09266def): once an injection period dt the angle moves by dt (4000 g e + I), g = 0.3, and the
speed I by 10 g e.

MESC (MESC_Firmware: MESC_Common/Src/MESChfi.c, commit 1ea620e1): twice an injection period the
angle moves by x + y, x = 5000 (m/m_0 - 1) of 65 536 parts of a turn, m the size of the ripple and
m_0 its mean over a turn, y = 0.05 times the sum of all x.  45 degrees beside d, m/m_0 - 1 = 2 S D
e/(S^2 + D^2), with the mean S and half the difference D of both inverse inductances.

Left out: both firmwares' limits of error and speed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple


class Gains(NamedTuple):
    """Gains of a type 2 tracking loop."""

    kp: float  # 1/s
    ki: float  # 1/s^2


VESC_GAIN = 0.3
MESC_STEP = 5000.0 * 2.0 * math.pi / 65536.0  # rad for a ripple twice as large


def vesc(period: float, gamma_d: float, gamma_q: float) -> Gains:
    """Return VESC's gains; period: s, of the injection; gamma: 1/H, inverse inductances."""
    return Gains(4000.0 * VESC_GAIN, 10.0 * VESC_GAIN / period)


def mesc(period: float, gamma_d: float, gamma_q: float) -> Gains:
    """Return MESC's gains, arguments as of `vesc`."""
    mean, half, h = 0.5 * (gamma_d + gamma_q), 0.5 * abs(gamma_d - gamma_q), 0.5 * period
    step = MESC_STEP * 2.0 * mean * half / (mean * mean + half * half)
    return Gains(step / h, 0.05 * step / (h * h))


PUBLISHED: dict[str, Callable[[float, float, float], Gains]] = {"vesc": vesc, "mesc": mesc}
