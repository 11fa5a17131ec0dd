"""A package of somebody else brings an estimator, an effect and a preset by entry points: made, installed, used."""

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
METADATA = "Metadata-Version: 2.1\nName: bench-pack\nVersion: 1.5\nSummary: what our bench has\n"
ENTRY_POINTS = """[sensorless.estimators]
mine_of_pack = bench_pack.observer:ESTIMATOR

[sensorless.effects]
fan = bench_pack.effects

[sensorless.presets]
ourlog = bench_pack.presets
"""
OBSERVER = """
import dataclasses
import sandbox
ESTIMATOR = dataclasses.replace(sandbox.load_estimator("qnull"), name="mine_of_pack", summary="of our bench")
"""
# in the scratch environment: every list, a run with the effect, a run of the estimator, the preset's column
USES = """
import sandbox
from sandbox.cli import main
from sandbox.recordings.formats.presets import with_preset
assert sandbox.list_estimators()["mine_of_pack"] == "what our bench has (package bench-pack 1.5)"
assert "fan" in sandbox.list_effects() and "fan.coefficient" in sandbox.describe("fan")
assert "ourlog" in sandbox.list_presets()
assert with_preset("ourlog", {}, {})[1]["t"].column == "stamp"
still = sandbox.Scenario("still", (sandbox.Segment(0.02),), start_up=False)
runs = {name: sandbox.simulate("ipm_exchanged", still, name) for name in ("qnull", "mine_of_pack")}
assert runs["qnull"].error_deg == runs["mine_of_pack"].error_deg
sandbox.simulate("ipm_exchanged", still, "mine_of_pack", effects={"fan.coefficient": 1e-6})
assert main(["list", "estimators", "mine_of_pack"]) == 0
assert main(["simulate", "--estimator", "mine_of_pak"]) == 2
print("used")
"""


def wheel_of(folder: Path) -> Path:
    """Write the package as a wheel: an archive of its files with entry points beside them."""
    import zipfile

    preset = (FOLDER / "odrive.toml").read_text(encoding="utf-8")
    head, _, rest = preset.partition("[columns]\n")
    fan = (ROOT / "experiments" / "my_effects.py").read_text(encoding="utf-8")
    info = "bench_pack-1.5.dist-info"
    files = {
        "bench_pack/__init__.py": "", "bench_pack/observer.py": OBSERVER, "bench_pack/effects.py": fan,
        "bench_pack/presets/__init__.py": "",
        "bench_pack/presets/ourlog.toml": f'{head}[columns]\nt = {{column = "stamp", unit = "s"}}\n',
        f"{info}/METADATA": METADATA, f"{info}/entry_points.txt": ENTRY_POINTS,
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }  # fmt: skip
    assert rest
    path = folder / "bench_pack-1.5-py3-none-any.whl"
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in files.items():
            archive.writestr(name, text)
        record = [*(f"{name},," for name in files), f"{info}/RECORD,,"]
        archive.writestr(f"{info}/RECORD", "\n".join(record))
    return path


def test_a_package_of_somebody_else_is_installed_and_used(tmp_path):
    """In a scratch environment with pip; the libraries are those of this one."""
    venv = tmp_path / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    python = venv / "bin" / "python"
    call = [str(python), "-m", "pip", "install", "-q", "--no-deps", "--no-index", str(wheel_of(tmp_path))]
    subprocess.run(call, check=True, capture_output=True)
    libraries = [place for place in sys.path if place.endswith("site-packages")]
    around = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), *libraries])}
    done = subprocess.run([str(python), "-c", USES], cwd=tmp_path, env=around, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.endswith("used\n")
    assert "did you mean 'mine_of_pack'?" in done.stderr


class Point:
    """An entry point of a package that is broken."""

    dist = None

    def __init__(self, name, value, loaded=None):
        self.name, self.value, self.module, self.loaded = name, value, value.partition(":")[0], loaded

    def load(self):
        """Return what it names, or fail as that does."""
        if self.loaded is None:
            raise ImportError("no module of theirs")
        return self.loaded


def test_what_a_broken_package_brings_is_told_in_a_sentence(monkeypatch):
    points = {"theirs": Point("theirs", "pack:E"), "other": Point("other", "pack:X", loaded=3)}
    monkeypatch.setattr("estimators.registry.brought", lambda kind: points)
    assert sandbox.list_estimators()["theirs"] == "of another package"
    with pytest.raises(BadInput, match="'theirs' of another package cannot be loaded: ImportError: no module of"):
        sandbox.load_estimator("theirs")
    with pytest.raises(BadInput, match="'pack:X' of another package is no Estimator of the name 'other'"):
        sandbox.load_estimator("other")
    with pytest.raises(BadInput, match="names the module 'no_such_pack', which is no file"):
        plugins.place_of(Point("fan", "no_such_pack"))
    with pytest.raises(BadInput, match="cannot be found: ModuleNotFoundError"):
        plugins.place_of(Point("fan", "no_such_pack.effects"))


def test_ours_are_not_given_away(monkeypatch):
    monkeypatch.setattr("estimators.registry.brought", lambda kind: {"qnull": Point("qnull", "pack:E")})
    assert list(sandbox.list_estimators()).count("qnull") == 1
    assert "null" in sandbox.list_estimators()["qnull"]
    assert sandbox.load_estimator("qnull").compiled
