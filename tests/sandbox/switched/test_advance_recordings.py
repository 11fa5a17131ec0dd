"""The switched bench replays the practice campaigns with their true parameters: residuals are the
sensors' noise.

Fitted on the way are the ordinary deviations only: sensor gains and offsets (linear), encoder
offset, locked angle within a count, residual dead time.  Recordings come from SENSORLESS_RECORDINGS
or ../shared/recordings.
"""

import dataclasses
import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

from model.effects.library import parameters
from model.parameters import Converter, Motor
from sandbox.switched.advance import replay
from sandbox.switched.bench_numbers import bench, quiet

parquet = pytest.importorskip("pyarrow.parquet")
HOME = Path(__file__).resolve().parents[3].parent / "shared" / "recordings"
PRACTICE = Path(os.environ.get("SENSORLESS_RECORDINGS") or HOME) / "practice"
pytestmark = pytest.mark.skipif(
    not PRACTICE.is_dir(), reason=f"no recordings in {PRACTICE}; set SENSORLESS_RECORDINGS"
)
USED = [
    "locked_q_inject_q",
    "locked_steps",
    "locked_low_current",
    "driven_grid",
    "driven_grid_slow",
    "driven_idle",
]
# two of them show by far that an effect is missing
TWO = ["locked_q_inject_q", "driven_grid"]
FEWER = ["locked_q_inject_q", "locked_low_current", "driven_grid", "driven_idle"]
TRUE = {
    "R": "resistance",
    "phim": "magnet_flux",
    "Ld": "inductance_d",
    "Lq": "inductance_q",
    "J": "inertia",
}
TRUE |= {
    "a30": "alpha_30",
    "a12": "alpha_12",
    "a40": "alpha_40",
    "a22": "alpha_22",
    "a04": "alpha_04",
}
TRUE |= {"B": "viscous_friction"}
RATED = {6: 1.2, 3: 6.0}  # A peak by pole pairs: the paper's motor, the 2.2 kW motor


def load(name, files=USED):
    """Return nominal and true motor, converter, true effects, and the columns of some
    recordings."""
    campaign = tomllib.loads((PRACTICE / name / "campaign.toml").read_text())
    truth = tomllib.loads((PRACTICE / f"{name}.truth.toml").read_text())
    extra = {
        "rated_current": RATED[campaign["motor"]["pole_pairs"]],
        "rated_torque": 1.0,
        "rated_speed_rpm": 1e3,
    }
    nominal = Motor(name, **campaign["motor"], **extra)
    true = dataclasses.replace(
        nominal, **{TRUE[k]: v for k, v in truth["true_motor"].items() if k in TRUE}
    )
    effects = {
        f"{effect}.{key}": v for effect in truth["effects"] for key, v in truth[effect].items()
    }
    tables = {file: parquet.read_table(PRACTICE / name / f"{file}.parquet") for file in files}
    # half of a locked one will do: rms of 2880 rows of noise is 1 within 4 / sqrt(2 x 2 x 2880) = 4
    # %
    tables = {f: t[: len(t) // 2] if f.startswith("locked") else t for f, t in tables.items()}
    columns = {
        f: {c: t[c].to_numpy().astype(float) for c in t.column_names} for f, t in tables.items()
    }
    return nominal, true, Converter(**campaign["drive"]), effects, columns


def ramps(t, knots):
    """Return angle and speed of unit tent functions of speed, (n, knots) each: exact integrals."""
    angle = np.empty((len(t), len(knots)))
    j = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(knots) - 2)
    dt, width = t - knots[j], np.diff(knots)
    for m, tent in enumerate(np.eye(len(knots))):
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (tent[1:] + tent[:-1]) * width)])
        angle[:, m] = whole[j] + tent[j] * dt + 0.5 * (np.diff(tent) / width)[j] * dt**2
    return angle, np.stack([np.interp(t, knots, tent) for tent in np.eye(len(knots))], axis=1)


