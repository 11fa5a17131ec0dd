"""R, L_d, L_q and magnet flux from ordinary recordings: a step at locked rotor, a sweep, a spin at
any commands.

Two steps over the same recordings:

1. linear least squares on the flux balance over windows (`sandbox.recordings.checks.balance` writes
it out),
2. from there the exact replay, by Gauss and Newton: the parameters whose simulated currents miss
   the measured ones least.  The first errs where readings are noisy, since noise stands on both
   sides of its equations; the second does not.

Beside the motor the voltage that each leg loses and the offsets of two sensors are fitted.
Deviations are those of blocks of time (the "sandwich" of White, Econometrica 48 (1980) 817, with
blocks as its independent pieces): what the model lacks is alike over many samples, so single
samples would promise too much.  All four are free together, from a wide prior about the nominal
ones: what the data do not tell apart is in each other's interval.  A parameter that they leave open
by more than MAX_DEVIATION of itself is not told: its nominal value stands, and a sentence says why.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from model.effects.library import parameters, true_motor
from model.errors import BadInput, PhysicsError
from model.mapped import MappedMotor
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.rows.commands import mean_command
from sandbox.replay.inputs import Inputs
from sandbox.replay.replay import Prepared, prepare, replay, residuals

Array = NDArray[np.float64]
NAMES = ("resistance", "inductance_d", "inductance_q", "magnet_flux")
OF_EFFECT = {
    "resistance": "stator_resistance.resistance",
    "inductance_d": "inductance.scale_d",
    "inductance_q": "inductance.scale_q",
    "magnet_flux": "magnet_flux.magnet_flux",
}
THRESHOLD, DEAD = LOST = ("device_drop.threshold", "dead_time.time")
OFFSETS = ("current_offset.offset_a", "current_offset.offset_b")
# of each angle that was made: its zero is nobody's reading
OFFSET_OF, ANGLE = "encoder_offset.offset", "angles."
# relative standard deviation: beyond it an interval holds a half and twice the value
MAX_DEVIATION = 0.3
ALIKE = 0.7  # correlation: half of what is open of a parameter is another one's
BLOCKS = 40  # blocks of time that all recordings are cut into, for the scatter of what they say
MAX_SAMPLES = 60_000  # samples used: at 10 kHz six seconds of motion
LOGARITHMS = ("inductance_d", "inductance_q")  # R and flux in shares of their start: linear ones
EXPLAINED = 1.5  # of the noise's square: what is left of a fit that needs no other start
STEPS, ENOUGH = 12, 1e-3  # of Gauss and Newton; in standard deviations
SHARE = 1e-3  # of a parameter: the step of its slope
# priors, one standard deviation: of rated current; of the link, as voltage or as time
OFFSET, DROP = 0.01, 0.02
# prior of R and flux, one standard deviation over nominal: data that say anything outdo it
OPEN = 10.0
FARTHEST = math.log(3.0)  # of a parameter in one step
CHANGES = 5.0  # noises: the least rms change of a current that tells an inductance
# logarithm of the factor from the start within which one is looked for; inductances: inside a
# scale's bounds
WIDE = {
    "resistance": math.log(1e3),
    "magnet_flux": math.log(1e3),
    "inductance_d": math.log(4.0),
    "inductance_q": math.log(4.0),
}


@dataclass(frozen=True, repr=False)
class OrdinaryFit:
    """What ordinary recordings say of a motor.

    values, deviations: of what was told, by name of [motor]; untold: why the others are not; start:
    by the linear least squares (nominal where it says nothing); nuisance: by public name of
    effects, and angles.FILE (rad) of a zero that was made; residual_rms: A; misfit: the residual's
    square over the noise's; files: of the recordings used; samples: used, of `of_samples`.
    """

    motor: Motor
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    untold: Mapping[str, str]
    start: Mapping[str, float]
    nuisance: Mapping[str, float]
    residual_rms: float
    misfit: float
    rms: Mapping[str, float]
    samples: int
    of_samples: int

    def ci95(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter that is told."""
        half = 1.959964 * self.deviations[name]
        return self.values[name] - half, self.values[name] + half


