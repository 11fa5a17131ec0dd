"""Ratings that cannot belong to one motor are cautioned; 3/2 p psi i = 1.06 N m is what the paper's
motor states."""

import dataclasses

import numpy as np
import pytest

from model.drive_files import QUOTED, load_drive, motor_names
from model.errors import BadInput
from model.ratings import assumed, cautions, largest_torque


def changed(**values):
    """The paper's interior-magnet motor with other ratings."""
    own = load_drive("ipm_exchanged")
    return dataclasses.replace(own, motor=dataclasses.replace(own.motor, **values))


@pytest.mark.parametrize("name", motor_names())
def test_motors_of_the_package_have_ratings_that_go_together(name):
    assert cautions(load_drive(name)) == ()


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"magnet_flux": 98.1}, ["gives 1059 N m", "a factor of 1000", "magnet_flux in mWb?"]),
        (
            {"rated_torque": 1060.0},
            ["rated_torque is 1060 N m", "no motor has that: rated_torque in mN m?"],
        ),
        (
            {"rated_current": 1200.0},
            ["a factor of 1000", "no motor has that: rated_current in mA?"],
        ),
        ({"rated_speed_rpm": 188.5}, ["rad/s", "less than a tenth"]),  # 1800 rpm
        ({"rated_speed_rpm": 1800.0 * 60.0}, ["more than 5 times"]),
    ],
)
def test_a_value_in_another_unit_is_named(values, said):
    found = " ".join(cautions(changed(**values)))
    assert all(words in found for words in said), found


@pytest.mark.parametrize(
    "values", [{"rated_current": 1.2 * 2**0.5}, {"rated_torque": 1.2}, {"rated_speed_rpm": 9000.0}]
)
def test_what_a_motor_may_have_is_not_cautioned(values):
    """A third less torque than rated current gives, a torque rounded up, field weakening to five
    times the base speed."""
    assert cautions(changed(**values)) == ()


def test_an_rms_value_is_named_by_the_torque():
    """No current gives more than 3/2 pole_pairs magnet_flux rated_current, with reluctance."""
    (found,) = cautions(changed(rated_current=1.2 / 2**0.5))
    assert "is rated_current or magnet_flux an rms value" in found


SHEET = {
    "pole_pairs": 4,
    "resistance": 0.36,
    "magnet_flux": 0.0064,
    "inductance_d": 2e-4,
    "inductance_q": 3e-4,
    "inertia": 7.06e-6,
    "rated_current": 7.1,
    "rated_torque": 0.27,
    "rated_speed_rpm": 4000.0,
}


def small(**values):
    """A 100 W motor at 24 V, as its data sheet has it, with other numbers."""
    drive = load_drive("ipm_exchanged")
    converter = dataclasses.replace(drive.converter, dc_bus_voltage=24.0)
    motor = dataclasses.replace(
        drive.motor,
        **dict.fromkeys(("alpha_30", "alpha_12", "alpha_40", "alpha_22", "alpha_04"), 0.0),
        **(SHEET | values),
    )
    return dataclasses.replace(drive, motor=motor, converter=converter)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"inductance_d": 0.2, "inductance_q": 0.3}, "inductance_d and inductance_q in mH"),
        ({"resistance": 360.0}, "resistance in mohm"),
        ({"inertia": 7.06e-2}, "inertia in kg cm^2"),
        ({"inertia": 7.06}, "inertia in kg cm^2"),
        ({"inertia": 1e3 * 7.06e-5}, "inertia in g m^2"),  # with a load of ten rotors
        ({"inertia": 7.06e-9}, "inertia 1000 times too small"),
        ({"magnet_flux": 6.4}, "magnet_flux in mWb"),
        ({"magnet_flux": 6.4e-6}, "magnet_flux 1000 times too small"),
        ({"inertia": 70.6}, "inertia in g cm^2"),
        ({"rated_current": 7100.0}, "rated_current in mA"),
        ({"rated_torque": 270.0}, "rated_torque in mN m"),
        (
            {"inductance_d": 2e-7, "inductance_q": 3e-7},
            "inductance_d and inductance_q 1000 times too small",
        ),
        # copper loses 0.02 % of the power
        ({"resistance": 3.6e-4}, "resistance 1000 times too small"),
        ({"inductance_q": 0.3}, "inductance_q in mH"),
        ({"inductance_d": 0.2}, "inductance_d in mH"),
        ({"magnet_flux": 4 * 0.0064}, "magnet_flux multiplied by pole_pairs?"),
        ({"rated_torque": 0.27e-3}, "rated_torque in kN m?"),
        ({"rated_current": 7.1e-3}, "rated_current in kA?"),
    ],
)
def test_numbers_that_physics_binds_are_compared(values, said):
    """R I, w L I, L I / psi, L / R, J w / T, T w, R I^2 / T w and L_q / L_d against link, time and
    power; the unit that mends all is named."""
    assert cautions(small()) == ()
    assert said in " ".join(cautions(small(**values)))


