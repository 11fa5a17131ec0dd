"""Replay: against the switched bench effect by effect, on recordings of a foreign bench, and its
derivatives.

Plant and bench are both exact between events, so their difference is of their steps alone: 2e-5 of
rated current with the steps that `prepare` asks for, less with more
(`experiments/plant_against_bench.py` has the table). Recordings come from SENSORLESS_RECORDINGS or
../shared/recordings; truths beside the practice campaigns.
"""

import dataclasses
import tomllib

import numpy as np
import pytest

from model.effects import library
from model.energy import flux_from_current, hessian
from model.errors import BadInput
from sandbox.plant import additions as add
from sandbox.plant.ports import NUMBERS
from sandbox.plant.sets import batch_of, complete, features_of
from sandbox.recordings.campaign import Campaign, CampaignRecording, read_folder
from sandbox.replay.replay import (
    halving_error,
    plan,
    prepare,
    replay,
    residuals,
    run_block,
    with_steps,
)
from sandbox.replay.sensitivity import all_parameters, sensitivities
from sandbox.switched.advance import replay as switched
from sandbox.switched.bench_numbers import bench, quiet
from tests.data import recordings_folder
from tests.sandbox.replay.benches import CASES, DRIVE, MOTION, campaign, record, typical

EXACT = 2e-5  # of rated current
ORDERS = {  # several of each effect at once
    "flux_harmonics.psi_d6": 0.003,
    "flux_harmonics.2.psi_d": 0.002,
    "flux_harmonics.2.psi_q": -0.001,
    "flux_harmonics.3.psi_q": 0.001,
    "flux_harmonics.3.order": 18.0,
    "flux_harmonics.3.phase": 0.7,
    "inductance_harmonics.2.gamma": 0.5,
    "inductance_harmonics.3.pulse": 0.4,
    "inductance_harmonics.3.order": 6.0,
    "cogging_torque.amplitude": 0.02,
    "cogging_torque.order_mech": 36.0,
    "cogging_torque.2.amplitude": 0.03,
    "cogging_torque.2.order_mech": 12.0,
    "cogging_torque.2.phase": 1.0,
}


def gaps(recorded, prepared, values):
    """Return rms vector difference over rated current per recording, and the largest rms
    innovation."""
    p = replay(prepared, [values])
    out = []
    for r, current in zip(recorded.recordings, p.currents, strict=True):
        miss = np.stack([r.i_a, r.i_b, r.i_c], axis=1) - current[:, :, 0]
        out.append(
            np.sqrt(np.mean(np.sum(miss[100:] ** 2, axis=1) * 2 / 3)) / DRIVE.motor.rated_current
        )
    return np.array(out), max(float(np.sqrt(np.mean(m**2))) for m in p.motion if m is not None)


def counts_on_current():
    """Return what rounding of an angle moves a current by, rms over rated current."""
    count = 2.0 * np.pi * 6 / DRIVE.converter.encoder_counts
    # A/rad over A
    slope = DRIVE.motor.magnet_flux / DRIVE.motor.inductance_q / DRIVE.motor.rated_current
    return count / np.sqrt(12.0) * slope


@pytest.mark.parametrize("name", ["none", "orders", *library.effect_names()])
def test_effect_is_that_of_the_switched_bench(name):
    """With the steps that `prepare` asks for."""
    effects = {"none": {}, "orders": ORDERS}[name] if name in ("none", "orders") else typical(name)
    recorded = campaign(effects)
    prepared = prepare(recorded, effects)
    current, motion = gaps(recorded, prepared, effects)
    without, still = gaps(recorded, prepared, {})
    print(
        f"{name}: {prepared.steps} steps, {np.round(current * 1e6, 1)} ppm of rated "
        f"current, motion {motion:.4f}"
    )
    assert prepared.steps == 1
    if name == "encoder_eccentricity":
        # less than a turn: straight pieces stand for its sine, off by their counts
        assert current[1] < 1.25 * counts_on_current()
        current = np.delete(current, 1)
    assert current.max() < EXACT
    assert motion < MOTION
    if name != "none":
        assert without.max() > 30 * EXACT or still > 5 * motion


