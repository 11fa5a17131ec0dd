"""Replay: against the switched bench effect by effect, on recordings of a foreign bench, and its derivatives.

Tolerances against the switched bench are what averaging can give (sandbox/switched/AVERAGING.md), share of rated
current.  Recordings come from SENSORLESS_RECORDINGS or ../shared/recordings; truths beside the practice campaigns.
"""

import dataclasses
import tomllib

import numpy as np
import pytest

from model.effects import library
from model.energy import flux_from_current, hessian
from model.errors import BadInput
from model.parameters import load_drive
from sandbox.campaign import Campaign, CampaignRecording, read_campaign
from sandbox.plant.sets import compile_set, complete, features_of, lag_weights, parabola_weights
from sandbox.replay import lanes
from sandbox.replay.inputs import edge_table
from sandbox.replay.replay import halving_error, plan, prepare, replay, residuals, with_steps
from sandbox.replay.sensitivity import all_parameters, sensitivities
from sandbox.switched.effects import bench, quiet
from sandbox.switched.simulate import replay as switched
from tests.data import recordings_folder

DRIVE = load_drive("ipm")
DRIVE = dataclasses.replace(DRIVE, converter=dataclasses.replace(DRIVE.converter, encoder_counts=1 << 16))
CASES = (("locked", 0.0), ("driven", 20.0), ("driven", 100.0), ("free", 0.0))
AVERAGING = {"dead_time": 5e-4, "current_filter": 3e-4, "iron_loss": 2e-4, "device_drop": 2e-4}  # else 1.3e-4
MOTION = 0.1  # standard deviations: what may be left of a free rotor's innovations without noise


def record(effects, rotor, speed=0.0, n=700, load_torque=True):
    """Return a recording of the switched bench without noise: voltage, injection, a step of load for a free rotor."""
    b, period, pairs = quiet(bench(DRIVE.motor, DRIVE.converter, effects)), DRIVE.converter.sampling_period, 6
    k = np.arange(n)
    theta, middle = (0.3 + pairs * speed * period * (k + x) for x in (0.0, 0.5))
    size = 12.0 + 0.1 * pairs * speed if rotor == "driven" else 12.0 * np.sin(2 * np.pi * k / 600)
    u = size * np.exp(1j * (middle + 1.6)) + 30.0 * np.where(k % 8 < 4, 1, -1) * np.exp(1j * middle)
    load, more = np.zeros(n), {"theta": theta, "speed": speed}
    if rotor == "free":
        u, load = (10.0 + 5.0 * np.sin(k / 50.0)).astype(complex), np.where(k > 300, 0.2, 0.0)
        more = {"theta": 0.3, "load_torque": load}
    r = switched(b, rotor, u.real, u.imag, 400.0, **more)
    columns = {"t": k * period, "u_alpha": u.real, "u_beta": u.imag, "theta": r["theta"], "u_dc": np.full(n, 400.0)}
    columns |= {name: r[name] for name in ("i_a", "i_b", "i_c")} | ({"load_torque": load} if load_torque else {})
    return CampaignRecording(f"{rotor}_{speed:g}.parquet", rotor, "d", columns)


def campaign(effects, cases=CASES, **more):
    """Return a campaign of the switched bench."""
    return Campaign("bench", DRIVE, tuple(record(effects, *c, **more) for c in cases), {}, {}, False)


def typical(name):
    """Return an effect at its typical size, without the jitter that no prediction shows."""
    return {k: v for k, v in library.typical(name, DRIVE.motor, DRIVE.converter).items() if not k.endswith("jitter")}


def gaps(recorded, prepared, values):
    """Return rms vector difference over rated current per recording, and the largest rms innovation."""
    p = replay(prepared, [values])
    out = []
    for r, current in zip(recorded.recordings, p.currents, strict=True):
        miss = np.stack([r.i_a, r.i_b, r.i_c], axis=1) - current[:, :, 0]
        out.append(np.sqrt(np.mean(np.sum(miss[100:] ** 2, axis=1) * 2 / 3)) / DRIVE.motor.rated_current)
    return np.array(out), max(float(np.sqrt(np.mean(m**2))) for m in p.motion if m is not None)


