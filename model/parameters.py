"""A drive as its engineer states it: motor, converter and sensors, injection; read from TOML,
checked at birth.

A built-in motor is a file of the same kind as a user's (`model/motors/*.toml`); a campaign's
`campaign.toml` is one too, given its rated values.  Numbers are SI units, angles electrical unless
a key ends in `_rpm`.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any

from model.energy import AnyEnergy, Energy
from model.errors import BadInput, as_toml, brief, unknown
from model.inverter_table import Points, checked
from model.names import check_name
from model.remedies import number_of, remedy

LARGEST = 1e300
WAVEFORMS = ("square", "sine", "random")
# gains of the tracking loop: from margins, or see `estimators.published`
TRACKINGS = ("designed", "vesc", "mesc")
LINKS = ("steady", "measured")  # what the true link voltage does, beside effects
COMMANDS = ("volts", "duties", "nominal")  # what recorded commands are
# which legs switch, see `sandbox.plant.gates.modulation`
MODULATIONS = ("centred", "dpwm_min", "dpwm_max", "dpwm_60")
# as others call it
CENTRED = dict.fromkeys(("svpwm", "svm", "space_vector", "space vector"), "centred")
SINUSOIDAL = ("spwm", "sinusoidal", "sine")  # none of MODULATIONS: nothing is added to all legs
# what is made of a voltage that the legs cannot give
OVERMODULATIONS = ("nearest", "shortened", "six_step")
BETWEEN = ("held", "interpolated")  # what commands do between the rows of a slow log
MOST_PERIODS = 400  # of the PWM, from row to row of a slow log
TEXTS = (
    "description",
    "waveform",
    "transformation",
    "rotor",
    "reference",
    "dc_link",
    "command",
    "modulation",
    "overmodulation",
    "between_rows",
    "tracking",
)
# of rated current: the most that a scenario may ask for, and the worst point of every loop
OVERLOAD = 2.5


class Rotor(IntEnum):
    """What is done with a rotor while something is recorded, as compiled code has it."""

    LOCKED, DRIVEN, FREE = range(3)


ROTORS = tuple(rotor.name.lower() for rotor in Rotor)


def quantity(unit: str, low: float, high: float, *, default: Any = dataclasses.MISSING) -> Any:
    """Declare a dataclass field that is a finite number in a range of plausible values, with its
    unit."""
    meta = {"unit": unit, "low": low, "high": high}
    return (
        field(metadata=meta)
        if default is dataclasses.MISSING
        else field(default=default, metadata=meta)
    )


def check(thing: Any, table: str) -> None:
    """Raise BadInput for the first field that is no finite number inside its declared range."""
    for f in dataclasses.fields(thing):
        if "low" not in f.metadata:
            continue
        value, low, high = getattr(thing, f.name), f.metadata["low"], f.metadata["high"]
        if value is None and f.default is None:
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            unit = f.metadata["unit"] or "no unit"
            write = number_of(value, low, high, unit)
            raise BadInput(
                f"[{table}] {f.name} = {as_toml(value)} is not a number; give one ({unit}){write}"
            )
        if not low <= value <= high:  # NaN lands here too
            bound = f"[{low:g}, {high:g}] {f.metadata['unit']}".rstrip()
            known = float(value) if abs(value) <= LARGEST else math.nan
            how = remedy(f.name, known, low, high, f.metadata["unit"])
            spare = ", or leave it out" if f.default is not dataclasses.MISSING else ""
            raise BadInput(
                f"[{table}] {f.name} = {as_toml(value)} is out of range; give a finite "
                f"value in {bound}{how}{spare}"
            )
    for name in TEXTS:
        if not isinstance(getattr(thing, name, "") or "", str):
            raise BadInput(
                f"[{table}] {name} = {as_toml(getattr(thing, name))} is not a text; put "
                "it in quotes"
            )
    if hasattr(thing, "name"):
        check_name(thing.name, f"[{table}] name")


def finite(value: object) -> float | None:
    """Return a number that a file gives as a float, None where it is none, not finite or too large
    for one."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= LARGEST:
        return None
    return float(value)


def texts(table: dict[str, Any]) -> dict[str, str]:
    """Return a table's values as texts, whatever they are."""
    return {k: v if isinstance(v, str) else brief(v, 1000) for k, v in table.items()}


