"""A drive's settings beside those that recordings of it ask for: values of the motor, gains of the
current loop, dead time.

Gains cancel the winding's pole by the controller's zero: kp = omega L, ki = omega R, with the
loop's bandwidth omega (Harnefors, Nee, Model-based current control of AC machines using the
internal model control method, IEEE Trans. Industry Applications 34(1), 1998).  Looked up on
2026-11-28, the tools work them out alike: VESC from a time constant of 1 ms (bldc, conf_general.c,
conf_general_calc_apply_foc_cc_kp_ki_gain), ODrive from current_control_bandwidth (v0.5,
MotorControl/motor.cpp, update_current_controller_gains), moteus from --cal-bw-hz (moteus_tool.py,
calculate_bandwidth), in newer firmware from servo.pid_dq_hz and with L_d and L_q for their own axes
(fw/bldc_servo_control.h), SimpleFOC from a bandwidth, also with both L
(docs.simplefoc.com/tuning_current_loop).  Here L is the mean of both axes, as one gain is stated.
The bandwidth is the one that the configuration means: stated, or kp over its own L.

The time that dead-time compensation should make up for is what recordings show that legs lose; a
device's drop is made up for by threshold/link of a period.  Only VESC states one (`foc_dt_us`).
Its firmware takes it off the voltage that the observer sees and that is reported, not off the
switching times (motor/mcpwm_foc.c, update_valpha_vbeta): currents show the whole loss beside the
duties.  A microsecond of it makes up for 4/3 us of a leg (`VESC_DEAD_TIME`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from model.effects.said import COPPER
from model.tools.configurations import VESC_DEAD_TIME

NEAR = 0.05  # of a factor that explains a difference
WARM = (0.75, 1.5)  # of the resistance found over that stated: what temperature can explain
SALIENT = 1.1
FACTORS = {  # stated over found, of which value, why
    2.0: (
        ("resistance", "inductance_d", "inductance_q"),
        "twice: as measured between two terminals",
    ),
    0.5: (
        ("resistance", "inductance_d", "inductance_q"),
        "half: a value between two terminals halved twice",
    ),
    math.sqrt(3.0): (("magnet_flux",), "sqrt(3) times: of the voltage between two terminals"),
    1.0 / math.sqrt(3.0): (
        ("magnet_flux",),
        "1/sqrt(3): divided for a line's voltage that was a phase's",
    ),
    math.sqrt(2.0): (("magnet_flux",), "sqrt(2) times: a peak value taken for an rms one"),
    1.0 / math.sqrt(2.0): (("magnet_flux",), "1/sqrt(2): an rms value taken for a peak one"),
    1.5: (
        ("magnet_flux", "inductance_d", "inductance_q"),
        "3/2: the factor of the transformation counted twice",
    ),
    2.0 / 3.0: (
        ("resistance", "magnet_flux", "inductance_d", "inductance_q"),
        "2/3: the factor of the transformation left out (older VESC firmware stated R and L so)",
    ),
}
UNITS = {
    "resistance": "ohm",
    "inductance_d": "H",
    "inductance_q": "H",
    "magnet_flux": "Wb",
    "current_kp": "V/A",
    "current_ki": "V/(A s)",
    "dead_time": "s",
}
Interval = tuple[float, float]


@dataclass(frozen=True)
class Found:
    """A value that recordings show, its 95 % interval (None: not known)."""

    value: float
    ci95: Interval | None = None


@dataclass(frozen=True)
class Setting:
    """One setting: what is stated, what it should be (None: not told), why and what to do in a
    sentence."""

    name: str
    stated: float | None
    found: float | None
    ci95: Interval | None
    said: str

    @property
    def unit(self) -> str:
        """Its unit."""
        return UNITS[self.name]

    @property
    def off(self) -> float | None:
        """How much larger it is stated than found, a share; None where one is not known, or it
        should be 0."""
        if self.stated is None or not self.found:
            return None
        return self.stated / self.found - 1.0

    @property
    def verdict(self) -> str:
        """`agrees` (inside the interval, or within 1 % of it), `differs`, `not stated` or
        `not told`."""
        if self.found is None:
            return "not told"
        if self.stated is None:
            return "not stated"
        low, high = self.ci95 or (self.found, self.found)
        slack = 0.01 * abs(self.found)
        return "agrees" if low - slack <= self.stated <= high + slack else "differs"


def settings(
    stated: Mapping[str, float],
    found: Mapping[str, Found],
    untold: Mapping[str, str],
    bandwidth: float | None = None,
    named: Sequence[str] = (),
) -> list[Setting]:
    """Return every setting in the order of UNITS.

    stated, found: by names of UNITS (found without gains), SI; a bandwidth or kp that is not
    positive is not stated;
    untold: why a value is not found; bandwidth: rad/s, of the current loop; named: effects in the
    voltages or readings that the result names.
    """
    stated = {k: v for k, v in stated.items() if v > 0.0 or k not in ("bandwidth", "current_kp")}
    rows = [_of_motor(name, stated, found, untold, named) for name in list(UNITS)[:4]]
    return [*rows, *_gains(stated, found, bandwidth), _dead_time(stated, found, untold)]


def _of_motor(
    name: str,
    stated: Mapping[str, float],
    found: Mapping[str, Found],
    untold: Mapping[str, str],
    named: Sequence[str],
) -> Setting:
    measured, own = found.get(name), stated.get(name)
    if measured is None:
        return Setting(
            name,
            own,
            None,
            None,
            untold.get(name, f"the result does not tell {name}; record what shows it"),
        )
    row = Setting(name, own, measured.value, measured.ci95, "")
    if row.verdict == "differs":
        said = (
            f"set {measured.value:.4g} {row.unit}; "
            f"{_because(name, own or 0.0, measured.value, stated, found)}"
        )
        if named:
            said += (
                f"; the result names {', '.join(named)}: what measured it without them reads "
                "it wrong"
            )
    else:
        said = (
            "as found" if own is not None else f"not stated; it is {measured.value:.4g} {row.unit}"
        )
    return Setting(name, own, measured.value, measured.ci95, said)


def _because(
    name: str, own: float, value: float, stated: Mapping[str, float], found: Mapping[str, Found]
) -> str:
    """Return what may have made a stated value differ, in words."""
    ratio = own / value
    for factor, (names, said) in FACTORS.items():
        if name in names and abs(ratio / factor - 1.0) < NEAR:
            return said
    if name == "resistance" and WARM[0] <= value / own <= WARM[1]:
        kelvin = (value / own - 1.0) * COPPER
        return (
            f"copper {abs(kelvin):.0f} K {'warmer' if kelvin > 0.0 else 'colder'} than when "
            "it was stated explains it"
        )
    if name.startswith("inductance") and stated.get("inductance_d") == stated.get("inductance_q"):
        both = [found[n].value for n in ("inductance_d", "inductance_q") if n in found]
        if len(both) == 2 and max(both) > SALIENT * min(both):
            return (
                "one inductance is stated for both axes, and an observer takes it off the "
                "voltage in either"
            )
    return "no usual factor explains it"


def _mean(found: Mapping[str, Found]) -> Found | None:
    """Return the mean inductance of the axes that are told."""
    both = [found[n] for n in ("inductance_d", "inductance_q") if n in found]
    if not both:
        return None
    ends = [x.ci95 or (x.value, x.value) for x in both]
    low, high = (sum(e[k] for e in ends) / len(both) for k in (0, 1))
    return Found(sum(x.value for x in both) / len(both), (low, high))


def intended(stated: Mapping[str, float]) -> float | None:
    """Return the current loop's bandwidth (rad/s) that a configuration means; None where it states
    none above 0."""
    if stated.get("bandwidth", 0.0) > 0.0:
        return stated["bandwidth"]
    both = [stated[n] for n in ("inductance_d", "inductance_q") if n in stated]
    return (
        stated["current_kp"] * len(both) / sum(both)
        if both and stated.get("current_kp", 0.0) > 0.0
        else None
    )


def _gains(
    stated: Mapping[str, float], found: Mapping[str, Found], bandwidth: float | None
) -> list[Setting]:
    """Return the rows of the current loop's gains."""
    omega, inductance = bandwidth or intended(stated), _mean(found)
    own = dict(stated)
    if "bandwidth" in stated:  # gains follow from it and from the values stated
        both = [stated[n] for n in ("inductance_d", "inductance_q") if n in stated]
        if both:
            own.setdefault("current_kp", stated["bandwidth"] * sum(both) / len(both))
        if "resistance" in stated:
            own.setdefault("current_ki", stated["bandwidth"] * stated["resistance"])
    rows = []
    for name, of, what in (
        ("current_kp", inductance, "the inductances"),
        ("current_ki", found.get("resistance"), "the resistance"),
    ):
        if omega is None or of is None:
            why = (
                "no bandwidth is stated; give it"
                if omega is None
                else f"it needs {what}, which the result does not tell"
            )
            rows.append(Setting(name, own.get(name), None, None, why))
            continue
        low, high = of.ci95 or (of.value, of.value)
        row = Setting(name, own.get(name), omega * of.value, (omega * low, omega * high), "")
        law = (
            f"{omega:.4g} rad/s times {'the mean of L_d and L_q' if name == 'current_kp' else 'R'}"
        )
        done = {
            "agrees": "as it cancels the winding's pole",
            "differs": f"set {omega * of.value:.4g} {row.unit}",
        }
        said = f"{done.get(row.verdict, f'{omega * of.value:.4g} {row.unit}')}: {law}"
        if row.off is not None and row.verdict == "differs":
            if name == "current_kp":
                said += f"; the loop is {'faster' if row.off > 0.0 else 'slower'} than meant"
            else:
                said += _zero(own, of.value, inductance)
        rows.append(Setting(name, own.get(name), row.found, row.ci95, said))
    return rows


