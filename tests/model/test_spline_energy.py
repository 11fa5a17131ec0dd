"""The spline energy: its polynomials against SciPy, planted motors, symmetry, convexity, what it is
fitted to."""

import tracemalloc

import numpy as np
import pytest
from scipy.interpolate import BSpline

from model import spline
from model import spline_energy as se
from model.drive_files import load_drive
from model.energy import currents, flux_from_current, inductances, min_eigenvalue
from model.errors import BadInput, PhysicsError
from model.fluxmap import FluxMap, read_map, write_map
from model.spline_energy import Box
from tests.data import real_data


def _map(name="ipm_exchanged", top=2.0, points=15):
    motor = load_drive(name).motor
    i = np.linspace(-top, top, points)
    x, y = np.meshgrid(i, i, indexing="ij")
    d, q = flux_from_current(motor.energy, x, y)
    return FluxMap(name, i, i, d + motor.magnet_flux, q), motor


@pytest.fixture(scope="module")
def fitted():
    m, motor = _map()
    return se.fit(*m.points(), cells=(6, 5), smooth=1e-6), m, motor


def test_cells_are_the_b_spline_and_its_derivatives():
    rng = np.random.default_rng(0)
    box = se.Box(np.array([-0.1, 0.3]), np.array([0.0, 0.2]), (4, 3))
    c = rng.normal(size=box.unknowns)
    s = box.spline(c)
    full = c.reshape(box.n_d + 4, box.half) @ box.fold.T

    def exact(d, q, a, b):  # SciPy's tensor product, differentiated by SciPy
        rows = [
            BSpline(k, np.eye(len(k) - 5), 4)(x, nu=n)
            for k, x, n in ((box.knots_d, d, a), (box.knots_q, q, b))
        ]
        return rows[0] @ full @ rows[1]

    for d, q in rng.uniform([-0.1, -0.2], [0.3, 0.2], size=(40, 2)):
        assert spline.energy(s, d, q) == pytest.approx(exact(d, q, 0, 0), rel=1e-9, abs=1e-9)
        assert spline.currents(s, d, q) == pytest.approx(
            (exact(d, q, 1, 0), exact(d, q, 0, 1)), rel=1e-8, abs=1e-7
        )
        wanted = (exact(d, q, 2, 0), exact(d, q, 1, 1), exact(d, q, 0, 2))
        assert spline.hessian(s, d, q) == pytest.approx(wanted, rel=1e-7, abs=1e-5)


def test_a_quartic_motor_is_carried(fitted):
    # a quartic is in the spline's own space: what is left is the smoothness weight
    s, _, motor = fitted
    assert se.magnet_flux(s) == pytest.approx(motor.magnet_flux, abs=1e-6)
    for d, q in ((0.02, 0.05), (-0.05, -0.1), (0.03, 0.0)):
        wanted = currents(motor.energy, d, q)
        assert spline.currents(s, d + motor.magnet_flux, q) == pytest.approx(wanted, abs=2e-4)
    found, wanted = se.inductances(s, 0.7, -1.1), inductances(motor.energy, 0.7, -1.1)
    np.testing.assert_allclose(found, wanted, rtol=1e-3)


def test_flux_of_a_current_is_its_inverse(fitted):
    s, m, _ = fitted
    _, _, i_d, i_q = m.points()
    d, q = se.flux_from_current(s, i_d, i_q)
    back = np.array([spline.currents(s, a, b) for a, b in zip(d, q, strict=True)])
    np.testing.assert_allclose(back, np.column_stack([i_d, i_q]), atol=1e-9)


def test_energy_is_even_in_q_smooth_and_strictly_convex(fitted):
    s, _, _ = fitted
    high_d, high_q = s.low_d + s.cells.shape[0] / s.per_d, -s.low_q
    for d in np.linspace(s.low_d, high_d, 23):
        for q in np.linspace(0, high_q, 17):
            i_d, i_q = spline.currents(s, d, q)
            assert spline.currents(s, d, -q) == pytest.approx((i_d, -i_q), abs=1e-9)
            dd, dq, qq = spline.hessian(s, d, q)
            assert dd * qq > dq * dq
            assert dd > 0
    edge = s.low_d + 3 / s.per_d  # across a cell's border the Hessian neither jumps nor kinks (C3)
    h = 1e-6
    left = [np.array(spline.hessian(s, edge - k * h, 0.02)) for k in (2, 1)]
    right = [np.array(spline.hessian(s, edge + k * h, 0.02)) for k in (1, 2)]
    np.testing.assert_allclose(right[0] - left[1], 2 * (left[1] - left[0]), rtol=1e-3, atol=1e-6)


