"""Withheld campaigns: drawn, sealed, then recorded on the switched bench.

The truth is written and hashed before the first sample is recorded.  Truths follow from the seed,
and with as many digits as are sealed they are the same on every machine; recordings follow from the
seed on one machine (elsewhere their last digits may differ).  A call that was interrupted goes on
where it stopped.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from model.errors import BadInput
from model.mapped import MappedMotor
from model.parameters import Drive
from sandbox.engine.processes import ALONE, Workers, spread
from sandbox.output.files import json_bytes, plain, write_whole
from sandbox.recordings.campaign import Campaign, CampaignRecording
from sandbox.recordings.writing import write_campaign
from sandbox.switched.bench_numbers import SwitchedBench, bench
from sandbox.withheld.making.case_list import NO_MAPS, Maps, cases
from sandbox.withheld.making.cycle_styles import cycles
from sandbox.withheld.making.cycles import LOAD, Cycle, scale_of
from sandbox.withheld.making.cycles_narrow import all_cycles as narrow
from sandbox.withheld.making.draw import Drawn, draw, outside_names
from sandbox.withheld.making.drives import LINK_NOISE, uncertainty
from sandbox.withheld.making.map_motors import map_families, no_maps, stated_map
from sandbox.withheld.making.outside_causes import DRIFT_TIME
from sandbox.withheld.making.rig import RECORDED, record, tuned
from sandbox.withheld.making.users_effects import users_cards

SEAL, HASH, CAMPAIGNS = "truth.sealed", "SHA256", "campaigns"
CONTROL_SHARE = 0.6  # of the usual length, for checks of controls only


@dataclass(frozen=True)
class Made:
    """A made check: its folder, the seal's SHA-256, the campaigns recorded in this call."""

    folder: Path
    sha256: str
    recorded: int


class CheckPlan(NamedTuple):
    """What a check is to be made of.

    kind: 'mixed', 'controls' (shorter, without a gap), 'pairs' (one operating point, where two
    effects look alike), 'many' (four to ten effects) or 'outside' (a cause outside the library,
    beside some an effect of it); style of the cycles: 'practice' or 'scored'; sizes: 'published'
    (ranges with sources; ordinary deviations 0.5 to 2 times the stated ones; other shapes of a
    current's sign) or 'ladder'; maps: share of a mixed check whose nominal model is a flux map.
    """

    campaigns: int
    seed: int
    kind: str = "mixed"
    style: str = "scored"
    sizes: str = "published"
    maps: float = 0.0