@pytest.mark.parametrize("once", [0.005, 0.0])
def test_further_orders_of_an_encoder_are_those_of_the_switched_bench(once):
    """Locked and free to the steps' error.  Driven, the order twice a turn is in a motion that is
    smoothed behind counts, to half of what rounding leaves of one reading (`test_ramps`); without
    it in the replay, currents are 20 times as far off."""
    effects = {
        "encoder_eccentricity.amplitude_mech": once,
        "encoder_eccentricity.phase": 0.5,
        "encoder_eccentricity.2.amplitude_mech": 0.002,
        "encoder_eccentricity.2.phase": 1.0,
    }
    recorded = campaign(effects)
    prepared = prepare(recorded, effects)
    current, motion = gaps(recorded, prepared, effects)
    first, _ = gaps(recorded, prepared, {k: v for k, v in effects.items() if ".2." not in k})
    print(f"{current * 1e6} ppm of rated current, without the second order {first * 1e6}")
    assert current[[0, 3]].max() < EXACT
    assert current[[1, 2]].max() < 0.5 * counts_on_current()
    assert motion < MOTION
    assert (first > 20.0 * current).all()


def test_the_bench_steps_over_no_corner_of_a_leg_s_sign():
    """Steps end at corners and are short enough to see them: 16 times finer ones change a reading
    by less than a tenth of EXACT.  One step a segment misses a current that turns back inside it,
    five times EXACT; straight over, the same.
    """
    effects, case = typical("device_drop"), CASES[2]
    own, finer = (record(effects, *case, finer=x) for x in (1.0, 16.0))
    assert np.abs(own.i_a - finer.i_a).max() < 0.1 * EXACT * DRIVE.motor.rated_current


def test_all_effects_together_are_those_of_the_switched_bench():
    """Several lags, late edges and the kinks of sign(i) in one: the steps' errors add up, and go
    with finer steps."""
    effects = {
        k: v
        for name in library.effect_names()
        if name != "cross_saturation"
        for k, v in typical(name).items()
    }
    recorded = campaign(effects)
    coarse, fine = (gaps(recorded, prepare(recorded, effects, steps=n), effects)[0] for n in (1, 8))
    without, _ = gaps(recorded, prepare(recorded, effects, steps=1), {})
    print(
        f"all effects: {coarse * 1e6} ppm of rated current with them, with 8 steps "
        f"{fine * 1e6}; {without} without"
    )
    assert coarse.max() < 10.0 * EXACT
    # a latency goes by the speed that is read, which has the slope of an eccentric encoder's sine
    m, period = DRIVE.motor, DRIVE.converter.sampling_period
    speed = [np.ptp(np.diff(r.theta, prepend=r.theta[0])) / period for r in recorded.recordings]
    angle = effects["encoder_offset.latency"] * effects["encoder_eccentricity.amplitude_mech"]
    read = np.array(speed) * angle * m.magnet_flux / m.inductance_d / m.rated_current
    assert (fine < EXACT + read)[[0, 3]].all()  # driven below a turn: see encoder_eccentricity
    # over a turn: that sine is known to its counts, two deviations (`test_ramps`)
    counts = 2.0 * counts_on_current() * np.sqrt(10.0 / len(recorded.recordings[2].t))
    assert fine[2] < counts + read[2]
    assert without.min() > 100 * coarse.max()


PAIRS = (  # whose effects meet inside the period
    *(
        ("dead_time", other)
        for other in ("pwm_delay", "iron_loss", "device_drop", "flux_harmonics", "current_filter")
    ),
    *(("iron_loss", other) for other in ("current_sampling", "current_filter")),
    ("pwm_delay", "current_filter"),
)


@pytest.mark.parametrize("names", PAIRS, ids=" ".join)
def test_pairs_are_those_of_the_switched_bench(names):
    effects = {k: v for name in names for k, v in typical(name).items()}
    recorded = campaign(effects, n=500)
    prepared = prepare(recorded, effects, steps=4)
    current, motion = gaps(recorded, prepared, effects)
    print(f"{names}: {np.round(current * 1e6, 1)} ppm of rated current, motion {motion:.3f}")
    assert current.max() < EXACT
    assert motion < MOTION


