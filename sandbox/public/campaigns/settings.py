"""The settings of a drive beside what recordings of it show: from the folder of `identify` or
`diagnose`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from model.effect_files import effects_of
from model.errors import BadInput
from model.given import given_bytes, is_file, is_folder, read_toml
from model.parameters import finite
from model.tools.configurations import read_configuration
from model.tools.settings import UNITS, Found, Setting, settings
from model.tools.statements import steps_of
from sandbox.output.tables import print_prose, print_table
from sandbox.public.result import Result

OF_VOLTAGE = (
    "pwm_delay",
    "dead_time",
    "device_drop",
    "dc_link_error",
    "current_sampling",
    "current_gain",
)
FILES = {"identify": "identify.json", "diagnose": "diagnosis.json"}
MAX_BYTES = 64_000_000  # bytes of a result's JSON
MOTOR = tuple(UNITS)[:4]


@dataclass(frozen=True, repr=False)
class SettingsResult(Result):
    """A drive's settings: stated, found, how far apart, and what to set."""

    command: ClassVar[str] = "settings"
    kinds: ClassVar[tuple[str, ...]] = ()
    of: str
    program: str
    rows: tuple[Setting, ...]

    def summary(self) -> str:
        """Return whose settings these are and how many differ."""
        differ = [row.name for row in self.rows if row.verdict == "differs"]
        return (
            f"{self.program} beside {self.of}, {', '.join(differ) if differ else 'nothing'} "
            "to set anew"
        )

    def as_json(self) -> dict[str, Any]:
        """Return what `settings.json` holds beyond its header."""
        rows = [
            {
                "name": r.name,
                "unit": r.unit,
                "stated": r.stated,
                "found": r.found,
                "ci95": None if r.ci95 is None else list(r.ci95),
                "off": r.off,
                "verdict": r.verdict,
                "said": r.said,
            }
            for r in self.rows
        ]
        return {"campaign": self.of, "program": self.program, "settings": rows}

    def report(self) -> None:
        """Print the table, then what to set and why."""
        cells = []
        for r in self.rows:
            interval = "" if r.ci95 is None else f"{r.ci95[0]:.4g} to {r.ci95[1]:.4g}"
            numbers = ["–" if x is None else f"{x:.4g}" for x in (r.stated, r.found)]
            off = "–" if r.off is None else f"{100.0 * r.off:+.1f} %"
            cells.append([f"{r.name}, {r.unit}", *numbers, interval, off, r.verdict])
        title = f"{self.program} beside what {self.of} shows"
        print_table(title, ["setting", "stated", "should be", "95 % interval", "off by", ""], cells)
        for r in self.rows:
            print_prose(r.said, f"{r.name}: ")


def check_settings(
    result: str | Path, config: str | Path, bandwidth_hz: float | None = None
) -> SettingsResult:
    """Return the settings that a drive should have by its recordings, beside those of its
    configuration file.

    Values of the motor, gains of the current loop that cancel the winding's pole, and the time that
    dead-time compensation should make up for.

    Parameters
    ----------
    result : str or Path
        Folder that `identify` or `diagnose` has written.
    config : str or Path
        Configuration of VESC, ODrive, moteus or SimpleFOC.
    bandwidth_hz : float, optional
        Hz, of the current loop; by default what the configuration means (stated, or kp over its own
        inductance).

    Returns
    -------
    SettingsResult
        `.rows`: each with `.stated`, `.found`, `.ci95` (SI), `.off` (a share), `.verdict` and
        `.said`.

    Raises
    ------
    BadInput
        For a folder without such a result, a result that tells none of these values, a file of none
        of these tools.

    Examples
    --------
    >>> from sandbox import check_settings
    >>> check_settings("sensorless-out/identify", "vesc.xml")  # doctest: +SKIP
    """
    if bandwidth_hz is not None and not 0.0 < bandwidth_hz <= 1e5:
        raise BadInput(
            f"bandwidth = {bandwidth_hz:g} Hz is out of range; give a current loop's, up to 1e5 Hz"
        )
    folder, content = _result(Path(result))
    motor = read_toml(folder / "motor.toml") if is_file(folder / "motor.toml") else {}
    try:
        found, untold = _found(motor, folder, content)
        named = sorted({str(e) for e in _best(content).get("effects", []) if e in OF_VOLTAGE})
        pairs = str(motor.get("motor", {}).get("pole_pairs", 1))
    except (AttributeError, LookupError, TypeError):
        # of another shape than identify and diagnose give it
        raise BadInput(
            f"{folder}: its files are not as identify and diagnose write them; make the "
            "result again"
        ) from None
    if not found:
        raise BadInput(
            f"{folder}: its recordings tell nothing of a motor's values or of what legs lose; "
            "record what shows them (sensorless plan says what)"
        )
    read = read_configuration(Path(config))
    own = _stated(read.stated, pairs) | read.control
    omega = None if bandwidth_hz is None else math.tau * bandwidth_hz
    return SettingsResult(
        str(content["campaign"]), read.program, tuple(settings(own, found, untold, omega, named))
    )


