"""A block of parameter sets on its way through one recording, stretch by stretch; where its states
start."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from model.array_types import Array
from model.compiled import inlined, kernel
from model.energy import OUTSIDE, SOLVED, Energy, flux_newton
from model.errors import BadInput
from model.frames import stationary
from model.parameters import Drive
from model.spline import SplineEnergy
from sandbox.plant import additions, ports
from sandbox.plant.batch import BRANCHES, blank_room
from sandbox.plant.electrical import quartic
from sandbox.plant.mechanics import begin_bristles
from sandbox.plant.sets import timing_of
from sandbox.replay.inputs import Inputs, readings_off, with_columns
from sandbox.replay.kernel import Fixed, Rows, run, turn
from sandbox.replay.motion.twisted_start import without_start
from sandbox.replay.negative_resistance import Given, held_everywhere, none_given

NEWTON_STEPS = 60
# of 1 A and the current's size: below it rounding may end the search for its flux
CURRENT_TOLERANCE = 1e-11


@dataclass(frozen=True)
class Block:
    """Sets that run together: their places, the batch, lock angles, common features, what legs give
    back; delay_periods: whole periods by which the voltage of all of them comes later."""

    members: tuple[int, ...]
    batch: Any
    lock: Array
    features: int
    given: Given
    delay_periods: int = 0

    @property
    def lanes(self) -> int:
        """Sets that its batch has room for."""
        return len(self.batch["offset"])


@dataclass
class Running:
    """One block in one recording: its states (batch, room, span) after `done` samples, and what
    does not change.

    track: of all samples, those in which states settle before those that are shown; torque: of each
    of its periods, of the first lane, N m (free rotor; else empty).
    """

    r: Inputs
    batch: Any
    flux_map: SplineEnergy | None
    timing: Any
    features: int
    room: Any
    track: Any
    fixed: Fixed
    torque: Array
    span: float = 0.0
    done: int = 0
    # (3, lanes) readings of sample `done` taken before its pattern began
    ahead: Array | None = None
    # states at the first sample, and the rated torque, N m: of shafts whose start nobody has read
    start: Any = None
    rated: float = 0.0

    @classmethod
    def begun(
        cls, drive: Drive, steps: int, r: Inputs, block: Block, *, settled: bool = True
    ) -> Running:
        """Return a block before the first sample of a recording; steps: plant steps a sampling
        period; settled: its states went through the samples before."""
        w = block.batch.copy()
        if r.rotor == "locked":
            w["offset"] -= block.lock
            w["off_c"], w["off_s"] = np.cos(w["offset"]), np.sin(w["offset"])
        energy = drive.motor.energy
        flux_map = energy if isinstance(energy, SplineEnergy) else None
        features = block.features | (additions.MOTION if r.rotor == "free" else 0)
        start_states(w, r.settling or r, flux_map)
        timing = timing_of(w, drive.converter.update_period, steps)
        whole = r.track if r.settling is None else np.concatenate([r.settling.track, r.track])
        track = later(whole, block.delay_periods)
        torque = np.empty(len(track) if r.rotor == "free" else 0)
        # states that are known by readings only are held by them
        given = none_given(block.lanes) if r.start is None else block.given
        if r.hold:
            given = held_everywhere(block.given, r.hold)
        own = cls(
            r,
            w,
            flux_map,
            timing,
            features,
            blank_room(block.lanes),
            track,
            Fixed(r.motion.eccentric, np.array(w["supply"]), given),
            torque,
        )
        if features & additions.TWIST and turns_at_first(r):
            own.start, own.rated = w.copy(), drive.motor.rated_torque
        if settled:
            own.settle()
        return own

    @property
    def lanes(self) -> int:
        """Sets that the block has room for."""
        return len(self.fixed.supply)

    def on(self, stop: int, out: Array, moved: Array, first: int = 0) -> None:
        """Go on to sample `stop`: readings (A) into columns first ... of out (stop - done, 3, ...),
        innovations of a free rotor into those of moved (stop - done, ...).  Before the end of a
        recording `out` has a row more."""
        columns = slice(first, first + self.lanes)
        ahead, before = stop < self.r.samples, len(self.track) // self.r.held - self.r.samples
        assert out.shape[0] >= stop - self.done + ahead, (
            "no room for the readings: compiled code writes unchecked"
        )
        assert out.shape[2] >= columns.stop, "no room for every lane of the block"
        if self.ahead is not None:
            out[0, :, columns] = self.ahead
        self._run(before + self.done, before + stop, out, moved, first)
        self._free_start(stop, moved[:, columns])
        self.ahead = out[stop - self.done, :, columns].copy() if ahead else None
        self.done = stop

    def settle(self) -> None:
        """Go through the samples before the first one, which are not shown."""
        if self.r.settling is None:
            return
        n = self.r.settling.samples
        out, moved = np.empty((n + 1, 3, self.lanes)), np.empty((n, self.lanes))
        self._run(0, n, out, moved, 0)
        self.ahead = out[n].copy()

    def turn(self, stop: int, torque: Array, moved: Array) -> None:
        """Go on to sample `stop` by the shafts alone, all under the torque of another block's first
        lane, and write innovations (stop - done, lanes): for sets that differ from that lane in
        nothing but the motion."""
        self._turn(self.batch, stop, torque, moved)
        self._free_start(stop, moved)
        self.done = stop

    def _turn(self, w: Any, stop: int, torque: Array, moved: Array) -> None:
        """Move shafts with given states on to a sample, and write their innovations."""
        before = len(self.track) // self.r.held - self.r.samples
        spans = [(before + self.done, before + stop, moved)]
        if before and not self.done:
            spans.insert(0, (0, before, np.empty((before, self.lanes))))
        for first, last, out in spans:
            rows, wobbles = self._rows(first, last), self.r.motion.eccentric
            turn(w, self.timing, self.features, self.track, rows, wobbles, torque, out)

    def _free_start(self, stop: int, moved: Array) -> None:
        """Take off innovations (stop, lanes) of the first stretch what the start of compliant
        shafts adds to them."""
        if self.start is None or self.done:
            return
        rest = np.zeros(len(self.track))

        def turned(w: Any) -> Array:
            """Return innovations of shafts without torque."""
            out = np.empty((stop, self.lanes))
            self._turn(w, stop, rest, out)
            return out

        without_start(moved, self.start, self.rated, turned)

    def _rows(self, start: int, stop: int) -> Rows:
        """Return samples start to stop - 1, each of so many periods of the track."""
        held = self.r.held
        return Rows(held, held * (self.r.settling or self.r).first, held * start, held * stop)

    def _run(self, start: int, stop: int, out: Array, moved: Array, first: int) -> None:
        """Go through samples start to stop - 1."""
        self.span = run(
            self.batch,
            self.flux_map,
            self.timing,
            self.features,
            self.room,
            self.track,
            self._rows(start, stop),
            self.fixed,
            self.span,
            out,
            moved,
            self.torque,
            first,
        )


def later(track: Any, periods: int) -> Any:
    """Return a track whose commands act so many whole periods later; before them, none."""
    if not periods:
        return track
    columns = {}
    for name in ("d_a", "d_b", "d_c"):
        columns[name] = np.concatenate([np.full(periods, 0.5), track[name]])[: len(track)]
    return with_columns(track, columns)


def start_states(w: Any, r: Inputs, flux_map: SplineEnergy | None) -> None:
    """Set the states at the first sample: without current, or (`Inputs.loaded`) with the current as
    read; BadInput where no flux gives that current."""
    lanes = len(w["offset"])
    off = np.zeros((1, lanes))
    for _ in range(2):  # the deviation at the true angle
        turn = r.motion.angle[:1] / r.pole_pairs - np.mean(w["offset"] + off[0]) / r.pole_pairs
        off[:] = 0.0
        if r.motion.eccentric:
            readings_off(w, turn, off)
    theta = r.motion.angle[0] - w["offset"] - off[0] + w["latency"] * r.motion.speed[0]
    c, s = np.cos(theta), np.sin(theta)
    rest = np.zeros((2, lanes))
    additions.at_rest(w, c, s, rest)
    flux = np.zeros((2, lanes))
    if r.loaded:
        without, current = flux_as_read(w, flux_map, r.read[0], c, s, flux)
        if without >= 0:
            raise BadInput(
                f"{r.file}: no flux of this motor gives the first reading of {current:.3g} A"
            )
    d, q = flux[0] + w["magnet"] + rest[0], flux[1] + rest[1]
    w["psi_alpha"], w["psi_beta"] = c * d - s * q, s * d + c * q
    w["eddy_alpha"], w["eddy_beta"] = w["psi_alpha"], w["psi_beta"]
    if r.rotor == "free":
        begin_bristles(w, r.motion.speed[0] / r.pole_pairs)
    if turns_at_first(r):
        start_turning(w, r)


def turns_at_first(r: Inputs) -> bool:
    """Return whether a free rotor turns, or may, at a recording's first sample."""
    return r.rotor == "free" and (r.turning or r.first > 0)