@dataclass(frozen=True)
class Motor:
    """A permanent-magnet motor in two axes, with the energy of the paper; currents are peak,
    amplitude-invariant.

    Parameters
    ----------
    name : str
        As results call it; it must do as a file's name.
    pole_pairs : int
        1 to 100: electrical angle over mechanical angle.
    resistance : float
        ohm, 1e-05 to 1000: of a phase winding.
    magnet_flux : float
        Wb, 0 to 100: peak flux of the magnets along d; 0 for a reluctance motor.
    inductance_d, inductance_q : float
        H, 1e-07 to 10: along d and q at zero current.
    inertia : float
        kg m^2, 1e-09 to 10000: of the whole shaft, load included.
    rated_current : float
        A peak, 0.001 to 100000: amplitude of a phase current.
    rated_torque : float
        N m, 1e-06 to 1e+06: at rated current, i_d = 0.
    rated_speed_rpm : float
        rpm, 0.01 to 200000: mechanical.
    alpha_30, alpha_12 : float, default 0.0
        A/Wb^2, -1e+09 to 1e+09: of phi_d^3 (saturation along d) and phi_d phi_q^2
        (cross-saturation) in the energy.
    alpha_40, alpha_22, alpha_04 : float, default 0.0
        A/Wb^3, -1e+12 to 1e+12: of phi_d^4, phi_d^2 phi_q^2 (cross-saturation) and phi_q^4.
    viscous_friction : float, default 0.0
        N m s/rad, 0 to 10000: torque against the motion over mechanical speed.
    description : str, default ''
        One line for people: where the values come from.

    Raises
    ------
    BadInput
        For a value outside its range, and for pole pairs that are not whole.

    Examples
    --------
    >>> from sandbox import load_motor
    >>> motor = load_motor("ipm_exchanged").motor
    >>> motor.inductance_q, motor.rated_current
    (0.0919, 1.2)
    """

    name: str
    pole_pairs: int = quantity("", 1, 100)
    resistance: float = quantity("ohm", 1e-5, 1e3)
    magnet_flux: float = quantity("Wb", 0, 1e2)
    inductance_d: float = quantity("H", 1e-7, 10)
    inductance_q: float = quantity("H", 1e-7, 10)
    inertia: float = quantity("kg m^2", 1e-9, 1e4)
    rated_current: float = quantity("A peak", 1e-3, 1e5)
    rated_torque: float = quantity("N m", 1e-6, 1e6)
    rated_speed_rpm: float = quantity("rpm", 0.01, 2e5)
    alpha_30: float = quantity("A/Wb^2", -1e9, 1e9, default=0.0)
    alpha_12: float = quantity("A/Wb^2", -1e9, 1e9, default=0.0)
    alpha_40: float = quantity("A/Wb^3", -1e12, 1e12, default=0.0)
    alpha_22: float = quantity("A/Wb^3", -1e12, 1e12, default=0.0)
    alpha_04: float = quantity("A/Wb^3", -1e12, 1e12, default=0.0)
    viscous_friction: float = quantity("N m s/rad", 0, 1e4, default=0.0)
    description: str = ""

    def __post_init__(self) -> None:
        check(self, "motor")
        if self.pole_pairs != int(self.pole_pairs):
            raise BadInput(
                f"[motor] pole_pairs = {self.pole_pairs} is not whole; count pairs of "
                "poles, not poles"
            )

    @property
    def energy(self) -> AnyEnergy:
        """The saturated magnetic model."""
        alphas = (self.alpha_30, self.alpha_12, self.alpha_40, self.alpha_22, self.alpha_04)
        return Energy(1.0 / self.inductance_d, 1.0 / self.inductance_q, *(float(a) for a in alphas))

    @property
    def has_map(self) -> bool:
        """Whether a flux map says how it saturates, in place of inductances, magnet flux and alphas
        of its file."""
        return False

    @property
    def linear_energy(self) -> Energy:
        """The linear magnetic model: the same motor without its alphas."""
        return Energy(1.0 / self.inductance_d, 1.0 / self.inductance_q, 0.0, 0.0, 0.0, 0.0, 0.0)

    @property
    def rated_omega(self) -> float:
        """Rated speed, electrical rad/s."""
        return self.pole_pairs * self.rated_speed_rpm * math.pi / 30.0