def _result(path: Path) -> tuple[Path, dict[str, Any]]:
    """Return a result's folder and what its JSON says."""
    folder = path if is_folder(path) else path.parent
    for file in (folder / name for name in FILES.values()):
        if is_file(file):
            try:
                content = json.loads(
                    given_bytes(file, MAX_BYTES, "give a result of identify or diagnose")
                )
            except (ValueError, RecursionError) as error:
                raise BadInput(f"{file}: no whole JSON ({error}); make the result again") from None
            if isinstance(content, dict) and isinstance(content.get("campaign"), str):
                return folder, content
            raise BadInput(f"{file}: no result of identify or diagnose; make it again")
    raise BadInput(
        f"{path} holds neither identify.json nor diagnosis.json; give the folder that "
        "one of them wrote"
    )


def _best(content: Mapping[str, Any]) -> dict[str, Any]:
    """Return the first hypothesis of a diagnosis; nothing of an identification."""
    every = content.get("hypotheses") or [{}]
    return every[0] if isinstance(every[0], dict) else {}


def _found(
    motor: Mapping[str, Any], folder: Path, content: Mapping[str, Any]
) -> tuple[dict[str, Found], dict[str, str]]:
    """Return the values that a result tells, with their intervals, and why others are not told."""
    own, ends = motor.get("motor", {}), motor.get("ci95", {})
    found: dict[str, Found] = {}
    for name in MOTOR:
        value, both = finite(own.get(name)), [finite(x) for x in ends.get(name, ())]
        if value is not None and len(both) == 2 and both[0] is not None and both[1] is not None:
            found[name] = Found(value, (both[0], both[1]))
    untold = {str(x["parameter"]): str(x["why"]) for x in content.get("cannot_tell", ())}
    lost = _lost(motor, folder, _best(content))
    return (found if lost is None else {**found, "dead_time": lost}), untold


def _lost(motor: Mapping[str, Any], folder: Path, best: Mapping[str, Any]) -> Found | None:
    """Return the time (s) that legs lose by dead time and by their devices' drop; None where no
    result names either."""
    if not is_file(folder / "effects.toml"):
        return None
    effects, drive = effects_of(folder / "effects.toml"), motor.get("drive", {})
    period, link = finite(drive.get("sampling_period")), finite(drive.get("dc_bus_voltage"))
    rate = finite(drive.get("pwm_frequency"))
    period = 1.0 / rate if rate else period
    factors = {
        "dead_time.time": 1.0,
        "device_drop.threshold": period / link if period and link else 0.0,
    }
    if not any(effects.get(name) and factor for name, factor in factors.items()):
        return None
    value = sum(factor * effects.get(name, 0.0) for name, factor in factors.items())
    spread, known = 0.0, True
    for name, factor in factors.items():
        ends = best.get("parameters", {}).get(name, {}).get("ci95")
        if effects.get(name) and factor:
            if not ends or None in ends:
                known = False
            else:
                spread += (0.5 * factor * (ends[1] - ends[0])) ** 2
    return Found(value, (value - math.sqrt(spread), value + math.sqrt(spread)) if known else None)


def _stated(stated: Mapping[str, str], pairs: str) -> dict[str, float]:
    """Return a configuration's values of [motor] in SI; pole pairs that it does not state are the
    result's."""
    known = dict(stated)
    if not {"pole_pairs", "poles"} & set(known):
        known["pole_pairs"] = pairs
    return {s.key: s.value for s in steps_of(known) if s.table == "motor" and s.key in UNITS}
