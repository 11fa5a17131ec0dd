"""The draw, the seal and the files: the same by seed, whatever the order; nothing written by
half."""

import hashlib
import tomllib

import numpy as np
import pyarrow.parquet as pq
import pytest
from scipy.interpolate import CubicSpline

from experiments.testbench import bench, cycles, draw, effects, make, maps, seal
from experiments.testbench.design import nominal_design
from experiments.testbench.drives import DRIVES

SERVO = next(d for d in DRIVES if d.name == "servo_400w")


def _short_plans(scale=None, rng=None):
    scale = scale or bench.build(nominal_design(SERVO, None)).scale
    rng = rng or np.random.default_rng(0)
    rows = (
        cycles.locked_cycles(scale, 600, rng)
        + cycles.driven_cycles(scale, 600, rng)
        + cycles.free_cycles(scale, 600, rng)
    )
    return rows[2:3] + rows[6:7] + rows[9:10]


@pytest.fixture
def short(monkeypatch):
    """Recordings of 600 samples (locked) and of the servo only: whole campaigns in a second."""
    monkeypatch.setattr(bench.cycles, "plans", _short_plans)
    monkeypatch.setattr(draw, "DRIVES", (SERVO,))
    monkeypatch.setattr(maps, "maps_folder", lambda folder=None: None)


@pytest.mark.parametrize("kind", draw.KINDS)
def test_each_kind_has_what_it_says(kind):
    for index in range(6):
        truth, _ = draw.draw(kind, 11, index)
        n = len(truth.causes)
        low, high = {
            "one": (1, 1),
            "several": (1, 3),
            "many": (3, 10),
            "outside": (0, 1),
            "none": (0, 0),
        }[kind]
        assert low <= n <= high
        assert len(truth.outside) == (kind == "outside")
        assert all(c["name"] in effects.LIBRARY for c in truth.causes)


def test_one_runs_through_every_name():
    names = {draw.draw("one", 3, k)[0].causes[0]["name"] for k in range(len(effects.LIBRARY))}
    assert names == set(effects.LIBRARY)
    assert len(names) == 26, "as many as DIAGNOSIS.md lists"


def test_the_draw_depends_on_seed_and_index_only():
    first = [draw.draw("many", 5, k)[0] for k in range(4)]
    again = [draw.draw("many", 5, k)[0] for k in (3, 1, 0, 2)]
    assert [first[k] for k in (3, 1, 0, 2)] == again
    assert draw.draw("many", 6, 0)[0] != first[0]


def test_parameters_with_the_ordinary_deviation():
    """An offset of the encoder is the cause's and the background's together."""
    order = draw.generator(3, "one", 0, "order").permutation(len(effects.LIBRARY))
    index = [list(effects.LIBRARY)[k] for k in order].index("encoder_offset")
    truth, d = draw.draw("one", 3, index)
    whole = truth.causes[0]["with_background"]["offset"]
    assert whole == d.sens["angle_offset"]
    assert whole == pytest.approx(
        truth.causes[0]["parameters"]["offset"] + truth.background["encoder_offset"]
    )


def test_deviations_stay_within_what_is_stated():
    """Normal draws held at 2.5 deviations; over 40 benches their spread is near 0.98 sigma, +- 30
    %."""
    values = []
    for k in range(40):
        truth, d = draw.draw("none", 2, k)
        values.append(truth.deviations["resistance"] / 0.01)
        assert all(
            abs(truth.background[b]) <= 2.5 * d.background[b]
            for b in ("encoder_offset", "dead_time")
        )
    assert np.abs(values).max() <= 2.5
    assert 0.67 < np.std(values) < 1.25


@pytest.mark.parametrize("name", [*effects.LIBRARY, *effects.OUTSIDE])
def test_every_cause_changes_the_bench(name):
    """In either form, a part of the compiled bench differs from the neutral one."""
    for own in (False, True):
        neutral = nominal_design(SERVO, None)
        changed = nominal_design(SERVO, None)
        cause = {**effects.LIBRARY, **effects.OUTSIDE}[name]
        parameters, note = cause(changed, 1.0, own, np.random.default_rng(4))
        assert note
        assert all(np.isfinite(v) for v in parameters.values())
        assert repr(bench.build(changed).parts) != repr(bench.build(neutral).parts)