@dataclass(frozen=True)
class Converter:
    """The inverter and the current sensors: one sample and one voltage update each sampling period.

    pwm_frequency: one sample a PWM period, or two (double update: half of 1 / sampling_period).  Of
    recordings only: a whole number of PWM periods from row to row of a slow log, between_rows of
    which: the drive `held` a command until the next row, or updated it in every PWM period
    (`interpolated`; None: as recordings show);
    dc_link: `steady` (nominal but for effects; u_dc is noise about it) or `measured` (as u_dc
    reads; None: what recordings show); command: u is in `volts` that the drive divides by u_dc, in
    `duties` (of the link), or divided by the `nominal` voltage; pwm_counts: of the counter in half
    a PWM period, to which duties are rounded.

    modulation, overmodulation, least_pulse: how the drive makes pulses of a voltage
    (`sandbox.plant.gates.modulation`).
    readings, pulse_shift: for estimators that read inside the PWM period (usual values where None),
    not used by others.
    """

    # one sample of the currents and one new voltage in each
    sampling_period: float = quantity("s", 1e-6, 0.01)
    dc_bus_voltage: float = quantity("V", 0.1, 1e5)  # of the DC link, nominal
    # step of a current reading; 0: none
    current_resolution: float = quantity("A per count", 0, 1e4)
    current_noise: float = quantity("A rms", 0, 1e4)  # of one phase's reading
    # None: 1 / sampling_period, one sample a PWM period; half of that: double update
    pwm_frequency: float | None = quantity("Hz", 1, 1e6, default=None)
    transformation: str = "amplitude-invariant"  # of phases to alpha and beta; there is no other
    # None: angle readings are exact
    encoder_counts: int | None = quantity("counts per revolution", 1, 1e9, default=None)
    # about what the link is
    link_noise: float = quantity("V rms of the DC-link reading", 0, 1e4, default=0.0)
    # of recordings: `steady` (u_dc is noise about the nominal) or `measured`; None: as recordings
    # show
    dc_link: str | None = None
    # of slow logs: commands are `held` or `interpolated`; None: as recordings show
    between_rows: str | None = None
    # of recordings: u in `volts`, in `duties`, or divided by the `nominal` link voltage
    command: str = "volts"
    # to which duties are rounded; None: exact
    pwm_counts: int | None = quantity("counts of half a PWM period", 16, 1e9, default=None)
    # for estimators that read there; None: the usual
    readings: int | None = quantity("current readings inside a PWM period", 4, 32, default=None)
    # for the same; None: the usual
    pulse_shift: float | None = quantity(
        "of a period, the legs' pulses against each other", 0.01, 0.25, default=None
    )
    # `centred`, or discontinuous PWM, one leg at rest: `dpwm_min`, `dpwm_max`, `dpwm_60`
    modulation: str = "centred"
    # beyond the hexagon of what legs give: `nearest` point, `shortened`, `six_step`; None: control
    # stays inside it
    overmodulation: str | None = None
    # shorter pulses and gaps of a leg are dropped
    least_pulse: float = quantity("s", 0, 1e-3, default=0.0)
    inverter_table: Points | None = None  # a leg's voltage error (V) against its current (A)

    def __post_init__(self) -> None:
        check(self, "drive")
        if self.inverter_table is not None:
            object.__setattr__(self, "inverter_table", checked(self.inverter_table))
        if self.transformation != "amplitude-invariant":
            raise BadInput(
                f"[drive] transformation = '{self.transformation}' is not known; only "
                "'amplitude-invariant'"
            )
        self._check_periods()
        if self.dc_link is not None and self.dc_link not in LINKS:
            raise unknown("[drive] dc_link", self.dc_link, LINKS)
        if self.command not in COMMANDS:
            raise unknown("[drive] command", self.command, COMMANDS)
        if self.pwm_counts is not None and self.pwm_counts != int(self.pwm_counts):
            raise BadInput(
                f"[drive] pwm_counts = {self.pwm_counts} is not whole; give the counter's counts"
            )
        if self.readings is not None and self.readings != int(self.readings):
            raise BadInput(
                f"[drive] readings = {self.readings} is not whole; give a number of "
                "readings a period"
            )
        self._check_modulation()
        if not self.link_noise <= 0.1 * self.dc_bus_voltage:
            raise BadInput(
                f"[drive] link_noise = {self.link_noise:g} V is out of range; duties are "
                "formed with that reading: "
                f"give at most a tenth of dc_bus_voltage = {self.dc_bus_voltage:g} V"
            )

    def _check_periods(self) -> None:
        """Raise BadInput unless rows and PWM periods belong together."""
        one_or_two = any(abs(self.samples_a_period - n) < 1e-6 for n in (1.0, 2.0))
        rows = self.periods_a_row
        slow = 1 < rows <= MOST_PERIODS and abs(1.0 / self.samples_a_period - rows) < 1e-3 * rows
        if not (one_or_two or slow):
            raise BadInput(
                f"[drive] pwm_frequency = {self.pwm_frequency} Hz and sampling_period = "
                f"{self.sampling_period} s do not belong together; one or two samples a PWM period "
                "are simulated: give 1 / sampling_period, or half of it (double update), or of a "
                f"slower log a whole multiple up to {MOST_PERIODS} times"
            )
        if self.between_rows is not None and self.between_rows not in BETWEEN:
            raise unknown("[drive] between_rows", self.between_rows, BETWEEN)
        if self.between_rows is not None and rows == 1:
            raise BadInput(
                f"[drive] between_rows = '{self.between_rows}' is of logs whose rows are several "
                "PWM periods apart, as pwm_frequency says; leave it out where a row is one period"
            )

    def _check_modulation(self) -> None:
        """Raise BadInput unless it is known how the drive makes pulses of a voltage."""
        if self.modulation not in MODULATIONS:
            if str(self.modulation).casefold() in SINUSOIDAL:
                raise BadInput(
                    f"[drive] modulation = '{self.modulation}': sinusoidal PWM, without a part "
                    "common to all legs, is not simulated; 'centred' gives the same voltage "
                    "between the terminals, up to link/sqrt(3) in place of link/2"
                )
            raise unknown("[drive] modulation", self.modulation, MODULATIONS, CENTRED)
        if self.overmodulation is not None and self.overmodulation not in OVERMODULATIONS:
            raise unknown("[drive] overmodulation", self.overmodulation, OVERMODULATIONS)
        if not self.least_pulse < 0.25 * self.update_period:
            raise BadInput(
                f"[drive] least_pulse = {self.least_pulse:g} s is out of range; pulses "
                "are as long as the voltage "
                f"needs: give less than a quarter of the PWM period = {self.update_period:g} s"
            )
        if self.double and (
            self.modulation != "centred" or self.overmodulation or self.least_pulse
        ):
            raise BadInput(
                "[drive] pwm_frequency says two updates a PWM period, in which pulses "
                "are not centred; leave "
                "modulation, overmodulation and least_pulse away, or give one sample a PWM period"
            )

    @property
    def samples_a_period(self) -> float:
        """Samples and updates a PWM period: 1, 2 with double update, less than 1 in a slow log."""
        return (
            1.0 if self.pwm_frequency is None else 1.0 / (self.pwm_frequency * self.sampling_period)
        )

    @property
    def double(self) -> bool:
        """Whether duties are updated twice a PWM period: legs rise in one sampling period and fall
        in the next."""
        return self.samples_a_period > 1.5

    @property
    def periods_a_row(self) -> int:
        """PWM periods from one row of a log to the next: 1 but for slow logs."""
        return max(1, round(1.0 / self.samples_a_period))

    @property
    def update_period(self) -> float:
        """Seconds for which the PWM holds a voltage: the sampling period but for slow logs."""
        return self.sampling_period / self.periods_a_row

    def at_full_rate(self) -> Converter:
        """Return the drive itself, which samples in every PWM period, of what a slow log says of
        it."""
        if self.periods_a_row == 1:
            return self
        return replace(
            self, sampling_period=self.update_period, pwm_frequency=None, between_rows=None
        )

    @property
    def voltage_limit(self) -> float:
        """Largest amplitude the inverter can give at every angle (circle inside the hexagon), V."""
        return self.dc_bus_voltage / math.sqrt(3.0)

    @property
    def command_limit(self) -> float:
        """Largest amplitude that control asks for, V: as above, or with overmodulation that of the
        hexagon's corner."""
        return (
            self.voltage_limit if self.overmodulation is None else 2.0 / 3.0 * self.dc_bus_voltage
        )