def imposed_motion(c, pole_pairs):
    """Return angle and mechanical speed behind encoder counts: constant speed, or speed ramps with
    fitted corners."""
    t, theta = c["t"], c["theta"]

    def fit(corners):
        angle, speed = ramps(t, np.concatenate([[0.0], corners, [t[-1] + t[1]]]))
        a = np.column_stack([np.ones_like(t), angle])
        x = np.linalg.lstsq(a, theta, rcond=None)[0]
        return a @ x, speed @ x[1:] / pole_pairs

    if np.abs(fit([])[0] - theta).max() < 0.02:
        angle, _ = fit([])
        return angle, np.full_like(t, (angle[-1] - angle[0]) / (t[-1] - t[0]) / pole_pairs)
    first = np.array([0.0833, 0.5, 0.6325]) * t[-1]  # as seen in the recordings
    return fit(least_squares(lambda x: fit(x)[0] - theta, first, x_scale=1e-3, diff_step=1e-4).x)


def predict(b, columns, motion, encoder_offset, lock, dead_time):
    """Return predicted phase currents (3, samples of all recordings)."""
    b, out = b._replace(dead_time=b.dead_time + dead_time), []
    for file, c in columns.items():
        command = c["u_alpha"], c["u_beta"], c["u_dc"]
        if file.startswith("locked"):
            r = replay(b, "locked", *command, theta=c["theta"][0] + lock - encoder_offset)
        else:
            r = replay(
                b, "driven", *command, theta=motion[file][0] - encoder_offset, speed=motion[file][1]
            )
        out.append(np.stack([r["i_a"], r["i_b"], r["i_c"]]))
    return np.concatenate(out, axis=1)


def unexplained(predicted, read):
    """Return the residual (3, n) after the best gains and offsets; the offsets add up to zero."""
    n = predicted.shape[1]
    a = np.zeros((3 * n, 5))
    for k in range(3):
        a[k * n : (k + 1) * n, k] = predicted[k]
    a[:n, 3] = a[n : 2 * n, 4] = 1.0
    a[2 * n :, 3:] = -1.0
    return (read.ravel() - a @ np.linalg.lstsq(a, read.ravel(), rcond=None)[0]).reshape(3, n)


def vector(phases):
    """Return alpha + j beta as real rows (2, n)."""
    return np.stack(
        [(2 * phases[0] - phases[1] - phases[2]) / 3, (phases[1] - phases[2]) / np.sqrt(3)]
    )


def motions(columns, pole_pairs):
    """Return the imposed motion of every driven recording."""
    return {f: imposed_motion(c, pole_pairs) for f, c in columns.items() if f.startswith("driven")}


def residuals(motor, converter, effects, columns, motion):
    """Return rms residual of each recording over the noise floor, ordinary deviations fitted."""
    b = quiet(bench(motor, converter, effects))
    read = np.concatenate(
        [np.stack([c["i_a"], c["i_b"], c["i_c"]]) for c in columns.values()], axis=1
    )

    def miss(x):
        return vector(unexplained(predict(b, columns, motion, *x), read)).ravel()

    x, steps = np.array([b.encoder_offset, 0.0, 0.0]), np.array([2e-3, 2e-3, 5e-8])
    at = miss(x)
    turned, late = (miss(x + h) - at for h in np.diag(steps)[[0, 2]])
    locked = np.concatenate(
        [np.full(len(c["t"]), 1.0 * f.startswith("locked")) for f, c in columns.items()]
    )
    # a lock turns back what an encoder turns
    slope = np.stack([turned, -np.tile(locked, 2) * turned, late], axis=1)
    for _ in range(2):
        # Gauss-Newton on the first slopes: nearly straight over a count and a residual dead time
        x = x - steps * np.linalg.lstsq(slope, at, rcond=None)[0]
        at = miss(x)
    square = np.sum(at.reshape(2, -1) ** 2, axis=0)
    floor = 4 / 3 * (converter.current_noise**2 + converter.current_resolution**2 / 12)
    ends = np.cumsum([len(c["t"]) for c in columns.values()])[:-1]
    return np.sqrt([part.mean() / floor for part in np.split(square, ends)])