def fit_ordinary(campaign: Campaign, workers: int = 1) -> OrdinaryFit:
    """Return R, L_d, L_q and magnet flux of a campaign's recordings, whatever was commanded.

    BadInput where they say nothing of any of them.
    """
    used = _shortened(campaign)
    begin, why = linear(used)
    if set(why) == set(NAMES):
        raise BadInput(
            f"{campaign.name}: {why['resistance']}: nothing to identify; record steps of "
            "the current"
        )
    nominal = {n: float(getattr(campaign.drive.motor, n)) for n in NAMES}
    starts = [
        _Search(prepare(_begun_at(used, x)), NAMES, x, nominal, workers)
        for x in (begin, nominal)
        if min(x.values()) > 0
    ]
    x = _best_of(sorted(starts, key=lambda s: s.square_at_start()))
    names = x.names
    inner, scatter = x.information()
    covariance: Array = np.asarray(np.linalg.inv(inner), dtype=np.float64)
    sandwich = covariance @ scatter @ covariance
    deviation = x.relative(np.sqrt(np.maximum(np.diag(covariance), np.diag(sandwich))))
    estimated, untold = [], {}
    for k, name in enumerate(NAMES):
        if deviation[k] < MAX_DEVIATION and not x.at_bound(k):
            estimated.append(name)
        else:
            untold[name] = why.get(name) or _why_open(
                name, k, names, covariance, float(deviation[k])
            )
    values = x.values()
    prepared, shown = x.prepared, x.residual_rms()
    count = sum(len(r.t) for r in used.recordings)
    motor = _with(campaign.drive.motor, {n: values[n] for n in estimated})
    return OrdinaryFit(
        motor,
        {n: values[n] for n in estimated},
        {n: float(deviation[NAMES.index(n)]) * values[n] for n in estimated},
        untold,
        begin,
        {n: values[n] for n in names[len(NAMES) :]},
        prepared.noise_std * math.sqrt(x.square()),
        x.square(),
        shown,
        count,
        sum(len(r.t) for r in campaign.recordings),
    )


def _best_of(starts: Sequence[_Search]) -> _Search:
    """Return the fit from the first start that noise explains, else the best of them."""
    fits = []
    for start in starts:
        fits.append(_of_both(start))
        if fits[-1].square() < EXPLAINED:
            break
    return min(fits, key=lambda s: s.square())


def _of_both(start: _Search) -> _Search:
    """Return the fit with both ways to lose voltage, from the better one of the fits with either:
    where the current goes through zero they differ, and a fit of both may stick at the wrong
    one."""
    zeros = list(
        dict.fromkeys(ANGLE + r.angle_name for r in start.prepared.recordings if r.zero > 0.0)
    )
    either = [start.beside([*NAMES, one, *OFFSETS, *zeros]).found() for one in LOST]
    best = min(either, key=lambda s: s.square())
    return best.beside([*NAMES, *LOST, *OFFSETS, *zeros]).found()


def _begun_at(campaign: Campaign, begin: Mapping[str, float]) -> Campaign:
    """Return a campaign whose nominal motor has the values found first; one with a flux map keeps
    it."""
    drive = campaign.drive
    own = (
        dict(begin)
        if not isinstance(drive.motor, MappedMotor)
        else {"resistance": begin["resistance"]}
    )
    motor = replace(drive.motor, **own)  # type: ignore[arg-type]
    return replace(campaign, drive=replace(drive, motor=motor))


def _with(motor: Motor, values: Mapping[str, float]) -> Motor:
    """Return a motor with values of its own replaced; one with a flux map keeps the map."""
    effects = {
        OF_EFFECT[n]: v / (getattr(motor, n) if n.startswith("inductance") else 1.0)
        for n, v in values.items()
    }
    return true_motor(motor, {**complete_neutral(motor), **effects}, keep_map=True)


def complete_neutral(motor: Motor) -> dict[str, float]:
    """Return the values of a motor that effects replace, as they are."""
    from model.effects.library import replaced, scaled

    return {n: getattr(motor, f) for n, f in replaced().items()} | dict.fromkeys(scaled(), 1.0)


def _shortened(campaign: Campaign) -> Campaign:
    """Return a campaign of at most MAX_SAMPLES samples, of each recording the same share from its
    beginning on, the load's torque left out: it is not asked."""
    whole = sum(len(r.t) for r in campaign.recordings)
    share = min(1.0, MAX_SAMPLES / whole)
    return replace(campaign, recordings=tuple(_part(r, share) for r in campaign.recordings))


def _part(r: CampaignRecording, share: float) -> CampaignRecording:
    rows = max(2, 2 * int(0.5 * share * len(r.t)))
    columns = {n: x[:rows] for n, x in r.columns.items() if n != "load_torque"}
    return replace(r, columns=columns)


