"""Packages of somebody else bring an estimator, an effect and a preset by entry points: made,
installed, used."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

import sandbox
from model import plugins
from model.errors import BadInput
from sandbox.recordings.formats.presets import FOLDER

ROOT = Path(__file__).resolve().parents[3]
METADATA = "Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\nSummary: what our bench has\n"
WHEEL = "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
POINTS = """[sensorless.estimators]
mine_of_pack = bench_pack.observer:ESTIMATOR

[sensorless.presets]
ourlog = bench_pack.presets
"""
OBSERVER = """
import dataclasses
import sandbox
ESTIMATOR = dataclasses.replace(sandbox.load_estimator("qnull"), name="mine_of_pack", summary="of our bench")
"""  # noqa: E501
# beside the package: the lists, a run of the estimator, the preset's column
USES = """
import sandbox
from sandbox.cli import main
from sandbox.recordings.formats.presets import with_preset
assert sandbox.list_estimators()["mine_of_pack"] == "what our bench has (package bench-pack 1.5)"
assert "ourlog" in sandbox.list_presets()
assert with_preset("ourlog", {}, {})[1]["t"].column == "stamp"
still = sandbox.Scenario("still", (sandbox.Segment(0.02),), start_up=False)
runs = {name: sandbox.simulate("ipm_exchanged", still, name) for name in ("qnull", "mine_of_pack")}
assert runs["qnull"].error_deg == runs["mine_of_pack"].error_deg
assert main(["list", "estimators", "mine_of_pack"]) == 0
assert main(["simulate", "--estimator", "mine_of_pak"]) == 2
print("used")
"""
# with an effect: its list and card, its equation in the plant's own port, for a fan at 3 rad/s
TURNS = """
import sandbox
from model.drive_files import load_drive
from sandbox.plant.sets import batch_of, complete
assert "fan" in sandbox.list_effects() and "fan.coefficient" in sandbox.describe("fan")
import sandbox.plant.ports as ports
drive = load_drive("ipm")
values = complete(drive.motor, drive.converter, {"fan.coefficient": 1e-6})
assert ports.load(batch_of(drive.motor, drive.converter, [values], 1), 0, -3.0) == -9e-6
print("turns")
"""


def wheel_of(folder: Path, name: str, files: dict[str, str], points: str) -> Path:
    """Write a package as a wheel: an archive of its files with entry points beside them."""
    import zipfile

    info = f"{name}-1.5.dist-info"
    about = {
        "METADATA": METADATA.format(name=name.replace("_", "-")),
        "entry_points.txt": points,
        "WHEEL": WHEEL,
    }
    files = {f"{name}/{file}": text for file, text in files.items()}
    files |= {f"{info}/{file}": text for file, text in about.items()}
    path = folder / f"{name}-1.5-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for file, text in files.items():
            archive.writestr(file, text)
        record = [*(f"{file},," for file in files), f"{info}/RECORD,,"]
        archive.writestr(f"{info}/RECORD", "\n".join(record))
    return path


def used(wheel: Path, code: str) -> subprocess.CompletedProcess[str]:
    """Return what code did beside a wheel that pip has unpacked into a folder of its own."""
    place = wheel.parent / "installed"
    call = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "-q",
        "--no-deps",
        "--no-index",
        "-t",
        str(place),
        str(wheel),
    ]
    subprocess.run(call, check=True, capture_output=True)
    around = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(place)])}
    return subprocess.run(
        [sys.executable, "-c", code], cwd=wheel.parent, env=around, capture_output=True, text=True
    )


def test_a_package_of_somebody_else_is_installed_and_used(tmp_path):
    preset = (FOLDER / "odrive.toml").read_text(encoding="utf-8")
    head, _, rest = preset.partition("[columns]\n")
    assert rest
    files = {
        "__init__.py": "",
        "observer.py": OBSERVER,
        "presets/__init__.py": "",
        "presets/ourlog.toml": f'{head}[columns]\nt = {{column = "stamp", unit = "s"}}\n',
    }
    done = used(wheel_of(tmp_path, "bench_pack", files, POINTS), USES)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("used\n")
    assert "did you mean 'mine_of_pack'?" in done.stderr


def test_an_effect_of_a_package_enters_the_plant(tmp_path):
    """Its equation at its port; what a whole plant with it does is in
    tests/sandbox/plant/test_sets_own_effects.py."""
    fan = (ROOT / "experiments" / "my_effects.py").read_text(encoding="utf-8")
    points = "[sensorless.effects]\nfan = fan_pack.effects\n"
    done = used(
        wheel_of(tmp_path, "fan_pack", {"__init__.py": "", "effects.py": fan}, points), TURNS
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout == "turns\n"


class Point:
    """An entry point of a package that is broken."""

    dist = None

    def __init__(self, name, value, loaded=None):
        self.name, self.value, self.module, self.loaded = (
            name,
            value,
            value.partition(":")[0],
            loaded,
        )

    def load(self):
        """Return what it names, or fail as that does."""
        if self.loaded is None:
            raise ImportError("no module of theirs")
        return self.loaded


def test_what_a_broken_package_brings_is_told_in_a_sentence(monkeypatch):
    points = {"theirs": Point("theirs", "pack:E"), "other": Point("other", "pack:X", loaded=3)}
    monkeypatch.setattr("estimators.registry.brought", lambda kind: points)
    assert sandbox.list_estimators()["theirs"] == "of another package"
    with pytest.raises(
        BadInput, match="'theirs' of another package cannot be loaded: ImportError: no module of"
    ):
        sandbox.load_estimator("theirs")
    with pytest.raises(
        BadInput, match="'pack:X' of another package is no Estimator of the name 'other'"
    ):
        sandbox.load_estimator("other")
    with pytest.raises(BadInput, match="names the module 'no_such_pack', which is no file"):
        plugins.place_of(Point("fan", "no_such_pack"))
    with pytest.raises(BadInput, match="cannot be found: ModuleNotFoundError"):
        plugins.place_of(Point("fan", "no_such_pack.effects"))


def test_ours_are_not_given_away(monkeypatch):
    monkeypatch.setattr(
        "estimators.registry.brought", lambda kind: {"qnull": Point("qnull", "pack:E")}
    )
    assert list(sandbox.list_estimators()).count("qnull") == 1
    assert "null" in sandbox.list_estimators()["qnull"]
    assert sandbox.load_estimator("qnull").compiled