@pytest.mark.parametrize("name", ["none", *library.effect_names()])
def test_effect_is_that_of_the_switched_bench(name):
    effects = {} if name == "none" else typical(name)
    recorded = campaign(effects)
    prepared = prepare(recorded, effects, steps=1)
    current, motion = gaps(recorded, prepared, effects)
    without, still = gaps(recorded, prepared, {})
    print(f"{name}: {np.round(current * 1e6)} ppm of rated current with it, {np.round(without * 1e6)} without")
    assert current.max() < AVERAGING.get(name, 1.4e-4)
    assert motion < MOTION
    if name != "none":
        assert without.max() > 10 * current.max() or still > 3 * motion


def test_all_effects_together_are_those_of_the_switched_bench():
    effects = {k: v for name in library.effect_names() if name != "cross_saturation" for k, v in typical(name).items()}
    recorded = campaign(effects)
    current, motion = gaps(recorded, prepare(recorded, effects, steps=1), effects)
    without, _ = gaps(recorded, prepare(recorded, effects, steps=1), {})
    print(f"all effects: {current} of rated current with them, {without} without; motion {motion}")
    assert current.max() < 1.7e-3  # the sensors' noise
    assert without.min() > 50 * current.max()


PAIRS = (  # whose effects meet inside the period
    *(("dead_time", other) for other in ("pwm_delay", "iron_loss", "device_drop", "flux_harmonics", "current_filter")),
    *(("iron_loss", other) for other in ("current_sampling", "current_filter")),
    ("pwm_delay", "current_filter"),
    ("encoder_eccentricity", "cogging_torque"),
)


@pytest.mark.parametrize("names", PAIRS, ids=" ".join)
def test_pairs_are_those_of_the_switched_bench(names):
    effects = {k: v for name in names for k, v in typical(name).items()}
    recorded = campaign(effects, n=500)
    current, motion = gaps(recorded, prepare(recorded, effects, steps=1), effects)
    print(f"{names}: {np.round(current * 1e6)} ppm of rated current, motion {motion:.3f}")
    assert current.max() < 9e-4
    assert motion < MOTION


BESIDE = (  # what typical sizes leave out, and where effects meet
    {"current_gain.gain_c": 1.03},
    {"dc_link_ripple.amplitude": 20.0, "dc_link_ripple.frequency": 3000.0, "pwm_delay.delay": 4e-5},
    {"current_sampling.delay": 6e-5, "dc_link_error.gain_error": 0.06},
    {"dc_link_error.sag": 30.0, "dead_time.time": 2e-6},
    {"dc_link_error.sag": 30.0, "iron_loss.core_resistance": 2e3, "current_sampling.delay": 6e-5},
    {"coulomb_friction.stribeck_torque": 0.05},
    {"coulomb_friction.torque": 0.03, "coulomb_friction.stribeck_torque": 0.05, "coulomb_friction.width": 0.5},
)


@pytest.mark.parametrize("effects", BESIDE, ids=str)
def test_sizes_beside_the_typical_ones_are_those_of_the_switched_bench(effects):
    """Within twice what single effects leave and a fifteenth of the effect; i_c sampled between pulses is the worst.

    (There it goes towards the mean slope until the sample, not through the pulses one by one: 1.2e-3 in either plant.)
    """
    recorded = campaign(effects)
    prepared = prepare(recorded, effects, steps=1)
    current, motion = gaps(recorded, prepared, effects)
    without, still = gaps(recorded, prepared, {})
    print(
        f"{effects}: {np.round(current * 1e6)} ppm, {np.round(without * 1e6)} without; motion {motion:.3f}, {still:.3f}"
    )
    assert current.max() < 1.6e-3
    assert motion < MOTION
    assert without.max() > 15 * current.max() or still > 5 * motion


