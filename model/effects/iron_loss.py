"""Eddy currents and hysteresis of the core, as a resistance across the flux slope."""

from __future__ import annotations

from model.compiled import kernel
from model.effects.card import INF, Effect, Parameter


@kernel
def slope(conductance, tau, e_d, e_q, core_d, core_q, omega):
    """Return the slope of i_c (A/s) in the rotor frame; e: slope of the stationary-frame flux seen from there, V."""
    d = omega * core_q + (conductance * e_d - core_d) / tau
    return d, (conductance * e_q - core_q) / tau - omega * core_d


@kernel
def reading(conductance, tau, ripple):
    """Return what the pulses' flux ripple adds to a sampled i_c (A); ripple: its lag by tau, `pulses.ripple_lag`."""
    return -conductance * ripple / tau


@kernel
def reading_filtered(conductance, tau, ripple, tau_filter, ripple_filter):
    """Return the same behind a current filter of another time constant (A)."""
    return -conductance * (ripple - ripple_filter) / (tau - tau_filter)


CARD = Effect(
    name="iron_loss",
    summary="eddy currents and hysteresis of the core, as a resistance across the flux slope",
    subsystem="machine",
    equation=(
        "terminal current = magnetising current + i_c, tau di_c/dt = (dpsi_ab/dt)/R_c - i_c; torque from "
        "the magnetising current; loss 3/2 R_c i_c^2"
    ),
    source=(
        "size of the losses: Mi, Slemon, Bonert, Modeling of iron losses of permanent-magnet synchronous motors, "
        "IEEE Trans. Ind. Appl. 39 (2003) 734; resistance across the flux slope: the usual equivalent circuit, its "
        "time constant (derivation) keeps i_c finite under pulses; reading under pulses: AVERAGING 4"
    ),
    parameters=(
        Parameter("core_resistance", "ohm", INF, 1.0, INF, 20.0, "rated reactance", fit="reciprocal"),
        Parameter("time_constant", "s", 2e-4, 1e-5, 1e-2, 2e-4, fit="log", spread=0.5),
    ),
    axis="q at speed, along the injected voltage in the injection band",
    order="0 and the injection band",
    region="grows with speed; with injection at standstill, too",
    confused_with=("dc_link_error", "current_filter", "skin_effect", "viscous_friction"),
    separated_by="driven idle at several speeds (drag current) together with injection at standstill",
    rows=lambda v, motor: {
        "core_g": 1.0 / v["iron_loss.core_resistance"],
        "core_rate": 1.0 / v["iron_loss.time_constant"],
    },
    switches=("core_resistance",),
)
