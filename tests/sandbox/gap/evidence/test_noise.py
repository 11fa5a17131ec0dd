"""The noise a campaign states against that of its readings, and other doors of a diagnosis."""

import dataclasses
import math
import shutil
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2

from model.errors import BadInput, PhysicsError
from sandbox.cli import main
from sandbox.gap.diagnose import diagnosis_of
from sandbox.gap.evidence.noise import noise_caution as caution_of
from sandbox.gap.evidence.noise import noise_of, noise_std_of
from sandbox.gap.evidence.sensor_noise import sensor_noise
from sandbox.gap.two_sensors import two_sensors
from sandbox.recordings.campaign import CampaignRecording, read_folder
from sandbox.replay.inputs import stated_noise_std


def with_noise(campaign, noise):
    converter = dataclasses.replace(campaign.drive.converter, current_noise=noise)
    return dataclasses.replace(
        campaign, drive=dataclasses.replace(campaign.drive, converter=converter)
    )


def with_currents(campaign, change):
    recordings = []
    for r in campaign.recordings:
        columns = {k: change(v) if k in ("i_a", "i_b", "i_c") else v for k, v in r.columns.items()}
        recordings.append(dataclasses.replace(r, columns=columns))
    return dataclasses.replace(campaign, recordings=tuple(recordings))


def noise_caution(campaign):
    """Return what is said of a campaign's noise."""
    return caution_of(campaign, noise_of(campaign))


def test_noise_seen_is_that_put_in(small_folder):
    """White noise of 20 mA on top of the bench's own: their root sum of squares.

    12 blocks of 512, half of each shared with the next one, hold 3600 readings that do not depend
    on each other: 1/sqrt(2 x 3600) = 1.2 % of the rms, 1.9 times that where every 150th periodogram
    is left out and a quarter of the readings is left outside whole blocks; two deviations.
    """
    campaign, rng = read_folder(small_folder), np.random.default_rng(0)
    noisy = with_currents(campaign, lambda i: i + 0.02 * rng.standard_normal(len(i)))
    true = np.hypot(0.02, stated_noise_std(campaign.drive.converter))
    assert noise_of(noisy).seen == pytest.approx(true, rel=0.035)


def test_what_turns_with_the_rotor_is_no_noise(small_folder):
    """A line of three times the noise in all three readings alike, as a core that remembers leaves
    it: its sum has sqrt(3) times 3/sqrt(2), so a mean would show 3.8 times the noise.  In 512
    samples a line stands in four of 257 frequencies, of which neighbours tell the noise."""
    campaign = read_folder(small_folder)
    size = 3.0 * stated_noise_std(campaign.drive.converter)
    lined = with_currents(campaign, lambda i: i + size * np.sin(0.7 * np.arange(len(i))))
    plain, found = noise_of(campaign), noise_of(lined)
    assert found.seen == pytest.approx(plain.seen, rel=0.035)
    assert found.colour == plain.colour == ()


def test_drawn_noise_comes_out_within_its_stated_error(small_folder):
    """White noise, and noise half of which is behind a filter that forgets 0.8 from reading to
    reading, 40 draws of 2.5 mA to 20 mA: of the errors over their stated deviations the rms is 1 at
    most (1 + 2/sqrt(80): two deviations), the mean 2/sqrt(40) of one."""
    campaign, rng = read_folder(small_folder), np.random.default_rng(11)
    still = with_currents(campaign, lambda i: 0.0 * i)
    errors = []
    for k in range(40):
        size, rho = 0.0025 * 2.0 ** (k % 4), 0.8 * (k % 2)

        def noise(i, size=size, rho=rho):
            own = rng.standard_normal((2, len(i) + 100)) * size * math.sqrt(0.5)
            return own[0, 100:] + lfilter([math.sqrt(1 - rho**2)], [1, -rho], own[1])[100:]

        found = noise_of(with_currents(still, noise))
        errors.append(math.log(found.seen / size) / found.error)
    assert np.sqrt(np.mean(np.square(errors))) < 1.0 + 2.0 / math.sqrt(80.0)
    assert abs(np.mean(errors)) < 0.5