def test_jitter_is_noise_above_the_floor_not_a_prediction():
    """Locked, constant current along d: what jitter leaves is jitter x R Gamma_dd i, the slope of the zero vector."""
    jitter, theta, n, motor = 5e-6, 0.3, 3000, DRIVE.motor
    u = np.full(n, 8.0 * np.exp(1j * theta))
    b = quiet(bench(motor, DRIVE.converter))._replace(jitter=jitter)
    r = switched(b, "locked", u.real.copy(), u.imag.copy(), 400.0, theta=theta, seed=1)
    columns = {"t": np.arange(n) * DRIVE.converter.sampling_period, "u_alpha": u.real, "u_beta": u.imag}
    columns |= {"theta": r["theta"], "u_dc": np.full(n, 400.0)} | {x: r[x] for x in ("i_a", "i_b", "i_c")}
    one = Campaign("c", DRIVE, (CampaignRecording("r.parquet", "locked", "none", columns),), {}, {}, False)
    prepared = prepare(one, steps=1)
    plain, with_it = (replay(prepared, [s]).currents[0][:, :, 0] for s in ({}, {"current_sampling.jitter": jitter}))
    assert np.array_equal(plain, with_it)
    miss = (one.recordings[0].i_a - plain[:, 0])[1000:]
    i = 8.0 / motor.resistance
    d, q = flux_from_current(motor.energy, i, 0.0)
    slope = motor.resistance * i * hessian(motor.energy, float(d), float(q))[0] * np.cos(theta)
    assert miss.std() == pytest.approx(jitter * slope, rel=0.06)  # 2000 draws: 1.6 % each way


def test_threads_batches_and_neutral_values_change_no_bit():
    prepared = prepare(campaign({}, CASES[1:]), steps=1)
    sets = [{"stator_resistance.resistance": 12.0 + 0.01 * k, "dead_time.time": 1e-7 * (k % 3)} for k in range(40)]
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
    """In a block that needs effects, a set without them takes the longer code: equal to rounding, in its own place."""
    prepared = prepare(campaign({}), steps=1)
    alone = replay(prepared, [{}]).currents
    other = {k: v for name in library.effect_names() if name != "cross_saturation" for k, v in typical(name).items()}
    mixed = replay(prepared, [other, {}, {"magnet_flux.magnet_flux": 0.09}])
    assert all(np.abs(a[:, :, 0] - b[:, :, 1]).max() < 1e-9 for a, b in zip(alone, mixed.currents, strict=True))
    many = [typical(name) for name in library.effect_names()] + [{}]
    assert len(plan(prepared, many)) == 2
    for k, values in enumerate(many):
        own, among = replay(prepared, [values]), replay(prepared, many)
        assert all(
            np.abs(a[:, :, 0] - b[:, :, k]).max() < 1e-9 for a, b in zip(own.currents, among.currents, strict=True)
        )
        if k > 3:
            break


def test_one_step_a_period_is_far_below_the_noise_and_of_fourth_order():
    prepared = prepare(campaign({}))
    assert prepared.steps == 1
    halved = [max(halving_error(with_steps(prepared, n))) for n in (1, 2, 4)]
    print("change on halving the step, noise floors:", halved)
    assert halved[0] < 2e-3
    assert halved[0] / halved[1] == pytest.approx(16.0, rel=0.3)
    assert halved[1] / halved[2] == pytest.approx(16.0, rel=0.3)


def test_sensitivities_against_richardson():
    """Central differences of two widths, extrapolated, on one driven and one free recording, every effect on."""
    effects = {k: v for name in library.effect_names() if name != "cross_saturation" for k, v in typical(name).items()}
    prepared = prepare(campaign({}, CASES[1:], n=300), effects, steps=1)
    names = [n for n in all_parameters() if n not in ("bench.lock_angle",)]
    found = sensitivities(prepared, names, effects)
    wide, narrow = ([sensitivities(prepared, names, effects, share=s * h) for s in (1, -1)] for h in (2e-3, 1e-3))
    worst = {}
    for k, name in enumerate(names):
        a, exact = [], []
        for kind in ("currents", "motion"):
            for r in range(3):
                if getattr(found, kind)[r] is None:
                    continue
                w, n = (0.5 * (getattr(x[0], kind)[r] + getattr(x[1], kind)[r]) for x in (wide, narrow))
                a.append(getattr(found, kind)[r][..., k].ravel())
                exact.append(((4.0 * n - w) / 3.0)[..., k].ravel())
        x, y = np.concatenate(a), np.concatenate(exact)
        if name != "shaft_compliance.stiffness":  # a secant
            worst[name] = np.linalg.norm(x - y) / max(np.linalg.norm(y), 1e-300) if np.any(y) else 0.0
        assert np.any(y) or not np.any(x), name
    print({k: float(f"{v:.1e}") for k, v in sorted(worst.items(), key=lambda i: -i[1])[:8]})
    assert max(worst.values()) < 5e-3  # dead time: its soft sign has corners
    assert np.median(list(worst.values())) < 1e-4


