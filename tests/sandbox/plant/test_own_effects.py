"""Effects of one's own: the example beside the switched bench, which has both, and what is refused.

The plant is compiled once a process, so the example runs in a process of its own; its fan's coefficient is planted on
the switched bench (phase equations, no code shared).
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import sandbox.plant.electrical as electrical  # from here on an effect comes too late
from model import compiled
from model.effects import adopt
from model.effects.card import At, Effect, Parameter
from model.effects.library import load_effect
from model.effects.own import EQUATIONS
from model.errors import BadInput
from sandbox.validation.switched import inverter

ROOT = Path(__file__).parents[3]
EXAMPLE = ROOT / "experiments" / "my_effects.py"
RUN = """
import math
import numpy as np
from model.effects.adopt import adopt
print(*[c.name for c in adopt({example!r})])
import sandbox.plant.ports as ports
from model.drive_files import load_drive
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.plant.sets import batch_of, complete
from sandbox.replay.replay import prepare, replay
from sandbox.validation.switched.bench_numbers import bench, quiet
from sandbox.validation.switched.advance import replay as switched
drive = load_drive("ipm")
n, h, k = 1600, drive.converter.sampling_period, {fan}
b = quiet(bench(drive.motor, drive.converter))._replace(fan=k)
u = np.full(n, 20.0 + 0.0j)
theta = 0.3
angle = 0.3 + 0.5 * 400.0 * (h * np.arange(n)) ** 2
u = (10.0 + 0.1 * 400.0 * h * np.arange(n)) * np.exp(1j * (angle + 1.6))
r = switched(b, "free", u.real, u.imag, 400.0, theta=0.3, speed=60.0)
columns = {{"t": h * np.arange(n), "u_alpha": u.real, "u_beta": u.imag, "theta": r["theta"], "u_dc": np.full(n, 400.0)}}
columns |= {{name: r[name] for name in ("i_a", "i_b", "i_c")}} | {{"load_torque": np.zeros(n)}}
c = Campaign("fan", drive, (CampaignRecording("free", "free", "none", columns),), {{}}, {{}}, False)
for values in ({{"fan.coefficient": k}}, {{}}):
    moved = replay(prepare(c, values, steps=1), [values]).motion[0][200:, 0]
    print(float(np.sqrt(np.mean(moved**2))))
values = complete(drive.motor, drive.converter, {{"resolver.amplitude": 0.004, "resolver.phase": 0.7}})
w = batch_of(drive.motor, drive.converter, [values], 1)
print(max(abs(ports.angle(w, 0, x, 6.0) - 6.0 * 0.004 * math.sin(2.0 * x + 0.7)) for x in np.linspace(-3.0, 9.0, 50)))
"""


def test_the_examples_fan_and_resolver_enter_the_plant(tmp_path):
    """With the fan a free rotor's innovations vanish (0.1 of a reading's standard deviation, as for library effects,
    tests/sandbox/replay/test_replay.py); the resolver's error is its equation to rounding (sums of a few 1e-2:
    1e-15)."""
    script = tmp_path / "run.py"
    script.write_text(RUN.format(example=str(EXAMPLE), fan=2e-5), encoding="utf-8")
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=env, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    names, with_it, without, error = done.stdout.strip().splitlines()
    assert names == "fan resolver"
    assert float(with_it) < 0.1
    assert float(without) > 10.0 * float(with_it)
    assert float(error) < 1e-14


def test_kernels_that_hold_no_effect_are_not_compiled_again(monkeypatch):
    """The plant imports the ports, the switched bench shares no code with it."""
    monkeypatch.setattr(compiled, "_folder", lambda key: key)
    monkeypatch.setattr(compiled, "_MORE", [])
    plant, bench = (compiled._folder_of(f.py_func) for f in (electrical.begin, inverter.settle))
    monkeypatch.setattr(compiled, "_MORE", [("mine", EQUATIONS)])
    assert compiled._folder_of(electrical.begin.py_func) == f"{plant}-mine"
    assert compiled._folder_of(inverter.settle.py_func) == bench


def test_effects_after_the_plant_come_too_late():
    with pytest.raises(BadInput, match="compiled already"):
        adopt.adopt(EXAMPLE)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("EFFECTS = ()", "no effects"),
        ("x = (", "SyntaxError"),
        ("1 / 0", "ZeroDivisionError"),
        ("raise SystemExit(7)", "SystemExit"),
        ("EFFECTS = ('fan',)", "no effects"),
    ],
)
def test_a_file_that_holds_no_effects_is_refused_in_a_sentence(tmp_path, text, said):
    file = tmp_path / "mine.py"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=said) as refusal:
        adopt._cards(file, "sensorless_effects_test")
    assert "\n" not in str(refusal.value)


def card(name="mine", at=(), numbers=("size",), repeats=1):
    """Return a card."""
    return Effect(
        name=name, repeats=repeats, summary="", subsystem="mechanics", equation="", source="", at=at, axis="",
        order="", region="",
        parameters=tuple(Parameter(n, "", 0.0, -1.0, 1.0, 0.1) for n in numbers), confused_with=(), separated_by="",
    )  # fmt: skip


DRAG = load_effect("viscous_friction").at[0].equation  # takes (coefficient, omega)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (card("dead_time", (At("friction", DRAG, ("size",)),)), "already"),
        (card("../x", (At("friction", DRAG, ("size",)),)), "no name"),
        (card(), "no equation"),
        (card(numbers=("a\x1b[2J",)), "no name"),
        (replace(card(), summary="a\nb\x1b[2J"), r"'a\\nb\\x1b\[2J' in 'mine' is no line"),
        (card(at=(At("wind", DRAG, ("size",)),)), "ports are"),
        (card(at=(At("friction", DRAG, ("length",)),)), "none of its parameters"),
        (card(at=(At("winding", DRAG, ("size",)),)), "must be @inlined"),
        (card(at=(At("friction", abs, ("size",)),)), "must be @inlined"),
        (card(at=(At("friction", DRAG, ("size",)),), repeats=3), "repeats at the port 'friction'"),
        (card(at=(At("friction", DRAG, ("size",)),), repeats=0), "give 1 ..."),
    ],
)
def test_a_card_that_the_plant_cannot_take_is_refused(wrong, said):
    with pytest.raises(BadInput, match=said):
        adopt._check(wrong, Path("mine.py"))