BESIDE = (  # what typical sizes leave out, and where effects meet
    {"current_gain.gain_c": 1.03},
    {"dc_link_ripple.amplitude": 20.0, "dc_link_ripple.frequency": 3000.0, "pwm_delay.delay": 4e-5},
    {"current_sampling.delay": 6e-5, "dc_link_error.gain_error": 0.06},
    {"dc_link_error.sag": 30.0, "dead_time.time": 2e-6},
    {"dc_link_error.sag": 10.0, "pwm_delay.delay": 4e-5},
    {"dead_time.time": 3e-6, "dead_time.zone_width": 0.5, "dead_time.zone_shape": 1.0},
    {"dead_time.time": -3e-6, "dead_time.zone_width": 0.4, "dead_time.zone_center": 0.7},
    {"dc_link_error.sag": 30.0, "iron_loss.core_resistance": 2e3, "current_sampling.delay": 6e-5},
    {"coulomb_friction.stribeck_torque": 0.05},
    {
        "coulomb_friction.torque": 0.03,
        "coulomb_friction.stribeck_torque": 0.05,
        "coulomb_friction.width": 0.5,
    },
    {
        "coulomb_friction.torque": 0.05,
        "coulomb_friction.stribeck_torque": 0.03,
        "coulomb_friction.presliding": 5e-3,
        "coulomb_friction.presliding_damping": 0.1,
    },
)


@pytest.mark.parametrize("effects", BESIDE, ids=str)
def test_sizes_beside_the_typical_ones_are_those_of_the_switched_bench(effects):
    recorded = campaign(effects)
    prepared = prepare(recorded, effects, steps=2)
    current, motion = gaps(recorded, prepared, effects)
    without, still = gaps(recorded, prepared, {})
    print(
        f"{effects}: {np.round(current * 1e6, 1)} ppm, {np.round(without * 1e6)} "
        f"without; {motion:.3f}, {still:.3f}"
    )
    assert current.max() < EXACT
    assert motion < 0.1  # friction within its width is passed in one sample
    assert without.max() > 30 * EXACT or still > 5 * motion


def test_jitter_is_noise_above_the_floor_not_a_prediction():
    """Locked, constant current along d: what jitter leaves is jitter x R Gamma_dd i, the slope of
    the zero vector."""
    jitter, theta, n, motor = 5e-6, 0.3, 3000, DRIVE.motor
    u = np.full(n, 8.0 * np.exp(1j * theta))
    b = quiet(bench(motor, DRIVE.converter))._replace(jitter=jitter)
    r = switched(b, "locked", u.real.copy(), u.imag.copy(), 400.0, theta=theta, seed=1)
    columns = {
        "t": np.arange(n) * DRIVE.converter.sampling_period,
        "u_alpha": u.real,
        "u_beta": u.imag,
    }
    columns |= {"theta": r["theta"], "u_dc": np.full(n, 400.0)} | {
        x: r[x] for x in ("i_a", "i_b", "i_c")
    }
    one = Campaign(
        "c", DRIVE, (CampaignRecording("r.parquet", "locked", "none", columns),), {}, {}, False
    )
    prepared = prepare(one, steps=1)
    plain, with_it = (
        replay(prepared, [s]).currents[0][:, :, 0]
        for s in ({}, {"current_sampling.jitter": jitter})
    )
    assert np.array_equal(plain, with_it)
    miss = (one.recordings[0].i_a - plain[:, 0])[1000:]
    i = 8.0 / motor.resistance
    d, q = flux_from_current(motor.energy, i, 0.0)
    slope = motor.resistance * i * hessian(motor.energy, float(d), float(q))[0] * np.cos(theta)
    assert miss.std() == pytest.approx(jitter * slope, rel=0.06)  # 2000 draws: 1.6 % each way


def test_threads_batches_and_neutral_values_change_no_bit():
    prepared = prepare(campaign({}, CASES[1:]), steps=1)
    sets = [
        {"stator_resistance.resistance": 12.0 + 0.01 * k, "dead_time.time": 1e-7 * (k % 3)}
        for k in range(40)
    ]
    one, two = replay(prepared, sets), replay(prepared, sets, workers=2)
    for a, b in zip((*one.currents, *one.motion), (*two.currents, *two.motion), strict=True):
        assert (a is b is None) or np.array_equal(a, b)
    neutral = complete(DRIVE.motor, DRIVE.converter)
    few = replay(prepared, [{}, neutral, {}])
    for current in few.currents:
        assert np.array_equal(current[:, :, [0, 0]], current[:, :, 1:])
    first, second = sensitivities(prepared), sensitivities(prepared, workers=2)
    assert all(np.array_equal(a, b) for a, b in zip(first.currents, second.currents, strict=True))


