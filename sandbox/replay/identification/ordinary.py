"""R, L_d, L_q and magnet flux from ordinary recordings: a step at locked rotor, a sweep, a spin at
any commands.

Two steps over the same recordings:

1. linear least squares on the flux balance over windows (`sandbox.recordings.checks.balance` writes
it out),
2. from there the exact replay, by Gauss and Newton: the parameters whose simulated currents miss
   the measured ones least.  The first errs where readings are noisy, since noise stands on both
   sides of its equations; the second does not.

All four are free together, from a wide prior about the nominal ones, beside what every drive has
(`places`): what the data do not tell apart is in each other's interval, and what the model lacks
widens them (`Search.deviations`).  A parameter that they leave open by more than MAX_DEVIATION of
itself is not told: its nominal value stands, and a sentence says why.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from model.array_types import Array
from model.confidence import Z95
from model.effects.library import title, true_motor
from model.errors import BadInput
from model.mapped import MappedMotor
from model.parameters import Drive, Motor
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.rows.commands import mean_command
from sandbox.replay.identification.places import (
    ALPHA,
    ANGLE,
    CORE,
    LAG,
    LEAST,
    LOST,
    NAMES,
    OF_EFFECT,
    OFFSETS,
    SIGN,
    places,
)
from sandbox.replay.identification.search import Search
from sandbox.replay.replay import prepare

# relative standard deviation: beyond it an interval holds a half and twice the value
MAX_DEVIATION = 0.3
TIED = 0.9  # correlation: four fifths of what is open of a parameter are another one's
ALIKE = 0.7  # correlation: half of what is open of a parameter is another one's
MAX_SAMPLES = 60_000  # samples used: at 10 kHz six seconds of motion
EXPLAINED = 1.5  # of the noise's square: what is left of a fit that needs no other start
CHANGES = 5.0  # noises: the least rms change of a current that tells an inductance


@dataclass(frozen=True, repr=False)
class OrdinaryFit:
    """What ordinary recordings say of a motor.

    values, deviations: of what was told, by name of [motor]; untold: why the others are not; start:
    by the linear least squares (nominal where it says nothing); nuisance: by public name of
    effects, and angles.FILE (rad) of a zero that was made; apart: of it, what stands more than an
    interval from where it usually is; residual_rms: A; missed_share: that over the current's rms;
    misfit: the residual's square over the noise's; rough: value and relative deviation of what the
    recordings hold and do not tell; tied: of a parameter, what looks alike beside it, and the value
    if that is as usual; files: of the recordings used; samples: used, of `of_samples`.
    """

    motor: Motor
    values: Mapping[str, float]
    deviations: Mapping[str, float]
    untold: Mapping[str, str]
    start: Mapping[str, float]
    nuisance: Mapping[str, float]
    apart: tuple[str, ...]
    residual_rms: float
    missed_share: float
    misfit: float
    rms: Mapping[str, float]
    samples: int
    of_samples: int
    rough: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    tied: Mapping[str, tuple[str, float]] = field(default_factory=dict)

    def ci95(self, name: str) -> tuple[float, float]:
        """Return the 95 % interval of a parameter that is told."""
        half = Z95 * self.deviations[name]
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
    # a reluctance motor has no flux: as `places` takes it
    nominal = {n: max(float(getattr(campaign.drive.motor, n)), LEAST) for n in NAMES}
    starts = []
    for values in (begin, nominal):
        if min(values.values()) > 0:
            prepared = prepare(_begun_at(used, values))
            own = places(prepared, values, campaign.drive.motor)
            starts.append(Search(prepared, NAMES, own, workers))
    x = _best_of(sorted(starts, key=lambda s: s.square_at_start()))
    names = x.names
    size, covariance = x.deviations()
    moved = tied(x, covariance)
    for k, (_, move) in moved.items():
        size[k] = math.hypot(size[k], move / Z95)
    deviation = x.relative(size)
    estimated, untold = [], {}
    for k, name in enumerate(NAMES):
        if deviation[k] < MAX_DEVIATION and not x.at_bound(k):
            estimated.append(name)
        else:
            untold[name] = why.get(name) or _why_open(x, k, covariance, float(deviation[k]))
    values, bending = x.values(), {}
    others = {n: values[n] for n in names[len(NAMES) :] if math.isfinite(values[n])}
    if CORE not in others:
        others.pop(LAG)
    if {"inductance_d", "inductance_q"} <= set(estimated):  # those at no current: with what bends
        bending = {n: v for n, v in others.items() if n.startswith(ALPHA)}
    apart = np.abs(x.x - x.centre) > Z95 * size
    count = sum(len(r.t) for r in used.recordings)
    current = [np.mean(y**2) for r in used.recordings for y in (r.i_a, r.i_b, r.i_c)]
    left = x.prepared.noise_std * math.sqrt(x.square())
    return OrdinaryFit(
        _with(campaign.drive.motor, {n: values[n] for n in estimated}, bending),
        {n: values[n] for n in estimated},
        {n: float(deviation[NAMES.index(n)]) * values[n] for n in estimated},
        untold,
        begin,
        others,
        tuple(n for n, a in zip(names, apart, strict=True) if a and n in others),
        left,
        left / math.sqrt(float(np.mean(current))),
        x.square(),
        x.residual_rms(),
        count,
        sum(len(r.t) for r in campaign.recordings),
        {n: (values[n], float(deviation[NAMES.index(n)])) for n in untold if n not in why},
        {
            NAMES[k]: (other, x.places[NAMES[k]].value(float(x.x[k] + move)))
            for k, (other, move) in moved.items()
            if NAMES[k] in estimated
        },
    )


def tied(x: Search, covariance: Array) -> dict[int, tuple[str, float]]:
    """Return of each parameter what looks alike beside the motor (a correlation above TIED), and by
    how much the parameter moves where that is as usual.

    What stands beside may stand in for something that the model lacks: then it takes with it what
    looks alike.  The 95 % interval reaches to the value that is found without it.
    """
    size, out = np.sqrt(np.diag(covariance)), {}
    for k in range(len(NAMES)):
        alike = np.abs(covariance[k]) / (size[k] * size)
        alike[: len(NAMES)] = 0.0
        m = int(np.argmax(alike))
        if alike[m] > TIED:
            move = covariance[k, m] / covariance[m, m] * (x.centre[m] - x.x[m])
            out[k] = (x.names[m], float(move))
    return out


def _best_of(starts: Sequence[Search]) -> Search:
    """Return the fit from the first start that noise explains, else the best of them."""
    fits = []
    for start in starts:
        fits.append(_of_both(start))
        if fits[-1].square() < EXPLAINED:
            break
    return min(fits, key=lambda s: s.square())


def _of_both(start: Search) -> Search:
    """Return the fit with all that stands beside, from the better one of the fits with either way
    to lose voltage: where the current goes through zero they differ, and a fit of both may stick at
    the wrong one."""
    zeros = [n for n in start.places if n.startswith(ANGLE)]
    either = [start.of_others([*NAMES, one, *OFFSETS, *zeros]).found() for one in LOST]
    best = min(either, key=lambda s: s.square())
    return best.of_others(list(start.places)).found()


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


def _with(motor: Motor, values: Mapping[str, float], effects: Mapping[str, float]) -> Motor:
    """Return a motor with values of its own replaced, and those of effects that replace some; one
    with a flux map keeps the map."""
    own = {
        OF_EFFECT[n]: v / (getattr(motor, n) if n.startswith("inductance") else 1.0)
        for n, v in values.items()
    }
    return true_motor(motor, {**complete_neutral(motor), **own, **effects}, keep_map=True)


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
    least = max(CHANGES * noise, 1e-4 * drive.motor.rated_current)
    frames = []
    for r in campaign.recordings:
        alpha, beta = r.current
        frames.append((alpha + 1j * beta) * np.exp(-1j * r.theta))
    out = {}
    largest = max(float(np.sqrt(np.mean(np.abs(x) ** 2))) for x in frames)
    if largest < least:
        out["resistance"] = (
            f"the current stays below {least:.2g} A, {CHANGES:g} times the sensors' noise"
        )
    for name, part, axis, other in (
        ("inductance_d", "real", "d", "q"),
        ("inductance_q", "imag", "q", "d"),
    ):
        change = max(float(np.std(getattr(x, part))) for x in frames)
        if change < least:
            out[name] = (
                f"the current on {axis} changes by {change:.2g} A rms, the sensors' noise is "
                f"{noise:.2g} A; step or inject on {axis}, too (all changes lie on {other})"
            )
    if all(r.rotor == "locked" or np.ptp(r.theta) == 0.0 for r in campaign.recordings):
        out["magnet_flux"] = "no rotor turns (back-EMF alone tells it); record a spin"
    return out


def _why_open(x: Search, k: int, covariance: Array, deviation: float) -> str:
    """Return why a parameter stays open: what the model lacks, or what it is fitted beside."""
    size, name = np.sqrt(np.diag(covariance)), x.names[k]
    alike = np.abs(covariance[k]) / (size[k] * size)
    alike[k] = 0.0
    spread = f"its standard deviation is {100.0 * deviation:.2g} % of it"
    if deviation < MAX_DEVIATION:
        return (
            "it goes to the bound of what is looked for; the model is another one "
            "(saturation? units?)"
        )
    if x.relative(size)[k] < MAX_DEVIATION:
        return f"{spread}: so much of what the model lacks may hide in it (`sensorless diagnose`)"
    words = dict.fromkeys((*LOST, SIGN), "the voltage that the inverter loses")
    words |= {n: "the angle's zero" for n in x.names if n.startswith(ANGLE)}
    near = [n for n, a in zip(x.names, alike, strict=True) if a > ALIKE]
    others = dict.fromkeys(words.get(n) or (title(n) if "." in n else n) for n in near)
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
