"""What a motion contradicts: units, signs and gears, found by undoing each known mistake on trial.

Three things must agree: the inertia that torque and acceleration show and the stated one; the angle
and the log's own speed; the angle and the back-EMF in the log's voltages.  Each mistake multiplies
angle, time or current, so it moves the three by known factors.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from model.array_types import Array
from model.units import UNITS
from sandbox.gap.motion.shaft import USUAL_WIDTH, Nominal, Terms, design_of, fitted, reweighted
from sandbox.gap.motion.windows import Averages, averages
from sandbox.recordings.checks.balance import plain
from sandbox.recordings.checks.changes import fluxes
from sandbox.recordings.findings import Doubt, Finding, Refused
from sandbox.recordings.motion_log import MotionCampaign

USUAL = 4.0  # times the stated inertia, or a part of it: a load, or a rotor alone
STRANGE = 30.0  # times: no load that anyone states an inertia for
# factors between angle and speed or back-EMF: noticed, and beyond any magnet's tolerance
PACE, FAR = 1.25, 1.6
# of the logarithm: stated inertia (a factor of 2 is two of it), pace
SPREAD_INERTIA, SPREAD_PACE = 0.35, 0.1
FITS = 9.0  # squared deviations up to which a mistake explains what was seen
ALIKE = 4.0  # squared deviations within which another explains it as well
# an estimate over half its 95 % interval, and the correlation below, from which it says anything
MIN_RATIO = 4.0
TOGETHER = 0.9
APART = 0.5  # correlation of two speeds: a filter that lags by 60 degrees of a swing
SEEN = 0.1  # of the torque that the inertia takes, from which its size says anything
FASTEST = 3e5 * math.tau / 60.0  # rad/s mechanical: beyond what machines turn
LOUD = 100.0  # times the rated current: a unit
LEAST_GEAR, MOST_GEAR = 1.25, 200.0  # as PACE is noticed; beyond it a unit
COUNTS = (64.0, 2.0**24)  # of an encoder, a turn
LINES = (360.0, 500.0, 600.0, 1000.0, 2000.0, 2500.0, 3600.0, 5000.0)  # of encoders, decimal ones
RARE = "kA"  # that a log holds: no likelier than a mistake in [motor]
MOST_USUAL = 3  # numbers of counts that are named


@dataclass(frozen=True)
class Look:
    """What recordings show beside what is stated or read: ratios, NaN where it cannot be told;
    fastest in rad/s.

    most: the inertia at most, where it is not told and the stated one would be; together: how the
    angle's speed goes with the log's (1: as one).
    """

    inertia: float
    speed: float
    emf: float
    fastest: float
    most: float = math.nan
    together: float = math.nan

    @property
    def ratios(self) -> list[float]:
        """Ratios of inertia, speed and back-EMF."""
        return [self.inertia, self.speed, self.emf]


@dataclass(frozen=True)
class Mistake:
    """A mistake: by which factor the angle, the time and the current are read too large, its words
    and remedy.

    torque, emf, inertia: likewise of what [motor] states; speed: of the log's speed.
    """

    guess: str
    remedy: str
    angle: float = 1.0
    time: float = 1.0
    current: float = 1.0
    torque: float = 1.0
    emf: float = 1.0
    inertia: float = 1.0
    speed: float = 1.0
    rank: float = 0.0  # the likelier first, of those that explain it alike

    @property
    def ratios(self) -> list[float]:
        """What it makes of the ratios of inertia, speed and back-EMF."""
        pace = self.angle / self.time
        torque = self.current * self.torque
        return [
            torque * self.time**2 / self.angle / self.inertia,
            pace / self.speed,
            1.0 / pace / self.emf,
        ]


def contradictions(campaign: MotionCampaign) -> list[Finding]:
    """Return what is suspicious about units, signs and gears of a motion; BadInput for what cannot
    be right."""
    with np.errstate(all="ignore"):
        parts = [averages(r, campaign) for r in campaign.recordings]
    seen = look(campaign, parts)
    found = _explained(campaign, seen)
    r = campaign.recordings[0]
    said = _contradicted(campaign, seen)
    if not said:
        return _not_together(campaign, seen) or _loud(campaign)
    text = f"{r.file}: {said}"
    if found:
        text += (
            f"; it would be right if {', or if '.join(f'{m.guess} ({m.remedy})' for m in found)}"
        )
    own = r.source
    names = f"{own.get('t', 't')}, {_angle(own)}, {own.get('i_q', 'the currents')}"
    column = "theta" if seen.inertia > 0.0 else "i_q"
    if _strange(seen) and (found or seen.inertia < 0.0 or seen.fastest > FASTEST):
        text += "" if found else f"; check units and signs of {names}"
        raise Refused(Finding(r.file, column, None, text))
    more = f"; a wrong unit of {names} or of what [motor] states" if not found else ""
    if seen.inertia > USUAL:
        more += "; a load or a gear does that, too"
    return [Doubt(r.file, column, None, text + more)]


def inertia_contradicted(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where the inertia of a motion whose angle, clock and currents are known to
    be right is far from the stated one, or negative."""
    with np.errstate(all="ignore"):
        inertia, _ = _inertia(campaign, [averages(r, campaign) for r in campaign.recordings])
    seen = Look(inertia, math.nan, math.nan, 0.0)
    said = _contradicted(campaign, seen)
    if not said:
        return []
    rows = [(_cost(campaign, seen, m), m) for m in _of_motor(campaign)]
    found = [
        f"{m.guess} ({m.remedy})" for cost, m in sorted(rows, key=lambda x: x[0]) if cost < FITS
    ][:2]
    more = f"; it would be right if {', or if '.join(found)}" if found else ""
    if inertia > USUAL:
        more += "; a load or a gear does that, too"
    r = campaign.recordings[0]
    return [Doubt(r.file, "theta", None, f"{r.file}: {said}{more}")]