def make(
    folder: Path,
    plan: CheckPlan,
    *,
    workers: Workers = ALONE,
    announce: Callable[[str], None] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Made:
    """Make a check in `folder`; announce gets the seal's hash before anything is recorded.

    Effects of the user that were taken over (`model.effects.adopt`) are drawn beside the library's;
    a cluster's workers find the folder at the same place.
    BadInput where the folder holds another check, or where maps are wanted and none is on this
    machine.
    """
    folder = folder if workers.cluster is None else folder.resolve()
    count, seed, kind, style, sizes, maps = plan
    outside, users = outside_names(kind), list(users_cards())
    wanted = wanted_maps(maps)
    drawn = [draw(case, seed) for case in cases(count, seed, kind, style, outside, sizes, wanted)]
    header = {"seed": seed, "kind": kind, "style": style, "sizes": sizes, "outside": outside}
    if wanted.share > 0.0:
        header["maps"] = wanted
    if users:
        header["users_effects"] = users
    digest = seal(folder, header, drawn)
    if announce is not None:
        announce(digest)
    share = CONTROL_SHARE if kind == "controls" else 1.0
    left = [d for d in drawn if not (folder / CAMPAIGNS / d.case.name).exists()]
    work = [(folder / CAMPAIGNS / d.case.name, d, share) for d in left]
    if progress is not None:
        progress(0.0)
    for done, _ in enumerate(spread(_write, work, workers), 1):
        if progress is not None:
            progress(done / len(work))
    return Made(folder, digest, len(left))


def wanted_maps(share: float) -> Maps:
    """Return the share of flux maps with the families that can be drawn here; BadInput where there
    is none of them."""
    if not 0.0 <= share <= 1.0:
        raise BadInput(f"maps = {share} is no share; give a number in [0, 1]")
    if share == 0.0:
        return NO_MAPS
    if not (families := map_families()):
        raise BadInput(f"{no_maps()}; or give maps = 0 for a check without")
    return Maps(share, families)


def seal(folder: Path, header: dict[str, Any], drawn: Sequence[Drawn]) -> str:
    """Write all truths into one file and its SHA-256 beside it; return the hash.  BadInput where
    another is there."""
    content = {"schema": 1, **header, "campaigns": {d.case.name: d.sealed() for d in drawn}}
    text = json_bytes(plain(content))
    digest = hashlib.sha256(text).hexdigest()
    if folder.exists() and not folder.is_dir():
        raise BadInput(f"'{folder}' is a file, no folder for a check; give a new folder")
    path = folder / SEAL
    if path.exists() and path.read_bytes() != text:
        raise BadInput(
            f"'{folder}' holds another withheld check; give a new folder, or its own "
            "count, seed, kind and data"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name, data in ((SEAL, text), (HASH, f"{digest}  {SEAL}\n".encode())):
        write_whole(folder / name, data)
    return digest


def _write(item: tuple[Path, Drawn, float]) -> None:
    folder, drawn, share = item
    write_campaign(folder, campaign_of(drawn, share), stated_map(drawn.stated))


def campaign_of(drawn: Drawn, share: float = 1.0) -> Campaign:
    """Record a drawn case; the campaign states what its engineer knows, nothing of the truth."""
    rng = np.random.default_rng([drawn.seed, 3])
    drive = drawn.true
    pair, style = drawn.case.pair, drawn.case.style
    plans = (
        cycles(style, drive, rng, share)
        if pair is None
        else narrow(pair, scale_of(drive, share), rng)
    )
    b = switched(drawn)
    recordings = []
    for k, plan in enumerate(plans):
        recordings.append(recording(drawn, drifted(drawn, b, k), plan, rng))
    stated = replace(drawn.stated, name=drawn.case.name, description="")
    nominal = Drive(stated, drive.converter, drive.injection, {})
    # a nameplate states the rated values where few operating points show none, and beside a flux
    # map, of which a campaign's rated torque could not be told without reading it
    unrated = drawn.case.pair is None and not isinstance(stated, MappedMotor)
    stated_deviations = uncertainty(stated)
    return Campaign(
        drawn.case.name,
        nominal,
        tuple(recordings),
        stated_deviations,
        drawn.bench.background,
        unrated,
    )


def switched(drawn: Drawn) -> SwitchedBench:
    """Return the switched bench of a drawn case."""
    b = bench(drawn.true.motor, drawn.true.converter, drawn.plant)
    own: dict[str, Any] = {**drawn.own, **drawn.sign}
    return b._replace(common_offset=float(np.mean(drawn.bench.offsets)), **own)


def drifted(drawn: Drawn, b: SwitchedBench, k: int) -> SwitchedBench:
    """Return the bench at the campaign's recording k."""
    warm = 1.0 + drawn.drift * (1.0 - float(np.exp(-k / DRIFT_TIME)))
    return b._replace(resistance=warm * b.resistance)


def recording(
    drawn: Drawn, b: SwitchedBench, plan: Cycle, rng: np.random.Generator, link: float | None = None
) -> CampaignRecording:
    """Record one cycle; link: nominal DC-link voltage (V) where it is not the drive's."""
    n, converter = len(plan.plan), drawn.true.converter
    drive = drawn.true
    if link is not None:
        b = b._replace(link_voltage=b.link_voltage * link / converter.dc_bus_voltage)
        converter = replace(converter, dc_bus_voltage=link)
        drive = replace(drive, converter=converter)
    asked = plan.plan[:, LOAD].copy()
    noise = 1.0 + drawn.bench.background["load_torque_gain"] * rng.standard_normal(n)
    acting = asked * noise + drawn.bench.load_torque_offset
    u_dc = converter.dc_bus_voltage + LINK_NOISE * rng.standard_normal(n)
    tuning = tuned(drive, drawn.stated, plan.injection_axis, rng)
    table = record(b, plan, tuning, drawn.theta, acting, u_dc, int(rng.integers(2**31)))
    columns = {"t": np.arange(n, dtype=np.float64) * converter.sampling_period}
    columns |= {name: table[name].copy() for name in RECORDED.names or ()}
    columns |= {"u_dc": u_dc, "load_torque": asked}
    return CampaignRecording(f"{plan.file}.parquet", plan.rotor, plan.injection_axis, columns, link)
