"""The true DC-link voltage is not what the controller divides by: it has another mean, sags under
load, and rings where its capacitor is fed through an inductance."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

from model.compiled import inlined
from model.effects.card import At, Effect, Limit, Parameter
from model.effects.said import percent, quantity
from model.parameters import Converter, Motor

HALF_ROOT = 0.8660254037844386
LARGEST_SAG = 0.2  # of the link
# rad of the resonance in a period, over which the draw counts as constant: its mean, taken in the
# middle, is then off by 1/24 of the square, 1.7 %
FASTEST = 2.0 / math.pi
# where a fit begins that looks for a resonance, of the voltage's update rate: twice the mains, as
# rectifiers feed capacitors, of some 10 kHz
RECTIFIED = 0.01


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
def source(sag, resonance, impedance):
    """Return rate (rad/s), impedance (ohm) and damping ratio of the source and the link's
    capacitor; a rate of 0 where the capacitor is none that rings."""
    rings = impedance > 0.0
    return (
        math.tau * resonance if rings else 0.0,
        impedance,
        0.5 * sag / impedance if rings else 0.0,
    )


@inlined
def off(gain_error):
    """Return the share of the nominal voltage that the link has more."""
    return gain_error


def limits(v: Mapping[str, float], motor: Motor, converter: Converter) -> Iterator[Limit]:
    """Yield how much the link may sag."""
    bound = LARGEST_SAG * converter.dc_bus_voltage / motor.rated_current
    what = "ohm: a fifth of the link is lost where it feeds rated current"
    yield Limit("dc_link_error.sag", v["dc_link_error.sag"], bound, what)
    yield Limit("dc_link_error.impedance", v["dc_link_error.impedance"], bound, what)
    if v["dc_link_error.impedance"]:
        most = FASTEST / (math.tau * converter.update_period)
        what = "Hz: it would ring within a period of the voltage's update"
        yield Limit("dc_link_error.resonance", v["dc_link_error.resonance"], most, what)


def otherwise(
    v: Mapping[str, float], width: float, motor: Motor, converter: Converter
) -> dict[str, float]:
    """Return a source whose inductance rings with the link's capacitor, by a fiftieth of the link
    at a step to rated current, in place of one without, or none in place of one."""
    if v["dc_link_error.impedance"] > 0.0:
        return {"dc_link_error.impedance": 0.0, "dc_link_error.resonance": 0.0}
    return {
        "dc_link_error.impedance": 0.02 * converter.dc_bus_voltage / motor.rated_current,
        "dc_link_error.resonance": RECTIFIED / converter.update_period,
    }


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
    if ohm := v["dc_link_error.impedance"]:
        rings = quantity(v["dc_link_error.resonance"], "Hz")
        out.append(
            "let the control divide by the link measured in each period: it rings at "
            f"{rings}, by {quantity(ohm, 'ohm')} times a step of the current drawn"
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
        "resistance `sag` feeds it (i_dc < 0: it rises). With an impedance Z = sqrt(L/C) its "
        "inductance rings with the capacitor: x' = w (Z i_dc - y), y' = w (x - sag y/Z) in place "
        "of sag i_dc, w = 2 pi resonance, y/Z the source's current"
    ),
    formulas=(
        r"u = u^* \cdot \frac{(1 + g)\,V_\text{nominal} + v_\text{ripple} - "
        r"r_\text{sag}\,i_\text{dc}}{u_\text{dc, read}}, \qquad i_\text{dc} = \sum_{k = a, "
        r"b, c} D_k\,i_k",
        r"r_\text{sag}\,i_\text{dc} \to x, \qquad \dot x = \omega\,(Z\,i_\text{dc} - y), "
        r"\quad \dot y = \omega\,\Bigl(x - \frac{r_\text{sag}}{Z}\,y\Bigr)",
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
        Parameter(
            "resonance",
            "Hz",
            0.0,
            0.0,
            1e5,
            0.0,
            fit="log",
            spread=1.0,
            change=100.0,
            title="resonance of the DC link with its supply",
        ),
        Parameter(
            "impedance",
            "ohm",
            0.0,
            0.0,
            1e4,
            0.0,
            "DC link / rated current",
            fit="log",
            spread=1.0,
            change=0.02,
            title="impedance of that resonance, sqrt(L/C)",
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
    at=(
        At("supply", off, ("gain_error",)),
        At("drawn", sag, ("sag",)),
        At("source", source, ("sag", "resonance", "impedance"), switches=("impedance",)),
    ),
    switches=("gain_error", "sag", "impedance"),
    limits=limits,
    do=do,
    otherwise=otherwise,
)