def shows_inertia(campaign: MotionCampaign) -> bool:
    """Tell whether a motion shows an inertia that may be the stated one, or any that may be one
    where none is stated."""
    with np.errstate(all="ignore"):
        inertia, _ = _inertia(campaign, [averages(r, campaign) for r in campaign.recordings])
    return 1.0 / USUAL < inertia < USUAL


def _strange(seen: Look) -> bool:
    """Return whether what is seen cannot be right, whatever turns with the rotor."""
    if _is(seen.inertia) and not 1.0 / STRANGE < seen.inertia < STRANGE:
        return True
    return any(_off(x, FAR) for x in (seen.speed, seen.emf)) or seen.fastest > FASTEST


def _off(ratio: float, most: float) -> bool:
    """Return whether a ratio that can be told is negative, or off by more than a factor."""
    return _is(ratio) and (ratio < 0.0 or abs(math.log(ratio)) > math.log(most))


def _is(x: float) -> bool:
    return math.isfinite(x) and x != 0.0


def look(campaign: MotionCampaign, parts: list[Averages]) -> Look:
    """Return what recordings show beside what is stated or read."""
    speeds = [np.abs(a.speed) for a in parts if np.all(np.isfinite(a.speed))]
    fastest = float(np.quantile(np.concatenate(speeds), 0.99)) if speeds else math.inf
    stated = [
        (a, r.further["speed"])
        for a, r in zip(parts, campaign.recordings, strict=True)
        if "speed" in r.further
    ]
    pace = together = math.nan
    if stated:
        own = (
            np.concatenate([a.speed for a, _ in stated]),
            np.concatenate([a.mean(s) for a, s in stated]),
        )
        pace, together = _pace(*own), _together(*own)
    inertia, most = _inertia(campaign, parts)
    return Look(inertia, pace, _emf(campaign, parts), fastest, most, together)


