"""Commands of a recording as volts that the drive divides by u_dc of the row, whatever they were written as."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

from model.parameters import Converter

Recording = TypeVar("Recording", bound=Any)


def with_volts(r: Recording, converter: Converter) -> Recording:
    """Return a `CampaignRecording` whose commands are in volts (`Converter.command`)."""
    if converter.command == "volts":
        return r
    factor = r.u_dc if converter.command == "duties" else r.u_dc / (r.dc_bus_voltage or converter.dc_bus_voltage)
    volts = {name: factor * r[name] for name in ("u_alpha", "u_beta")}
    return dataclasses.replace(r, columns={**r.columns, **volts})
