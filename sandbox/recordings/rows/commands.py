"""The voltage between the rows of a log: in every PWM period of a slow one (`slow`), and its mean
from row to row."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.array_types import Array
from model.parameters import Converter
from sandbox.recordings.campaign import CampaignRecording

Complex = NDArray[np.complexfloating[Any, Any]]
HELD, INTERPOLATED = "held", "interpolated"


def every_period(
    r: CampaignRecording, converter: Converter, theta: Array
) -> tuple[Array, Array, Array]:
    """Return u_alpha, u_beta and u_dc (V) in every PWM period (n held,); theta: the angle (rad) at
    each of them."""
    held = converter.periods_a_row
    if held == 1:
        return r.u_alpha, r.u_beta, r.u_dc
    u = r.u_alpha + 1j * r.u_beta
    if converter.between_rows != INTERPOLATED:
        u, link = np.repeat(u, held), np.repeat(r.u_dc, held)
        return u.real, u.imag, link
    own = _straight(u * np.exp(-1j * theta[::held]), held) * np.exp(1j * theta)
    return own.real, own.imag, _straight(r.u_dc, held).real


def _straight(x: NDArray[Any], parts: int) -> NDArray[Any]:
    """Return so many values from each row of x on, in a straight line to the next; the last one
    stays."""
    step = np.append(np.diff(x), 0.0)
    return (x[:, None] + step[:, None] * (np.arange(parts) / parts)[None, :]).ravel()


def mean_command(u: Complex, theta: Array, converter: Converter) -> Complex:
    """Return the mean voltage (V) from each row to the next, of commands u and angles theta (rad)
    in the rows (n,)."""
    held = converter.periods_a_row
    if held == 1 or converter.between_rows != INTERPOLATED or len(u) < 2:
        return u
    turn = np.append(np.diff(theta), 0.0)
    step = np.append(u[1:], 0.0) * np.exp(-1j * turn) - u
    step[-1] = 0.0
    return np.asarray(
        sum((u + k / held * step) * np.exp(1j * k / held * turn) for k in range(held)) / held
    )