def _inertia(campaign: MotionCampaign, parts: list[Averages]) -> tuple[float, float]:
    """Return the inertia of the motion over the stated one (1 kg m^2 where none is, so that only
    its sign counts), NaN where it cannot be told; then what it is at most, NaN where the stated one
    could not be told either."""
    if not all(
        np.all(np.isfinite(x)) for a in parts for x in (a.acceleration, a.torque, a.slope, a.speed)
    ):
        return math.nan, math.nan
    with np.errstate(all="ignore"):
        design = design_of(parts)
        terms = Terms(inertia=True, viscous=True, dry=USUAL_WIDTH * design.fastest)
        shaft = fitted(design, terms, Nominal(None, 0.0, 0.0, 0.0))
        for _ in range(2):
            shaft = fitted(reweighted(design, shaft), terms, Nominal(None, 0.0, 0.0, 0.0))
    low, high = shaft.ci95("inertia")
    value = shaft.value("inertia")
    speeding, driving = (
        float(np.sqrt(np.mean(x**2))) for x in (design.acceleration, design.torque)
    )
    if abs(value) > MIN_RATIO * 0.5 * (high - low) and abs(value) * speeding >= SEEN * driving:
        return value / (campaign.inertia or abs(value)), math.nan
    enough = (campaign.inertia or 0.0) * speeding >= SEEN * driving
    return math.nan, max(abs(low), abs(high)) if enough else math.nan


def _emf(campaign: MotionCampaign, parts: list[Averages]) -> float:
    """Return back-EMF over what the angle's speed and the magnet flux give, NaN where the log does
    not hold it."""
    s = campaign.stated
    if not all(s.get(k, 0.0) > 0.0 for k in ("resistance", "magnet_flux", "pole_pairs")):
        return math.nan
    read, given = [], []
    for a, r in zip(parts, campaign.recordings, strict=True):
        if not all(n in r.further for n in ("u_q", "i_q", "i_d")):
            continue
        turning = s["pole_pairs"] * a.speed
        along = s.get("inductance_d", 0.0) * a.mean(r.further["i_d"]) + s["magnet_flux"]
        read.append(a.mean(r.further["u_q"]) - s["resistance"] * a.mean(r.further["i_q"]))
        given.append(turning * along)
    return _pace(np.concatenate(read), np.concatenate(given)) if read else math.nan


def _pace(read: Array, given: Array) -> float:
    """Return how many times as large a signal is as another it should equal, NaN where they do not
    go together."""
    good = np.isfinite(read) & np.isfinite(given)
    a, b = read[good], given[good]
    energy, cross = math.sqrt(float(a @ a) * float(b @ b)), float(a @ b)
    return cross / float(b @ b) if energy > 0.0 and abs(cross) > TOGETHER * energy else math.nan


def _together(a: Array, b: Array) -> float:
    """Return how two signals go together, 1 as one but for a factor, NaN where one is none."""
    good = np.isfinite(a) & np.isfinite(b)
    energy = math.sqrt(float(a[good] @ a[good]) * float(b[good] @ b[good]))
    return float(a[good] @ b[good]) / energy if energy > 0.0 else math.nan


def _not_together(campaign: MotionCampaign, seen: Look) -> list[Finding]:
    """Return a finding where the log's speed is not that of its angle, or the motion shows no
    inertia where the stated one would stand out: then a column is another one's."""
    r = campaign.recordings[0]
    own, angle = r.source, _angle(r.source)
    if abs(seen.together) < APART:
        text = (
            f"'{own.get('speed', 'speed')}' and the speed of '{angle}' do not go together "
            f"(correlation {seen.together:.2g}, at least {APART:g} is usual): one of them is "
            "another column, or has another clock"
        )
        return [Doubt(r.file, "speed", None, f"{r.file}: {text}")]
    if campaign.inertia and seen.most * STRANGE < campaign.inertia:
        name = own.get("i_q", own.get("torque", "the currents"))
        text = (
            f"the motion shows an inertia of {seen.most:.3g} kg m^2 at most, stated is "
            f"{campaign.inertia:.3g}: '{angle}', '{name}' or '{own.get('t', 't')}' is another "
            "column, or the inertia is wrong"
        )
        return [Doubt(r.file, "theta", None, f"{r.file}: {text}")]
    return []


