"""Measured and finite-element flux maps: read, scattered, inverted onto a table of currents over
fluxes."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.interpolate import BSpline, RectBivariateSpline
from scipy.sparse import csr_array, eye_array, kron, vstack
from scipy.sparse.linalg import spsolve
from scipy.spatial import cKDTree

KNOT = 2.0  # points of a published map for a knot of the co-energy


class FluxMap(NamedTuple):
    """Flux linkages over a rectangle of currents."""

    i_d: np.ndarray  # (n,) A, rising
    i_q: np.ndarray  # (m,)
    psi_d: np.ndarray  # (n, m) Wb
    psi_q: np.ndarray


def maps_folder(folder: str | os.PathLike | None = None) -> Path | None:
    """Folder of the published maps: given, from TESTBENCH_MAPS, or `shared/realdata` beside the
    repository; or None."""
    places: list[str | os.PathLike | None] = (
        [folder] if folder is not None else [os.environ.get("TESTBENCH_MAPS")]
    )
    places += [p / "shared" / "realdata" for p in Path(__file__).resolve().parents]
    for p in places:
        if p and (Path(p) / "brusa_hsm1").is_dir():
            return Path(p)
    return None


def read_map(folder: Path, file: str) -> FluxMap:
    """A published map as a bench's machine has it: magnet on +d, q ahead, with an energy."""
    return reciprocal(published(folder, file))


def published(folder: Path, file: str) -> FluxMap:
    """A published map in the convention of this bench: magnet on +d, q ahead."""
    data = np.load(folder / file)
    if "thor" in file:  # magnet on -q there: turned by a quarter, and mirrored about the d axis
        i_d = -data["iq"][::-1, 0]
        i_d, psi_d = np.sort(i_d), -data["psi_q_mean"][::-1, :]
        order = np.argsort(-data["iq"][::-1, 0])
        psi_d, psi_q = psi_d[order], data["psi_d_mean"][::-1, :][order]
        i_q = data["id"][0]
        psi_q = psi_q - psi_q[:, :1]
        i_q = np.concatenate([-i_q[:0:-1], i_q])
        return FluxMap(
            i_d,
            i_q,
            np.concatenate([psi_d[:, :0:-1], psi_d], 1),
            np.concatenate([-psi_q[:, :0:-1], psi_q], 1),
        )
    i, psi = data["i_s_dq"], data["psi_s_dq"]
    if i.ndim == 1:
        n = np.unique(i.real).size
        i, psi = i.reshape(n, -1), psi.reshape(n, -1)
    if i[1, 0].real == i[0, 0].real:
        i, psi = i.T, psi.T
    m = FluxMap(i[:, 0].real, i[0, :].imag, psi.real, psi.imag)
    return _mend_middle(m, 18.0, 50.0) if "brusa" in file else m


def reciprocal(m: FluxMap, refined: int = 2) -> FluxMap:
    """The nearest map of a machine that has an energy: psi = grad W(i), W the co-energy that fits
    best.

    A measured map and one of finite elements miss that by what was measured or meshed (L_dq and
    L_qd of the Brusa map differ by 4 % of L_d): a machine of such a map would make energy out of
    nothing.  W is a spline of degree 4 with a knot for KNOT points: one for each would leave a
    checkerboard of W that no flux shows.  The
    answer is at `refined` times as many points, so that splines through them are reciprocal, too.
    """
    one, two = (_basis(x) for x in (m.i_d, m.i_q))
    rows = vstack([kron(one(m.i_d, 1), two(m.i_q, 0)), kron(one(m.i_d, 0), two(m.i_q, 1))]).tocsr()
    normal = (rows.T @ rows).tocsc()
    ridge = 1e-12 * normal.diagonal().max()  # a constant in W moves no flux
    w = spsolve(
        normal + ridge * eye_array(normal.shape[0]),
        rows.T @ np.concatenate([m.psi_d.ravel(), m.psi_q.ravel()]),
    )
    i_d, i_q = (
        np.interp(np.arange(refined * (x.size - 1) + 1) / refined, np.arange(x.size), x)
        for x in m[:2]
    )
    shape = i_d.size, i_q.size
    psi_d, psi_q = (kron(one(i_d, a), two(i_q, 1 - a)) @ w for a in (1, 0))
    return FluxMap(i_d, i_q, psi_d.reshape(shape), psi_q.reshape(shape))


