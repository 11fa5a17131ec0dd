"""From recordings to parameters: planted motors come back, intervals hold, and a bench's mistakes
are named."""

import dataclasses
import math
import tomllib

import numpy as np
import pytest

from model.drive_files import load_drive
from model.errors import BadInput
from model.levels import NAMES, UNITS
from model.parameters import Drive
from sandbox.recordings.campaign import CampaignRecording, read_folder
from sandbox.recordings.identify import identify
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.staircase import rest_of_transient
from sandbox.recordings.writing import write_campaign
from sandbox.replay.identification.locked_test import LockedBench, paper_campaign, staircase
from tests.data import recordings_folder

MOTORS = ("ipm", "ipm_exchanged", "spm_exchanged")
WRONG = dict(zip(NAMES, (1.3, 0.7, 1.3, 0.7, 1.3, 1.3, 0.7, 1.3), strict=True))
TRUTH = dict(zip(NAMES, ("R", "Ld", "Lq", "a30", "a12", "a40", "a22", "a04"), strict=True))


def _misled(campaign):
    """The same campaign with a nominal motor that is wrong by 30 %."""
    motor = campaign.drive.motor
    wrong = dataclasses.replace(motor, **{n: f * getattr(motor, n) for n, f in WRONG.items()})
    return dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, motor=wrong))


def _errors(campaign, motor, method="exact"):
    values = identify(campaign).fits[method].values
    return {n: values[n] / getattr(motor, n) - 1 for n in NAMES}


@pytest.mark.parametrize("name", MOTORS)
def test_planted_motor_is_recovered_from_a_wrong_start(name):
    drive = load_drive(name)
    campaign = paper_campaign(drive, bench=LockedBench(theta=0.7))
    errors = _errors(_misled(campaign), drive.motor)
    # the issue asks 1e-3; pulses shift a sample from the mean voltage's current by 9e-5 of rated
    # current (AVERAGING 0), of which terms of fourth order are less than a third
    assert max(map(abs, errors.values())) < 3e-4, errors


def test_inverter_voltage_error_does_not_leak_into_inductances():
    drive = load_drive("ipm_exchanged")
    campaign = paper_campaign(drive, bench=LockedBench(theta=0.7, threshold=2.0, width=0.018))
    fit = identify(campaign).fits["exact"]
    errors = {n: fit.values[n] / getattr(drive.motor, n) - 1 for n in NAMES}
    # the test's plant holds the error over h/16 substeps, the fit's is continuous: 1/16 of a 2 V
    # error in 30 V misplaced at each zero crossing, 4e-3 at the worst
    assert max(abs(errors[n]) for n in NAMES[:3]) < 4e-3, errors
    assert fit.nuisance["voltage_threshold"] == pytest.approx(2.0, rel=0.01)
    # the paper's method pays 2 %
    assert abs(_errors(campaign, drive.motor, "first_order")["inductance_d"]) > 0.02


def test_error_of_the_lock_angle_is_found_by_symmetry():
    drive = load_drive("ipm_exchanged")
    found = identify(paper_campaign(drive, bench=LockedBench(theta=2.0, angle_error=0.05))).fits[
        "exact"
    ]
    assert found.nuisance["angle_error"] == pytest.approx(0.05, abs=1e-4)
    assert found.values["alpha_12"] == pytest.approx(drive.motor.alpha_12, rel=1e-3)


def test_another_size_rate_and_waveform():
    """A motor 20 times larger in current at 10 kHz, with a sine of 20 samples."""
    base = load_drive("ipm_exchanged")
    scale = {
        "inductance_d": 1 / 20,
        "inductance_q": 1 / 20,
        "resistance": 1 / 20,
        "rated_current": 20,
    }
    # same fluxes
    scale |= dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 20.0)
    motor = dataclasses.replace(
        base.motor, **{n: f * getattr(base.motor, n) for n, f in scale.items()}
    )
    converter = dataclasses.replace(base.converter, sampling_period=1e-4, pwm_frequency=None)
    injection = dataclasses.replace(base.injection, waveform="sine")
    drive = Drive(motor, converter, injection, {})
    campaign = paper_campaign(
        drive, np.linspace(-40, 40, 9), dwell=100, bench=LockedBench(theta=-1.0)
    )
    assert max(map(abs, _errors(_misled(campaign), motor).values())) < 1e-4


def test_intervals_cover_the_truth():
    """One in a short run of the study in experiments/interval_coverage.py (>= 400 repetitions,
    93-97 %)."""
    drive, inside = load_drive("ipm_exchanged"), []
    levels = np.linspace(-1.92, 1.92, 5)
    for k in range(100):
        bench = LockedBench(theta=0.4, noise=0.002, resolution=0.0024, seed=1000 + 3 * k)
        fit = identify(paper_campaign(drive, levels, 60, bench)).fits["exact"]
        inside += [a <= getattr(drive.motor, n) <= b for n in NAMES for a, b in [fit.ci95(n)]]
    # 8 correlated parameters x 100: standard deviation of the share at most sqrt(.05 * .95 / 100) =
    # 2.2 %
    assert np.mean(inside) > 0.95 - 2.5 * 0.022


