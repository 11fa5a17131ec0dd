"""Numbers of the model by hand: slope of the null, rays of an audit, a map's margin, intervals,
what is refused."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from model import mapped
from model.drive_files import load_drive
from model.energy import currents, flux_from_current, hessian, min_eigenvalue
from model.errors import BadInput
from model.fluxmap import _check_size
from model.levels import Fit, require_information
from model.map_mistakes import check_points
from model.map_points import MapPoints
from model.saliency import audit
from model.spline import SplineEnergy
from model.spline_energy import _Box

MOTOR = load_drive("ipm_exchanged").motor


def numerical_hessian(m, d, q, step=1e-6):
    """Central differences of the currents, which are the energy's gradient."""
    along_d = np.subtract(currents(m, d + step, q), currents(m, d - step, q))
    along_q = np.subtract(currents(m, d, q + step), currents(m, d, q - step))
    return np.array([along_d, along_q]).T / (2.0 * step)


def test_the_slope_of_the_null_is_the_difference_of_the_eigenvalues():
    """Of the inverse inductances, over that at zero current: L_dq counts by its double."""
    m, found = MOTOR.energy, audit(MOTOR, rays=4, points=4)
    for load, slope in zip(found.load[::6], found.slope[::6], strict=True):
        d, q = flux_from_current(m, 0.0, load * MOTOR.rated_current)
        low, high = np.linalg.eigvalsh(numerical_hessian(m, float(d), float(q)))
        assert slope == pytest.approx((high - low) / abs(m.gamma_d - m.gamma_q), rel=1e-6)


def test_rays_of_an_audit_go_round_once():
    """Four rays are the half axes: the least eigenvalue is that of the worst of them."""
    found = audit(MOTOR, rays=4, points=6)
    least = math.inf
    for angle in (0.0, 0.5, 1.0, 1.5):
        for r in np.linspace(0.0, found.radius, 7):
            i = r * np.cos(angle * math.pi), r * np.sin(angle * math.pi)
            d, q = flux_from_current(MOTOR.energy, *i)
            least = min(least, min_eigenvalue(*hessian(MOTOR.energy, float(d), float(q))))
    assert found.min_eigenvalue == pytest.approx(least, rel=1e-9)
    assert min(abs(x) for x in found.worst_current) < 1e-12


def test_a_map_s_box_reaches_three_hundredths_beyond_its_data():
    box = _Box(np.array([0.1, 0.3]), np.array([-0.5, 0.4]), (4, 4))
    assert (box.low_d, box.high_d, box.high_q) == pytest.approx((0.094, 0.306, 0.515))


@pytest.mark.parametrize(("magnet", "kept"), [(-0.0009, 0.0), (-0.0011, -0.0011)])
def test_a_flux_a_thousandth_below_zero_is_noise_of_a_motor_without_magnets(
    monkeypatch, tmp_path, magnet, kept
):
    """The map goes down to -1 Wb.  A motor that keeps a negative flux is refused: its bounds say
    so."""
    spline = SplineEnergy(np.zeros((1, 1, 5, 5)), -1.0, -1.0, 1.0, 1.0, 10.0, 20.0)
    monkeypatch.setattr(
        mapped, "_remembered", lambda *_: SimpleNamespace(spline=spline, magnet=magnet)
    )
    seen = {}
    monkeypatch.setattr(mapped, "build", lambda kind, values, where: seen.update(values) or 1 / 0)
    with pytest.raises(ZeroDivisionError):
        mapped.mapped_motor({}, {"file": "mine.csv"}, tmp_path)
    assert seen["magnet_flux"] == kept


def test_an_interval_is_two_standard_deviations_wide_on_either_side():
    fit = SimpleNamespace(values={"resistance": 3.0}, sd={"resistance": 0.1})
    assert Fit.ci95(fit, "resistance") == pytest.approx((3.0 - 0.1959964, 3.0 + 0.1959964))


def test_a_magnet_off_the_d_axis_is_seen_where_a_map_ends_at_no_current_along_q():
    """psi_q of 0.3 Wb at i_q = 0, the map's last column, and of 0.6 Wb at most."""
    i_d, i_q = np.linspace(-2.0, 2.0, 5), np.linspace(-2.0, 0.0, 5)
    x, y = np.meshgrid(i_d, i_q, indexing="ij")
    d, q = x.ravel(), y.ravel()
    with pytest.raises(BadInput, match="the magnet is not on the d axis"):
        check_points(MapPoints("mine", d, q, 0.1 * d, 0.3 + 0.1 * q, ()))
    check_points(MapPoints("mine", d, q, 0.1 * d, 0.1 * q, ()))


def test_how_many_numbers_of_a_map_are_missing_is_told():
    values = np.array([1.0 + 1.0j, np.nan, 2.0, np.nan, 1.0j])
    with pytest.raises(BadInput, match=r"mine.csv: 2 of 5 currents are not finite"):
        _check_size("mine.csv", "currents", values, (1e-3, 1e5), "A")


def test_readings_inside_a_period_are_a_whole_number():
    own = load_drive("ipm_exchanged").converter
    assert dataclasses.replace(own, readings=8.0).readings == 8.0
    with pytest.raises(BadInput, match=r"readings = 8.5 is not whole"):
        dataclasses.replace(own, readings=8.5)


@pytest.mark.parametrize(
    ("levels", "said"),
    [
        ((0.0, 0.7, 10.0), "at least three"),  # 0.7 A is no level of its own beside 0
        ((-0.7, 3.0, 10.0), "no level at negative"),
        ((-10.0, 3.0, 0.7), "no level at|at least three"),
    ],
)
def test_levels_of_a_staircase_lie_eight_hundredths_of_the_largest_current_apart(levels, said):
    """Of 10 A: 0.8 A."""
    current = np.column_stack([levels, np.zeros(3)])
    with pytest.raises(BadInput, match=said):
        require_information(SimpleNamespace(current=current, pick=lambda axis, bias: np.arange(3)))


def test_what_reads_a_link_scatters_by_a_tenth_of_it_at_most():
    converter = load_drive("ipm_exchanged").converter
    link = converter.dc_bus_voltage
    assert dataclasses.replace(converter, link_noise=0.099 * link).link_noise == 0.099 * link
    with pytest.raises(BadInput, match="link_noise"):
        dataclasses.replace(converter, link_noise=0.101 * link)
