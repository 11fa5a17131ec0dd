"""The truth of a withheld case: its drive, deviations and effects, all drawn from one seed.

The last digits of a drawn number depend on the machine (its exponential function, the spline fit of
a flux map), so a truth is sealed with SEALED digits: the same seed gives the same seal everywhere.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from model.effects.library import complete
from model.errors import BadInput
from model.mapped import MappedMotor, without_map
from model.parameters import Drive, Motor
from sandbox.output.files import plain, rounded
from sandbox.switched.bench_numbers import SOFT_SIGN
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.drives import (
    VALID_TO,
    BenchDeviations,
    draw_bench,
    draw_drive,
    misjudge,
    off_by,
    sign_of,
    valid,
)
from sandbox.withheld.making.effect_sizes import Planted, plant, truth_of
from sandbox.withheld.making.map_motors import can_be_stated, changed, like_map
from sandbox.withheld.making.mapped_drive import FLUX_MAP, SUBSYSTEM, identified, missing
from sandbox.withheld.making.outside_causes import EVERY, OUTSIDE
from sandbox.withheld.making.published import multiple, planted
from sandbox.withheld.making.users_effects import size_at, users_cards, users_planted, users_truth

# significant digits; what machines differ by, 1e-12 at the most, moves one in a million of them
SEALED = 6


@dataclass(frozen=True)
class Drawn:
    """A case with its drive: what is true, what its engineer believes, what the switched bench gets
    beside."""

    case: Case
    true: Drive
    stated: Motor  # as campaign.toml states it
    bench: BenchDeviations
    plant: dict[str, float]
    own: dict[str, float]  # the switched bench's own effects
    sign: dict[str, float]  # how the sign of a current goes through zero on it, where not as usual
    drift: float
    theta: float  # rad at the start; where a locked rotor stands
    seed: int
    sizes: tuple[float, ...]  # multiples of the medium one
    off: dict[str, float]  # ordinary deviations, in stated ones
    # alphas by which the true motor saturates beyond the flux map that is stated
    added_to_map: dict[str, float]

    def as_json(self) -> dict[str, Any]:
        """Return the truth as the seal keeps it."""
        case, b = self.case, self.bench
        return {
            **{k: getattr(case, k) for k in ("kind", "family", "style", "outside")},
            **({"pair": case.pair} if case.pair else {}),
            "effects": [*case.names, *(["unknown"] if case.outside else [])],
            "outside_subsystem": outside_subsystem(case.outside),
            "sizes": self.sizes,
            **(
                {"places": case.sizes[: len(case.names)]}
                if case.table == "published" and case.names
                else {}
            ),
            "parameters": truth_of(
                list(case.names), self.true.motor, self.stated, self.plant, self.added_to_map
            )
            | users_truth(case.names, self.own),
            "outside_parameters": {**self.own, **({"drift": self.drift} if self.drift else {})},
            "true_motor": dataclasses.asdict(without_map(self.true.motor)),
            "plant": self.plant,
            "deviations": self.off,
            "bench": {
                "common_offset": float(np.mean(b.offsets)),
                "load_torque_offset": b.load_torque_offset,
                "theta": self.theta,
                "soft_current": SOFT_SIGN * self.true.motor.rated_current,
                **self.sign,
            },
        }

    def sealed(self) -> dict[str, Any]:
        """Return the truth as it stands in the seal: with as many digits as all machines agree
        on."""
        truth: dict[str, Any] = rounded(plain(self.as_json()), SEALED)
        return truth


def outside_names(kind: str = "mixed") -> list[str]:
    """Return what is outside the library and can be made here in a kind of check: a flux map needs
    its data set."""
    return [*(EVERY if kind == "outside" else OUTSIDE), *([] if missing() else [FLUX_MAP])]


def outside_subsystem(name: str | None) -> str | None:
    """Return where an effect outside the library lies."""
    if name is None:
        return None
    return SUBSYSTEM if name == FLUX_MAP else EVERY[name].subsystem


def draw(case: Case, seed: int, without: Sequence[str] = ()) -> Drawn:
    """Return a case with its drive; drawn again where motor or effects are not valid on it.

    without: effects of the case that are taken out of the drive; all that is drawn and stated is
    the same without them.
    """
    rng = np.random.default_rng([seed, 2, case.index])
    for _ in range(200):
        found = _once(case, rng, without)
        if found is not None:
            return found
    raise AssertionError(f"{case.name}: nothing valid in 200 draws")


def _once(case: Case, rng: Generator, without: Sequence[str]) -> Drawn | None:
    drive = draw_drive(case.family, rng, case.style == "scored")
    by_range = case.table == "published"
    bench = draw_bench(drive, rng, by_range)
    base = drive.motor
    plans, multiples = _plans(case, drive, rng)
    believed = identified(base) if case.outside == FLUX_MAP else base
    for p in plans.values():
        believed = changed(believed, p.believed)
    true, values, own = _put_in(base, plans, ())
    drift, unlisted = 0.0, dict[str, float]()
    if case.outside in EVERY:
        p = EVERY[case.outside].planted(drive, case.sizes[-1], rng)
        unlisted, drift = dict(p.bench), p.drift
    own |= unlisted
    values = with_deviations(values, bench)
    stated = misjudge(believed, rng, by_range)
    sign = sign_of(base, rng) if by_range else {}
    if not (valid(true) and _can_be_stated(stated, true)):
        return None
    try:
        complete(true, drive.converter, values)
    except BadInput:
        return None
    stands, last = float(rng.uniform(0.0, 2.0 * np.pi)), int(rng.integers(2**31))
    added = _added_to_map(plans, without)
    if without:
        case, multiples = _taken_out(case, multiples, without)
        true, values, left = _put_in(base, plans, without)
        values, own = with_deviations(values, bench), left | unlisted
    return Drawn(
        case,
        dataclasses.replace(drive, motor=true),
        stated,
        bench,
        values,
        own,
        sign,
        drift,
        stands,
        last,
        tuple(multiples),
        off_by(believed, stated, bench),
        added,
    )


def _can_be_stated(stated: Motor, true: Motor) -> bool:
    """Tell whether a stated motor is a valid one; of a flux map, wherever the true motor goes."""
    if isinstance(stated, MappedMotor):
        return can_be_stated(stated, true, VALID_TO * true.rated_current)
    return valid(stated)


def _added_to_map(plans: Mapping[str, Planted], without: Sequence[str]) -> dict[str, float]:
    """Return the alphas that a stated flux map lacks of the true motor's; none of a motor whose own
    alphas say it."""
    return {
        name: -size
        for effect, p in plans.items()
        if effect not in without
        for name, size in p.of_map.items()
    }


def _taken_out(
    case: Case, multiples: list[float], without: Sequence[str]
) -> tuple[Case, list[float]]:
    """Return a case and its sizes (multiples of medium ones) without some of its effects; a cause
    outside stays."""
    kept = [
        k for k in range(len(case.sizes)) if k >= len(case.names) or case.names[k] not in without
    ]
    names = tuple(case.names[k] for k in kept if k < len(case.names))
    smaller = dataclasses.replace(case, names=names, sizes=tuple(case.sizes[k] for k in kept))
    return smaller, [multiples[k] for k in kept]


def _plans(case: Case, drive: Drive, rng: Generator) -> tuple[dict[str, Planted], list[float]]:
    """Return what each effect of a case changes, and its size as a multiple of the medium one."""
    plans, multiples, users = dict[str, Planted](), list(case.sizes), users_cards()
    for k, name in enumerate(case.names):
        if name in users:
            multiples[k] = size_at(case.sizes[k]) if case.table == "published" else case.sizes[k]
            plans[name] = users_planted(
                users[name], drive.motor, drive.converter, multiples[k], rng
            )
            continue
        like = like_map(drive.motor, name)
        if case.table == "published":
            plans[name] = planted(name, like, drive.converter, case.sizes[k], rng)
            multiples[k] = multiple(name, like, drive.converter, plans[name])
        else:
            plans[name] = plant(name, like, drive.converter, case.sizes[k], rng)
        if like is not drive.motor:
            plans[name] = _on_map(plans[name], like)
    return plans, multiples


def _on_map(p: Planted, like: Motor) -> Planted:
    """Return what an effect on saturation changes on a flux map, planted on the quartic that is
    like it: what the map that is stated has more than the true one."""
    more = {name: value - getattr(like, name) for name, value in p.believed.items()}
    return dataclasses.replace(p, believed=more, of_map=more)


def _put_in(
    base: Motor, plans: Mapping[str, Planted], without: Sequence[str]
) -> tuple[Motor, dict[str, float], dict[str, float]]:
    """Return the true motor, the plant's parameters and the switched bench's own ones; what is
    taken out is true as the engineer believes it."""
    true, values, own = base, dict[str, float](), dict[str, float]()
    for name, p in plans.items():
        if name in without:
            true = changed(true, p.believed)
            continue
        true = changed(true, p.true)
        values |= p.plant
        own |= p.bench
    return true, values, own


def with_deviations(values: dict[str, float], bench: BenchDeviations) -> dict[str, float]:
    """Return the plant's parameters with the bench's ordinary deviations on top."""
    offsets = np.array(bench.offsets) - np.mean(bench.offsets)
    more = {f"current_gain.gain_{x}": g - 1.0 for x, g in zip("abc", bench.gains, strict=True)}
    more |= {
        "current_offset.offset_a": float(offsets[0]),
        "current_offset.offset_b": float(offsets[1]),
    }
    more |= {"encoder_offset.offset": bench.encoder_offset, "dead_time.time": bench.dead_time}
    neutral = {name: 1.0 if name.startswith("current_gain") else 0.0 for name in more}
    return values | {name: values.get(name, neutral[name]) + x for name, x in more.items()}