def linear(campaign: Campaign) -> tuple[dict[str, float], dict[str, str]]:
    """Return R (ohm), L_d, L_q (H) and magnet flux (Wb) by least squares on the flux balance,
    nominal where recordings are silent, and why they are, by name."""
    drive = campaign.drive
    rows = [_equations(r, drive) for r in campaign.recordings]
    a = np.concatenate([a for a, _ in rows])
    b = np.concatenate([b for _, b in rows])
    why = _silent(campaign)
    keep = [k for k, n in enumerate(NAMES) if n not in why] + [4]
    scale = np.sqrt(np.mean(a**2, axis=0))
    keep = [k for k in keep if scale[k] > 0.0]
    held = [k for k in range(4) if k not in keep]
    b = b - a[:, held] @ np.array([float(getattr(drive.motor, NAMES[k])) for k in held])
    found = np.linalg.lstsq(a[:, keep] / scale[keep], b, rcond=1e-6)[0] / scale[keep]
    estimated = dict(zip(keep, found, strict=True))
    out = {}
    for k, name in enumerate(NAMES):
        nominal = max(float(getattr(drive.motor, name)), 1e-9)
        value = float(estimated.get(k, nominal))
        out[name] = value if value > 0.0 and 1e-3 < value / nominal < 1e3 else nominal
    return out, why


