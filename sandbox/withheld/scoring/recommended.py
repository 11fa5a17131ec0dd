"""What a diagnosis recommends is recorded on the true bench and diagnosed with the rest: does it
settle the ambiguity?

Recording knows the truth (the seal is open by then), diagnosing gets a campaign's folder only.
"""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from model.errors import BadInput, unknown
from sandbox.gap.planning.menu import Entry
from sandbox.gap.planning.within import allowed
from sandbox.recordings.campaign import Campaign, read_folder
from sandbox.recordings.writing import map_read, write_campaign
from sandbox.withheld.making.case_list import Maps, cases
from sandbox.withheld.making.cycles import CURRENT, Cycle, cycle
from sandbox.withheld.making.draw import Drawn, draw
from sandbox.withheld.making.make import drifted, recording, switched

FILE = "recommended"


def recommended(diagnosis: Mapping[str, Any]) -> tuple[str, float] | None:
    """Return name and seconds of the recording that an ambiguous diagnosis recommends; None where
    nothing is to settle."""
    following = diagnosis.get("next_recording")
    if following is None or diagnosis["verdict"] != "ambiguous":
        return None
    name, seconds = following.get("entry"), following.get("seconds")
    return None if name is None or seconds is None else (str(name), float(seconds))


def entry_of(campaign: Campaign, name: str, seconds: float) -> Entry:
    """Return a campaign's menu entry; BadInput with the nearest name for an unknown one."""
    entries = {e.name: e for e in allowed(campaign.drive, campaign.limits, seconds)}
    if name not in entries:
        raise unknown("recording", name, list(entries))
    return entries[name]


def grow(folder: Path, new: Path, entry: tuple[str, float], drawn: Drawn) -> Path:
    """Write a campaign with one more recording, made on its true bench, into a new folder."""
    campaign = read_folder(folder)
    wanted = entry_of(campaign, *entry)
    rng = np.random.default_rng([drawn.seed, 4])
    share = wanted.link if wanted.link != 1.0 else None
    link = None if share is None else share * drawn.true.converter.dc_bus_voltage
    b = drifted(drawn, switched(drawn), len(campaign.recordings))
    added = recording(drawn, b, cycle_of(wanted), rng, link)
    shutil.rmtree(new, ignore_errors=True)
    grown = replace(campaign, recordings=(*campaign.recordings, added))
    return write_campaign(new, grown, map_read(campaign.drive.motor))


def cycle_of(entry: Entry) -> Cycle:
    """Return a menu's entry as a cycle under current control."""
    axis = "d" if entry.injection[0] else "q" if entry.injection[1] else "none"
    return cycle(FILE, entry.rotor, axis, CURRENT, entry.i_d, entry.i_q, speed=entry.speed)


def drawn_again(content: Mapping[str, Any], name: str) -> Drawn:
    """Return a campaign's truth as it was drawn; BadInput where today's drawing no longer gives
    what was sealed."""
    truths = content["campaigns"]
    try:
        table = content.get("sizes", "")  # seals of before do not say so
        maps = Maps(*content.get("maps", ()))  # seals of before have none
        listed = cases(
            len(truths),
            content["seed"],
            content["kind"],
            content["style"],
            content["outside"],
            table,
            maps,
        )
        drawn = draw(next(c for c in listed if c.name == name), content["seed"])
        same = drawn.sealed() == truths[name]
    except (LookupError, TypeError, ValueError, ArithmeticError, StopIteration):
        # a header of no check of this version
        same = False
    if not same:
        raise BadInput(
            f"{name}: the seal was made by another version, whose bench cannot be drawn "
            "again; make a new one"
        )
    return drawn