def test_a_set_is_the_same_alone_and_beside_others():
    """Neighbours that need the same give the same bits; others may have the batch stop more often
    (behind late edges, where lags are on), which moves a set's numbers by what its steps leave, in
    its own place."""
    prepared = prepare(campaign({}), steps=1)
    alone = replay(prepared, [{}, {"dead_time.time": 2e-6}])
    beside = [{}, {"magnet_flux.magnet_flux": 0.09}, {"stator_resistance.resistance": 9.0}]
    for a, b in zip(alone.currents, replay(prepared, beside[::-1]).currents, strict=True):
        # the block of two runs the code of late edges
        assert np.abs(a[:, :, 0] - b[:, :, 2]).max() < 1e-9
    for a, b in zip(
        replay(prepared, [{}]).currents, replay(prepared, beside[::-1]).currents, strict=True
    ):
        assert np.array_equal(a[:, :, 0], b[:, :, 2])
    many = [typical(name) for name in library.effect_names()] + [{}]
    assert len(plan(prepared, many)) > 1
    among = replay(prepared, many).currents
    for k in (0, 5, len(many) - 1):
        own = replay(prepared, [many[k]]).currents
        assert all(
            np.abs(a[:, :, 0] - b[:, :, k]).max() < 10.0 * EXACT * DRIVE.motor.rated_current
            for a, b in zip(own, among, strict=True)
        )


def test_one_step_a_period_is_far_below_the_noise_and_halving_gains_a_square_or_more():
    """Edges make most segments shorter than half a period, so that the first halving leaves them as
    they are; the order itself is measured in tests/sandbox/plant/test_period_order.py."""
    prepared = prepare(campaign({}))
    assert prepared.steps == 1
    halved = [max(halving_error(with_steps(prepared, n))) for n in (1, 2, 4)]
    print("change on halving the step, noise floors:", halved)
    assert halved[0] < 2e-3
    assert halved[0] > 2.0 * halved[1]
    assert halved[1] > 4.0 * halved[2]


def test_sensitivities_against_richardson():
    """Central differences of two widths, extrapolated, on one driven and one free recording, every
    effect on.

    Dead time's zone as a hyperbolic tangent: no corner that a difference could lie across.
    """
    effects = {
        k: v
        for name in library.effect_names()
        if name != "cross_saturation"
        for k, v in typical(name).items()
    }
    effects["dead_time.zone_shape"] = 1.0
    prepared = prepare(campaign({}, CASES[1:], n=300), effects, steps=1)
    # no core loss is below none: differences about it go one way only
    ends = ("iron_loss.excess_current", "iron_loss.hysteresis_current")
    names = [n for n in all_parameters() if n not in ("bench.lock_angle", *ends)]
    found = sensitivities(prepared, names, effects)
    wide, narrow = (
        [sensitivities(prepared, names, effects, share=s * h) for s in (1, -1)]
        for h in (2e-3, 1e-3)
    )
    worst = {}
    for k, name in enumerate(names):
        a, exact = [], []
        for kind in ("currents", "motion"):
            for r in range(3):
                if getattr(found, kind)[r] is None:
                    continue
                w, n = (
                    0.5 * (getattr(x[0], kind)[r] + getattr(x[1], kind)[r]) for x in (wide, narrow)
                )
                a.append(getattr(found, kind)[r][..., k].ravel())
                exact.append(((4.0 * n - w) / 3.0)[..., k].ravel())
        x, y = np.concatenate(a), np.concatenate(exact)
        if name != "shaft_compliance.stiffness":  # a secant
            worst[name] = (
                np.linalg.norm(x - y) / max(np.linalg.norm(y), 1e-300) if np.any(y) else 0.0
            )
        assert np.any(y) or not np.any(x), name
    print({k: float(f"{v:.1e}") for k, v in sorted(worst.items(), key=lambda i: -i[1])[:8]})
    # steps of 1e-4 of the typical size, curvature of up to ten times the slope
    assert max(worst.values()) < 1e-3
    assert np.median(list(worst.values())) < 1e-4


def test_sensitivity_coordinates_and_companions():
    prepared = prepare(campaign({}, CASES[1:], n=300), steps=1)
    s = sensitivities(prepared)
    by_name = dict(zip(s.names, s.coordinates, strict=True))
    assert by_name["iron_loss.core_resistance"] == "1/iron_loss.core_resistance"
    assert s.base["cogging_torque.order_mech"] == 36.0
    assert s.base["cogging_torque.amplitude"] == 0.0
    k = s.names.index("current_offset.offset_a")
    assert s.currents[0][:, :, k] == pytest.approx(
        np.broadcast_to([1.0, 0.0, -1.0], (300, 3)), abs=1e-6
    )
    k = s.names.index("encoder_eccentricity.amplitude_mech")
    assert np.any(s.currents[2][:, :, k])
    assert np.any(s.motion[2][:, k])
    k = s.names.index("coulomb_friction.torque")
    assert not np.any(s.currents[2][:, :, k])
    assert np.any(s.motion[2][:, k])


