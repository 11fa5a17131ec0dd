"""Networks and maps of the bench against the published curves they stand for."""

import numpy as np
import pytest

from experiments.testbench import forms, magnetics, maps


def test_dowell_against_the_complex_impedance():
    """One layer: R_ac/R_dc = Re[z coth z], z = (1 + j) x (a plate); small x: 1 + 4/45 x^4."""
    x = np.array([0.2, 0.7, 1.5, 4.0])
    z = (1 + 1j) * x
    np.testing.assert_allclose(forms.dowell(x, 1), (z / np.tanh(z)).real, rtol=1e-12)
    assert forms.dowell(np.array(0.2), 1) - 1 == pytest.approx(4 / 45 * 0.2**4, rel=2e-3)
    # m layers: Re[z coth z] + 2 (m^2 - 1)/3 Re[z tanh(z/2)]
    many = (z / np.tanh(z)).real + 2 * (25 - 1) / 3 * (z * np.tanh(z / 2)).real
    np.testing.assert_allclose(forms.dowell(x, 5), many, rtol=1e-12)


@pytest.mark.parametrize("layers", [2, 4, 6])
def test_branches_follow_dowell(layers):
    """The error that is reported holds at other frequencies than those of the fit, and is below a
    tenth of R_ac."""
    branches, error = forms.dowell_branches(0.3, 1000.0, layers, 8000.0)
    assert error < 0.1
    assert np.all(branches[:, 0] >= 0)
    low, high = 1e-3, 6.0
    for _ in range(60):
        x = 0.5 * (low + high)
        low, high = (x, high) if forms.dowell(np.array(x), layers) < 1.3 else (low, x)
    for f in (60.0, 333.0, 1500.0, 6500.0):
        w = 2 * np.pi * f * branches[:, 1]
        r_ac = 1 + branches[:, 0] @ (w**2 / (1 + w**2))
        assert (
            abs(r_ac / forms.dowell(np.array(x * np.sqrt(f / 1000.0)), layers) - 1) <= error * 1.05
        )


def test_lamination_has_the_low_frequency_loss_of_the_sheet():
    """Y(0) is the conductance; the half-power frequency of tanh(sqrt(s tau'))/sqrt(s tau') is kept
    by the first mode.

    The diffusion of a sheet: tanh(z)/z with z = sqrt(s pi^2 tau / 4) has the poles s = -(2k-1)^2 /
    tau.
    """
    modes = forms.lamination(2.0, 2e-4)
    assert modes[:, 0].sum() == pytest.approx(2.0)
    s = 2j * np.pi * 300.0
    z = np.sqrt(s * np.pi**2 * 2e-4 / 4)
    ours = sum(g / (1 + s * t) for g, t in modes)
    assert abs(ours - 2.0 * np.tanh(z) / z) < 0.02 * abs(ours)


def test_coloured_noise_has_its_deviation():
    rng = np.random.default_rng(1)
    for colour in (0.0, 0.8):
        x = forms.coloured(rng, 200_000, 2, 0.3, colour)
        assert x.std() == pytest.approx(0.3, rel=0.02)
        lag = np.mean(x[1:] * x[:-1]) / np.mean(x**2)
        assert lag == pytest.approx(0.5 * colour, abs=0.02)


def _toy():
    """A map with a closed form: psi = 0.1 + tanh-like on q, linear on d, reciprocal by an energy of
    the currents."""
    a, b = np.linspace(-10, 10, 21), np.linspace(-12, 12, 25)
    i_d, i_q = np.meshgrid(a, b, indexing="ij")
    psi_q = 0.02 * i_q + 0.1 * np.tanh(i_q / 5)
    return maps.FluxMap(a, b, 0.1 + 0.01 * i_d, psi_q)


def test_a_map_inverts_back():
    m = _toy()
    grid, table_d, table_q = maps.invert(m)
    mag = magnetics.neutral()._replace(
        use_table=1, magnet=0.1, grid=tuple(grid.tolist()), table_d=table_d, table_q=table_q
    )
    for i_d, i_q in ((0.0, 0.0), (3.3, -4.1), (-7.0, 9.0)):
        psi_d, psi_q = 0.1 + 0.01 * i_d, 0.02 * i_q + 0.1 * np.tanh(i_q / 5)
        got = magnetics.field(mag, psi_d, psi_q, 0.0)
        # cells of a 121-point table: the cubic of Keys leaves h^3, here below 1 mA of 12 A
        assert got[0] == pytest.approx(i_d, abs=5e-3)
        assert got[1] == pytest.approx(i_q, abs=5e-3)
        assert got[2] == pytest.approx(psi_d * got[1] - psi_q * got[0])


def _turning(m):
    """d psi_d/d i_q - d psi_q/d i_d over a map's inside, in H: 0 for a machine that has an
    energy."""
    a, b = np.meshgrid(m.i_d[2:-2], m.i_q[2:-2], indexing="ij")
    _, _, jac = maps.flux(m, a, b)
    return float(np.sqrt(np.mean((jac[0, 1] - jac[1, 0]) ** 2))), float(
        np.sqrt(np.mean(jac[0, 0] ** 2))
    )