@dataclass(frozen=True)
class Injection:
    """Pulsating voltage added along the estimated d axis.

    waveform: `square`, `sine`, or `random`: pseudo-random signs for half a period, then the same
    negated.
    tracking: gains of the estimators' tracking loop, `designed` from its margins, or the defaults
    that VESC or MESC publish for their injection 45 degrees beside d (`vesc`, `mesc`).
    """

    frequency: float = quantity("Hz", 0.1, 1e6)  # of the injected voltage
    amplitude: float = quantity("V", 1e-3, 1e5)  # of the injected voltage
    waveform: str = "square"  # `square`, `sine` or `random`
    # gains of the tracking loop: `designed`, or those published by `vesc` or `mesc`
    tracking: str = "designed"

    def __post_init__(self) -> None:
        check(self, "injection")
        if self.waveform not in WAVEFORMS:
            raise unknown("injection waveform", self.waveform, WAVEFORMS)
        if self.tracking not in TRACKINGS:
            raise unknown("[injection] tracking", self.tracking, TRACKINGS)


@dataclass(frozen=True)
class Limits:
    """What a bench may do at the most (None: what the drive is rated for), and what it can do with
    the rotor."""

    # largest amplitude of a phase current; None: as the motor's rating says
    current: float | None = quantity("A peak", 1e-3, 1e5, default=None)
    # largest mechanical speed; None: the same
    speed_rpm: float | None = quantity("rpm", 0.01, 2e5, default=None)
    # largest; None: that of the converter
    voltage: float | None = quantity("V of the DC link", 0.1, 1e5, default=None)
    can: tuple[str, ...] = ROTORS  # what the bench can do with the rotor: locked, driven, free
    fixed_link: bool = False  # whether the link's voltage cannot be changed

    def __post_init__(self) -> None:
        check(self, "limits")
        if not isinstance(self.fixed_link, bool):
            raise BadInput(
                f"[limits] fixed_link = {as_toml(self.fixed_link)} must be true or false"
            )
        if not isinstance(self.can, (list, tuple)) or not self.can:
            raise BadInput(
                f"[limits] can = {as_toml(self.can)} is no list; give some of {', '.join(ROTORS)}"
            )
        for kind in self.can:
            if kind not in ROTORS:
                raise unknown("kind of rotor", kind, ROTORS)
        object.__setattr__(self, "can", tuple(self.can))