def _zero(own: Mapping[str, float], resistance: float, inductance: Found | None) -> str:
    """Return where the controller's zero ki/kp lies beside the winding's pole R/L; nothing without
    kp or L."""
    if "current_kp" not in own or inductance is None:
        return ""
    ratio = own["current_ki"] / own["current_kp"] * inductance.value / resistance
    if abs(ratio - 1.0) < NEAR:
        return "; its zero is the winding's pole, both gains are off alike"
    return f"; its zero lies {'above' if ratio > 1.0 else 'below'} the winding's pole"


def _dead_time(
    stated: Mapping[str, float], found: Mapping[str, Found], untold: Mapping[str, str]
) -> Setting:
    lost, own = found.get("dead_time"), stated.get("dead_time")
    if lost is None:
        return Setting(
            "dead_time",
            own,
            None,
            None,
            untold.get("dead_time", "the result names no voltage that legs lose"),
        )
    value, ends = (
        max(0.0, lost.value),
        lost.ci95 and (max(0.0, lost.ci95[0]), max(0.0, lost.ci95[1])),
    )
    row = Setting("dead_time", own, value, ends, "")
    said = f"legs lose {1e6 * lost.value:.3g} us"
    if lost.value < 0.0:
        said = f"what legs lose is made up for by {-1e6 * lost.value:.3g} us too much"
    if own is None:
        return Setting("dead_time", own, value, ends, f"{said}; make up for {1e6 * value:.3g} us")
    said += "" if row.verdict == "agrees" else f"; set foc_dt_us = {_vesc_number(value):.3g}"
    if own:
        said += (
            "; if the log holds VESC's reported d/q voltage, what is stated was taken off "
            "there: set foc_dt_us = "
        )
        said += f"{_vesc_number(max(0.0, own + lost.value)):.3g}"
    return Setting("dead_time", own, value, ends, said)


def _vesc_number(time: float) -> float:
    """Return what foc_dt_us has to be to make up for a time (s) that legs lose."""
    return 1e6 * time / VESC_DEAD_TIME
