"""A refitted motor with a flux map takes its map along, and is the motor that it was."""

import tomllib

from model.drive_files import load_drive
from model.effect_files import effects_and_angles
from sandbox.output.refitted import Refitted
from sandbox.output.toml import toml_text
from tests.fuzz.whole import make_map


def test_a_flux_map_goes_along(tmp_path):
    make_map("npz")(tmp_path)
    drive, out = load_drive(tmp_path / "mine.toml"), tmp_path / "out"
    out.mkdir()
    effects = {
        "dead_time.time": 2e-6,
        "cogging_torque.2.order_mech": 12.0,
        "bench.soft_current": 0.02,
    }
    ci95 = {"resistance": (12.0, 12.3), "dead_time.time": (1e-6, 3e-6)}
    Refitted(
        drive,
        effects,
        {"a b.parquet": 1e-4},
        ci95,
        {"dead_time.time": "s"},
        {"a b.parquet": 0.98},
        "A test",
        offsets={"a b.parquet": (0.01, -0.02, 0.01)},
    ).write(out)
    assert sorted(p.name for p in out.iterdir()) == ["effects.toml", "mine.npz", "motor.toml"]
    assert load_drive(out / "motor.toml").motor == drive.motor
    found = effects_and_angles(out / "effects.toml")
    assert found == (effects, {"a b.parquet": 1e-4}, {"a b.parquet": (0.01, -0.02, 0.01)})
    assert (
        "dead_time.time = 2e-06  # s, 95 % interval 1e-06 to 3e-06"
        in (out / "effects.toml").read_text()
    )


def test_toml_keeps_what_json_lacks():
    """Infinite numbers, names with dots and spaces, tables in tables; empty tables and None are
    left out."""
    tables = [
        ("[a]", {"x y": float("inf"), "b": {"c": {"d": 1.5}}, "none": None}),
        ("[empty]", {}),
        ("[z]", {"é": "\n"}),
    ]
    assert tomllib.loads(toml_text(tables)) == {
        "a": {"x y": float("inf"), "b": {"c": {"d": 1.5}}},
        "z": {"é": "\n"},
    }
