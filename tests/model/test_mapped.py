"""A motor from a flux map: the user's file, what it may not say, what is remembered, what is
missing."""

import io

import numpy as np
import pytest

from model.drive_files import load_drive, mapped_names
from model.energy import flux_from_current, inductances
from model.errors import BadInput, PhysicsError
from model.fluxmap import FluxMap, write_map
from model.kernels.kept import note, read, write
from model.mapped import held_by_data, mapped_motor
from tests.data import real_data
from tests.model.planted_map import write_square

TEXT = """
[motor]
pole_pairs = 6
resistance = 12.15
inertia = 0.0011
rated_current = 1.2
rated_torque = 1.06
rated_speed_rpm = 1800.0
[flux_map]
file = "mine.csv"
"""
CHOICE = "cells = [8, 6]\nsmooth = 1e-6\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path / "cache"))
    write_square(tmp_path / "mine.csv")
    (tmp_path / "mine.toml").write_text(TEXT + CHOICE)
    return tmp_path


@pytest.mark.parametrize("name", ["mine.toml", "mine.csv"])
def test_a_user_s_map_gives_back_the_motor_it_was_computed_from(folder, name):
    found, motor = load_drive(folder / name).motor, load_drive("ipm_exchanged").motor
    assert found.name == "mine"
    # the spline's space holds the quartic; smoothness 1e-6 leaves less than 1e-3
    # (test_spline_energy)
    for key in ("inductance_d", "inductance_q", "magnet_flux"):
        assert getattr(found, key) == pytest.approx(getattr(motor, key), rel=2e-3), key
    at = (0.5, -1.3)
    np.testing.assert_allclose(
        inductances(found.energy, *at), inductances(motor.energy, *at), rtol=2e-3
    )
    with pytest.raises(
        PhysicsError,
        match=r"i_q = 30 A is outside the motor's flux map: .* the map ends at i_d = 0 A",
    ):
        flux_from_current(found.energy, 0.0, 30.0)


def test_a_fit_is_remembered_until_the_map_changes(folder, monkeypatch, capsys):
    note.cache_clear()  # said once a process
    first = load_drive(folder / "mine.toml").motor
    assert len(list((folder / "cache" / "maps").glob("*.kept"))) == 1
    with monkeypatch.context() as patched:
        patched.setattr("model.mapped._fitted", lambda *_: pytest.fail("fitted again"))
        again = load_drive(folder / "mine.toml").motor
    assert capsys.readouterr().err == ""
    assert again == first
    assert hash(again) == hash(first)
    np.testing.assert_array_equal(again.spline.cells, first.spline.cells)
    stored = next((folder / "cache" / "maps").glob("*.kept"))
    stored.write_bytes(b"damaged")
    assert load_drive(folder / "mine.toml").motor == first
    rows = (folder / "mine.csv").read_text().splitlines()
    cells = rows[40].split(",")
    rows[40] = ",".join([*cells[:2], repr(float(cells[2]) * 1.01), cells[3]])
    (folder / "mine.csv").write_text("\n".join(rows))
    assert load_drive(folder / "mine.toml").motor != first


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: t.replace("[flux_map]", "inductance_d = 0.05\n[flux_map]"),
            "inductance_d comes from the flux map",
        ),
        (
            lambda t: t.replace("file =", "fil ="),
            r"unknown key in \[flux_map\] 'fil'; did you mean 'file'",
        ),
        (
            lambda t: t.replace("mine.csv", "other.csv"),
            "other.csv' does not exist; give a flux map",
        ),
        (lambda t: t.replace("[8, 6]", "[8]"), "give both, cells"),
        (lambda t: t + 'magnet = "x"\n', "magnet axis 'x' is not known"),
        (lambda t: t.replace("resistance = 12.15\n", ""), r"\[motor\] lacks 'resistance'"),
        (
            lambda t: t + 'dataset = "brusa"\n',
            "unknown data set 'brusa'; did you mean 'brusa_hsm1'",
        ),
    ],
)
def test_what_is_wrong_is_named(folder, change, message):
    (folder / "mine.toml").write_text(change(TEXT + CHOICE))
    with pytest.raises(BadInput, match=message):
        load_drive(folder / "mine.toml")


def test_a_map_alone_says_what_to_write_beside_it(folder):
    (folder / "mine.toml").unlink()
    with pytest.raises(
        BadInput, match=r"gives no resistance, pole pairs and ratings; write them into 'mine.toml'"
    ):
        load_drive(folder / "mine.csv")