def test_a_campaign_is_written_and_sealed_first(short, tmp_path, capsys):
    digest = make.make(tmp_path, "several", 2, 9)
    assert capsys.readouterr().out.startswith(f"sealed 2 truths, SHA-256 {digest}")
    assert hashlib.sha256((tmp_path / seal.SEALED).read_bytes()).hexdigest() == digest
    assert set(seal.unpack(tmp_path)["truths"]) == {"c0000", "c0001"}
    toml = tomllib.loads((tmp_path / "c0000" / "campaign.toml").read_text())
    assert len(toml["recording"]) == 3
    n = toml["drive"]["sampling_period"]
    for r in toml["recording"]:
        table = pq.read_table(tmp_path / "c0000" / r["file"])
        assert table.column_names == ["t", *bench.COLUMNS]
        t = table["t"].to_numpy()
        np.testing.assert_allclose(t, np.arange(t.size) * n, rtol=1e-12)
        assert all(np.isfinite(table[c].to_numpy()).all() for c in table.column_names)
    stated = bench.campaign_text("c0000", nominal_design(SERVO, None), _short_plans())
    assert (tmp_path / "c0000" / "campaign.toml").read_text() == stated, (
        "what is stated tells nothing of the causes"
    )


def test_a_call_that_was_stopped_goes_on_and_gives_the_same(short, tmp_path):
    make.make(tmp_path / "a", "one", 2, 4, quiet=True)
    made = {p: p.stat().st_mtime_ns for p in (tmp_path / "a").rglob("*.parquet")}
    make.make(tmp_path / "a", "one", 2, 4, quiet=True)
    assert {p: p.stat().st_mtime_ns for p in (tmp_path / "a").rglob("*.parquet")} == made
    make.make(tmp_path / "b", "one", 2, 4, jobs=1, quiet=True)
    for p in (tmp_path / "a").rglob("*.parquet"):
        assert pq.read_table(p).equals(
            pq.read_table(tmp_path / "b" / p.relative_to(tmp_path / "a"))
        )
    with pytest.raises(ValueError, match="another draw"):
        make.make(tmp_path / "a", "one", 2, 5, quiet=True)


def test_a_changed_seal_and_a_wrong_key_are_refused(tmp_path):
    truths = {"x": draw.draw("one", 1, 0)[0]}
    seal.write_seal(tmp_path, seal.pack(truths, {}, "secret"))
    assert seal.unpack(tmp_path, "secret")["truths"]["x"]["kind"] == "one"
    with pytest.raises(ValueError, match="does not open"):
        seal.unpack(tmp_path, "other")
    (tmp_path / seal.SEALED).write_bytes(b"changed")
    with pytest.raises(ValueError, match="was changed"):
        seal.unpack(tmp_path, "secret")


@pytest.mark.parametrize(
    ("arguments", "sentence"), [(["two", "3"], "not one of"), (["one", "0"], "at least 1")]
)
def test_bad_arguments_end_in_a_sentence(arguments, sentence, tmp_path, capsys):
    assert make.main([str(tmp_path), *arguments]) == 2
    assert sentence in capsys.readouterr().err
    assert not any(tmp_path.iterdir())