def test_convexity_is_imposed_where_data_contradict_it():
    m, _ = _map()
    psi_d = m.psi_d.copy()
    psi_d[7, 5:10] += 0.02  # a bump that makes the map fall with i_d: no motor
    s = se.fit(*FluxMap("bad", m.i_d, m.i_q, psi_d, m.psi_q).points(), cells=(8, 6), smooth=1e-4)
    for d in np.linspace(s.low_d, s.low_d + 8 / s.per_d, 49):
        for q in np.linspace(0, -s.low_q, 37):
            dd, dq, qq = spline.hessian(s, d, q)
            assert min_eigenvalue(dd, dq, qq) > 0, (d, q)


def test_outside_the_map_is_an_error_that_names_the_current(fitted):
    with pytest.raises(PhysicsError, match="i_d = 40 A, i_q = 0 A lies outside the flux map"):
        se.flux_from_current(fitted[0], 40.0, 0.0)
    with pytest.raises(BadInput, match="do not span both axes"):
        se.fit(np.zeros(20), np.zeros(20), np.zeros(20), np.zeros(20))


@pytest.mark.parametrize(
    # held-out rms over the map's largest flux; issue: 0.5 % of rated flux
    ("file", "magnet", "goal"),
    [
        ("baldor_pmsyrm/baldor_meas.npz", "d", 0.002),
        ("thor_fea/thor_fea.npz", "-q", 0.001),
        ("brusa_hsm1/brusa_meas.npz", "d", 0.0045),
    ],
)
def test_measured_maps_are_carried_between_their_points(file, magnet, goal):
    m = read_map(real_data() / file, magnet)
    s = se.fit(*m.every(2).points())
    psi_d, psi_q, i_d, i_q = m.points()
    d, q = se.flux_from_current(s, i_d, i_q)
    assert np.sqrt(np.mean((d - psi_d) ** 2 + (q - psi_q) ** 2)) < goal * np.max(
        np.hypot(psi_d, psi_q)
    )


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv"])
def test_maps_survive_export_and_import(tmp_path, suffix):
    m, _ = _map(points=7)
    torque = 1.5 * 6 * (m.psi_d * m.i_q[None, :] - m.psi_q * m.i_d[:, None])
    m = FluxMap(m.name, m.i_d, m.i_q, m.psi_d, m.psi_q, torque)
    write_map(tmp_path / f"map{suffix}", m)
    again = read_map(tmp_path / f"map{suffix}")
    for name in ("i_d", "i_q", "psi_d", "psi_q", "torque"):
        np.testing.assert_allclose(getattr(again, name), getattr(m, name), atol=1e-15)


def test_complex_and_raw_files_of_one_motor_agree():
    folder = real_data() / "baldor_pmsyrm"
    a, b = read_map(folder / "baldor_meas.npz"), read_map(folder / "ABB_400rpm_map.mat")
    np.testing.assert_allclose(a.i_d, b.i_d, atol=1e-9)
    assert np.max(np.abs(a.psi_d - b.psi_d)) < 0.02  # the raw one is not symmetrised


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.pop("psi_q"), "no 'psi_q'"),
        (lambda d: d.update(psi_d=np.zeros(3)), "shape"),
        (lambda d: d["psi_d"].__setitem__((1, 2), np.nan), "psi_d is nan at i_d = 1 A, i_q = 2 A"),
        (lambda d: d.update(i_d=d["i_d"] + 0.1 * np.eye(4)), "do not fill a grid"),
    ],
)
def test_bad_maps_are_named(tmp_path, change, message):
    x, y = np.meshgrid(np.arange(4.0), np.arange(4.0), indexing="ij")
    data = {"i_d": x, "i_q": y, "psi_d": x.copy(), "psi_q": y.copy()}
    change(data)
    np.savez(tmp_path / "m.npz", **data)
    with pytest.raises(BadInput, match=message):
        read_map(tmp_path / "m.npz")
    with pytest.raises(BadInput, match="magnet axis 'x'"):
        read_map(tmp_path / "m.npz", "x")


def test_a_fit_says_before_it_starts_that_it_takes_too_much_memory():
    """63 x 63 unknowns, 13 x 169 + 110 x 3600 numbers of 8 bytes for each."""
    i = np.linspace(-5.0, 5.0, 13)
    i_d, i_q = (x.ravel() for x in np.meshgrid(i, i, indexing="ij"))
    with pytest.raises(BadInput, match=r"60 x 60 cells on 169 points of a flux map take 12\.6 GB"):
        se.fit(0.3 + 0.01 * i_d, 0.01 * i_q, i_d, i_q, (60, 60))