def _contradicted(campaign: MotionCampaign, seen: Look) -> str:
    """Return in words what does not go together, empty where nothing stands out."""
    out, own = [], campaign.recordings[0].source
    angle, speed = _angle(own), own.get("speed", "speed")
    if seen.fastest > FASTEST:
        rpm = (
            f"{seen.fastest * 60.0 / math.tau:.3g} rpm"
            if math.isfinite(seen.fastest)
            else "no finite speed"
        )
        out.append(f"'{angle}' turns at {rpm}")
    if _off(seen.speed, PACE):
        out.append(f"'{angle}' turns {plain(seen.speed)} times as fast as '{speed}' says")
    if _off(seen.emf, PACE):
        out.append(
            f"the back-EMF in '{own.get('u_q', 'u_q')}' is {plain(seen.emf)} times what "
            f"magnet_flux and the speed of '{angle}' give"
        )
    if _is(seen.inertia) and seen.inertia < 0.0:
        value = f" ({seen.inertia * campaign.inertia:.3g} kg m^2)" if campaign.inertia else ""
        out.append(
            f"the motion speeds up against its torque, which would be a negative inertia{value}"
        )
    elif _is(seen.inertia) and campaign.inertia and not 1.0 / USUAL < seen.inertia < USUAL:
        out.append(
            f"the motion shows an inertia of {seen.inertia * campaign.inertia:.3g} kg m^2, "
            f"{plain(seen.inertia)} times the stated {campaign.inertia:.3g}"
        )
    return ", and ".join(out)


def _explained(campaign: MotionCampaign, seen: Look) -> list[Mistake]:
    """Return the likeliest mistakes that explain what was seen, the best first, three at most."""
    rows = [(_cost(campaign, seen, m), m) for m in mistakes(campaign, seen)]
    best = min((cost for cost, _ in rows), default=math.inf)
    alike = [
        (m.rank, cost, k, m)
        for k, (cost, m) in enumerate(rows)
        if cost <= best + ALIKE and cost < FITS
    ]
    return [
        m
        for rank, _, _, m in sorted(alike, key=lambda x: x[:3])
        if rank == min(x[0] for x in alike)
    ][:3]


def _cost(campaign: MotionCampaign, seen: Look, m: Mistake) -> float:
    """Return the squared deviations that are left once a mistake is undone."""
    spreads = [SPREAD_INERTIA, SPREAD_PACE, 2.0 * SPREAD_PACE]
    total = 0.0
    for k, (x, predicted, spread) in enumerate(zip(seen.ratios, m.ratios, spreads, strict=True)):
        if not _is(x):
            continue
        if x * predicted < 0.0:
            return math.inf
        if k > 0 or campaign.inertia:
            total += (math.log(x / predicted) / spread) ** 2
    if seen.fastest * m.time / abs(m.angle) > FASTEST:
        return math.inf
    return total


def mistakes(campaign: MotionCampaign, seen: Look) -> Iterator[Mistake]:
    """Yield the mistakes of an angle, a clock, currents, what [motor] states, and a gear, in the
    log's words."""
    own = campaign.recordings[0].source
    angle, current, clock = _angle(own), own.get("i_q", "the currents"), own.get("t", "t")
    reversed_ = f"'{angle}' is counted backwards"
    turned, made = [*_angles(campaign, angle)], _made(own)
    yield Mistake(reversed_, "map it with scale = -1", -1.0, speed=-1.0 if made else 1.0)
    yield Mistake(
        f"'{current}' is counted out of the motor", "map it with scale = -1", current=-1.0
    )
    for m in turned:
        yield m
        yield Mistake(
            f"{m.guess} and counted backwards",
            f"{m.remedy}, and scale = -1",
            angle=-m.angle,
            speed=-m.speed if made else m.speed,
            rank=1.0,
        )
    for unit, factor in _others(campaign, "t", "time"):
        yield Mistake(f"'{clock}' is in {unit}", f'map it with unit = "{unit}"', time=factor)
    for unit, factor in _others(campaign, "i_q", "current"):
        said, how = f"'{current}' is in {unit}", f'map it with unit = "{unit}"'
        yield Mistake(said, how, current=factor, rank=0.5 if unit == RARE else 0.0)
        yield Mistake(
            f"{said} and {reversed_}",
            f"{how}, and '{angle}' with scale = -1",
            -1.0,
            current=factor,
            speed=-1.0 if made else 1.0,
            rank=1.0,
        )
    if (rated := campaign.stated.get("rated_current", 0.0)) > 0.0:
        yield Mistake(
            f"'{current}' is per unit of rated_current",
            f"map it with scale = {rated:g}",
            current=1.0 / rated,
        )
    yield from _of_motor(campaign)
    yield from _gears(seen, angle)
    yield from _counts(campaign, seen, angle)


