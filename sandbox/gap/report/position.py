"""The position estimate's own gap: the same estimator on recorded and on simulated currents.

An estimator of the sandbox runs open loop (its estimate controls nothing) over the commands of a
recording with injection and a turning rotor, once on the currents as recorded, once on those that
the replay predicts before and after the diagnosis, noise added.  All errors are against the
encoder's reading.  The injection was along an axis of the encoder's frame, which an estimator that
watches its own axis (`qnull`, `inversion`) does not expect; the Kalman filter takes the commands as
they are.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from estimators.registry import load_estimator
from model.array_types import Array
from model.effects.library import true_motor
from model.errors import BadInput, PhysicsError
from model.frames import wrapped
from model.parameters import Drive
from sandbox.drive.design import belief_of, design
from sandbox.drive.follow import follow
from sandbox.gap.diagnose import Diagnosis
from sandbox.gap.evidence.normal import ParameterPoint
from sandbox.recordings.campaign import CampaignRecording
from sandbox.recordings.injection import carrier
from sandbox.replay.inputs import LEGS
from sandbox.replay.replay import Prepared, replay

ESTIMATOR = "ekf"
SETTLE = 0.1  # s left out at the start
TURNS = 2.0  # electrical, at least, before a rotor counts as turning


@dataclass(frozen=True)
class PositionError:
    """Rms position error (deg electrical) over the turning recordings with injection, and what it
    was taken from.

    believing_after: on recorded currents with a belief that has the diagnosed motor.
    """

    recorded: float
    simulated_before: float
    simulated_after: float
    believing_after: float | None
    estimator: str
    files: tuple[str, ...]

    def as_json(self) -> dict[str, float]:
        """Return three numbers of `diagnosis.json`."""
        keys = ("recorded", "simulated_before", "simulated_after")
        return {key: getattr(self, key) for key in keys}


def compared(d: Diagnosis, estimator: str = ESTIMATOR, seed: int = 0) -> PositionError | str:
    """Return the estimator's errors, or why there are none: no turning recording has injection, or
    no estimator can be designed for the nominal model (no saliency, an injection that does not fit
    the sampling)."""
    prepared = d.start.prepared
    chosen = [k for k, r in enumerate(prepared.recordings) if _suits(d, k)]
    drive = d.campaign.drive
    if not chosen:
        return _none_suits(d)
    rng = np.random.default_rng(seed)
    try:
        recorded = [
            errors(drive, d.campaign[prepared.recordings[k].file], None, estimator) for k in chosen
        ]
        before, after = (
            [
                errors(drive, d.campaign[prepared.recordings[k].file], i, estimator)
                for k, i in simulated(p, chosen, rng)
            ]
            for p in (d.before.point, d.after.point)
        )
    except (BadInput, PhysicsError) as error:
        return f"the estimator '{estimator}' cannot run on these recordings: {error}"
    files = tuple(prepared.recordings[k].file for k in chosen)
    return PositionError(
        _rms_deg(recorded),
        _rms_deg(before),
        _rms_deg(after),
        _believing(d, files, estimator),
        estimator,
        files,
    )


def _suits(d: Diagnosis, k: int) -> bool:
    r = d.start.prepared.recordings[k]
    return _injected(d, k) and float(np.ptp(r.motion.angle)) > TURNS * math.tau


def _injected(d: Diagnosis, k: int) -> bool:
    """Return whether a recording has injection, a rotor that is not locked, and its angle as an
    encoder read it."""
    r = d.start.prepared.recordings[k]
    own = d.campaign[r.file]
    return r.rotor != "locked" and own.injection_axis != "none" and own.made is None


def _none_suits(d: Diagnosis) -> str:
    """Return why no recording shows a position error."""
    if any(_injected(d, k) for k in range(len(d.start.prepared.recordings))):
        return f"no recording with injection turns by more than {TURNS:g} electrical turns"
    if all(r.made is not None for r in d.campaign.recordings):
        return "no angle was read"
    return "no turning recording has injection"


def _believing(d: Diagnosis, files: tuple[str, ...], estimator: str) -> float | None:
    """Return the error of a belief that has the motor found (magnetics, resistance), or None where
    none can be had."""
    motor = true_motor(
        d.after.point.prepared.campaign.drive.motor, dict(d.after.point.values), keep_map=True
    )
    drive = dataclasses.replace(d.campaign.drive, motor=motor)
    try:
        return _rms_deg([errors(drive, d.campaign[f], None, estimator) for f in files])
    except (BadInput, PhysicsError):
        return None


def simulated(
    point: ParameterPoint, chosen: list[int], rng: np.random.Generator
) -> list[tuple[int, Array]]:
    """Return (recording, currents alpha, beta (n, 2) in A) that a point predicts, with sensor noise
    added."""
    part = Prepared(
        point.prepared.campaign,
        tuple(point.prepared.recordings[k] for k in chosen),
        point.prepared.steps,
        point.prepared.noise_std,
        point.prepared.base,
    )
    predicted = replay(part, [point.values]).currents
    out = []
    for k, current in zip(chosen, predicted, strict=True):
        read = current[:, :, 0] + part.noise_std * rng.standard_normal(current.shape[:2])
        out.append((k, np.asarray((2.0 / 3.0) * read @ LEGS)))
    return out


def errors(drive: Drive, r: CampaignRecording, current: Array | None, estimator: str) -> Array:
    """Return encoder's reading less estimate (n,) in rad, the start left out; current: (n, 2) in A,
    None as recorded.

    The rotor's first position is told.  BadInput or PhysicsError where no estimator can be designed
    for the drive.
    """
    own, before = load_estimator(estimator), len(r.settling.get("t", ()))
    r = r.with_settling()
    belief = belief_of(drive, "saturated")
    tuning = design(drive, start_up=False, published=own.takes_published).tuning
    primitive = carrier_at(drive, r)
    i = np.stack(r.current, axis=1)
    if current is not None:
        i[before:] = current
    u = np.zeros_like(i)
    u[1:] = np.stack([r.u_alpha, r.u_beta], axis=1)[:-1]
    state = own.init(belief, tuning, float(r.theta[0]))
    found = np.empty(len(i))
    follow(own, state, np.column_stack([i, u, primitive]), belief, tuning, found)
    first = max(before, round(SETTLE / drive.converter.sampling_period))
    if first >= len(i):
        raise BadInput(f"{r.file}: an estimator needs more than {SETTLE:g} s")
    return np.asarray(wrapped(r.theta[first:] - found[first:]))


def carrier_at(drive: Drive, r: CampaignRecording) -> Array:
    """Return the injected waveform's primitive (n,) in s at each sample, its phase read off the
    commands."""
    wave = carrier(drive.injection, drive.converter)
    n = len(wave.waveform)
    turn = r.theta + (math.pi / 2.0 if r.injection_axis == "q" else 0.0)
    along = np.cos(turn) * r.u_alpha + np.sin(turn) * r.u_beta
    whole = along[: len(along) // n * n].reshape(-1, n).mean(axis=0)
    shift = int(np.argmax([np.dot(np.roll(wave.waveform, s), whole) for s in range(n)]))
    return np.asarray(np.resize(np.roll(wave.primitive, shift), len(r.t)))


def _rms_deg(parts: list[Array]) -> float:
    return float(np.degrees(np.sqrt(np.mean(np.concatenate(parts) ** 2))))
