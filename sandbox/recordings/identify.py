"""The door to identification: from a campaign folder to both fits, as tables and JSON."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model.effects.library import parameters
from model.errors import BadInput
from model.exact_fit import exact
from model.identification import first_order
from model.levels import UNITS, Fit, Levels
from model.mapped import without_map
from model.parameters import Motor
from sandbox.output.refitted import Refitted
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.importing import read_recordings
from sandbox.recordings.staircase import levels_of

LARGE_MISFIT = 5.0


@dataclass(frozen=True, repr=False)
class Identification:
    """What a campaign's locked recordings say about the motor; `fits` by method name."""

    campaign: Campaign
    levels: Levels
    fits: dict[str, Fit]
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<Identification: {self.campaign.name}, {', '.join(self.fits)}>"

    def summary(self) -> str:
        """Return the campaign, and what each fit leaves."""
        left = ", ".join(
            f"{name} {1e3 * fit.residual_rms:.3g} mA rms" for name, fit in self.fits.items()
        )
        return f"{self.campaign.name}, {len(self.levels.axis)} levels, left by the fits: {left}"

    def motor(self, method: str = "exact") -> Motor:
        """Return the nominal motor with the identified values in place of its own (a flux map,
        too), e.g. for `model.saliency.audit`."""
        values: dict[str, Any] = dict(self.fits[method].values)
        return dataclasses.replace(without_map(self.campaign.drive.motor), **values)

    def refitted(self) -> Refitted:
        """Return the exact fit's motor and what stood between it and the readings, as files for the
        simulator.

        The fit's delay is that of the pulses after the reading amid them: later pulses, or a
        reading that much later.
        """
        fit, own = self.fits["exact"], self.campaign.drive
        n, units = fit.nuisance, {name: p.unit for name, p in parameters().items()}
        effects = {f"current_gain.gain_{x}": 1.0 + n[f"gain_{x}"] for x in "abc" if n[f"gain_{x}"]}
        effects |= {
            f"current_offset.offset_{x}": n[f"offset_{x}"] for x in "ab" if n[f"offset_{x}"]
        }
        effects |= {
            "device_drop.threshold": n["voltage_threshold"],
            "encoder_offset.offset": -n["angle_error"],
        }
        late = n["delay"]
        effects |= {"pwm_delay.delay": late} if late > 0.0 else {"current_sampling.delay": -late}
        effects |= {"bench.soft_current": n["width"]}
        origins = {
            **own.provenance,
            **dict.fromkeys(fit.values, "identified: exact fit to locked recordings"),
        }
        ci95 = {name: fit.ci95(name) for name in fit.values}
        said = (
            f"Identified from the locked recordings of '{self.campaign.name}' by identify: "
            "the exact fit"
        )
        drive = dataclasses.replace(own, motor=self.motor(), provenance=origins)
        return Refitted(drive, effects, {}, ci95, units, {}, said)

    def as_json(self) -> dict[str, Any]:
        """Return the command's JSON body: methods, parameters in SI units, null where a number is
        undefined."""
        return {
            "campaign": self.campaign.name,
            "levels": len(self.levels.axis),
            "methods": {name: fit_as_json(fit) for name, fit in self.fits.items()},
            "simulator": self.refitted().as_json(),
            "remarks": list(self.remarks),
        }


def fit_as_json(fit: Fit) -> dict[str, Any]:
    """Return one method's parameters with values, 95 % intervals and units."""
    parameters = {
        name: {
            "value": _number(value),
            "ci95": [_number(x) for x in fit.ci95(name)],
            "unit": UNITS[name],
        }
        for name, value in fit.values.items()
    }
    return {
        "parameters": parameters,
        "residual_rms": _number(fit.residual_rms),
        "misfit": _number(fit.misfit),
        "nuisance": {k: _number(v) for k, v in fit.nuisance.items()},
    }


def _number(x: float) -> float | None:
    return float(x) if math.isfinite(x) else None


def staircases(campaign: Campaign) -> bool:
    """Tell whether a campaign has what `identify` reads levels from: a locked rotor with
    injection."""
    return any(r.rotor == "locked" and r.injection_axis != "none" for r in campaign.recordings)


def identify(folder: str | Path | Campaign, columns: Path | None = None) -> Identification:
    """Identify the motor of a campaign from its locked recordings with injection, by both methods.

    `columns` maps the names and units of recordings from elsewhere
    (`sandbox.recordings.importing`).  Raises BadInput naming recording and row, level or axis where
    the recordings do not allow it.
    """
    campaign = (
        folder if isinstance(folder, Campaign) else read_recordings(folder, columns, ("locked",))
    )
    levels = levels_of(campaign)
    fits, remarks = {}, [f.text for f in campaign.findings]
    try:
        fits["first_order"] = first_order(levels)
    except BadInput as error:
        if "eq. (LdLq)" not in str(error):
            raise
        remarks.append(f"first_order left out: {error}")
    fits["exact"] = exact(levels, campaign.drive.motor, dict(campaign.background))
    if fits["exact"].misfit > LARGE_MISFIT:
        remarks.append(
            f"the levels differ from the model {math.sqrt(fits['exact'].misfit):.0f} times as much "
            "as their noise: an effect outside the model acts (inverter, delay, iron loss, other "
            "saturation); intervals may be too narrow"
        )
    return Identification(campaign, levels, fits, tuple(remarks))