@pytest.mark.parametrize("rho", [0.5, 0.8, -0.3])
def test_coloured_noise_is_seen_whole(small_folder, rho):
    """AR(1) of 20 mA beside the bench's own white noise of 4 mA: squares add up, and the
    correlation is that of the whole.  Second differences alone would show (3 - 4 rho + rho^2)/3 of
    it, 0.65 of the rms at 0.5.

    4800 readings' mean square scatters by sqrt(2/4800 (1 + rho^2)/(1 - rho^2)), 0.044 of it at 0.8;
    half of it in the rms, twice for what blocks leave out, two deviations: 9 %.  rho follows within
    (1 - rho) times that, 0.12 at -0.3."""
    campaign, rng = read_folder(small_folder), np.random.default_rng(3)

    def noisy(i):
        own = rng.standard_normal(len(i) + 200) * 0.02 * math.sqrt(1.0 - rho**2)
        return i + lfilter([1.0], [1.0, -rho], own)[200:]

    white = stated_noise_std(campaign.drive.converter) ** 2
    found = noise_of(with_currents(campaign, noisy))
    assert found.seen == pytest.approx(math.sqrt(0.02**2 + white), rel=0.09)
    share = 0.02**2 / (0.02**2 + white)
    assert found.colour[:3] == pytest.approx([share * rho**h for h in (1, 2, 3)], abs=0.12)


def test_white_noise_has_no_colour(small_folder):
    assert noise_of(read_folder(small_folder)).colour == ()


def test_stated_noise_far_from_the_sensors_is_told(small_folder):
    campaign = read_folder(small_folder)
    floor = stated_noise_std(campaign.drive.converter)
    own = dataclasses.replace(
        campaign.drive.converter, current_noise=noise_of(campaign).seen, current_resolution=0.0
    )
    right = dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, converter=own))
    assert noise_caution(right) == ""
    with pytest.raises(BadInput, match="nothing could be seen below the stated noise"):
        noise_caution(with_noise(campaign, 1000.0 * floor))
    with pytest.raises(BadInput, match="no current of any recording ever changes"):
        noise_caution(with_currents(campaign, lambda i: 0.0 * i))
    small = dataclasses.replace(
        campaign.drive.converter, current_noise=floor / 10.0, current_resolution=0.0
    )
    found = noise_caution(
        dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, converter=small))
    )
    assert "may look larger than it is" in found


def test_the_sum_of_two_sensors_tells_nothing_of_noise(small_folder):
    campaign = read_folder(small_folder)
    two = tuple(
        dataclasses.replace(r, columns={**r.columns, "i_c": -r.columns["i_a"] - r.columns["i_b"]})
        for r in campaign.recordings
    )
    assert sensor_noise(dataclasses.replace(campaign, recordings=two)) is None


def test_rounding_to_float32_is_no_noise(small_folder):
    """Without counts each reading is rounded to 24 bits; the sum's rest is rounding, below all
    stated noise.  What neighbouring readings show is told: 10 mA beside the bench's own 4 mA."""
    campaign = read_folder(small_folder)
    rng = np.random.default_rng(1)
    two = []
    for r in campaign.recordings:
        a, b = (c + 0.01 * rng.standard_normal(len(c)) for c in (r.i_a, r.i_b))
        kept = {
            k: v.astype(np.float32).astype(float)
            for k, v in (("i_a", a), ("i_b", b), ("i_c", -a - b))
        }
        two.append(dataclasses.replace(r, columns={**r.columns, **kept}))
    assert np.any(two[0].i_a + two[0].i_b + two[0].i_c != 0.0)
    two = dataclasses.replace(campaign, recordings=tuple(two))
    assert sensor_noise(two) is None
    assert noise_of(two).seen == pytest.approx(
        math.hypot(0.01, stated_noise_std(campaign.drive.converter)), rel=0.1
    )
    assert "follows the readings more than the file" in noise_caution(two)


def with_counts(campaign, noise, resolution):
    """Return a campaign read in counts, the first recording at rest, the others swinging; noise (A)
    in each reading."""
    rng = np.random.default_rng(2)

    def read(i, size):
        return resolution * np.round((size * i + noise * rng.standard_normal(len(i))) / resolution)

    recordings = []
    for k, r in enumerate(campaign.recordings):
        columns = {
            x: read(v, float(k > 0)) if x in ("i_a", "i_b", "i_c") else v
            for x, v in r.columns.items()
        }
        recordings.append(dataclasses.replace(r, columns=columns))
    converter = dataclasses.replace(
        campaign.drive.converter, current_noise=noise, current_resolution=resolution
    )
    drive = dataclasses.replace(campaign.drive, converter=converter)
    return dataclasses.replace(campaign, drive=drive, recordings=tuple(recordings))


