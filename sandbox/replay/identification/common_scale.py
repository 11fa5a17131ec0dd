"""Whether all that was identified is off by one factor, as a wrong DC link makes it.

Voltages k times too large in the log make R, inductances and flux k times as large and leave the
currents as they are: no recording tells such a link from another motor.  What tells is how unlike
it is that all values of a motor are off from the stated ones by the same factor:

    s_n = log(identified / stated) = log k + own deviation

weighed without and with a common k, of which is known before the data what one value alone tells
(Kass, Wasserman, J. Am. Stat. Assoc. 90 (1995) 928); of usual deviations as in
`sandbox.recordings.checks.factors` where the campaign states none.
"""

from __future__ import annotations

import math

import numpy as np

from model.effects import library
from model.effects.said import percent
from sandbox.recordings.campaign import Campaign
from sandbox.recordings.checks.factors import deviations
from sandbox.replay.identification.ordinary import OrdinaryFit

LINK = "dc_link_error.gain_error"
FEWEST = 3  # values: two may be alike by chance
LIKELIER = 2.0  # times as likely as without it, from which a common factor is worth a line
APART = 2.0  # mean square of what is left of each: beyond it they differ on their own


def common_scale(fit: OrdinaryFit, campaign: Campaign) -> str:
    """Return a sentence on a common factor of all values that are told; where nothing speaks for
    one, that a link that was not measured could hide one; else nothing."""
    return _found(fit, campaign) or _hidden(fit, campaign)


def _hidden(fit: OrdinaryFit, campaign: Campaign) -> str:
    """Return what a link that was not measured hides."""
    if not fit.values or any(np.ptp(r.u_dc) > 0.0 for r in campaign.recordings):
        return ""
    stated, names = campaign.recordings[0].u_dc[0], ", ".join(fit.values)
    return (
        f"the DC link was not measured ({stated:g} V is stated): if commands were worked out from "
        f"a wrong one, {names} are off by the same factor, and no current shows it"
    )


def _found(fit: OrdinaryFit, campaign: Campaign) -> str:
    """Return a sentence on a common factor, empty where nothing speaks for one."""
    drive = campaign.drive
    known, typical = deviations(campaign.uncertainty), library.parameters()[LINK].typical
    names = [n for n in known if n in fit.values and getattr(drive.motor, n) > 0.0]
    if len(names) < FEWEST:
        return ""
    off = np.array([math.log(fit.values[n] / getattr(drive.motor, n)) for n in names])
    own = np.array([math.hypot(known[n], fit.deviations[n] / fit.values[n]) for n in names])
    precision = float(np.sum(own**-2.0))
    share = len(names) / (len(names) + 1.0)
    scale = float(np.sum(off / own**2)) / precision
    gain = 0.5 * precision * share * scale**2 - 0.5 * math.log(1.0 + len(names))
    left = float(np.sum(((off - scale) / own) ** 2)) / (len(names) - 1)
    if abs(scale) < typical or gain < math.log(LIKELIER) or left > APART:
        return ""
    k, link = math.exp(scale), drive.converter.dc_bus_voltage
    return (
        f"{', '.join(names)} are all about {percent(k - 1.0)} from the stated ones, as a wrong DC "
        f"link makes them: [drive] dc_bus_voltage = {link:g} V, about {link / k:.3g} V would bring "
        "them back; currents and angle alone cannot tell that from another motor: measure the link"
    )