@pytest.mark.parametrize("name", mapped_names())
def test_missing_data_are_one_sentence(name, tmp_path, monkeypatch):
    monkeypatch.setenv("SENSORLESS_DATA", str(tmp_path))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr("importlib.import_module", _no_pooch)
    with pytest.raises(BadInput, match=f"data set '{name}' is neither in SENSORLESS_DATA"):
        load_drive(name)


def _no_pooch(name, *_):
    raise ImportError(name)


def test_a_map_with_its_magnet_on_another_axis_is_named(folder):
    """The same map turned by 90 degrees: at i_q = 0 its q flux is the magnet's."""
    (folder / "mine.toml").write_text(TEXT + CHOICE + 'magnet = "-q"\n')
    with pytest.raises(
        BadInput,
        match=r"psi_q is .* Wb at i_q = 0 .* so the magnet is not on the d axis: .*magnet = \"d\"",
    ):
        load_drive(folder / "mine.toml")


def test_a_flux_that_falls_with_its_current_is_named(folder):
    rows = (folder / "mine.csv").read_text().splitlines()
    cells = rows[1 + 17 * 8 + 3].split(",")  # i_d = 0, the fourth i_q: -3.2 + 3 x 0.4 A
    rows[1 + 17 * 8 + 3] = ",".join([*cells[:3], "0.5"])
    (folder / "mine.csv").write_text("\n".join(rows))
    with pytest.raises(
        BadInput, match=r"wild points: i_d = 0 A, i_q = -2 A \(line 141\): .* psi_q = 0.5 Wb"
    ):
        load_drive(folder / "mine.toml")


def test_a_changed_number_of_a_kept_fit_is_not_believed(folder, capsys):
    note.cache_clear()  # said once a process
    first = load_drive(folder / "mine.toml").motor
    kept = next((folder / "cache" / "maps").glob("*.kept"))
    whole = kept.read_bytes()
    for k in range(70, len(whole), len(whole) // 7):
        kept.write_bytes(whole[:k] + bytes([whole[k] ^ 4]) + whole[k + 1 :])
        assert load_drive(folder / "mine.toml").motor == first
    assert "was damaged and is made anew" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["cells", "rest", "magnet"])
@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_a_kept_fit_that_is_whole_but_no_fit_is_made_anew(folder, name, value):
    """Under a right seal, as an earlier state of the code might have left it."""
    first = load_drive(folder / "mine.toml").motor
    place = next((folder / "cache" / "maps").glob("*.kept"))
    with np.load(io.BytesIO(read(place))) as kept:
        arrays = dict(kept)
    body = io.BytesIO()
    np.savez(body, **arrays | {name: np.full_like(arrays[name], value)})
    write(place, body.getvalue())
    found = load_drive(folder / "mine.toml").motor
    believed = (
        name == "magnet" and value == 0.0
    )  # a motor may have none: nothing else that is kept says how large it is
    assert (found == first) != believed


def test_currents_between_the_points_are_held_by_the_data():
    """The SEW map: currents up to 16 A, corners beyond the circle without a value, i_d up to 1
    A."""
    folder = real_data() / "sew_map"
    values = {
        "name": "sew",
        "pole_pairs": 4,
        "resistance": 0.208,
        "inertia": 0.02,
        "rated_current": 8.0,
    }
    values |= {"rated_torque": 4.4, "rated_speed_rpm": 3000.0}
    table = {"file": "LUT_SEW_jax_grad.mat", "cells": [6, 6], "smooth": 0.1}
    motor = mapped_motor(values, table, folder)
    asked = np.array([[0.0, 0.0], [-10.0, 8.0], [-14.0, 14.0], [-14.0, -14.0], [5.0, 0.0]])
    assert held_by_data(motor, *asked.T).tolist() == [True, True, False, False, False]
    assert held_by_data(motor.linear, *asked.T).all()


def test_a_flux_a_thousandth_below_zero_is_noise_of_a_motor_without_magnets(folder):
    """Of the least flux of the map's box, 0.1675 Wb, which is 5.3 % beyond its points."""
    motor, i = load_drive("ipm_exchanged").motor, np.linspace(-3.2, 3.2, 17)
    d, q = flux_from_current(motor.energy, *np.meshgrid(i, i, indexing="ij"))

    def magnet(share):
        write_map(folder / "mine.csv", FluxMap("mine", i, i, d + share * 1.053 * d.min(), q))
        return load_drive(folder / "mine.toml").motor.magnet_flux

    assert magnet(0.0009) == 0.0
    with pytest.raises(BadInput, match=r"a magnet flux of -0\.000184\d Wb, .* which no motor has"):
        magnet(0.0011)
