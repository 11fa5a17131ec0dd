"""A drive as functional mock-up units: FMI 2.0 and 3.0 for co-simulation, with sources and a binary
of this machine."""

from __future__ import annotations

import hashlib
import io
import platform
import subprocess
import tempfile
import zipfile
from pathlib import Path
from string import Template
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from estimators.c.build import compiler
from model.errors import BadInput
from sandbox.drive.export.source import HEADER, HERE, SOURCE, Number, Source

VERSIONS = {2: "2.0", 3: "3.0"}
INFINITE = 1e300  # as in fmu.c


class Variable(NamedTuple):
    """A variable of the unit beside its parameters: name, unit, what it is."""

    name: str
    unit: str
    said: str


START = (
    Variable("theta_start", "rad", "angle of the rotor at first, electrical"),
    Variable("omega_start", "rad/s", "its speed at first, electrical"),
)
INPUTS = (
    Variable("duty_a", "", "duty of leg a over the period that begins, 0 to 1"),
    Variable("duty_b", "", "of leg b"),
    Variable("duty_c", "", "of leg c"),
    Variable("load_torque", "N m", "asked of the load machine over the period"),
    Variable(
        "omega_driven",
        "rad/s",
        "speed that a driven rotor has at the end of the period, electrical",
    ),
)
OUTPUTS = (
    Variable(
        "read_a", "A", "reading of the current sensor of phase a at the beginning of the period"
    ),
    Variable("read_b", "A", "of phase b"),
    Variable("read_c", "A", "of phase c"),
    Variable("theta_read", "rad", "of the encoder at the beginning of the period, electrical"),
    Variable("omega_read", "rad/s", "slope of it"),
    Variable("u_dc_read", "V", "reading of the link"),
    Variable("i_a", "A", "current at terminal a at the end of the step"),
    Variable("i_b", "A", "at terminal b"),
    Variable("i_c", "A", "at terminal c"),
    Variable(
        "theta",
        "rad",
        "angle of the rotor at the end of the step, electrical, within a turn of the shaft",
    ),
    Variable("omega", "rad/s", "speed of the rotor there, electrical"),
    Variable("torque", "N m", "of the air gap there"),
    Variable("u_dc", "V", "of the link there"),
)
WHOLE = (
    (Variable("rotor", "", "0 locked, 1 driven, 2 free"), 2, 2),
    (Variable("noise_seed", "", "of noise in readings and of jitter; 0: none"), 0, 2**31 - 1),
)
BASE = {  # exponents of SI base units: kg, m, s, A, rad
    "s": (0, 0, 1, 0, 0),
    "V": (1, 2, -3, -1, 0),
    "A": (0, 0, 0, 1, 0),
    "Wb": (1, 2, -2, -1, 0),
    "H": (1, 2, -2, -2, 0),
    "1/H": (-1, -2, 2, 2, 0),
    "ohm": (1, 2, -3, -2, 0),
    "rad": (0, 0, 0, 0, 1),
    "rad/s": (0, 0, -1, 0, 1),
    "N m": (1, 2, -2, 0, 0),
    "kg m^2": (1, 2, 0, 0, 0),
    "Hz": (0, 0, -1, 0, 0),
}


def unit_of(source: Source, period: float, version: int) -> bytes:
    """Return a drive's FMU (a ZIP file) for a version of FMI, 2 or 3; BadInput where there is no C
    compiler."""
    model = f"{source.motor}_fmi{version}"
    token = hashlib.sha256(source.source.encode()).hexdigest()[:32]
    code = {
        HEADER: source.header,
        SOURCE: source.source,
        "drive_fmu.c": _code(source, token, version),
    }
    files = {f"sources/{name}": text.encode() for name, text in code.items()}
    files["modelDescription.xml"] = described(source, model, token, period, version)
    if version == 3:
        files["sources/buildDescription.xml"] = _build_description(model)
    folder = {2: "linux64", 3: f"{platform.machine()}-linux"}[version]
    files[f"binaries/{folder}/{model}.so"] = _binary(code)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, data in files.items():
            packed.writestr(
                zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED
            )
    return out.getvalue()


def _code(source: Source, token: str, version: int) -> str:
    shared = Template(HERE.joinpath("fmu.c").read_text(encoding="utf-8"))
    rest = HERE.joinpath(f"fmi{version}.c").read_text(encoding="utf-8")
    return (
        "#ifndef SENSORLESS_FLOAT64\n#define SENSORLESS_FLOAT64\n#endif\n"
        + shared.substitute(fmi=VERSIONS[version], header=HEADER, token=token, cname=source.motor)
        + rest
    )


