"""What goes beyond a smooth formula: networks and constants from published equations."""

import numpy as np
from scipy.optimize import nnls
from scipy.signal import lfilter

# Harmonics of the flux by finite elements: THOR (SyR-e project), 22 A on q, 8.8 A against the
# magnet; rows: order, then psi_d cos, psi_d sin, psi_q cos, psi_q sin over the flux of 0.435 Wb.
FINITE_ELEMENT_HARMONICS = np.array(
    [
        [6, 2.58e-3, 4.61e-3, -1.53e-3, -2.36e-3],
        [12, 1.07e-3, 0.32e-3, 1.33e-3, -0.09e-3],
        [18, 8.62e-3, -5.86e-3, -5.09e-3, -1.73e-3],
    ]
)


def dowell(ratio: np.ndarray, layers: int) -> np.ndarray:
    """R_ac/R_dc of a winding of `layers` layers whose conductors are `ratio` skin depths high.

    Dowell, Proc. IEE 113(8), 1966:
    x [(sinh 2x + sin 2x)/(cosh 2x - cos 2x) + 2 (m^2 - 1)/3 (sinh x - sin x)/(cosh x + cos x)].
    """
    x = np.asarray(ratio, float)
    own = (np.sinh(2 * x) + np.sin(2 * x)) / (np.cosh(2 * x) - np.cos(2 * x))
    near = (np.sinh(x) - np.sin(x)) / (np.cosh(x) + np.cos(x))
    return x * (own + 2 * (layers**2 - 1) / 3 * near)


def dowell_branches(
    rise: float, at: float, layers: int, highest: float
) -> tuple[np.ndarray, float]:
    """Four parallel branches (R_k over R_dc, time constant) whose resistance follows Dowell's curve
    up to `highest` Hz.

    `rise`: R_ac/R_dc - 1 at the frequency `at` (Hz).  Branch k adds R_k (w tau)^2/(1 + (w tau)^2);
    the R_k come from non-negative least squares.  Returns also the largest error of the fit
    relative to R_ac.
    """
    low, high = 1e-3, 6.0
    for _ in range(60):
        x = 0.5 * (low + high)
        low, high = (x, high) if dowell(np.array(x), layers) - 1 < rise else (low, x)
    f = np.geomspace(at / 30, highest, 60)
    curve = dowell(x * np.sqrt(f / at), layers)
    best: tuple[float, np.ndarray] = (np.inf, np.zeros((4, 2)))
    for short in (1.0, 1.5, 2.2):
        for long in (0.5, 1.0, 2.0, 4.0):
            taus = np.geomspace(1 / (2 * np.pi * highest * short), long / (2 * np.pi * at), 4)
            w = 2 * np.pi * f[:, None] * taus
            basis = w**2 / (1 + w**2)
            r, _ = nnls(basis / curve[:, None], (curve - 1) / curve)
            error = float(np.abs((basis @ r + 1) / curve - 1).max())
            if error < best[0]:
                best = error, np.column_stack([r, taus])
    return best[1], best[0]


def lamination(conductance: float, tau: float) -> np.ndarray:
    """Eddy-current admittance of a lamination as three modes (share of the conductance, time
    constant).

    Flux diffusion through a sheet: modes with time constants tau/(2k-1)^2 that share 8/(pi^2
    (2k-1)^2); the rest of the sum is given to the third.
    """
    k = np.array([1.0, 3.0, 5.0])
    share = 8 / (np.pi * k) ** 2
    share[2] = 1.0 - share[0] - share[1]
    return np.column_stack([conductance * share, tau / k**2])


def coloured(
    rng: np.random.Generator, n: int, columns: int, sigma: float, colour: float
) -> np.ndarray:
    """(n, columns) noise of standard deviation sigma: half its power white, half of first order
    (pole `colour`)."""
    white = rng.standard_normal((n, columns))
    if colour == 0.0:
        return sigma * white
    slow = lfilter(
        [np.sqrt(1 - colour**2)], [1, -colour], rng.standard_normal((n, columns)), axis=0
    )
    return sigma * np.sqrt(0.5) * (white + slow)