def test_sensitivity_coordinates_and_companions():
    prepared = prepare(campaign({}, CASES[1:], n=300), steps=1)
    s = sensitivities(prepared)
    by_name = dict(zip(s.names, s.coordinates, strict=True))
    assert by_name["iron_loss.core_resistance"] == "1/iron_loss.core_resistance"
    assert s.base["cogging_torque.order_mech"] == 36.0
    assert s.base["cogging_torque.amplitude"] == 0.0
    k = s.names.index("current_offset.offset_a")
    assert s.currents[0][:, :, k] == pytest.approx(np.broadcast_to([1.0, 0.0, -1.0], (300, 3)), abs=1e-6)
    k = s.names.index("encoder_eccentricity.amplitude_mech")
    assert np.any(s.currents[2][:, :, k])
    assert np.any(s.motion[2][:, k])
    k = s.names.index("coulomb_friction.torque")
    assert not np.any(s.currents[2][:, :, k])
    assert np.any(s.motion[2][:, k])


def test_arithmetic_without_a_library():
    angle, below = np.linspace(-300.0, 5000.0, 4 * lanes.LANES), np.linspace(-8.0, 0.0, 4 * lanes.LANES)
    pairs = np.array([lanes.sine_cosine.py_func(a) for a in angle])
    assert np.abs(pairs - np.stack([np.sin(angle), np.cos(angle)], axis=1)).max() < 1e-12
    assert [lanes.fading.py_func(float(a)) for a in below] == pytest.approx(np.exp(below), rel=1e-13)
    for tau in (0.0, 1e-6, 1e-4, 3.0):
        decay, old, new = lag_weights(1e-4, tau)
        assert decay + old + new == pytest.approx(1.0, abs=1e-14)
        decay, old, mid, new = parabola_weights(1e-4, tau)
        assert decay + old + mid + new == pytest.approx(1.0, abs=1e-12)
        # a lag follows its parabolic input t^2 (from rest in the far past) with t^2 - 2 tau t + 2 tau^2
        at = [t * t - 2 * tau * t + 2 * tau * tau for t in (0.0, 1e-4)]
        assert decay * at[0] + mid * 0.25e-8 + new * 1e-8 == pytest.approx(at[1], rel=1e-9)


def test_edges_come_in_order_of_time_and_close_the_pulses():
    duty = np.random.default_rng(0).uniform(0.02, 0.98, (50, 3))
    edges = edge_table(duty, 250e-6)
    assert np.all(np.diff(edges[:, :, 0], axis=1) >= 0.0)
    last = edges[:, 5, 1] * 1.5  # all pulses are over: alpha of T D, Clarke
    assert last == pytest.approx(250e-6 * (duty @ [1.0, -0.5, -0.5]))


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
        DRIVE, converter=dataclasses.replace(DRIVE.converter, current_noise=0.0, current_resolution=0.0)
    )
    with pytest.raises(BadInput, match="current_noise"):
        prepare(dataclasses.replace(recorded, drive=silent))


def test_features_and_rows():
    converter, motor = DRIVE.converter, DRIVE.motor
    assert features_of(complete(motor, converter)) == 0
    for name in library.effect_names():
        values = complete(motor, converter, typical(name))
        row = compile_set(motor, converter, values, 1)
        assert np.all(np.isfinite(row)), name


# ---- recordings of a foreign bench ----

SOFT = {6: 0.018, 3: 0.09}  # A by pole pairs: 1.5 % of rated current, which campaign.toml does not tell
TRUE = {"R": "stator_resistance.resistance", "phim": "magnet_flux.magnet_flux", "J": "inertia.inertia"}
TRUE |= {"B": "viscous_friction.coefficient"} | {
    f"a{n}": f"saturation.alpha_{n}" for n in ("30", "12", "40", "22", "04")
}
ORDINARY = {f"current_gain.gain_{x}": 1e-3 for x in "abc"} | {f"current_offset.offset_{x}": 1e-3 for x in "ab"}
ORDINARY |= {"encoder_offset.offset": 1e-3, "bench.lock_angle": 1e-3, "dead_time.time": 2e-8}
ORDINARY |= {"bench.load_torque_offset": 1e-3, "bench.common_offset": 1e-3}