def test_a_map_that_bends_the_wrong_way_in_places_is_fitted_by_a_convex_energy():
    """Noise of 5 % of the flux over a linear map, 30 x 30 points and 14 x 12 cells, little
    smoothed: least squares would bend the energy the wrong way.  What is found bends it nowhere by
    less than half the floor at the points where that is asked, and its currents are as near the
    data as the noise lets them: 0.01 Wb over 0.05 H, 0.2 A."""
    i = np.linspace(-2.4, 2.4, 30)
    i_d, i_q = (x.ravel() for x in np.meshgrid(i, i, indexing="ij"))
    drawn = 0.05 * np.random.default_rng(0).standard_normal((2, i_d.size))
    psi_d, psi_q = 0.3 + 0.05 * i_d + 0.2 * drawn[0], 0.08 * i_q + 0.3 * drawn[1]
    asked = []
    with pytest.MonkeyPatch.context() as patch:
        nnls = se.nnls
        patch.setattr(se, "nnls", lambda *x, **y: asked.append(len(x[1])) or nnls(*x, **y))
        m = se.fit(psi_d, psi_q, i_d, i_q, (14, 12))
    assert asked  # inequalities were needed
    box = se.Box(psi_d, psi_q, (14, 12))
    least = [
        min_eigenvalue(*spline.hessian(m, float(d), float(q)))
        for d, q in zip(*box.check_points(), strict=True)
    ]
    assert min(least) > 0.0
    found = np.array([currents(m, float(d), float(q)) for d, q in zip(psi_d, psi_q, strict=True)])
    assert np.sqrt(np.mean((found[:, 0] - i_d) ** 2)) < 0.25


def _told_and_taken(cells, lines, noise):
    """What a fit says that it takes, and the most that NumPy's arrays took; of a map of so many
    lines each way."""
    i = np.linspace(-2.4, 2.4, lines)
    i_d, i_q = (x.ravel() for x in np.meshgrid(i, i, indexing="ij"))
    drawn = noise * np.random.default_rng(0).standard_normal((2, i_d.size))
    psi_d, psi_q = 0.3 + 0.05 * i_d + 0.2 * drawn[0], 0.08 * i_q + 0.3 * drawn[1]
    tracemalloc.start()
    try:
        se.fit(psi_d, psi_q, i_d, i_q, cells)
    except PhysicsError:
        assert noise
    finally:
        taken = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    return se.bytes_taken(se.Box(psi_d, psi_q, cells), len(psi_d)), taken


@pytest.mark.parametrize(("cells", "lines"), [((4, 4), 60), ((6, 6), 80)])
def test_what_the_points_of_a_fit_take_is_what_is_told(cells, lines):
    """Cells take 0.03 to 0.07 of it: half or double AT_POINTS would be 1.8 or 0.5 of what is
    taken."""
    found, taken = _told_and_taken(cells, lines, 0.0)
    assert 0.8 < taken / found < 1.05


@pytest.mark.parametrize("cells", [(14, 12), (16, 14)])
def test_what_the_cells_of_a_fit_take_is_what_is_told(cells):
    """100 points take 0.07 of it; their noise bends the energy the wrong way at most places, each
    an inequality: the most that cells can take (a smooth map: 0.8 of it)."""
    found, taken = _told_and_taken(cells, 10, 1.0)
    assert 0.8 < taken / found < 1.05
    found, taken = _told_and_taken(cells, 10, 0.0)
    assert 0.65 < taken / found < 1.0


def test_choices_that_take_too_much_memory_are_not_tried():
    """20 x 16 cells (23 x 18 unknowns), 20 000 points: 0.98 GB; the smaller ones fit, and all on
    3600 points."""
    psi = np.linspace(-1.0, 1.0, 20_000)
    assert {c for c, _ in se.affordable(psi, psi)} == {(10, 8), (14, 12)}
    assert se.affordable(psi[:3600], psi[:3600]) == se.CHOICES


def test_a_map_s_box_reaches_three_hundredths_beyond_its_data():
    box = Box(np.array([0.1, 0.3]), np.array([-0.5, 0.4]), (4, 4))
    assert (box.low_d, box.high_d, box.high_q) == pytest.approx((0.094, 0.306, 0.515))