def test_bad_input_is_named():
    recorded = campaign({}, CASES[:1], n=50)
    prepared = prepare(recorded, steps=1)
    with pytest.raises(BadInput, match=r"dead_tim\.time.*dead_time"):
        replay(prepared, [{"dead_tim.time": 1e-6}])
    with pytest.raises(BadInput, match="out of range"):
        replay(prepared, [{"bench.lock_angle": 9.0}])
    with pytest.raises(BadInput, match="no parameter set"):
        replay(prepared, [])
    with pytest.raises(BadInput, match="threads"):
        replay(prepared, [{}], workers=0)
    with pytest.raises(BadInput, match="lock_angle"):
        sensitivities(prepared, ["bench.lock_angel"])
    with pytest.raises(BadInput, match="locked_0"):
        prepare(recorded, files=["locked_1"])
    with pytest.raises(BadInput, match="steps"):
        with_steps(prepared, 0)
    r = recorded.recordings[0]
    with pytest.raises(BadInput, match="column 'u_dc' is missing"):
        dataclasses.replace(r, columns={k: v for k, v in r.columns.items() if k != "u_dc"})
    with pytest.raises(BadInput, match="rotor"):
        dataclasses.replace(r, rotor="lockt")
    turning = dataclasses.replace(record({}, "driven", 20.0, n=50), rotor="locked")
    with pytest.raises(BadInput, match="theta moves"):
        prepare(dataclasses.replace(recorded, recordings=(turning,)))
    dead = dataclasses.replace(r, columns={**r.columns, "u_dc": np.zeros(50)})
    with pytest.raises(BadInput, match="u_dc"):
        prepare(dataclasses.replace(recorded, recordings=(dead,)))
    silent = dataclasses.replace(
        DRIVE,
        converter=dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0),
    )
    with pytest.raises(BadInput, match="current_noise"):
        prepare(dataclasses.replace(recorded, drive=silent))


def test_features_and_rows():
    """All that the plant runs on is finite; of effects' own numbers a stiffness may be infinite, as
    the cards say."""
    converter, motor = DRIVE.converter, DRIVE.motor
    # the motor's own viscous friction
    assert features_of(motor, complete(motor, converter)) == add.RUB
    for name in library.effect_names():
        batch = batch_of(motor, converter, [complete(motor, converter, typical(name))], 1)
        assert all(
            np.all(np.isfinite(batch[row])) for row in batch.dtype.names if row not in NUMBERS
        ), name


# ---- recordings of a foreign bench ----

# A by pole pairs: 1.5 % of rated current, which campaign.toml does not tell
SOFT = {6: 0.018, 3: 0.09}
TRUE = {
    "R": "stator_resistance.resistance",
    "phim": "magnet_flux.magnet_flux",
    "J": "inertia.inertia",
}
TRUE |= {"B": "viscous_friction.coefficient"} | {
    f"a{n}": f"saturation.alpha_{n}" for n in ("30", "12", "40", "22", "04")
}
ORDINARY = {f"current_gain.gain_{x}": 1e-3 for x in "abc"} | {
    f"current_offset.offset_{x}": 1e-3 for x in "ab"
}
ORDINARY |= {"encoder_offset.offset": 1e-3, "bench.lock_angle": 1e-3, "dead_time.time": 2e-8}
ORDINARY |= {"bench.load_torque_offset": 1e-3, "bench.common_offset": 1e-3}


