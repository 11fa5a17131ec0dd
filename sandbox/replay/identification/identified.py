"""What ordinary recordings say of a motor, as the command `identify` tells it: JSON, files for the
simulator, words."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from model.effects.library import neutral, parameters
from model.errors import PhysicsError
from model.levels import UNITS
from model.mapped import MappedMotor
from sandbox.output.refitted import Refitted
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.checks.balance import plain
from sandbox.replay.identification.common_scale import common_scale
from sandbox.replay.identification.ordinary import OrdinaryFit, fit_ordinary
from sandbox.replay.identification.places import ANGLE, NAMES, OF_EFFECT

MOST_MISSED = 0.05  # share of the current: beyond it the log is more probably another drive's
MOST_FILES = 4  # recordings that are named with what they miss
ROUGH = 0.6  # relative standard deviation: beyond it a value may as well be none
MORE_THAN_NOISE = 1.5  # misfit from which what the model lacks is told
SLOW = 2.0  # times L/R from row to row: what a command does to the current is over within a row
ANSWERED = 0.5  # correlation from which commands are said to follow readings
UNIT = {**UNITS, "magnet_flux": "Wb"}


@dataclass(frozen=True, repr=False)
class OrdinaryIdentification:
    """A campaign of any commands, and what it says of the motor."""

    campaign: Campaign
    fit: OrdinaryFit
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return f"<OrdinaryIdentification: {self.campaign.name}, {', '.join(self.fit.values)}>"

    def summary(self) -> str:
        """Return the campaign, what is told, and what the fit leaves."""
        count = len(self.campaign.recordings)
        left = f"{1e3 * self.fit.residual_rms:.3g} mA rms left"
        return (
            f"{self.campaign.name}, {count} ordinary recordings, told: "
            f"{', '.join(self.fit.values)}; {left}"
        )

    def refitted(self) -> Refitted:
        """Return the motor found and what stood between it and the readings, as files for the
        simulator."""
        fit, own = self.fit, self.campaign.drive
        units = {name: p.unit for name, p in parameters().items()}
        said = f"Identified from ordinary recordings of '{self.campaign.name}' by identify"
        as_it_is = neutral(fit.motor)
        effects = {
            name: value
            for name, value in fit.nuisance.items()
            if value != as_it_is.get(name, 0.0) and not name.startswith(ANGLE)
        }
        if isinstance(own.motor, MappedMotor):
            scales = {
                n: v / getattr(own.motor, n)
                for n, v in fit.values.items()
                if n.startswith("inductance")
            }
            effects |= {OF_EFFECT[n]: v for n, v in scales.items()}
            effects |= {OF_EFFECT[n]: fit.values[n] for n in ("magnet_flux",) if n in fit.values}
        provenance = {
            **own.provenance,
            **dict.fromkeys(fit.values, "identified: replay of ordinary recordings"),
        }
        drive = dataclasses.replace(own, motor=fit.motor, provenance=provenance)
        return Refitted(
            drive, effects, {}, {n: fit.ci95(n) for n in fit.values}, units, dict(fit.rms), said
        )

    def as_json(self) -> dict[str, Any]:
        """Return the command's JSON body; parameters that the recordings cannot tell stand in
        `cannot_tell`."""
        fit = self.fit
        parameters = {
            n: {"value": fit.values[n], "ci95": list(fit.ci95(n)), "unit": UNIT[n]}
            for n in NAMES
            if n in fit.values
        }
        method = {
            "parameters": parameters,
            "residual_rms": fit.residual_rms,
            "missed_share": fit.missed_share,
            "misfit": fit.misfit,
            "nuisance": dict(fit.nuisance),
        }
        return {
            "campaign": self.campaign.name,
            "levels": 0,
            "methods": {"replay": method},
            "cannot_tell": [
                {"parameter": n, "why": fit.untold[n]} for n in NAMES if n in fit.untold
            ],
            "simulator": self.refitted().as_json(),
            "remarks": list(self.remarks),
        }


def _tied(fit: OrdinaryFit) -> list[str]:
    """Return what looks alike beside each parameter, where it moves it by half of its interval or
    more."""
    return [
        f"{n} and {other} look alike in these recordings: with {other} as usual {n} would be "
        f"{value:.5g} {UNIT[n]}, and its interval reaches that far; currents of both signs at "
        "several speeds tell them apart"
        for n, (other, value) in fit.tied.items()
        if abs(value - fit.values[n]) > fit.deviations[n]
    ]


def identify_ordinary(campaign: Campaign, why: str = "") -> OrdinaryIdentification:
    """Return what a campaign's recordings say of R, L_d, L_q and magnet flux, whatever was
    commanded; BadInput where they say nothing of any of them, PhysicsError where no values of these
    explain them.

    why: they are not taken as staircases, one sentence.
    """
    fit = fit_ordinary(campaign)
    remarks = [f.text for f in campaign.findings] + [why] * bool(why)
    if fit.misfit > MORE_THAN_NOISE or not fit.values:
        each = missed(fit, campaign)
        said = (
            f"currents miss the measured ones by {100.0 * fit.missed_share:.2g} % of their "
            f"rms{_by_recording(each)}, "
            f"{plain(math.sqrt(fit.misfit))} times the sensors' noise: "
            f"{answered(campaign) or _acts(campaign)}"
        )
        if fit.missed_share > MOST_MISSED or not fit.values:
            raise PhysicsError(
                f"{campaign.name}: with the best R, L_d, L_q and magnet flux, {said}; values would "
                f"be off by more than their intervals{_each(fit)}: {_record(campaign, each)} "
                "(`sensorless diagnose` says where it lies)"
            )
        remarks.append(f"{said}; intervals take as much to be hidden in each value as is missed")
    remarks += _tied(fit)
    if said := common_scale(fit, campaign):
        remarks.append(said)
    if fit.samples < fit.of_samples:
        remarks.append(
            f"{fit.samples} of {fit.of_samples} samples are used, the same share of each recording"
        )
    return OrdinaryIdentification(campaign, fit, tuple(remarks))


def _each(fit: OrdinaryFit) -> str:
    """Return in words what is roughly known where no value is told, one standard deviation."""
    known = [
        f"{n} about {fit.rough[n][0]:.2g} {UNIT[n]}, give or take {100.0 * fit.rough[n][1]:.0f} %"
        for n in fit.rough
        if fit.rough[n][1] < ROUGH
    ]
    return f" (at best {', '.join(known)})" if known and not fit.values else ""


def missed(fit: OrdinaryFit, campaign: Campaign) -> dict[str, float]:
    """Return by recording which share of its current's rms the best values miss, the largest
    first."""
    noise = fit.residual_rms / math.sqrt(fit.misfit) if fit.misfit > 0.0 else 0.0
    out = {}
    for r in campaign.recordings:
        size = math.sqrt(float(np.mean([np.mean(x**2) for x in (r.i_a, r.i_b, r.i_c)])))
        if r.file in fit.rms and size > 0.0:
            out[r.file] = noise * fit.rms[r.file] / size
    return dict(sorted(out.items(), key=lambda x: -x[1]))


def _by_recording(each: Mapping[str, float]) -> str:
    """Return in words where most is missed, of several recordings."""
    some = [f"{file} {100.0 * share:.2g} %" for file, share in list(each.items())[:MOST_FILES]]
    return f" ({', '.join(some)})" if len(each) > 1 else ""


def _record(campaign: Campaign, each: Mapping[str, float]) -> str:
    """Return what to leave out or to record, so that fewer things act at once."""
    beyond = [file for file, share in each.items() if share > MOST_MISSED]
    if 0 < len(beyond) < len(each):
        return f"leave out {', '.join(beyond)}, or record them anew with smaller steps"
    saturates = "" if campaign.drive.motor.has_map else ", or give its flux map ([flux_map])"
    if all(r.rotor == "locked" for r in campaign.recordings):
        return f"record steps of a tenth of rated current, at which it hardly saturates{saturates}"
    return (
        "record R and inductances with the rotor locked (steps of a tenth of rated current), the "
        f"flux with it driven and without current{saturates}"
    )


def _acts(campaign: Campaign) -> str:
    """Return in words what else may act."""
    made = dict.fromkeys(r.made.of for r in campaign.recordings if r.made is not None and r.made.of)
    angle = f", or an angle that {', '.join(made)} tells too roughly" if made else ""
    c = campaign.drive.converter
    rows = f", rows {c.periods_a_row} PWM periods apart" if c.periods_a_row > 1 else ""
    return (
        "something else acts (saturation of another form, a filter, further harmonics, a shifted "
        f"log{rows}{angle})"
    )


def answered(campaign: Campaign) -> str:
    """Return in words that commands answer the noise of the readings in their own rows, where rows
    are too far apart for the currents that follow from it; else nothing.

    Fourth differences show the white part of both, in the rotor's frame.
    """
    m, period = campaign.drive.motor, campaign.drive.converter.sampling_period
    if period < SLOW * max(m.inductance_d, m.inductance_q) / m.resistance:
        return ""
    both = commands = readings = 0.0
    for r in campaign.recordings:
        turn, (a, b) = np.exp(-1j * r.theta), r.current
        u, i = (np.diff(x * turn, 4) for x in (r.u_alpha + 1j * r.u_beta, a + 1j * b))
        both += float(np.vdot(i, u).real)
        commands, readings = (
            commands + float(np.vdot(u, u).real),
            readings + float(np.vdot(i, i).real),
        )
    size = math.sqrt(commands * readings)
    if size == 0.0 or both > -ANSWERED * size:
        return ""
    return (
        f"commands answer the readings' noise in their rows (correlation {both / size:.2f}), so "
        f"the controller acts between rows, which {period:.3g} s do not show; log every PWM period"
    )