def _basis(x: np.ndarray, degree: int = 4) -> Callable[[np.ndarray, int], csr_array]:
    """Rows of the B-splines with a knot for KNOT points, or of their slopes, at points."""
    inner = np.linspace(x[0], x[-1], 1 + round((x.size - 1) / KNOT))
    knots = np.concatenate([[x[0]] * degree, inner, [x[-1]] * degree])
    spline = BSpline(knots, np.eye(inner.size + degree - 1), degree)
    return lambda at, order: csr_array(spline(at, nu=order))


def _mend_middle(m: FluxMap, inner: float, outer: float) -> FluxMap:
    """Fluxes below `inner` A anew, by the polynomial of degree 4 that fits the ring up to `outer`
    A.

    Over the ring the polynomial gives way to what was measured, without a seam.

    The Brusa map is not monotone at its middle (psi_d falls from -5 to 5 A): near zero current a
    flux measured from voltages hangs on the inverter's error.  That part is no property of the
    machine.
    """
    a, b = np.meshgrid(m.i_d, m.i_q, indexing="ij")
    size = np.hypot(a, b)
    ring = (size >= inner) & (size <= outer)
    # of the polynomial
    share = 0.5 + 0.5 * np.cos(np.pi * np.clip((size - inner) / (outer - inner), 0.0, 1.0))
    powers = [(j, k) for j in range(5) for k in range(5 - j)]
    done = []
    for psi, parity in ((m.psi_d, 0), (m.psi_q, 1)):
        base = np.stack(
            [(a / outer) ** j * (b / outer) ** k for j, k in powers if k % 2 == parity], -1
        )
        done.append(
            psi + share * (base @ np.linalg.lstsq(base[ring], psi[ring], rcond=None)[0] - psi)
        )
    spread = (1.5e-3 * np.ptp(done[0])) ** 2 * done[0].size  # the map's scatter: 0.15 % of its span
    smooth = [RectBivariateSpline(m.i_d, m.i_q, psi, s=spread)(m.i_d, m.i_q) for psi in done]
    return FluxMap(m.i_d, m.i_q, smooth[0], smooth[1])


def crop(m: FluxMap, reach: float) -> FluxMap:
    """The map's points within +-reach A on either axis."""
    a, b = np.abs(m.i_d) <= reach * 1.001, np.abs(m.i_q) <= reach * 1.001
    return FluxMap(m.i_d[a], m.i_q[b], m.psi_d[np.ix_(a, b)], m.psi_q[np.ix_(a, b)])


def resample(m: FluxMap, n: int, shift: float, reach: float) -> FluxMap:
    """The map at other points: n x n within `reach` (A), moved by `shift` of a step."""
    d, q = splines(m)
    step = 2 * reach / (n - 1)
    axis = -reach + (np.arange(n) + shift) * step
    i_d = axis[(axis >= m.i_d[0]) & (axis <= m.i_d[-1])]
    i_q = axis[(axis >= m.i_q[0]) & (axis <= m.i_q[-1])]
    return FluxMap(i_d, i_q, d(i_d, i_q), q(i_d, i_q))


def splines(m: FluxMap) -> tuple[RectBivariateSpline, RectBivariateSpline]:
    """Bicubic splines through a map's points."""
    return RectBivariateSpline(m.i_d, m.i_q, m.psi_d), RectBivariateSpline(m.i_d, m.i_q, m.psi_q)


