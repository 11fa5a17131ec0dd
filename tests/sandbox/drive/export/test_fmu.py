"""The FMUs beside the Python plant, driven by FMPy as any master would."""

import hashlib
import shutil
import zipfile

import numpy as np
import pytest

from estimators.c.build import compiler
from sandbox import load_motor
from sandbox.drive.export.fmu import SOURCE
from sandbox.public.exports.drive import export_drive
from tests.sandbox.drive.export.driven import (
    ANGLE,
    differences,
    python_run,
    quiet,
    sizes,
    top_speed,
)

fmpy = pytest.importorskip("fmpy")
pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler")
GOAL = 1e-9  # of rated current, and rad
OUTPUTS = (
    "read_a",
    "read_b",
    "read_c",
    "theta_read",
    "omega_read",
    "u_dc_read",
    "i_a",
    "i_b",
    "i_c",
    "theta",
    "omega",
    "torque",
    "u_dc",
)
INPUTS = ("duty_a", "duty_b", "duty_c", "load_torque", "omega_driven")
DELAYS = {"pwm_delay", "current_sampling"}  # their next commands a master does not know


@pytest.fixture(scope="module")
def drive():
    return quiet(load_motor("ipm_exchanged"))


@pytest.fixture(scope="module")
def effects(drive):
    return {k: v for k, v in sizes(drive).items() if k.partition(".")[0] not in DELAYS}


@pytest.fixture(scope="module")
def folder(drive, effects, tmp_path_factory):
    """The export with every effect on that a master can tell of."""
    rpm = top_speed(drive) / drive.motor.rated_omega * drive.motor.rated_speed_rpm
    return export_drive(drive, effects, top_speed_rpm=rpm).save(
        tmp_path_factory.mktemp("fmu") / "out"
    )


class Unit:
    """An FMU under FMPy, variables by name."""

    def __init__(self, file, start):
        self.told = fmpy.read_model_description(str(file), validate=True)
        self.place = {v.name: v.valueReference for v in self.told.modelVariables}
        self.folder = fmpy.extract(str(file))
        self.wide = self.told.fmiVersion == "3.0"
        kind = fmpy.fmi3.FMU3Slave if self.wide else fmpy.fmi2.FMU2Slave
        self.unit = kind(
            guid=self.told.guid,
            unzipDirectory=self.folder,
            instanceName="drive",
            modelIdentifier=self.told.coSimulation.modelIdentifier,
        )
        self.unit.instantiate()
        self.set(start)
        self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def set(self, values):
        places = [self.place[name] for name in values]
        (self.unit.setFloat64 if self.wide else self.unit.setReal)(places, list(values.values()))

    def get(self, names):
        places = [self.place[name] for name in names]
        return (self.unit.getFloat64 if self.wide else self.unit.getReal)(places)

    def end(self):
        self.unit.terminate()
        self.unit.freeInstance()
        shutil.rmtree(self.folder)


def commanded(drive, recording):
    """Return a recording's duties, load and next speed, (n, 5)."""
    from sandbox.plant.edges import duties

    rows = zip(recording.u_alpha, recording.u_beta, recording.u_dc, strict=True)
    legs = np.array([duties(float(a), float(b), float(u)) for a, b, u in rows])
    return np.column_stack([legs, recording.load_torque, np.append(recording.omega_ref[1:], 0.0)])


@pytest.mark.parametrize("version", [2, 3])
def test_against_the_python_plant(drive, effects, folder, version):
    unit = Unit(folder / f"ipm_exchanged_fmi{version}.fmu", {"theta_start": ANGLE})
    recording, period, found = (
        python_run(drive, "free", effects),
        drive.converter.sampling_period,
        [],
    )
    for k, row in enumerate(commanded(drive, recording)):
        unit.set(dict(zip(INPUTS, row, strict=True)))
        unit.unit.doStep(k * period, period)
        found.append(unit.get(OUTPUTS))
    unit.end()
    assert max(differences(drive, np.array(found), recording)) < GOAL


@pytest.mark.parametrize("version", [2, 3])
def test_a_units_token_is_the_digest_of_its_source(folder, version):
    """So a master never takes the binary of one drive for that of another."""
    file = folder / f"ipm_exchanged_fmi{version}.fmu"
    with zipfile.ZipFile(file) as packed:
        source = packed.read(f"sources/{SOURCE}")
    token = hashlib.sha256(source).hexdigest()
    assert fmpy.read_model_description(str(file)).guid == token[:32]


@pytest.mark.parametrize("version", [2, 3])
def test_a_state_is_kept_and_set_again(folder, version):
    unit = Unit(folder / f"ipm_exchanged_fmi{version}.fmu", {"theta_start": ANGLE})
    steps = iter(range(9))
    unit.set({"duty_a": 0.53})
    unit.unit.doStep(next(steps) * 250e-6, 250e-6)
    keep, back = ("getFMUState", "setFMUState") if unit.wide else ("getFMUstate", "setFMUstate")
    state = getattr(unit.unit, keep)()
    found = []
    for _ in range(2):
        getattr(unit.unit, back)(state)
        unit.unit.doStep(next(steps) * 250e-6, 250e-6)
        found.append(unit.get(OUTPUTS))
    unit.end()
    assert found[0] == found[1]


@pytest.mark.parametrize("version", [2, 3])
def test_parts_and_other_steps(folder, version):
    """Ten parts of a period do, a third of a period beside them does not."""
    unit = Unit(folder / f"ipm_exchanged_fmi{version}.fmu", {})
    for k in range(3):
        unit.unit.doStep(k * 25e-6, 25e-6)
    with pytest.raises(fmpy.fmi1.FMICallException):
        unit.unit.doStep(75e-6, 250e-6 / 3.0)


@pytest.mark.parametrize("version", [2, 3])
def test_parameters_have_bounds_and_units(folder, version):
    found = fmpy.read_model_description(
        str(folder / f"ipm_exchanged_fmi{version}.fmu"), validate=True
    )
    assert not fmpy.validation.validate_fmu(str(folder / f"ipm_exchanged_fmi{version}.fmu"))
    by = {v.name: v for v in found.modelVariables}
    assert (by["dead_time.time"].unit, by["stator_resistance.resistance"].unit) == ("s", "ohm")
    own = [v for v in found.modelVariables if "." in v.name]
    assert all(float(v.min) <= float(v.start) <= float(v.max) for v in own)
    with pytest.raises(fmpy.fmi1.FMICallException):
        Unit(folder / f"ipm_exchanged_fmi{version}.fmu", {"dead_time.time": 1.0})
