"""Numbers of a diagnosis as a trace, by hand: what is drawn where, of how many samples."""

from types import SimpleNamespace

import numpy as np
import pytest

from sandbox.gap.evidence.gap_size import OfRecording
from sandbox.gap.pages import traces
from tests.sandbox.gap.conftest import DRIVE


def test_a_spectrums_bars_are_decibels_over_a_thousandth_of_the_floor(monkeypatch):
    """A line of ten noise floors is 80 dB; bars are drawn half a width before their place."""
    f, size = np.array([10.0, 20.0, 30.0]), np.array([1e-4, 10.0, 1e-3])
    monkeypatch.setattr(traces.looks, "spectrum", lambda values, period: (f, size))
    found = traces._spectrum(1e-3, {"after": None})
    assert found.lines["after"] == pytest.approx([0.0, 80.0, 0.0], abs=1e-9)
    assert found.x == pytest.approx([5.0, 15.0, 25.0])
    assert found.width == pytest.approx(10.0)


@pytest.mark.parametrize(("f", "width"), [([10.0], 1.0), ([10.0, 14.0], 4.0)])
def test_a_bar_is_as_wide_as_two_are_apart(monkeypatch, f, width):
    monkeypatch.setattr(
        traces.looks, "spectrum", lambda values, period: (np.array(f), np.ones(len(f)))
    )
    assert traces._spectrum(1e-3, {"after": None}).width == width


@pytest.mark.parametrize(
    ("samples", "step"), [(400_000, 1), (500_000, 2), (800_000, 2), (800_004, 3)]
)
def test_a_trace_holds_400000_samples_of_a_recording(monkeypatch, samples, step):
    """2 A recorded along d where 1 A along q is simulated, on a rotor that stands at 0.4, ...
    rad."""
    monkeypatch.setattr(traces, "_spectrum", lambda *_: None)
    angle = 0.4 + 0.1 * np.arange(12)

    def read(z):
        return np.real(z[:, None] * np.exp(-2j * np.pi * np.arange(3) / 3.0))

    r = SimpleNamespace(
        samples=samples,
        first=0,
        motion=SimpleNamespace(angle=angle),
        read=read(2.0 * np.exp(1j * angle)),
    )
    p = SimpleNamespace(currents=[None, read(1j * np.exp(1j * angle))[:, :, None]])
    x = SimpleNamespace(
        current=read(3j * np.exp(1j * angle))[:, :, None], motion=np.ones((12, 1)), angle=None
    )
    found = dict(traces._recording(1, 1e-3, {"before": (r, p, x), "after": (r, p, x)}))
    few = -(-12 // step)
    assert found["current_d"].x[:3] == pytest.approx(step * 1e-3 * np.arange(3))
    assert len(found["current_d"].x) == -(-samples // step)
    assert found["current_d"].lines["recorded"] == pytest.approx(np.full(few, 2.0))
    assert found["current_q"].lines["recorded"] == pytest.approx(np.zeros(few), abs=1e-12)
    assert found["current_q"].lines["simulated before"] == pytest.approx(np.ones(few))
    assert found["residual_q"].lines["after"] == pytest.approx(np.full(few, -1.0))
    assert found["residual_d"].lines["after"] == pytest.approx(np.full(few, 2.0))
    assert found["motion"].lines["after"].tolist() == [1.0] * few
    assert "angle" not in found
    assert [len(found[x].colours) for x in ("current_d", "residual_d", "residual_q", "motion")] == [
        3,
        2,
        2,
        2,
    ]


def test_a_trace_has_a_tab_of_each_recording(monkeypatch, tmp_path):
    """What is shown of the second: its own inputs, the prediction of all, its own residual, before
    and after."""
    made = {}
    points = {
        name: SimpleNamespace(
            name=name, prepared=SimpleNamespace(recordings=[f"{name} a", f"{name} b"])
        )
        for name in ("before", "after")
    }
    monkeypatch.setattr(
        traces, "_seen", lambda p: (f"{p.name} all", [f"{p.name} 0", f"{p.name} 1"])
    )
    monkeypatch.setattr(traces, "decompose", lambda p, own: (p.name, own))
    monkeypatch.setattr(traces, "_whole", lambda a, parts: [("parts", parts)])
    monkeypatch.setattr(
        traces, "_recording", lambda k, period, shown: [("plot", (k, period, shown))]
    )
    monkeypatch.setattr(traces, "_text", lambda a: "told")
    monkeypatch.setattr(traces, "write_series", lambda path, title, text, tabs: made.update(tabs))
    files = [SimpleNamespace(file=f"{x}.parquet") for x in "ab"]
    d = SimpleNamespace(
        before=SimpleNamespace(point=points["before"]),
        after=SimpleNamespace(point=points["after"]),
        held_out=(1,),
        start=SimpleNamespace(prepared=SimpleNamespace(recordings=files)),
        campaign=SimpleNamespace(name="x", drive=DRIVE),
    )
    traces.write_traces(tmp_path, SimpleNamespace(diagnosis=d))
    assert list(made) == ["Overview", "a", "b, held out"]
    assert made["Overview"]["parts"]["after"] == ("after", ["after 0", "after 1"])
    shown = {name: (f"{name} b", f"{name} all", f"{name} 1") for name in ("before", "after")}
    assert made["b, held out"]["plot"] == (1, 0.25e-3, shown)


def test_bars_of_width_one_stand_around_their_place(monkeypatch):
    """Recordings 1 and 2, orders n: drawn from half before on; what is left, 2 of 8, in shares of
    the gap before."""
    monkeypatch.setattr(traces, "waterfall", lambda a: (["before", "+ PWM delay"], [5.0, 1.0]))
    rows = [SimpleNamespace(before=4.0, after=2.0)] * 2
    parts = {
        name: SimpleNamespace(excess=e, electrical={2: 0.5}, mechanical={1: 0.25})
        for name, e in (("before", 8.0), ("after", 2.0))
    }
    a = SimpleNamespace(diagnosis=SimpleNamespace(size=SimpleNamespace(recordings=rows)))
    found = dict(traces._whole(a, parts))
    assert found["recordings"].x.tolist() == found["waterfall"].x.tolist() == [0.5, 1.5]
    steps = {k: v.tolist() for k, v in found["waterfall"].lines.items()}
    assert steps == {"1_before": [5.0, 0.0], "2_PWM_delay": [0.0, 1.0]}
    k = traces.ORDERS.index(2)
    own = found["electrical"]
    assert (own.x[k], own.lines["before"][k], own.lines["after"][k]) == (1.5, 50.0, 12.5)
    assert own.lines["before"].sum() == 50.0
    assert (found["mechanical"].x[0], found["mechanical"].lines["after"][0]) == (0.5, 6.25)


def test_recordings_are_numbered_from_one(monkeypatch):
    for name in ("where_text", "which_text", "far_text", "next_text"):
        monkeypatch.setattr(traces.answers, name, lambda a: "told")
    rows = [OfRecording("a.parquet", 4.0, 2.0, False), OfRecording("b.parquet", 3.0, 1.0, True)]
    d = SimpleNamespace(campaign=SimpleNamespace(name="x"), size=SimpleNamespace(recordings=rows))
    d.start = SimpleNamespace(prepared=SimpleNamespace(noise_std=0.002))
    said = traces._text(SimpleNamespace(diagnosis=d))
    assert "One noise floor is 2 mA." in said
    found = said.splitlines()[-2:]
    assert found == [
        "| 1 | a.parquet | 4.00 | 2.00 |",
        "| 2 | b.parquet (held out) | 3.00 | 1.00 |",
    ]