@pytest.mark.parametrize("name", [f"p{k:02}" for k in range(1, 13) if k != 11])
def test_bench_campaigns_give_their_true_motor(name):
    folder = recordings_folder() / "practice"
    truth = tomllib.loads((folder / f"{name}.truth.toml").read_text())["true_motor"]
    fit = identify(folder / name).fits["exact"]
    z = {n: (fit.values[n] - truth[TRUTH[n]]) / fit.sd[n] for n in NAMES}
    # 11 campaigns x 8: one beyond 3.5 in 25 runs of this test
    assert max(map(abs, z.values())) < 3.5, z
    assert all(fit.sd[n] < 0.04 * abs(fit.values[n]) for n in NAMES)


def test_nuisances_of_the_bench_are_found_beside_the_motor():
    folder = recordings_folder() / "practice"
    late = identify(folder / "p09").fits["exact"].nuisance["delay"]
    assert late == pytest.approx(3.866e-5, rel=0.03)  # p09.truth.toml, pwm_delay
    dead = identify(folder / "p02").fits["exact"].nuisance["voltage_threshold"]
    # p02.truth.toml: dead time x U_dc / T_s
    assert dead == pytest.approx(1.2213e-6 / 250e-6 * 400.0, rel=0.03)
    turned = identify(folder / "p06").fits["exact"].nuisance["angle_error"]
    # p06.truth.toml: encoder_offset, read = true + offset
    assert turned == pytest.approx(0.0469, abs=0.005)


def test_iron_loss_is_outside_the_model_and_said_so():
    report = identify(recordings_folder() / "practice" / "p11")
    assert any("an effect outside the model acts" in remark for remark in report.remarks)


def _changed(campaign, **columns):
    def edit(r):
        return dataclasses.replace(
            r, columns={**r.columns, **{k: f(r) for k, f in columns.items()}}
        )

    return dataclasses.replace(campaign, recordings=tuple(edit(r) for r in campaign.recordings))


@pytest.fixture(scope="module")
def good():
    bench = LockedBench(theta=0.7, noise=0.002, resolution=0.0024)
    return paper_campaign(load_drive("ipm_exchanged"), np.linspace(-1.92, 1.92, 7), 60, bench)


def test_result_hands_back_a_motor_and_its_residuals(good):
    found = identify(good)
    assert found.motor().inductance_q == found.fits["exact"].values["inductance_q"]
    assert found.motor("first_order").pole_pairs == good.drive.motor.pole_pairs
    for fit in found.fits.values():
        assert fit.residuals.shape == found.levels.slope.shape
        assert fit.residual_rms == pytest.approx(np.sqrt(np.mean(fit.residuals**2)))


def test_json_holds_names_of_the_contract(good, tmp_path):
    report = identify(write_campaign(tmp_path / "c", good)).as_json()
    for method in ("first_order", "exact"):
        parameters = report["methods"][method]["parameters"]
        assert {n: p["unit"] for n, p in parameters.items()} == UNITS
        assert all(p["ci95"][0] <= p["value"] <= p["ci95"][1] for p in parameters.values())
        assert report["methods"][method]["residual_rms"] > 0


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (
            {"i_b": lambda r: r.i_c, "i_c": lambda r: r.i_b},
            "phases swapped .*order i_a, i_c, i_b fits",
        ),
        (
            {n: lambda r, n=n: 1e3 * r.columns[n] for n in ("i_a", "i_b", "i_c")},
            (
                r"locked_\w+.parquet: the bias levels .* \(at the largest, 23.\d V and "
                r"1.92e\+03 A\); are currents in mA"
            ),
        ),
        (
            {n: lambda r, n=n: 1e3 * r.columns[n] for n in ("u_alpha", "u_beta")},
            "or voltages in mV",
        ),
        (
            {n: lambda r, n=n: -r.columns[n] for n in ("i_a", "i_b", "i_c")},
            "no order of the phases fits; check signs",
        ),
        (
            {n: lambda r, n=n: 0.0 * r.columns[n] for n in ("i_a", "i_b", "i_c")},
            "no level has a mean current above",
        ),
        (
            {"theta": lambda r: np.degrees(r.theta)},
            "degrees off axis d at theta = 40.11; give theta in electrical rad",
        ),
        ({"i_a": lambda r: np.clip(r.i_a, -1.0, 1.0)}, "sensor of i_a is saturated at 1 A \\(row"),
        (
            {"theta": lambda r: r.theta + np.linspace(0, 1, len(r.t))},
            "theta spans 1 while rotor = 'locked'",
        ),
        (
            {
                "u_alpha": lambda r: np.repeat(r.u_alpha.reshape(-1, 8).mean(1), 8),
                "u_beta": lambda r: np.repeat(r.u_beta.reshape(-1, 8).mean(1), 8),
            },
            "no injection in the commanded voltage",
        ),
    ],
)
def test_mistakes_of_a_bench_are_named(good, columns, message):
    with pytest.raises(BadInput, match=message):
        identify(_changed(good, **columns))