def _equations(r: CampaignRecording, drive: Drive) -> tuple[Array, Array]:
    """Return columns (rows, 5) for R, L_d, L_q, magnet flux and a leg's lost voltage, and the flux
    (rows,) that voltage gives, over windows of a recording in its stator frame."""
    h = drive.converter.sampling_period
    i_alpha, i_beta = r.current
    i, u = i_alpha + 1j * i_beta, mean_command(r.u_alpha + 1j * r.u_beta, r.theta, drive.converter)
    size = max(1, min(8, (len(i) - 1) // 8))
    ends = np.arange(0, len(i), size)
    turn = np.exp(1j * r.theta)
    own = i * np.conj(turn)
    lost = sum(
        (2.0 / 3.0) * np.exp(2j * math.pi / 3.0 * k) * np.sign(0.5 * (x[1:] + x[:-1]))
        for k, x in enumerate((r.i_a, r.i_b, r.i_c))
    )
    over = [0.5 * h * (i[:-1] + i[1:]), h * lost, h * u[:-1]]
    drop, legs, flux = (np.diff(np.concatenate([[0j], np.cumsum(x)])[ends]) for x in over)
    steps = [np.diff(x[ends]) for x in (own.real * turn, 1j * own.imag * turn, turn)]
    columns = [drop, *steps, legs]
    return np.column_stack([np.concatenate([x.real, x.imag]) for x in columns]), np.concatenate(
        [flux.real, flux.imag]
    )


def _silent(campaign: Campaign) -> dict[str, str]:
    """Return the parameters that these recordings cannot show at all, and why."""
    drive = campaign.drive
    noise = math.hypot(drive.converter.current_noise, drive.converter.current_resolution)
    floor = max(CHANGES * noise, 1e-4 * drive.motor.rated_current)
    frames = []
    for r in campaign.recordings:
        alpha, beta = r.current
        frames.append((alpha + 1j * beta) * np.exp(-1j * r.theta))
    out = {}
    largest = max(float(np.sqrt(np.mean(np.abs(x) ** 2))) for x in frames)
    if largest < floor:
        out["resistance"] = (
            f"the current stays below {floor:.2g} A, {CHANGES:g} times the sensors' noise"
        )
    for name, part, axis, other in (
        ("inductance_d", "real", "d", "q"),
        ("inductance_q", "imag", "q", "d"),
    ):
        change = max(float(np.std(getattr(x, part))) for x in frames)
        if change < floor:
            out[name] = (
                f"the current on {axis} changes by {change:.2g} A rms, the sensors' noise is "
                f"{noise:.2g} A; step or inject on {axis}, too (all changes lie on {other})"
            )
    if all(r.rotor == "locked" or np.ptp(r.theta) == 0.0 for r in campaign.recordings):
        out["magnet_flux"] = "no rotor turns (back-EMF alone tells it); record a spin"
    return out


def _why_open(name: str, k: int, names: Sequence[str], covariance: Array, deviation: float) -> str:
    """Return why a parameter stays open, from what it is fitted beside."""
    size = np.sqrt(np.diag(covariance))
    alike = np.abs(covariance[k]) / (size[k] * size)
    alike[k] = 0.0
    spread = f"its standard deviation is {100.0 * deviation:.2g} % of it"
    if deviation < MAX_DEVIATION:
        return (
            "it goes to the bound of what is looked for; the model is another one "
            "(saturation? units?)"
        )
    words = dict.fromkeys(LOST, "the voltage that the inverter loses")
    others = dict.fromkeys(words.get(n, n) for n, a in zip(names, alike, strict=True) if a > ALIKE)
    if others:
        return (
            f"{spread}, since {' and '.join(others)} look{'s' * (len(others) == 1)} alike on these "
            "data; record several currents of both signs at several speeds"
        )
    return (
        f"{spread}; record larger steps of it"
        if name != "magnet_flux"
        else f"{spread}; spin faster"
    )


def _bounds(name: str) -> tuple[float, float]:
    """Return between which places a parameter or nuisance is looked for."""
    if name.startswith(ANGLE):
        return -math.inf, math.inf
    if name not in NAMES:
        return parameters()[name].low, parameters()[name].high
    wide = WIDE[name]
    return (-wide, wide) if name in LOGARITHMS else (math.exp(-wide), math.exp(wide))


class _Search:
    """Gauss and Newton on the replayed currents: places of parameters (R and flux in shares of
    their start, inductances as logarithms) and of nuisances (as they are).

    Slopes are differences of replays that run together.
    """

    def __init__(
        self,
        prepared: Prepared,
        names: Sequence[str],
        begin: Mapping[str, float],
        nominal: Mapping[str, float],
        workers: int,
    ) -> None:
        self.prepared, self.names, self.workers = prepared, list(names), workers
        drive = prepared.campaign.drive
        self.motor, self.origin, self.nominal = drive.motor, begin, nominal
        self.own = np.array([n in NAMES for n in names])
        self.logs = np.array([n in LOGARITHMS for n in names])
        self.unit = np.array([begin[n] if n in NAMES else 1.0 for n in names])
        self.x = np.where(self.own & ~self.logs, 1.0, 0.0)
        converter = drive.converter
        own = {THRESHOLD: DROP * converter.dc_bus_voltage, DEAD: DROP * converter.update_period}
        own |= dict.fromkeys(OFFSETS, OFFSET * drive.motor.rated_current)
        own |= {ANGLE + r.angle_name: r.zero for r in prepared.recordings}
        self.step = np.array([SHARE * own.get(n, 1.0) for n in names])
        stated = {n: max(nominal[n], 1e-9) / begin[n] for n in NAMES}  # in shares of the start
        own |= {n: WIDE[n] if n in LOGARITHMS else OPEN * stated[n] for n in NAMES}
        self.prior = np.array([own[n] for n in names])
        centre = {n: math.log(x) if n in LOGARITHMS else x for n, x in stated.items()}
        self.centre = np.array([centre.get(n, 0.0) for n in names])
        bounds = [_bounds(n) for n in names]
        self.least, self.most = np.array([b[0] for b in bounds]), np.array([b[1] for b in bounds])
        self.r = np.empty(0)

    def beside(self, names: Sequence[str]) -> _Search:
        """Return a search of other parameters that begins where this one stands."""
        other = _Search(self.prepared, names, self.origin, self.nominal, self.workers)
        here = dict(zip(self.names, self.x, strict=True))
        other.x = np.array([here.get(n, v) for n, v in zip(other.names, other.x, strict=True)])
        return other

    def values(self, x: Array | None = None) -> dict[str, float]:
        """Return parameters and nuisances at a place."""
        at = self.x if x is None else x
        values = self.unit * np.where(self.logs, np.exp(np.where(self.logs, at, 0.0)), at)
        return dict(zip(self.names, map(float, values), strict=True))

    def relative(self, deviation: Array) -> Array:
        """Return standard deviations of places as those of values over the values; of nuisances as
        they are."""
        return np.where(
            self.own & ~self.logs, deviation / np.where(self.x > 0.0, self.x, 1.0), deviation
        )

    def as_set(self, x: Array, angle: str) -> dict[str, float]:
        """Return a place as the replay takes it for the recordings of one angle."""
        out: dict[str, float] = {}
        for n, v in self.values(x).items():
            if n.startswith(ANGLE):
                out |= {OFFSET_OF: v} if n == ANGLE + angle else {}
                continue
            scale = getattr(self.motor, n) if n.startswith("inductance") else 1.0
            out[OF_EFFECT.get(n, n)] = v / scale
        return out

    def residuals(self, places: Sequence[Array]) -> Array:
        """Return residuals (n, places) of all currents over the noise floor."""
        shown = []
        for angle, own in itertools.groupby(self.prepared.recordings, self._own_angle):
            part = replace(self.prepared, recordings=tuple(own))
            shown += residuals(
                part, replay(part, [self.as_set(x, angle) for x in places], workers=self.workers)
            )
        return np.concatenate([t.current.reshape(-1, len(places)) for t in shown])

    def _own_angle(self, r: Inputs) -> str:
        """Return the name of a recording's angle where its zero is fitted, empty where it was
        read."""
        return r.angle_name if ANGLE + r.angle_name in self.names else ""

    def cost(self, r: Array, x: Array) -> float:
        """Return half the squares, those of nuisances' priors with them."""
        return 0.5 * float(r @ r + np.sum(((x - self.centre) / self.prior) ** 2))

    def slopes(self) -> Array:
        """Return slopes (n, p) at the place, and keep the residual there."""
        step = np.where(self.x + self.step > self.most, -self.step, self.step)
        every = self.residuals([self.x, *(self.x + np.diag(step))])
        self.r = every[:, 0]
        return np.asarray((every[:, 1:] - every[:, :1]) / step)

    def found(self) -> _Search:
        """Go to the place of the least squares; PhysicsError where none is found."""
        for _ in range(STEPS):
            j = self.slopes()
            weight = 1.0 / self.prior**2
            # seconds beside volts are no small direction
            size = np.sqrt(np.sum(j**2, axis=0) + weight)
            inner = (j.T @ j + np.diag(weight)) / np.outer(size, size) + 1e-9 * np.eye(len(size))
            down = -(j.T @ self.r + weight * (self.x - self.centre)) / size
            if not (np.all(np.isfinite(inner)) and np.all(np.isfinite(down))):
                raise PhysicsError(
                    "these recordings and the nominal motor go nowhere together; check "
                    "[motor] and units"
                )
            move = self.linear_step(inner, down, size)
            before, share = self.cost(self.r, self.x), 1.0
            while share > 1e-3:
                place = self.bounded(self.x + share * move)
                r = self.residuals([place])[:, 0]
                if np.all(np.isfinite(r)) and self.cost(r, place) <= before:
                    break
                share *= 0.5
            else:
                break
            gone = before - self.cost(r, place)
            self.x, self.r = place, r
            if gone < ENOUGH * max(1.0, before / len(r)):
                break
        self.j = self.slopes()
        return self

    def linear_step(self, inner: Array, down: Array, size: Array) -> Array:
        """Return the step that solves the linear problem inside the bounds, logarithms by FARTHEST
        at most.  Steps are scaled by size: a step cut at a bound afterwards would go elsewhere."""
        root = np.linalg.cholesky(inner)
        farthest = np.where(self.logs, FARTHEST, np.inf)
        low = size * np.maximum(self.least - self.x, -farthest)
        high = size * np.minimum(self.most - self.x, farthest)
        solved = lsq_linear(root.T, np.linalg.solve(root, down), (low, high))
        return np.asarray(solved.x / size)

    def bounded(self, x: Array) -> Array:
        """Return a place inside the bounds."""
        return np.asarray(np.clip(x, self.least, self.most))

    def information(self) -> tuple[Array, Array]:
        """Return what the slopes say (p, p), over noise or what is left where that is more, and its
        scatter from block to block."""
        inner = self.j.T @ self.j / max(self.square(), 1.0) + np.diag(1.0 / self.prior**2)
        cuts = np.array_split(np.arange(len(self.r)), BLOCKS)
        g = np.stack([self.j[c].T @ self.r[c] for c in cuts]) / max(self.square(), 1.0)
        return inner, g.T @ g

    def square_at_start(self) -> float:
        """Return the mean square of what the start leaves, over the noise's; infinite where it
        predicts nothing."""
        r = self.residuals([self.x])
        return float(np.mean(r**2)) if np.all(np.isfinite(r)) else math.inf

    def at_bound(self, k: int) -> bool:
        """Tell whether a parameter stands at a bound."""
        return bool(self.x[k] <= self.least[k] or self.x[k] >= self.most[k])

    def square(self) -> float:
        """Return the mean square of what is left, over the noise's."""
        return float(np.mean(self.r**2))

    def residual_rms(self) -> dict[str, float]:
        """Return each recording's rms, over the noise floor."""
        out, at = {}, 0
        for r in self.prepared.recordings:
            n = 3 * r.samples
            out[r.file] = float(np.sqrt(np.mean(self.r[at : at + n] ** 2)))
            at += n
        return out