def _of_motor(campaign: MotionCampaign) -> Iterator[Mistake]:
    """Yield other readings of what [motor] states."""
    s = campaign.stated
    by_flux = "torque_constant" not in s
    if not by_flux:
        yield Mistake("torque_constant is in mN m/A", "divide it by 1000 in [motor]", torque=1e3)
    if (flux := s.get("magnet_flux", 0.0)) > 0.0:
        for factor, guess, remedy in fluxes(s.get("pole_pairs", 1.0), flux):
            off, own = 1.0 / factor, 0.0 if math.isclose(factor, 1e-3) else 0.5
            yield Mistake(
                guess, f"{remedy} in [motor]", torque=off if by_flux else 1.0, emf=off, rank=own
            )
    for read, guess, remedy in (
        (2.0, "pole_pairs counts poles", "halve it in [motor]"),
        (0.5, "pole_pairs is half of what it is", "double it in [motor]"),
    ):
        angle, speed = (1.0 if _mechanical(campaign, n) else 1.0 / read for n in ("theta", "speed"))
        yield Mistake(
            guess, remedy, angle, torque=read if by_flux else 1.0, emf=read, speed=speed, rank=0.5
        )
    # as likely as currents in mA, which look the same; so is a constant of the torque
    small, remedy = "inertia is 1000 times too small", "multiply it by 1000 in [motor]"
    yield Mistake(small, remedy, inertia=1e-3)
    for unit, factor in (("kg cm^2", 1e-4), ("g m^2", 1e-3), ("g cm^2", 1e-7)):
        yield Mistake(
            f"inertia is in {unit}",
            f"multiply it by {factor:g} in [motor]",
            inertia=1.0 / factor,
            rank=0.5,
        )


def _made(own: Mapping[str, str]) -> bool:
    """Tell whether the angle is made of the log's speed: what is off of one is off of both."""
    return "theta" not in own and "speed" in own


def _angle(own: Mapping[str, str]) -> str:
    """Return the log's column that tells the angle."""
    return own.get("theta", own.get("speed", "theta"))


def _mechanical(campaign: MotionCampaign, name: str) -> bool:
    """Tell whether a column is mapped as the shaft's own, so that pole pairs have no part in it."""
    mapped = campaign.mapped.get(name)
    return mapped is not None and mapped.mechanical


def _angles(campaign: MotionCampaign, angle: str) -> Iterator[Mistake]:
    """Yield other units of the angle, and the electrical for the shaft's."""
    pairs, made = campaign.stated.get("pole_pairs", 1.0), _made(campaign.recordings[0].source)
    name, kind = ("speed", "speed") if made else ("theta", "angle")
    mechanical = _mechanical(campaign, name)

    def of(guess: str, remedy: str, factor: float) -> Mistake:
        """Return a mistake by a factor of the angle."""
        return Mistake(guess, remedy, angle=factor, speed=factor if made else 1.0)

    for unit, factor in _others(campaign, name, kind):
        said, how = f"'{angle}' is in {unit}", f'map it with unit = "{unit}"'
        yield of(said, how, factor)
        if pairs > 1.0 and not mechanical:
            shaft = of(f"{said} of the shaft", f"{how} and mechanical = true", factor / pairs)
            yield replace(shaft, rank=0.5)
    if pairs > 1.0:
        to = f"'{angle}' is electrical" if mechanical else f"'{angle}' is that of the shaft"
        how = "map it without mechanical" if mechanical else "map it with mechanical = true"
        yield of(to, how, pairs if mechanical else 1.0 / pairs)


def _others(campaign: MotionCampaign, name: str, kind: str) -> Iterator[tuple[str, float]]:
    """Yield each other unit of a column and by how much it is read too large in the one that was
    taken."""
    taken = campaign.units.get(name)
    units = UNITS[kind]
    now = units.get(taken or "", (1.0, 0.0))[0]
    some = {
        "time": ("s", "ms", "us", "ns"),
        "current": ("A", "mA", "kA"),
        "angle": ("rad", "deg", "rev"),
        "speed": ("rad/s", "rpm", "Hz"),
    }[kind]
    for unit in some:
        if not math.isclose(units[unit][0], now):
            yield unit, now / units[unit][0]


