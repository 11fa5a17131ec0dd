"""Core loss in Bertotti's three parts: eddy currents, excess loss, hysteresis.

Each is a current beside the magnetising one, which makes no torque.  At a flux psi that turns or
swings with f, losses go with f^2 psi^2 (eddy), f^1.5 psi^1.5 (excess), f psi (hysteresis, beyond
its reach).  What hysteresis holds when a recording begins is not known: nothing beside the flux of
the first instant is taken, and forgotten once the flux has gone twice the reach.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from model.compiled import inlined
from model.effects.card import INF, At, Effect, Parameter, flux_scale
from model.effects.said import quantity
from model.parameters import Converter, Motor

# of rated current, excess loss and hysteresis each: eddy currents take 0.05 at rated speed (20
# rated reactances, a flux of reactance x rated current), losses of electrical steel are about equal
# shares of the three
USUAL = 0.02
LARGEST_LAG = 0.5  # of the time constant in one step: the current is no parabola over a longer one


@inlined
def branch(core_resistance, time_constant):
    """Return the branch's conductance (1/ohm) and its lag's time constant (s): tau
    di_c/dt = (dpsi_ab/dt)/R_c - i_c."""
    return 1.0 / core_resistance, time_constant


@inlined
def excess(excess_current, slope):
    """Return the excess loss' current by the root of the flux slope (A/V^(1/2)); slope: rated,
    V."""
    return excess_current / math.sqrt(slope)


@inlined
def play(hysteresis_current, hysteresis_reach, flux):
    """Return hysteresis' current by what the flux is ahead of that held (1/H), and the most it can
    be ahead (Wb); flux: rated, Wb."""
    reach = hysteresis_reach * flux
    return hysteresis_current / reach, reach


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    ohm, flux = v["iron_loss.core_resistance"], flux_scale(motor)
    slope = motor.rated_omega * flux
    excess_current, hysteresis = (
        v["iron_loss.excess_current"],
        v["iron_loss.hysteresis_current"],
    )
    reach = min(v["iron_loss.hysteresis_reach"], 1.0)
    dragging = motor.rated_omega * flux * math.sqrt(1.0 - reach * reach)
    loss = 1.5 * (slope * (slope / ohm + excess_current) + dragging * hysteresis)
    parts = [f"a core resistance of {quantity(ohm, 'ohm')}"] if math.isfinite(ohm) else []
    if excess_current:
        parts.append(f"an excess-loss current of {quantity(excess_current, 'A')} at rated speed")
    if hysteresis:
        parts.append(f"a hysteresis current of {quantity(hysteresis, 'A')}")
    return (
        f"count {' and '.join(parts)} in (about {quantity(loss, 'W')} at "
        "rated speed without load) where torque or losses are worked out from currents"
    )


def longest(v: Mapping[str, float], motor: Motor, omega: float) -> float:
    """Return the longest step (s): hysteresis alone knows no time."""
    if math.isfinite(v["iron_loss.core_resistance"]) or v["iron_loss.excess_current"]:
        return LARGEST_LAG * v["iron_loss.time_constant"]
    return math.inf


CARD = Effect(
    name="iron_loss",
    summary="eddy currents, excess loss and hysteresis of the core, currents beside the "
    "magnetising one",
    subsystem="machine",
    equation=(
        "terminal current = magnetising current + i_c + i_x + i_h, tau di_c/dt = "
        "(dpsi_ab/dt)/R_c - i_c; i_x = I_x e/sqrt(abs(e) e_n), e = dpsi_ab/dt behind the same lag, "
        "e_n = w_n psi_n; i_h = I_h q/r, r = reach psi_n, q the flux ahead of that held, which "
        "follows at the distance r; torque from the magnetising current; loss 3/2 (R_c i_c^2 + "
        "i_x e + I_h x speed of the flux held); w_n, psi_n: nominal rated speed and magnet flux"
    ),
    formulas=(
        r"i_\text{terminal} = i + i_c + i_x + i_h, \qquad \tau\,\frac{d i_c}{d t} = "
        r"\frac{1}{R_c}\,\frac{d\psi_{\alpha\beta}}{d t} - i_c, \qquad i_x = "
        r"\frac{I_x\,e}{\sqrt{|e|\,\omega_n\psi_n}}, \quad \tau\,\frac{d e}{d t} = "
        r"\frac{d\psi_{\alpha\beta}}{d t} - e",
        r"i_h = I_h\,\frac{q}{r}, \quad q = \psi_{\alpha\beta} - p, \quad |q| \le r = "
        r"\rho\,\psi_n, \quad \frac{d p}{d t} = \lambda\,q, \quad \lambda \ge 0, \quad "
        r"\lambda\,(r - |q|) = 0, \qquad P = \tfrac32\,\Bigl(R_c\,|i_c|^2 + i_x \cdot e + "
        r"I_h\,\Bigl|\frac{d p}{d t}\Bigr|\Bigr)",
    ),
    source=(
        "three parts: Bertotti, General properties of power losses in soft ferromagnetic "
        "materials, IEEE Trans. Magn. 24 (1988) 621; vector play: Bergqvist, Magnetic vector "
        "hysteresis model with dry friction-like pinning, Physica B 233 (1997) 342; size of the "
        "losses: Mi, Slemon, Bonert, Modeling of iron losses of permanent-magnet "
        "synchronous motors, IEEE Trans. Ind. Appl. 39 (2003) 734; resistance across the flux "
        "slope: the usual equivalent circuit, its time constant (derivation) keeps i_c finite "
        "under pulses"
    ),
    parameters=(
        Parameter(
            "core_resistance",
            "ohm",
            INF,
            1.0,
            INF,
            20.0,
            "rated reactance",
            fit="reciprocal",
            title="core resistance",
        ),
        Parameter(
            "time_constant",
            "s",
            2e-4,
            1e-5,
            1e-2,
            2e-4,
            fit="log",
            spread=0.5,
            title="time constant of the iron",
        ),
        Parameter(
            "excess_current",
            "A",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated current",
            change=USUAL,
            title="excess-loss current at rated speed",
        ),
        Parameter(
            "hysteresis_current",
            "A",
            0.0,
            0.0,
            1e5,
            0.0,
            "rated current",
            change=USUAL,
            title="hysteresis current",
        ),
        Parameter(
            "hysteresis_reach",
            "",
            0.1,
            1e-3,
            10.0,
            0.1,
            fit="log",
            spread=1.0,
            title="reach of hysteresis, of the magnet flux",
        ),
    ),
    axis="q at speed, along the injected voltage in the injection band",
    order="0 and the injection band",
    region="grows with speed; with injection at standstill, too",
    confused_with=("dc_link_error", "current_filter", "skin_effect", "viscous_friction"),
    separated_by="driven idle at several speeds (drag current) together with injection at standstill",  # noqa: E501
    at=(
        At("iron", branch, ("core_resistance", "time_constant")),
        At("excess", excess, ("excess_current",)),
        At("play", play, ("hysteresis_current", "hysteresis_reach")),
    ),
    switches=("core_resistance", "excess_current", "hysteresis_current"),
    longest=longest,
    do=do,
)