def test_coarse_counts_at_rest_are_cautioned_not_refused(small_folder):
    """Counts of 50 mA, noise of 6 mA: half a count is four deviations away, so a current at rest
    never changes.

    Stated in mA instead (a count of 5 A), readings a hundredth of that apart tell the slip, and it
    is refused.
    """
    counts = with_counts(read_folder(small_folder), 6e-3, 50e-3)
    assert np.ptp(counts.recordings[0].i_a) == 0.0
    found = noise_caution(counts)
    assert "a count of 0.05 A hides the noise" in found
    used = noise_std_of(counts, stated_noise_std(counts.drive.converter))
    assert f"units of {used:.3g} A" in found
    # (6^2 + 50^2/12)^(1/2) mA; a quarter of the readings is at rest
    assert used == pytest.approx(0.0156, rel=0.1)
    slip = dataclasses.replace(counts.drive.converter, current_resolution=5.0)
    with pytest.raises(BadInput, match="nothing could be seen below the stated noise"):
        noise_caution(
            dataclasses.replace(counts, drive=dataclasses.replace(counts.drive, converter=slip))
        )


def test_a_nominal_model_without_finite_currents_is_refused(small_folder):
    campaign = read_folder(small_folder)
    motor = dataclasses.replace(campaign.drive.motor, alpha_40=-1e3)
    broken = dataclasses.replace(campaign, drive=dataclasses.replace(campaign.drive, motor=motor))
    with pytest.raises(PhysicsError, match="nominal model predicts no finite currents"):
        diagnosis_of(broken, workers=1)


def slips(text):
    """Yield changed campaign.toml texts and what is to be said of them."""
    yield text + "\n[background]\ncurrent_ofset = 1e-3\n", "did you mean 'current_offset'"
    first = text.index("[[recording]]")
    yield text + "\n" + text[first : text.index("[[recording]]", first + 5)], "list each table once"


def test_slips_in_campaign_toml_are_one_sentence(small_folder, tmp_path, capsys):
    for k, (text, found) in enumerate(slips((small_folder / "campaign.toml").read_text())):
        folder, out = tmp_path / f"c{k}", tmp_path / f"out{k}"
        shutil.copytree(small_folder, folder)
        (folder / "campaign.toml").write_text(text)
        assert main(["diagnose", str(folder), "--out", str(out), "--quiet"]) == 2
        error = capsys.readouterr().err
        assert found in error
        assert error.count("\n") == 1
        assert not out.exists()


def test_a_place_that_cannot_be_written_is_refused_before_the_run(
    small_folder, tmp_path, capsys, monkeypatch
):
    def begun(*_, **__):
        raise AssertionError("the run began")

    monkeypatch.setattr("sandbox.recordings.importing.read_recordings", begun)
    (tmp_path / "file").write_text("mine")
    for out in (tmp_path / "file", tmp_path / "file" / "below", tmp_path / "new" / (300 * "x")):
        assert main(["diagnose", str(small_folder), "--out", str(out), "--quiet"]) == 2
        error = capsys.readouterr().err
        assert f"cannot write to '{out}"[:200] in error  # a long one is cut
        assert error.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize("wrong", [1.0, 0.975, 1.2, 1.0 / 1.2])
def test_the_floor_is_what_stated_and_seen_noise_agree_on(small_folder, wrong):
    """A stated floor that is wrong by up to a fifth moves the floor by less than twice
    what the seen one errs with four short recordings (2 %), and a right one by less than that, too.
    20 mA of white noise are the truth."""
    campaign, rng = read_folder(small_folder), np.random.default_rng(0)
    noisy = with_currents(campaign, lambda i: i + 0.02 * rng.standard_normal(len(i)))
    true = np.hypot(0.02, stated_noise_std(campaign.drive.converter))
    assert noise_std_of(noisy, wrong * true) == pytest.approx(true, rel=0.04)


def locked(i, u, noise):
    """Return a campaign of one locked rotor: current (n,) and voltage along alpha, two sensors with
    noise (A)."""
    a, b = np.stack([i, -0.5 * i]) + noise * np.random.default_rng(2).standard_normal((2, len(i)))
    columns = {"u_alpha": u, "i_a": a, "i_b": b, "i_c": -a - b, "t": 1e-4 * np.arange(len(u))}
    columns |= dict.fromkeys(("u_beta", "theta"), 0.0 * u) | {"u_dc": 400.0 + 0.0 * u}
    return SimpleNamespace(recordings=[CampaignRecording("a.csv", "locked", "d", columns)])