def _binary(code: dict[str, str]) -> bytes:
    """Return the shared library of a unit's sources."""
    cc = compiler()
    if cc is None:
        raise BadInput("no C compiler is at hand to build the FMU's binary; install one or set CC")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in code.items():
            (folder / file).write_text(text, encoding="utf-8")
        call = [cc, "-std=c99", "-O2", "-fPIC", "-shared", "-DSENSORLESS_FLOAT64", "-o", "unit.so"]
        done = subprocess.run(
            [*call, SOURCE, "drive_fmu.c", "-lm"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise BadInput(f"the FMU does not compile with '{cc}': {done.stderr.splitlines()[0]}")
        return (folder / "unit.so").read_bytes()


def _root(tag: str, **attributes: str) -> Xml.Element:
    return Xml.Element(tag, dict(attributes))


def _child(parent: Xml.Element, tag: str, **attributes: str) -> Xml.Element:
    """Return a new element inside another."""
    return Xml.SubElement(parent, tag, dict(attributes))


def _finite(value: float) -> float:
    return max(-INFINITE, min(INFINITE, value))


def described(source: Source, model: str, token: str, period: float, version: int) -> bytes:
    """Return modelDescription.xml."""
    identity = {"guid": token} if version == 2 else {"instantiationToken": token}
    root = _root(
        "fmiModelDescription",
        fmiVersion=VERSIONS[version],
        modelName=f"{source.motor} drive",
        generationTool="sensorless-sandbox",
        variableNamingConvention="flat",
        description="a permanent-magnet motor with inverter, shaft and sensors, PWM edge by PWM edge",  # noqa: E501
        **identity,
    )
    ability = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"}
    if version == 3:
        ability = {k.replace("FMUstate", "FMUState"): v for k, v in ability.items()} | {
            "fixedInternalStepSize": repr(period)
        }
    run = _child(
        root,
        "CoSimulation",
        modelIdentifier=model,
        canHandleVariableCommunicationStepSize="true",
        **ability,
    )
    if version == 2:
        files = _child(run, "SourceFiles")
        for name in (SOURCE, "drive_fmu.c"):
            _child(files, "File", name=name)
    units = {v.unit for v in (*START, *INPUTS, *OUTPUTS)} | {n.unit for n in source.numbers} | {"s"}
    _units(_child(root, "UnitDefinitions"), sorted(units - {""}))
    _child(root, "DefaultExperiment", startTime="0.0", stopTime="0.1", stepSize=repr(period))
    variables = _child(root, "ModelVariables")
    _variables(variables, source.numbers, version)
    structure = _child(root, "ModelStructure")
    first = len(source.numbers) + len(START) + len(INPUTS)
    places = range(first, first + len(OUTPUTS))
    if version == 2:
        for kind in ("Outputs", "InitialUnknowns"):
            listed = _child(structure, kind)
            for at in places:
                _child(listed, "Unknown", index=str(at + 1))
    else:
        for kind in ("Output", "InitialUnknown"):
            for at in places:
                _child(structure, kind, valueReference=str(at))
    Xml.indent(root)
    return Xml.tostring(root, encoding="utf-8", xml_declaration=True)


def _units(element: Xml.Element, units: list[str]) -> None:
    for unit in units:
        entry = _child(element, "Unit", name=unit)
        if unit in BASE:
            powers = {
                k: str(v)
                for k, v in zip(("kg", "m", "s", "A", "rad"), BASE[unit], strict=True)
                if v
            }
            _child(entry, "BaseUnit", **powers)


def _variables(element: Xml.Element, numbers: tuple[Number, ...], version: int) -> None:
    """Write every variable; their value references are their places."""
    reference = 0
    for n in numbers:
        bounds = {"min": repr(_finite(n.low)), "max": repr(_finite(n.high))}
        bounds["start"] = repr(_finite(n.value))
        _real(element, version, reference, Variable(n.name, n.unit, n.said), "parameter", bounds)
        reference += 1
    for v in START:
        _real(element, version, reference, v, "parameter", {"start": "0.0"})
        reference += 1
    for k, v in enumerate(INPUTS):
        more = {"min": "0.0", "max": "1.0", "start": "0.5"} if k < 3 else {"start": "0.0"}
        _real(element, version, reference, v, "input", more)
        reference += 1
    for v in OUTPUTS:
        _real(element, version, reference, v, "output", {})
        reference += 1
    for v, start, most in WHOLE:
        shared = {
            "name": v.name,
            "valueReference": str(reference),
            "description": v.said,
            "causality": "parameter",
            "variability": "fixed",
        }
        bounds = {"start": str(start), "min": "0", "max": str(most)}
        if version == 2:
            _child(_child(element, "ScalarVariable", **shared), "Integer", **bounds)
        else:
            _child(element, "Int32", **shared, **bounds)
        reference += 1
    if version == 3:
        _child(
            element,
            "Float64",
            name="time",
            valueReference=str(reference),
            causality="independent",
            variability="continuous",
            unit="s",
            description="s since the beginning",
        )


def _real(
    element: Xml.Element,
    version: int,
    reference: int,
    v: Variable,
    causality: str,
    more: dict[str, str],
) -> None:
    variability = "fixed" if causality == "parameter" else "discrete"
    shared = {
        "name": v.name,
        "valueReference": str(reference),
        "description": v.said,
        "causality": causality,
        "variability": variability,
    }
    if causality == "parameter" or (causality == "output" and version == 2):
        shared["initial"] = "exact" if causality == "parameter" else "calculated"
    unit = {"unit": v.unit} if v.unit else {}
    if version == 2:
        _child(_child(element, "ScalarVariable", **shared), "Real", **unit, **more)
    else:
        _child(element, "Float64", **shared, **unit, **more)


def _build_description(model: str) -> bytes:
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    build = _child(root, "BuildConfiguration", modelIdentifier=model)
    files = _child(build, "SourceFileSet", language="C99")
    for name in (SOURCE, "drive_fmu.c"):
        _child(files, "SourceFile", name=name)
    _child(files, "PreprocessorDefinition", name="SENSORLESS_FLOAT64")
    Xml.indent(root)
    return Xml.tostring(root, encoding="utf-8", xml_declaration=True)