def start_turning(w: Any, r: Inputs) -> None:
    """Set the states of a free rotor that turns at the first sample: its speed, its shaft twisted
    by the load."""
    w["speed"] = r.motion.speed[0]
    stiff = np.where(w["swing_rate"] > 0.0, w["swing_rate"], np.inf)
    load = r.track["load"][0]
    w["twist"] = load * (w["motor_inv"] + w["load_inv"]) / stiff**2
    w["twist"] += 0.5 * np.sign(load) * w["backlash"]  # at that edge of a gap


@kernel
def flux_as_read(w, flux_map, reading, c, s, flux):
    """Write the flux (2, lanes) in Wb that a first reading's current (3,) in A links; the lags
    start from that current.

    Returns the first lane of which no flux gives that current, and the current (A); else -1.
    """
    for j in range(w.psi_alpha.size):
        p = w.common[j]
        x, y, z = unread(w, j, reading[0] - p, reading[1] - p, reading[2] - p)
        i_a, i_b = stationary(x, y, z)
        i_d, i_q = c[j] * i_a + s[j] * i_b, c[j] * i_b - s[j] * i_a
        if flux_map is None:
            d, q, status = flux_newton(energy_of(w, j), i_d, i_q, 0.0, 0.0)
        else:
            d, q, status = flux_newton(flux_map, i_d, i_q, 0.0, 0.0)
        x, y = added_current(w, flux_map, j, c[j], s[j], d, q)
        if x != 0.0 or y != 0.0:
            if status != SOLVED:
                d, q = 0.0, 0.0
            d, q, status = flux_with_added_current(w, flux_map, j, c[j], s[j], i_d, i_q, d, q)
        if status != SOLVED:
            return j, math.hypot(i_a, i_b)
        flux[0, j], flux[1, j] = d, q
        w.slow_alpha[j], w.filter_alpha[j], w.i_alpha[j] = i_a, i_a, i_a
        w.slow_beta[j], w.filter_beta[j], w.i_beta[j] = i_b, i_b, i_b
        w.over_alpha[j] = w.over_beta[j] = 0.0
        for n in range(BRANCHES):
            w.layer_alpha[n, j], w.layer_beta[n, j] = i_a, i_b
    return -1, 0.0