def test_what_is_recorded_is_what_was(short):
    """A control without drawn deviations: reading less truth is noise of the drawn size and half a
    count.

    Coloured or white, its deviation is `noise_over_stated` times the stated noise; resolution^2/12
    is added.
    """
    truth, d = draw.draw("none", 8, 0)
    runs = bench.recordings(truth, d)
    for r in runs:
        c = r.columns
        ab = np.column_stack(
            [(2 * c[:, 2] - c[:, 3] - c[:, 4]) / 3, (c[:, 3] - c[:, 4]) / np.sqrt(3)]
        )
        rest = ab - r.really[:, :2]
        gain = np.array(truth.background["current_gain"]).mean()
        rest -= (gain - 1) * r.really[:, :2]
        sigma = np.hypot(
            d.noise * truth.ordinary["noise_over_stated"], 0.002 * d.drive.current / np.sqrt(12)
        )
        # amplitude-invariant: 2/3 of a phase's variance on either axis
        expected = sigma * np.sqrt(2 / 3)
        assert rest.std(0) == pytest.approx([expected, expected], rel=0.25), r.plan.name


def _averaged(d, columns):
    """Currents i_d, i_q by the format's words alone: u_k acts over [t_k, t_k+1) as its mean, scaled
    by the true link.

    The paper's equations (elecd)-(iq) in the rotor frame, Runge-Kutta steps of a tenth of a period,
    angle and speed by a cubic through the recorded angles.
    """
    t, ts = d.true, d.drive.period
    angle = CubicSpline(np.arange(len(columns)) * ts, columns[:, 5])

    def currents(f):
        i_d = f[0] / t["inductance_d"] + 3 * t["alpha_30"] * f[0] ** 2 + t["alpha_12"] * f[1] ** 2
        i_d += 4 * t["alpha_40"] * f[0] ** 3 + 2 * t["alpha_22"] * f[0] * f[1] ** 2
        i_q = (
            f[1] / t["inductance_q"]
            + 2 * t["alpha_12"] * f[0] * f[1]
            + 2 * t["alpha_22"] * f[0] ** 2 * f[1]
        )
        return np.array([i_d, i_q + 4 * t["alpha_04"] * f[1] ** 3])

    def slope(time, f, u):
        c, s, w = np.cos(angle(time)), np.sin(angle(time)), angle(time, 1)
        v = np.array([c * u[0] + s * u[1], c * u[1] - s * u[0]]) - t["resistance"] * currents(f)
        return v + w * np.array([f[1], -f[0] - t["magnet_flux"]])

    f, out = np.zeros(2), []
    for k, row in enumerate(columns):
        out.append(currents(f))
        u = row[:2] * d.drive.link / row[6]
        for n in range(10):
            time, h = (k + n / 10) * ts, ts / 10
            a = slope(time, f, u)
            b = slope(time + h / 2, f + h / 2 * a, u)
            f = f + h * b
    return np.array(out)


@pytest.mark.parametrize("which", [0, 1])
def test_an_averaged_replay_meets_a_neutral_bench(which):
    """Locked under injection, and turned: a bench with no deviation and no noise is what the
    format's words say.

    A centred pulse and its mean voltage leave, at t_k, what the ripple does through R and the
    curvature of H within a period: of the order of R T_s/L times the ripple, here (0.03)^2 of a
    ripple of 2 A: 2 mA of 3.9
    A; 6 mA are allowed.
    """
    truth, d = draw.draw("none", 8, 0)
    d = nominal_design(SERVO._replace(lines=0, counter=1e13), None)
    truth.background["load_torque_offset"] = 0.0
    truth.ordinary |= {
        "noise_over_stated": 0.0,
        "jitter": 0.0,
        "begins_under_current": 0.0,
        "uneven_speed": 0.0,
    }
    built = bench.build(d)
    sensors = built.parts[4]._replace(resolution=0.0)
    built = built._replace(parts=(*built.parts[:4], sensors))
    r = bench.record(built, _short_plans(built.scale)[which], truth, np.random.default_rng(1))
    c, s = np.cos(r.columns[:, 5]), np.sin(r.columns[:, 5])
    i_d = c * r.really[:, 0] + s * r.really[:, 1]
    i_q = c * r.really[:, 1] - s * r.really[:, 0]
    replayed = _averaged(d, r.columns)
    assert np.abs(i_q).max() > 1.0
    assert np.abs(replayed - np.column_stack([i_d, i_q])).max() < 6e-3