def test_too_short_a_dwell_is_named():
    drive = load_drive("ipm_exchanged")
    with pytest.raises(
        BadInput, match=r"locked_d.parquet: no steady level: the longest stretch .* dwell longer"
    ):
        identify(paper_campaign(drive, np.linspace(-1.92, 1.92, 7), 9))


def test_no_locked_recording_is_named(good):
    free = tuple(dataclasses.replace(r, rotor="free") for r in good.recordings)
    with pytest.raises(BadInput, match="no recording has a locked rotor"):
        identify(dataclasses.replace(good, recordings=free))


def test_a_missing_axis_is_named(good):
    with pytest.raises(BadInput, match="no steady level with injection on q and bias on q"):
        identify(dataclasses.replace(good, recordings=good.recordings[:2]))


def test_a_staircase_starts_settled_at_its_first_level():
    r = staircase(load_drive("ipm"), "x", "none", np.array([[1.0, 0.5], [1.0, 0.5]]), 4)
    assert isinstance(r, CampaignRecording)
    alpha, beta = r.current
    pulses = 9e-5 * 1.2  # A: their share of a sample, AVERAGING 0
    np.testing.assert_allclose(alpha, 1.0, atol=pulses)
    np.testing.assert_allclose(beta, 0.5, atol=pulses)
    assert math.isclose(r.t[-1], 63 * 250e-6)


def test_reading_only_locked_tables(good, tmp_path):
    assert len(read_folder(write_campaign(tmp_path / "c", good), rotors=("free",)).recordings) == 0


def test_a_gap_cuts_the_recording_at_its_row(good, tmp_path):
    late = _changed(good, t=lambda r: r.t + np.where(np.arange(len(r.t)) > 1000, 0.01, 0.0))
    cut = read_recordings(write_campaign(tmp_path / "c", late))
    assert [r.file for r in cut.recordings[:2]] == ["locked_d-1.parquet", "locked_d-2.parquet"]
    assert len(cut.recordings[0].t) == 1001
    np.testing.assert_array_equal(cut.recordings[1]["i_a"], good.recordings[0]["i_a"][1001:])


@pytest.mark.parametrize("wrong", [0.7, 1.3])
def test_what_is_left_of_a_transient_does_not_bias_the_resistance(wrong):
    """SPM, L/R = 23 ms in levels of 100 ms: ignored, the ends of its transients shift R by 1.0e-3
    (measured)."""
    drive = load_drive("spm_exchanged")
    motor = dataclasses.replace(drive.motor, resistance=wrong * drive.motor.resistance)
    campaign = paper_campaign(drive, np.linspace(-8.0, 8.0, 7), 50, LockedBench(theta=0.4))
    led = dataclasses.replace(campaign, drive=dataclasses.replace(drive, motor=motor))
    # 9e-5 of rated current by which pulses shift a sample (AVERAGING 0), against levels of 2.7 A
    # and 3.4 A rated
    assert abs(_errors(led, drive.motor)["resistance"]) < 1e-4 + 9e-5 * 3.4 / 2.7


@pytest.mark.parametrize("constants", [0.2, 1.0, 5.0, 20.0])
def test_rest_of_a_transient_is_the_change_of_flux_over_the_level(constants):
    """Closed form: i = c + a exp(-t R/L) takes L (i(T) - i(0)) / T of the mean voltage; a line is
    off by its shape."""
    resistance, inductance, period, count = 2.0, np.array([0.05, 0.03]), 2e-3, 60
    whole = count * period
    inductance *= resistance * whole / constants / inductance[0]
    rate = resistance / inductance
    t, half = (np.arange(count) + 0.5)[:, None] * period, 0.5 * rate * period
    # an average over a period against the value at its middle, for which it is taken
    larger = np.sinh(half) / half
    current = 3.0 + 0.4 * np.exp(-t * rate) * larger
    rest, blur = rest_of_transient(current, resistance, inductance, period)
    exact = inductance * 0.4 * np.expm1(-whole * rate) / whole
    np.testing.assert_allclose(rest, exact, rtol=larger.max() - 1 + 1e-9)
    assert np.all(blur < 1e-9)