def test_a_map_gets_an_energy():
    """psi = dW/di + a part that turns (psi_d = c i_q, psi_q = -c i_d): orthogonal to all gradients
    on a square but for its edge, so the gradient part comes back to within a share of it, and what
    turns goes."""
    a = np.linspace(-10, 10, 21)
    i_d, i_q = np.meshgrid(a, a, indexing="ij")
    d, q = 0.01 * i_d - 1e-5 * i_d * i_q**2, 0.02 * i_q - 1e-5 * i_d**2 * i_q
    turned = maps.FluxMap(a, a, d + 5e-4 * i_q, q - 5e-4 * i_d)
    before, _ = _turning(turned)
    assert before == pytest.approx(1e-3)
    got = maps.reciprocal(turned)
    assert _turning(got)[0] < 1e-3 * before
    # less than half of what turned there
    assert np.max(np.abs(got.psi_d[::2, ::2] - d)[5:-5, 5:-5]) < 0.5 * 5e-4 * 10
    same = maps.reciprocal(maps.FluxMap(a, a, d, q))  # W is of degree 4: inside the splines
    assert same.psi_d[::2, ::2] == pytest.approx(d, abs=1e-9)
    assert same.psi_q[::2, ::2] == pytest.approx(q, abs=1e-9)


def test_sooner_keeps_the_slope_and_saturates_sooner():
    m = maps.sooner(_toy(), 0.2)
    _, _, jac = maps.flux(m, np.array(0.0), np.array(0.0))
    # the spline's own error at 1 A steps
    assert float(jac[1, 1]) == pytest.approx(0.02 + 0.1 / 5, rel=5e-3)
    _, psi_q, _ = maps.flux(m, np.array(0.0), np.array(8.0))
    assert float(psi_q) == pytest.approx((0.02 * 9.6 + 0.1 * np.tanh(9.6 / 5)) / 1.2, rel=1e-3)


def test_crossed_leaves_each_axis_alone():
    a = np.linspace(-4, 4, 9)
    i_d, i_q = np.meshgrid(a, a, indexing="ij")
    m = maps.FluxMap(a, a, i_d - 0.01 * i_d * i_q**2, i_q - 0.01 * i_d**2 * i_q)
    c = maps.crossed(m, -0.5)
    assert c.psi_d[:, 4] == pytest.approx(m.psi_d[:, 4])
    assert c.psi_d[8, 8] == pytest.approx(4 - 0.005 * 64)


@pytest.mark.skipif(maps.maps_folder() is None, reason="the published maps are not here")
@pytest.mark.parametrize(
    "file", ["baldor_pmsyrm/baldor_meas.npz", "brusa_hsm1/brusa_meas.npz", "thor_fea/thor_fea.npz"]
)
def test_published_maps_have_the_magnet_on_d_and_positive_slopes(file):
    m = maps.read_map(maps.maps_folder(), file)
    psi_d, psi_q, jac = maps.flux(m, np.array(0.0), np.array(0.0))
    assert psi_d > 0.03
    assert abs(psi_q) < 1e-3
    assert jac[1, 1] > jac[0, 0] > 0, "magnets lie where the inductance is small"
    turning, size = _turning(m)
    assert turning < 1e-3 * size  # published: 4 % (Brusa, measured), 3 % (THOR, finite elements)


def test_field_is_the_gradient_of_an_energy():
    """d i_d/d psi_q = d i_q/d psi_d, and the torque is -dH/dtheta at a fixed stator flux: by
    differences."""
    mag = magnetics.neutral()._replace(
        energy=(20.0, 30.0, 2.0, 3.0, 4.0, 5.0, 2.0),
        power=(50.0, 3.0, 20.0, 2.0, 10.0, 1.0, 0.0),
        magnet=0.4,
        harmonics=((6.0, 4e-3, 1e-3, 2e-3, 3e-3), (12.0, 1e-3, 0.0, 0.0, 2e-3), (0.0,) * 5),
        saliency=(0.7, 0.3, 2.0),
    )
    h, psi, theta = 1e-6, (0.5, 0.3), 0.7
    up = (
        magnetics.field(mag, psi[0], psi[1] + h, theta)[0]
        - magnetics.field(mag, psi[0], psi[1] - h, theta)[0]
    )
    side = (
        magnetics.field(mag, psi[0] + h, psi[1], theta)[1]
        - magnetics.field(mag, psi[0] - h, psi[1], theta)[1]
    )
    assert up == pytest.approx(side, rel=1e-6)

    def co(theta):
        """H by a straight path from the flux without current to psi, at a fixed angle."""
        s, w = np.polynomial.legendre.leggauss(40)
        s, w = 0.5 * (s + 1), 0.5 * w
        total = 0.0
        base = _rest(mag, theta)
        for a, b in zip(s, w, strict=True):
            x = base + a * (np.array(psi) - base)
            i = magnetics.field(mag, x[0], x[1], theta)
            total += b * (i[0] * (psi[0] - base[0]) + i[1] * (psi[1] - base[1]))
        return total

    slope = -(co(theta + 1e-5) - co(theta - 1e-5)) / 2e-5
    assert magnetics.field(mag, *psi, theta)[2] == pytest.approx(slope, rel=1e-5)


def _rest(mag, theta):
    """Flux at which no current flows: the magnet's with its harmonics, turned."""
    d, q = mag.magnet, 0.0
    for order, a, b, c, e in mag.harmonics:
        d += a * np.cos(order * theta) + b * np.sin(order * theta) if order else 0.0
        q += c * np.cos(order * theta) + e * np.sin(order * theta) if order else 0.0
    return np.array([d * np.cos(theta) - q * np.sin(theta), d * np.sin(theta) + q * np.cos(theta)])