def without(nominal, true, effects):
    """Return the true motor with the values that the effects replace taken back to nominal."""
    keys = {name.partition(".")[2] for name in effects if parameters()[name].neutral is None}
    return dataclasses.replace(true, **{key: getattr(nominal, key) for key in keys})


def test_campaign_without_deviations_is_met_to_the_noise_floor():
    """p01 with its nominal model, nothing fitted but the imposed motion behind the encoder's
    counts."""
    nominal, _, converter, _, columns = load("p01")
    b = quiet(bench(nominal, converter))
    predicted = predict(b, columns, motions(columns, 6), 0.0, 0.0, 0.0)
    read = np.concatenate(
        [np.stack([c["i_a"], c["i_b"], c["i_c"]]) for c in columns.values()], axis=1
    )
    floor = converter.current_noise**2 + converter.current_resolution**2 / 12
    assert np.sqrt(np.mean((read - predicted) ** 2) / floor) == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("file", ["reversal", "run_fast", "run_slow", "coast_down"])
def test_free_rotor_follows_to_the_encoders_counts(file):
    """p01 from rest, commands and load torque in: the angle stays within the rounding, until errors
    have grown.

    Commands without their feedback are an unstable way to drive: 1e-9 rad becomes 1e-4 rad over
    run_slow.
    """
    nominal, _, converter, _, columns = load("p01", [file])
    c, n = columns[file], 1000
    b = quiet(bench(nominal, converter))
    out = replay(b, "free", c["u_alpha"], c["u_beta"], c["u_dc"], load_torque=c["load_torque"])
    counts = (c["theta"] - out["theta"])[:n] / (2 * np.pi * 6 / 4096)
    assert np.abs(counts).max() < 0.8
    assert counts.std() == pytest.approx(1 / np.sqrt(12), abs=0.04)


# p10, without an effect, and p06 and p07, offsets, which are fitted anyway: nothing is left to the
# bench that p01 does not show; p02, a dead time: in p12
# campaign: residual that must remain without the true effect
EFFECTS = {
    "p03": 10.0,  # resistance
    "p04": 3.0,  # cross-saturation
    "p05": 10.0,  # flux harmonics
    "p09": 2.0,  # PWM delay
    "p11": 3.0,  # iron loss
    "p12": 10.0,  # dead time and magnet flux
}


@pytest.mark.parametrize("name", list(EFFECTS))
def test_true_effect_brings_the_residual_to_the_noise_floor(name):
    nominal, true, converter, effects, columns = load(name, FEWER)
    motion = motions(columns, nominal.pole_pairs)
    after = residuals(true, converter, effects, columns, motion)
    print(name, sorted(effects), "with", np.round(after, 3))
    assert after.max() < 1.08
    two = {file: columns[file] for file in TWO}
    before = residuals(without(nominal, true, effects), converter, {}, two, motion)
    print(name, "without", np.round(before, 2))
    assert np.sqrt(np.mean(before**2)) > EFFECTS[name]


def test_coulomb_friction_explains_the_free_rotor():
    """p08: the first 0.3 s of the reversal, from rest, with and without the true friction
    torque."""
    _, true, converter, effects, columns = load("p08", ["reversal"])
    effects = {"coulomb_friction.width": 2.0} | effects  # the width it was made with
    c, n = columns["reversal"], 2400
    miss = {}
    for name, on in (("with", effects), ("without", {})):
        b = quiet(bench(true, converter, on))
        out = replay(
            b,
            "free",
            c["u_alpha"],
            c["u_beta"],
            c["u_dc"],
            load_torque=c["load_torque"],
            theta=c["theta"][0],
        )
        miss[name] = np.abs(out["theta"] - c["theta"])[:n].max()
    print("p08 angle error, rad:", miss)
    assert miss["with"] < 0.1 * miss["without"]
