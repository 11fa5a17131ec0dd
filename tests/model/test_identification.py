"""The paper's least squares as printed: what it recovers, what biases it, and its uncertainties."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import load_drive
from model.energy import Energy, flux_from_current, hessian
from model.errors import BadInput
from model.identification import first_order, first_order_estimate
from model.levels import NAMES, D, Levels, Q

BIAS = np.linspace(-2.0, 2.0, 9)
AXES = np.repeat([D, D, Q], len(BIAS))


def _levels(slope_of, resistance=12.15, amplitude=30.0):
    """Levels of the three staircases with slopes from a function of (i_d, i_q) returning Gamma_dd,
    dq, qq."""
    zero = np.zeros_like(BIAS)
    current = np.column_stack(
        [np.concatenate([BIAS, zero, zero]), np.concatenate([zero, BIAS, BIAS])]
    )
    rows = [np.array(slope_of(a, b)) for a, b in current]
    slope = np.array(
        [g[[0, 1]] if axis == D else g[[1, 2]] for g, axis in zip(rows, AXES, strict=True)]
    )
    wave = np.zeros((len(AXES), 8, 2))
    wave[np.arange(len(AXES)), :, AXES] = np.where(np.arange(8) < 4, amplitude, -amplitude)
    sd = np.full((len(AXES), 2), 1e-3)
    return Levels(
        250e-6, AXES, resistance * current, current, slope, sd, sd, wave, np.zeros(len(AXES))
    )


def _printed(p):
    """Slopes by eqs. (saturation1) to (saturation4q), typed again from the paper."""

    def slope(i_d, i_q):
        _, ld, lq, a30, a12, a40, a22, a04 = p
        dd = 1 / ld + 6 * a30 * ld * i_d + 12 * a40 * ld**2 * i_d**2 + 2 * a22 * lq**2 * i_q**2
        return dd, 2 * a12 * lq * i_q, 1 / lq + 12 * a04 * lq**2 * i_q**2

    return slope


def test_data_that_obey_the_printed_formulas_are_recovered():
    p = [12.15, 0.0919, 0.0458, 7.70, 5.35, 19.42, 22.18, 6.62]
    fit = first_order(_levels(_printed(p)))
    np.testing.assert_allclose([fit.values[n] for n in NAMES], p, rtol=1e-10)
    assert fit.residual_rms < 1e-12


def test_exact_ripple_biases_it_as_polynomial_fits_of_the_hessian_say():
    m = load_drive("ipm").motor.energy
    levels = _levels(lambda a, b: hessian(m, *map(float, flux_from_current(m, a, b))))
    found = dict(zip(NAMES[1:], first_order_estimate(levels, levels.slope), strict=True))
    ld, lq = 0.0919, 0.0458
    on_d = np.array([hessian(m, *map(float, flux_from_current(m, x, 0.0)))[0] for x in BIAS])
    # independent of the code under test: plain polynomials
    basis = np.vander(BIAS, 3, increasing=True)[:, 1:]
    c1, c2 = np.linalg.lstsq(basis, on_d - 1 / ld, rcond=None)[0]
    assert found["alpha_30"] == pytest.approx(c1 / (6 * ld), rel=1e-9)
    assert found["alpha_40"] == pytest.approx(c2 / (12 * ld**2), rel=1e-9)
    assert found["alpha_40"] < 0.75 * 19.42  # no small bias: the reason for an exact fit
    assert found["inductance_q"] == pytest.approx(lq, rel=1e-9)


@pytest.mark.parametrize(
    # NOTES: 5.6 and 1.4 mH for the IPM, 12 and 1.7 mH for the SPM; L^2 x 10 mA / (u / 4f)
    ("name", "l_d", "l_q"),
    [("ipm", 5.6e-3, 1.4e-3), ("spm", 12.1e-3, 1.7e-3)],
)
def test_ten_milliampere_give_the_printed_uncertainty_of_inductances(name, l_d, l_q):
    drive = load_drive(name)
    m = drive.motor
    p = [m.resistance, *(getattr(m, n) for n in NAMES[1:])]
    fit = first_order(
        _levels(_printed(p), amplitude=drive.injection.amplitude), current_uncertainty=0.01
    )
    # two staircases pass i = 0 with d
    assert fit.sd["inductance_d"] == pytest.approx(l_d / np.sqrt(2), rel=0.02)
    assert fit.sd["inductance_q"] == pytest.approx(l_q, rel=0.02)


def _without(levels, keep):
    arrays = {f.name: getattr(levels, f.name) for f in dataclasses.fields(levels)}
    return Levels(**{k: v[keep] if isinstance(v, np.ndarray) else v for k, v in arrays.items()})


@pytest.mark.parametrize(
    ("drop", "message"),
    [
        (
            lambda lv: lv.axis == D,
            "no steady level with injection on d and bias on d: inductance_d",
        ),
        (
            lambda lv: lv.axis == Q,
            "no steady level with injection on q and bias on q: inductance_q and alpha_04",
        ),
        (
            lambda lv: (lv.axis == D) & (lv.current[:, 1] != 0),
            "on q with injection on d has levels at 0 A only: alpha_12 and alpha_22 need",
        ),
        (lambda lv: (lv.axis == D) & (lv.current[:, 0] < 0), "no level at negative i_d"),
        (
            lambda lv: (lv.axis == Q) & (np.abs(lv.current[:, 1]) < 1.9),
            "at -2, 2 A only: inductance_q and alpha_04",
        ),
        (lambda lv: np.hypot(*lv.current.T) < 0.1, "no level at zero current with injection on d"),
    ],
)
def test_missing_levels_are_named(drop, message):
    levels = _levels(_printed([12.15, 0.0919, 0.0458, 7.70, 5.35, 19.42, 22.18, 6.62]))
    with pytest.raises(BadInput, match=message):
        first_order(_without(levels, ~drop(levels)))


def test_the_fit_hands_back_its_energy():
    p = [12.15, 0.0919, 0.0458, 7.70, 5.35, 19.42, 22.18, 6.62]
    found = first_order(_levels(_printed(p))).energy
    np.testing.assert_allclose(found, Energy(1 / p[1], 1 / p[2], *p[3:]), rtol=1e-9)