def _gears(seen: Look, angle: str) -> Iterator[Mistake]:
    """Yield a gear between the motor, whose back-EMF or speed is seen, and the sensor of the
    angle: of any ratio, of either sense."""
    gear = seen.emf if _is(seen.emf) else 1.0 / seen.speed if _is(seen.speed) else math.nan
    if not (_is(gear) and math.log(LEAST_GEAR) < abs(math.log(abs(gear))) < math.log(MOST_GEAR)):
        return
    way = " and it is counted backwards" if gear < 0.0 else ""
    said = f"a gear of about {abs(gear):.3g} stands between motor and '{angle}'{way}"
    yield Mistake(said, f"map it with scale = {gear:.3g}", angle=1.0 / gear, rank=2.0)


def _counts(campaign: MotionCampaign, seen: Look, angle: str) -> Iterator[Mistake]:
    """Yield an angle in an encoder's counts, as many as the other signals ask for."""
    turn = math.tau / UNITS["angle"].get(campaign.units.get("theta") or "", (1.0, 0.0))[0]
    inverse = 1.0 / seen.inertia if _is(seen.inertia) and campaign.inertia else math.nan
    ratio = seen.speed if _is(seen.speed) else inverse
    # an encoder's are those of a turn of the shaft
    pairs = 1.0 if _mechanical(campaign, "theta") else campaign.stated.get("pole_pairs", 1.0)
    of_shaft = ", mechanical = true" if pairs > 1.0 else ""
    counts, how = (
        abs(ratio) * turn * pairs,
        f'map it with unit = "rev"{of_shaft} and scale = 1 / (counts a turn)',
    )
    if not _is(ratio) and seen.fastest > FASTEST:
        yield Mistake(f"'{angle}' is in counts of an encoder", how, angle=seen.fastest / 100.0)
    elif _is(ratio) and COUNTS[0] <= counts <= COUNTS[1]:
        spread = SPREAD_PACE if _is(seen.speed) else SPREAD_INERTIA
        usual = _usual_counts(counts, spread, math.tau / campaign.count if campaign.count else 0.0)
        said = f"'{angle}' is in counts of an encoder (about {counts:.2g} a turn)"
        if usual:
            minus = "-" if ratio < 0.0 else ""
            how = (
                f'map it with unit = "rev"{of_shaft} and scale = {minus}1/{usual[0]:.0f}'
                + "".join(f", or {minus}1/{c:.0f}" for c in usual[1:])
            )
        yield Mistake(said, how, angle=math.copysign(counts / turn / pairs, ratio), rank=1.5)


def _usual_counts(counts: float, spread: float, stated: float) -> list[float]:
    """Return the counts a turn that encoders have within a spread (of the logarithm), the stated
    one alone where it is among them, else the nearest first."""
    every = {2.0**k for k in range(6, 25)}
    every |= {four * lines for four in (1.0, 4.0) for lines in LINES}
    near = [c for c in (stated, *every) if c and abs(math.log(c / counts)) < spread]
    near.sort(key=lambda c: abs(math.log(c / counts)))
    return [stated] if stated in near else near[:MOST_USUAL]


def _loud(campaign: MotionCampaign) -> list[Finding]:
    """Return a finding where the torque is far beyond what rated values allow."""
    rated, constant = campaign.stated.get("rated_current", 0.0), campaign.torque_constant
    if rated <= 0.0 or constant is None:
        return []
    for r in campaign.recordings:
        k = int(np.argmax(np.abs(r.torque)))
        size = abs(float(r.torque[k])) / constant
        if size > LOUD * rated:
            name = r.source.get("i_q", "the current")
            text = (
                f"{r.file}: row {k} of column '{name}' is {size:.4g} A, rated_current = "
                f"{rated:g} A; is it in mA? map "
                'it with unit = "mA"'
            )
            return [Doubt(r.file, "i_q", k, text)]
    return []