def practice(name):
    """Return a practice campaign, of each recording the first half, its true set, and the names of
    its effects."""
    folder = recordings_folder() / "practice"
    recorded = read_folder(folder / name)
    halves = [{k: x[: len(x) // 2] for k, x in r.columns.items()} for r in recorded.recordings]
    recorded = dataclasses.replace(
        recorded,
        recordings=tuple(
            dataclasses.replace(r, columns=c)
            for r, c in zip(recorded.recordings, halves, strict=True)
        ),
    )
    truth = tomllib.loads((folder / f"{name}.truth.toml").read_text())
    motor, true = recorded.drive.motor, truth["true_motor"]
    values = {TRUE[k]: v for k, v in true.items() if k in TRUE} | {
        "bench.soft_current": SOFT[motor.pole_pairs],
        "coulomb_friction.width": 2.0,  # that of all campaigns of the time, not stated
    }
    values |= {
        f"inductance.scale_{x}": true[f"L{x}"] / getattr(motor, f"inductance_{x}") for x in "dq"
    }
    for effect in truth["effects"]:
        if effect != "cross_saturation":  # the alphas, among the true motor's
            values |= {f"{effect}.{k}": v for k, v in truth[effect].items()}
    return recorded, values, truth["effects"]


def rms(found):
    """Return rms over the floor per recording of current and of motion (0 where there is none)."""
    moved = [
        0.0 if r.motion is None else float(np.sqrt(np.mean(r.motion[:, 0] ** 2))) for r in found
    ]
    return np.array([r.rms()[0] for r in found]), np.array(moved)


def fitted(recorded, values, rounds):
    """Return the set with its ordinary deviations fitted (linear steps), and the residuals
    there."""
    own = complete(recorded.drive.motor, recorded.drive.converter, values)
    values = {**values, **{k: own[k] for k in ORDINARY}}
    for _ in range(rounds):
        prepared = prepare(recorded, values, steps=1)
        found = residuals(
            prepared,
            replay(
                prepared, [values, *({**values, k: values[k] + h} for k, h in ORDINARY.items())]
            ),
        )
        rows = [r.current.reshape(-1, 1 + len(ORDINARY)) for r in found] + [
            r.motion for r in found if r.motion is not None
        ]
        y = np.concatenate(rows)
        step = np.linalg.lstsq(y[:, 1:] - y[:, :1], -y[:, 0], rcond=None)[0]
        values = {
            **values,
            **{k: values[k] + x * h for x, (k, h) in zip(step, ORDINARY.items(), strict=True)},
        }
    return values, residuals(prepared, replay(prepared, [values]))


def test_p01_is_met_to_its_noise_floor():
    """No effect, no deviation, nothing fitted: every recording at the stated noise, and the free
    rotor's motion too."""
    recorded = read_folder(recordings_folder() / "practice" / "p01")
    prepared = prepare(recorded)
    assert prepared.steps == 1
    assert max(halving_error(prepared)) < 2e-3
    found = residuals(prepared, replay(prepared, [{}]))
    current, motion = rms(found)
    for r, c, m in zip(found, current, motion, strict=True):
        print(f"{r.file:28s} {r.rotor:7s} current {c:.3f}  motion {m:.3f}")
    assert current == pytest.approx(1.0, abs=0.03)
    assert motion[motion > 0.0] == pytest.approx(1.0, abs=0.08)
    assert [np.sqrt(np.mean(r.angle**2)) for r in found if r.angle is not None] == pytest.approx(
        [1.0] * 3, abs=0.05
    )


# p06, p07 and p10 have what is fitted in every campaign, or nothing: p01 shows that; p02: below
@pytest.mark.parametrize("name", ["p03", "p04", "p05", "p08", "p09", "p11", "p12"])
def test_true_effect_brings_the_residual_to_the_noise_floor(name):
    recorded, values, effects = practice(name)
    # they are nearly linear: a second step changes rms by 2e-4 (p05)
    _, found = fitted(recorded, values, rounds=1)
    current, motion = rms(found)
    print(name, effects, "current", np.round(current, 3), "motion", np.round(motion[motion > 0], 3))
    assert np.sqrt(np.mean(current**2)) < 1.03
    assert current.max() < 1.12  # p12, coasting without current: 2 mA, see AVERAGING.md
    assert motion.max() < 1.15


def test_a_fit_finds_dead_time_from_sensitivities():
    """p02 without its effect: linear steps of the ordinary deviations, residual dead time too, find
    the truth."""
    recorded, values, _ = practice("p02")
    found, _ = fitted(
        recorded, {k: v for k, v in values.items() if not k.startswith("dead_time")}, rounds=4
    )
    assert found["dead_time.time"] == pytest.approx(values["dead_time.time"], abs=2e-8)


def test_too_little_room_for_a_block_is_noticed_before_anything_is_written():
    """Compiled code writes unchecked: sixteen sets run in a block of 24 lanes."""
    prepared = prepare(campaign({}, cases=CASES[:1]), steps=1)
    block = plan(prepared, [{}] * 16)[0]
    r, moved = prepared.recordings[0], np.empty((1, 1))
    run_block(prepared, r, block, np.empty((r.samples, 3, block.lanes)), moved, 0)
    for shape in ((r.samples, 3, 16), (r.samples - 1, 3, block.lanes)):
        with pytest.raises(AssertionError, match="no room"):
            run_block(prepared, r, block, np.empty(shape), moved, 0)
