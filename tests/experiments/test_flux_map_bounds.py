"""The bound is nothing where a map is a motor's, and is met by what was planted where it is not."""

import numpy as np
import pytest

from experiments.flux_map_bounds import circulations, least_change, rises
from model.drive_files import load_drive
from model.energy import flux_from_current
from model.fluxmap import FluxMap


def planted(noise=0.0, bump=0.0, points=25):
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-2.0, 2.0, points)
    d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))
    rng = np.random.default_rng(1)
    d, q = d + noise * rng.normal(size=d.shape), q + noise * rng.normal(size=q.shape)
    d[points // 2, points // 2] += bump
    return FluxMap("planted", i, i, d, q)


def rms(change):
    return float(np.sqrt(np.mean(np.sum(change**2, axis=0))))


def test_a_motor_s_map_needs_no_change():
    # trapezoid: h^3/12 of the flux's second derivative, 1e-4 of the largest flux here; it falls
    # with the grid squared
    coarse, fine = (rms(least_change(planted(points=n), passive=True)) for n in (13, 25))
    assert fine < 2e-4 * 0.2
    assert fine < 0.35 * coarse


def test_noise_costs_the_share_of_it_that_is_not_a_gradient():
    """Projection onto the conditions: of 2 n^2 numbers, (n - 1)^2 are lost, each of them noise's
    variance."""
    n, sigma = 25, 1e-4
    change = least_change(planted(noise=sigma), passive=False)
    # 576 squares: 6 % of their mean
    assert rms(change) == pytest.approx(sigma * (n - 1) / n, rel=0.1)
    m = planted(noise=sigma)
    left = circulations(m) @ (np.array([m.psi_d, m.psi_q]) + change).ravel()
    assert np.max(np.abs(left)) < 1e-12


def test_a_fall_costs_what_its_repair_takes():
    m = planted(bump=0.05)  # beyond its neighbour at the next i_d, 0.016 Wb further
    assert np.min(rises(m) @ np.concatenate([m.psi_d.ravel(), m.psi_q.ravel()])) < -0.02
    change = least_change(m, passive=True)
    repaired = (np.array([m.psi_d, m.psi_q]) + change).ravel()
    assert np.min(rises(m) @ repaired) > -1e-9
    assert rms(change) * 25 < 0.05  # taking the bump back would do
    assert rms(change) > rms(least_change(m, passive=False))