def test_a_reluctance_motor_has_torque_without_a_magnet():
    """3/2 p (L_d - L_q)/2 i^2 at 45 degrees."""
    motor = dataclasses.replace(load_drive("ipm_exchanged").motor, magnet_flux=0.0)
    assert largest_torque(motor) == pytest.approx(9.0 * 0.5 * (0.0919 - 0.0458) * 1.2**2, rel=1e-3)


def test_what_a_motors_file_does_not_state_is_said(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("[motor]\n" + "".join(f"{k} = {v}\n" for k, v in SHEET.items()))
    (said,) = assumed(load_drive(path))
    assert "does not state sampling_period, dc_bus_voltage and current_noise" in said
    assert "dc_bus_voltage = 400 V" in said
    assert f"current_noise = {0.0017 * SHEET['rated_current']:g} A rms" in said  # model.drive_files
    assert "current_noise" not in assumed(load_drive(path), ["current_noise"])[0]
    assert assumed(load_drive(path), QUOTED) == ()
    assert all(assumed(load_drive(name)) == () for name in motor_names())


@pytest.mark.parametrize(
    ("amps", "webers", "said"),
    [
        (1.0, 1.0, None),
        (1e3, 1.0, "the flux map's currents in mA (write it into its header, e.g. i_d [mA])?"),
        (1.0, 1e3, "map.csv: its points make a magnet flux of 50 Wb, L_d = 9 H and L_q = 20 H"),
        (1e3, 1e3, "the flux map's currents and fluxes in mA and mWb"),
        (0.7071, 1.0, None),  # rms currents: within what motors have; a column of torque tells them
    ],
)
def test_a_flux_map_in_another_unit_is_named(amps, webers, said, tmp_path):
    """9 and 20 mH, 0.05 Wb, 6 A: L I / psi is 1 and 2.4; a map of milliamperes makes it a
    thousandth of that."""
    i = np.linspace(-12.0, 12.0, 9)
    i_d, i_q = (x.ravel() for x in np.meshgrid(i, i))
    rows = np.stack(
        [amps * i_d, amps * i_q, webers * (0.05 + 9e-3 * i_d), webers * 20e-3 * i_q], axis=1
    )
    np.savetxt(tmp_path / "map.csv", rows, delimiter=",", header="i_d,i_q,psi_d,psi_q", comments="")
    (tmp_path / "mine.toml").write_text(
        "[motor]\npole_pairs = 4\nresistance = 0.4\ninertia = 0.002\nrated_current = "
        "6.0\nrated_torque = 2.2\n"
        'rated_speed_rpm = 3000.0\n[flux_map]\nfile = "map.csv"\ncells = [4, 4]\nsmooth = 1e-5\n'
        "[drive]\nsampling_period = 125e-6\ndc_bus_voltage = 320.0\n"
    )
    try:
        told = " ".join(cautions(load_drive(tmp_path / "mine.toml")))
    except BadInput as error:
        told = str(error)
    assert told == "" if said is None else said in told