@dataclass(frozen=True, repr=False)
class Drive:
    """Motor, converter and injection together, and where the values come from."""

    motor: Motor  # what is driven
    converter: Converter  # inverter and sensors
    injection: Injection  # what is injected for the estimator
    provenance: dict[str, str]  # where each value comes from, in words, by name

    def __repr__(self) -> str:
        motor, injection = self.motor, self.injection
        return (
            f"<Drive: {self.name}, {motor.rated_current:g} A peak, {motor.rated_torque:g} N m, "
            f"{motor.rated_speed_rpm:g} rpm, {self.converter.dc_bus_voltage:g} V, injects "
            f"{injection.amplitude:g} V at {injection.frequency:g} Hz>"
        )

    def at_full_rate(self) -> Drive:
        """Return it with a converter that samples in every PWM period."""
        return replace(self, converter=self.converter.at_full_rate())

    @property
    def name(self) -> str:
        """The motor's name."""
        return self.motor.name


def build(kind: Any, values: dict[str, Any], table: str) -> Any:
    """Return `kind(**values)`; BadInput for an unknown key (with the nearest) or a missing one."""
    fields = {f.name: f for f in dataclasses.fields(kind)}
    for key in values:
        if key not in fields:
            raise unknown(f"key in [{table}]", key, fields)
    required = (f for f in fields.values() if f.default is dataclasses.MISSING)
    for f in required:
        if f.name not in values:
            raise BadInput(
                f"[{table}] lacks '{f.name}'; add it in {f.metadata.get('unit') or 'its unit'}"
            )
    for key, f in fields.items():
        if (
            key in values
            and "low" in f.metadata
            and f.type in ("float", "float | None")
            and type(values[key]) is int
        ):
            # numba would compile again for an int
            values[key] = float(min(max(values[key], -(10**300)), 10**300))
    return kind(**values)


def table_of(data: dict[str, Any], name: str, required: bool = False) -> dict[str, Any]:
    """Return a table of a TOML file; BadInput where it is none, or is required and missing."""
    table = data.get(name, {})
    if required and name not in data:
        raise BadInput(f"no [{name}] table; a drive file needs one")
    if not isinstance(table, dict):
        raise BadInput(f"'{name}' is not a table; write [{name}]")
    return dict(table)