def flux(m: FluxMap, i_d: np.ndarray, i_q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """psi_d, psi_q and Jacobian (2, 2, ...) at currents; outside the rectangle it goes on along its
    slope."""
    d, q = splines(m)
    c_d, c_q = np.clip(i_d, m.i_d[0], m.i_d[-1]), np.clip(i_q, m.i_q[0], m.i_q[-1])
    jac = np.array(
        [[d.ev(c_d, c_q, 1, 0), d.ev(c_d, c_q, 0, 1)], [q.ev(c_d, c_q, 1, 0), q.ev(c_d, c_q, 0, 1)]]
    )
    e_d, e_q = i_d - c_d, i_q - c_q
    psi_d = d.ev(c_d, c_q) + jac[0, 0] * e_d + jac[0, 1] * e_q
    psi_q = q.ev(c_d, c_q) + jac[1, 0] * e_d + jac[1, 1] * e_q
    return psi_d, psi_q, jac


def invert(m: FluxMap, n: int = 121) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Grid (4,) and tables i_d, i_q (n, n) over psi_d, psi_q of a map, by damped Newton steps.

    Raises ArithmeticError where the map does not fall to one current (not monotone).
    """
    margin_d, margin_q = 0.15 * np.ptp(m.psi_d), 0.15 * np.ptp(m.psi_q)
    axis_d = np.linspace(m.psi_d.min() - margin_d, m.psi_d.max() + margin_d, n)
    axis_q = np.linspace(m.psi_q.min() - margin_q, m.psi_q.max() + margin_q, n)
    want_d, want_q = np.meshgrid(axis_d, axis_q, indexing="ij")
    points = cKDTree(np.column_stack([m.psi_d.ravel(), m.psi_q.ravel()]))
    near = points.query(np.column_stack([want_d.ravel(), want_q.ravel()]))[1]
    a, b = np.meshgrid(m.i_d, m.i_q, indexing="ij")
    i_d, i_q = a.ravel()[near].reshape(n, n), b.ravel()[near].reshape(n, n)
    scale = max(np.ptp(m.i_d), np.ptp(m.i_q))
    for k in range(60):
        psi_d, psi_q, j = flux(m, i_d, i_q)
        r_d, r_q = want_d - psi_d, want_q - psi_q
        det = j[0, 0] * j[1, 1] - j[0, 1] * j[1, 0]
        s_d, s_q = (j[1, 1] * r_d - j[0, 1] * r_q) / det, (j[0, 0] * r_q - j[1, 0] * r_d) / det
        damp = np.minimum(1.0, 0.05 * scale / (np.hypot(s_d, s_q) + 1e-30))
        damp *= 1.0 if k < 25 else 0.4
        i_d, i_q = i_d + damp * s_d, i_q + damp * s_q
        if np.hypot(s_d, s_q).max() < 1e-9 * scale:
            break
    inside = (i_d >= m.i_d[0]) & (i_d <= m.i_d[-1]) & (i_q >= m.i_q[0]) & (i_q <= m.i_q[-1])
    if np.hypot(s_d, s_q)[inside].max() > 1e-5 * scale or not np.all(np.isfinite(i_d)):
        raise ArithmeticError("this flux map does not invert: it is not monotone")
    grid = np.array([axis_d[0], axis_q[0], axis_d[1] - axis_d[0], axis_q[1] - axis_q[0]])
    return grid, i_d, i_q


def sooner(m: FluxMap, share: float) -> FluxMap:
    """A core that saturates sooner: psi'(i) = psi_0 + [psi((1+s) i) - psi_0]/(1+s), the same slopes
    at zero current.

    It is the gradient of W((1+s) i)/(1+s)^2: reciprocal and monotone where the map is.
    """
    d, q = splines(m)
    a, b = np.meshgrid(m.i_d, m.i_q, indexing="ij")
    f = 1.0 + share
    psi_d, psi_q, _ = flux(m, f * a, f * b)
    z_d, z_q = d.ev(0.0, 0.0), q.ev(0.0, 0.0)
    return FluxMap(m.i_d, m.i_q, z_d + (psi_d - z_d) / f, z_q + (psi_q - z_q) / f)


def crossed(m: FluxMap, share: float) -> FluxMap:
    """What the axes do to each other, scaled by 1 + share; each axis alone is as it was."""
    d, q = splines(m)
    shape = m.psi_d.shape
    own_d = np.broadcast_to(d(m.i_d, [0.0]), shape)
    own_q = np.broadcast_to(q([0.0], m.i_q), shape)
    return FluxMap(
        m.i_d,
        m.i_q,
        own_d + (1 + share) * (m.psi_d - own_d),
        own_q + (1 + share) * (m.psi_q - own_q),
    )