def practice(name):
    """Return a practice campaign, its true set, and the names of its effects."""
    folder = recordings_folder() / "practice"
    recorded = read_campaign(folder / name)
    truth = tomllib.loads((folder / f"{name}.truth.toml").read_text())
    motor, true = recorded.drive.motor, truth["true_motor"]
    values = {TRUE[k]: v for k, v in true.items() if k in TRUE} | {"bench.soft_current": SOFT[motor.pole_pairs]}
    values |= {f"inductance.scale_{x}": true[f"L{x}"] / getattr(motor, f"inductance_{x}") for x in "dq"}
    for effect in truth["effects"]:
        if effect != "cross_saturation":  # the alphas, among the true motor's
            values |= {f"{effect}.{k}": v for k, v in truth[effect].items()}
    return recorded, values, truth["effects"]


def rms(found):
    """Return rms over the floor per recording of current and of motion (0 where there is none)."""
    moved = [0.0 if r.motion is None else float(np.sqrt(np.mean(r.motion[:, 0] ** 2))) for r in found]
    return np.array([r.rms()[0] for r in found]), np.array(moved)


def fitted(recorded, values, rounds=2):
    """Return the set with its ordinary deviations fitted (linear steps), and the residuals there."""
    own = complete(recorded.drive.motor, recorded.drive.converter, values)
    values = {**values, **{k: own[k] for k in ORDINARY}}
    for _ in range(rounds):
        prepared = prepare(recorded, values, steps=1)
        found = residuals(
            prepared, replay(prepared, [values, *({**values, k: values[k] + h} for k, h in ORDINARY.items())])
        )
        rows = [r.current.reshape(-1, 1 + len(ORDINARY)) for r in found] + [
            r.motion for r in found if r.motion is not None
        ]
        y = np.concatenate(rows)
        step = np.linalg.lstsq(y[:, 1:] - y[:, :1], -y[:, 0], rcond=None)[0]
        values = {**values, **{k: values[k] + x * h for x, (k, h) in zip(step, ORDINARY.items(), strict=True)}}
    return values, residuals(prepared, replay(prepared, [values]))


def test_p01_is_met_to_its_noise_floor():
    """No effect, no deviation, nothing fitted: every recording at the stated noise, and the free rotor's motion too."""
    recorded = read_campaign(recordings_folder() / "practice" / "p01")
    prepared = prepare(recorded)
    assert prepared.steps == 1
    assert max(halving_error(prepared)) < 2e-3
    found = residuals(prepared, replay(prepared, [{}]))
    current, motion = rms(found)
    for r, c, m in zip(found, current, motion, strict=True):
        print(f"{r.file:28s} {r.rotor:7s} current {c:.3f}  motion {m:.3f}")
    assert current == pytest.approx(1.0, abs=0.03)
    assert motion[motion > 0.0] == pytest.approx(1.0, abs=0.08)
    assert [np.sqrt(np.mean(r.angle**2)) for r in found if r.angle is not None] == pytest.approx([1.0] * 3, abs=0.05)


@pytest.mark.parametrize("name", [f"p{k:02d}" for k in range(2, 13)])
def test_true_effect_brings_the_residual_to_the_noise_floor(name):
    recorded, values, effects = practice(name)
    _, found = fitted(recorded, values)
    current, motion = rms(found)
    print(name, effects, "current", np.round(current, 3), "motion", np.round(motion[motion > 0], 3))
    assert np.sqrt(np.mean(current**2)) < 1.03
    assert current.max() < 1.12  # p12, coasting without current: 2 mA, see AVERAGING.md
    assert motion.max() < 1.15


def test_a_fit_finds_dead_time_from_sensitivities():
    """p02 without its effect: linear steps of the ordinary deviations, residual dead time too, find the truth."""
    recorded, values, _ = practice("p02")
    found, _ = fitted(recorded, {k: v for k, v in values.items() if not k.startswith("dead_time")}, rounds=4)
    assert found["dead_time.time"] == pytest.approx(values["dead_time.time"], abs=2e-8)