@inlined
def energy_of(w, j):
    """Return the motor's own energy in lane j, as coefficients of H."""
    return Energy(
        w.gamma_d[j],
        w.gamma_q[j],
        w.cubic_d[j] / 3.0,
        w.cubic_q[j],
        w.quartic_d[j] / 4.0,
        w.quartic_dq[j],
        w.quartic_q[j] / 4.0,
    )


@kernel
def added_current(w, flux_map, j, c, s, d, q):
    """Return the current (A) at a flux (Wb) that effects add to that of the quartic, or of the
    flux map."""
    i_d, i_q, _ = ports.energy(w, j, c, s, d, q)
    for k in range(w.more_energy):
        x, y, _ = ports.further_energy(w, k, j, c, s, d, q)
        i_d, i_q = i_d + x, i_q + y
    if flux_map is not None:
        x, y = quartic(w, j, d, q)
        i_d, i_q = i_d + x, i_q + y
    return i_d, i_q


@kernel
def missed(w, flux_map, j, c, s, i_d, i_q, d, q):
    """Return what is left of a current (A) at a flux (Wb)."""
    x, y = added_current(w, flux_map, j, c, s, d, q)
    m_d, m_q = quartic(w, j, d, q) if flux_map is None else ports.map_currents(flux_map, d, q)
    return i_d - m_d - x, i_q - m_q - y


@kernel
def flux_with_added_current(w, flux_map, j, c, s, i_d, i_q, d, q):
    """Solve for the flux (Wb) of a current (A) with all that effects add, by Newton's method from
    (d, q), steps halved until less is left; slopes are central differences, exact for currents of
    second degree.

    Returns d, q, status; it ends where rounding keeps a step from getting nearer, or by more than
    half once what is left is small.
    """
    x, y = missed(w, flux_map, j, c, s, i_d, i_q, d, q)
    small = CURRENT_TOLERANCE * (1.0 + math.hypot(i_d, i_q))
    for _ in range(NEWTON_STEPS):
        h = 1e-5 * (abs(d) + abs(q)) + 1e-9
        over = 0.5 / h
        a_d, a_q = missed(w, flux_map, j, c, s, i_d, i_q, d - h, q)
        b_d, b_q = missed(w, flux_map, j, c, s, i_d, i_q, d + h, q)
        dd, qd = over * (a_d - b_d), over * (a_q - b_q)
        a_d, a_q = missed(w, flux_map, j, c, s, i_d, i_q, d, q - h)
        b_d, b_q = missed(w, flux_map, j, c, s, i_d, i_q, d, q + h)
        dq, qq = over * (a_d - b_d), over * (a_q - b_q)
        det = dd * qq - dq * qd
        step_d, step_q = (qq * x - dq * y) / det, (dd * y - qd * x) / det
        left, t = math.hypot(x, y), 1.0
        while t > 1e-9:
            x, y = missed(w, flux_map, j, c, s, i_d, i_q, d + t * step_d, q + t * step_q)
            if math.hypot(x, y) < left:
                break
            t *= 0.5
        if not math.hypot(x, y) < left:
            return d, q, SOLVED if left <= small else OUTSIDE
        d, q = d + t * step_d, q + t * step_q
        if left <= small and math.hypot(x, y) > 0.5 * left:
            return d, q, SOLVED
    return d, q, SOLVED if math.hypot(x, y) <= small else OUTSIDE


@kernel
def unread(w, j, a, b, c):
    """Return the phase currents (A) behind three readings: the port `reading` is solved for them,
    gains near one."""
    x, y, z = a, b, c
    for _ in range(20):
        p, q, r = ports.reading(w, j, x, y, z)
        x, y, z = x + (a - p), y + (b - q), z + (c - r)
    return x, y, z
