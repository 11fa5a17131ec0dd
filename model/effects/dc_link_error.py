"""The true DC-link voltage is not what the controller divides by: it has another mean and sags
under load."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import percent, quantity
from model.parameters import Converter, Motor

HALF_ROOT = 0.8660254037844386
LARGEST_SAG = 0.2  # of the link


@inlined
def sag(resistance, d_a, d_b, d_c, i_alpha, i_beta):
    """Return by how much the link sags (V) over a period of these duties, current (A) at its
    start."""
    return resistance * drawn(d_a, d_b, d_c, i_alpha, i_beta)


@inlined
def drawn(d_a, d_b, d_c, i_alpha, i_beta):
    """Return the mean current (A) that legs of these duties draw from the link at a current vector
    (A)."""
    return (d_a - 0.5 * (d_b + d_c)) * i_alpha + HALF_ROOT * (d_b - d_c) * i_beta


@inlined
def off(gain_error):
    """Return the share of the nominal voltage that the link has more."""
    return gain_error


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how much the link may sag."""
    bound = LARGEST_SAG * converter.dc_bus_voltage / motor.rated_current
    what = "ohm: a fifth of the link is lost where it feeds rated current"
    yield Limit("dc_link_error.sag", v["dc_link_error.sag"], bound, what)


def do(v: Mapping[str, float], motor: Motor, converter: Converter) -> str:
    """Return what to do about it, at completed values."""
    gain, sag = v["dc_link_error.gain_error"], v["dc_link_error.sag"]
    out = []
    if gain:
        link = converter.dc_bus_voltage * (1.0 + gain)
        out.append(
            f"set the link voltage that the control divides by to {link:.4g} V "
            f"({percent(gain)}), or measure it"
        )
    if sag:
        out.append(
            f"let the control divide by the measured link: its supply has {quantity(sag, 'ohm')}"
        )
    return "; ".join(out)


CARD = Effect(
    name="dc_link_error",
    summary="the true DC-link voltage is not what the controller divides by: another mean, and "
    "sag under load",
    subsystem="inverter",
    equation=(
        "delivered = command x [(1 + gain_error) V_nominal + ripple - sag i_dc] / u_dc as read; "
        "i_dc = sum of duty x phase current at the pattern's start (t_k and its delay), the mean "
        "current drawn while it lasts: the link's capacitor holds within it, a supply of "
        "resistance `sag` feeds it (i_dc < 0: it rises)"
    ),
    formulas=(
        r"u = u^* \cdot \frac{(1 + g)\,V_\text{nominal} + v_\text{ripple} - "
        r"r_\text{sag}\,i_\text{dc}}{u_\text{dc, read}}, \qquad i_\text{dc} = \sum_{k = a, "
        r"b, c} D_k\,i_k",
    ),
    source=(
        "derivation: duties are formed with the measured link voltage; mean link current of a PWM "
        "inverter: power balance of legs and link, e.g. Holmes, Lipo, Pulse Width Modulation for "
        "Power Converters, IEEE Press (2003)"
    ),
    parameters=(
        Parameter(
            "gain_error", "", 0.0, -0.5, 0.5, 0.03, title="relative error of the DC link voltage"
        ),
        Parameter(
            "sag",
            "ohm",
            0.0,
            0.0,
            1e4,
            0.02,
            "DC link / rated current",
            title="resistance of the DC supply",
        ),
    ),
    axis="along the commanded voltage",
    order="0 and the injection band",
    region="grows with voltage: speed, steps and injection; sag: with power, nothing without "
    "current",
    confused_with=("iron_loss", "magnet_flux", "inductance", "stator_resistance"),
    separated_by=(
        "gain: none by itself: it equals scaling R, all fluxes and L together; told apart by a "
        "trusted value of one of them, e.g. the magnet flux on open circuit; sag: runs at speed "
        "without and with load"
    ),
    at=(At("supply", off, ("gain_error",)), At("drawn", sag, ("sag",))),
    limits=limits,
    do=do,
)