@pytest.mark.parametrize(
    ("period", "kinks", "told"), [(8, 0.0, True), (4, 0.0, True), (8, 0.05, False)]
)
def test_two_sensors_show_their_noise_where_only_noise_is_left(period, kinks, told):
    """An R-L circuit by Euler's rule in steps of 1/20 of L/R, under a swing and square injection: 5
    mA of white noise on both sensors come out within 1.5 % (VOTE).  Kinks of 50 mA in a tenth of
    the samples, half of the time, as dead time makes them near zero current, are not taken for
    noise."""
    k, rng = np.arange(40_000), np.random.default_rng(1)
    u = 20.0 * np.sin(k / 300.0) + np.where(k % period < period / 2, 5.0, -5.0)
    i = lfilter([0.0, 0.05], [1.0, -0.95], u)
    i += kinks * (rng.random(len(k)) < 0.1) * (k % 4000 < 2000)
    found = two_sensors(locked(i, u, 0.005))
    assert found == (pytest.approx(0.005, rel=0.015) if told else None)


@pytest.mark.parametrize("late", [0, 1])
@pytest.mark.parametrize("band", [0.02, 0.1, 0.3])
def test_a_controller_that_answers_the_noise_hides_none_of_it(band, late):
    """Commands that hold the noise explain it: of u[k] = -K n[k] four changes hold 4.8 s^2 of the 6
    s^2 of second differences, so 0.45 of the true noise would come out.  A proportional controller
    of phase a, of `band` of the sampling rate, without delay and with one sample of it, under
    injection: nothing is said of phase a, and what phase b says, whose noise no command holds, is
    right."""
    k, rng = np.arange(12_000), np.random.default_rng(4)
    noise, i, u = 0.005 * rng.standard_normal((len(k), 2)), 0.0, np.zeros((len(k), 2))
    read, waiting = np.zeros((len(k), 2)), 0.0
    for j in k:
        read[j] = i * np.array([1.0, -0.5]) + noise[j]
        asked = 20.0 * band * (1.0 - read[j, 0]) + (5.0 if j % 8 < 4 else -5.0)
        u[j, 0], waiting = (waiting, asked) if late else (asked, waiting)
        i = 0.95 * i + 0.05 * u[j, 0]
    campaign = locked(np.zeros(len(k)), u[:, 0], 0.0)
    columns = {"i_a": read[:, 0], "i_b": read[:, 1], "i_c": -read.sum(axis=1)}
    campaign.recordings = [
        dataclasses.replace(r, columns={**r.columns, **columns}) for r in campaign.recordings
    ]
    found = two_sensors(campaign)
    assert found is None or found == pytest.approx(0.005, rel=0.02)


@pytest.mark.parametrize(
    ("wider", "told"), [(-0.1, True), (0.0, True), (0.01, True), (0.017, False), (0.05, False)]
)
def test_two_sensors_say_nothing_where_blocks_scatter_more_than_noise(monkeypatch, wider, told):
    """Quartiles of the root of chi-squared (51 degrees of freedom, scipy) are 0.9275 and 1.0609; of
    400 blocks their ratio may be 0.31 / 20 = 1.55 % larger."""
    low, high = np.sqrt(chi2.ppf([0.25, 0.75], 51) / 51) * (0.005, 0.005 * (1.0 + wider))
    squares = [low**2, high**2] * 200
    monkeypatch.setattr("sandbox.gap.two_sensors._blocks", lambda r: squares)
    found = two_sensors(SimpleNamespace(recordings=[SimpleNamespace(rotor="locked")]))
    assert found == (pytest.approx(0.005, rel=1e-3) if told else None)


def test_few_readings_of_two_sensors_say_nothing():
    """A second difference and the eight changes of the voltage from which its command has to follow
    span 10 readings: 2010 make 20 blocks of each phase, 40 in all (FEWEST); one fewer makes 38.  A
    rotor that turns tells nothing."""
    assert two_sensors(locked(np.zeros(2_009), np.zeros(2_009), 0.005)) is None
    assert two_sensors(locked(np.zeros(4), np.zeros(4), 0.005)) is None
    turning = locked(np.zeros(2_010), np.zeros(2_010), 0.005)
    assert two_sensors(turning) == pytest.approx(0.005, rel=0.05)
    turning.recordings = [dataclasses.replace(r, rotor="driven") for r in turning.recordings]
    assert two_sensors(turning) is None


def test_noise_that_cannot_be_seen_is_the_stated_one(small_folder):
    """Ten times the noise is no vote; nor is the sum of two sensors' readings, the third made of
    theirs, where too few blocks of locked rotors are left."""
    campaign = read_folder(small_folder)
    both = [
        dataclasses.replace(r, columns={**r.columns, "i_c": -r.i_a - r.i_b})
        for r in campaign.recordings
    ]
    assert noise_std_of(dataclasses.replace(campaign, recordings=tuple(both)), 0.01) == 0.01
    assert noise_std_of(
        campaign, 10.0 * stated_noise_std(campaign.drive.converter)
    ) == 10.0 * stated_noise_std(campaign.drive.converter)
