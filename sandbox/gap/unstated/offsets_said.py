"""Offsets of the current sensors that differ between recordings, in words."""

from __future__ import annotations

from collections.abc import Mapping

from model.effects import said
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.unstated.drifting import NAMED
from sandbox.gap.words import quantity

ByRecording = Mapping[str, Mapping[str, Estimate]]  # parameters of current_offset by name


def sized(own: ByRecording) -> str:
    """Return the offset of the sensor that differs most, with its interval, in each recording; of
    more than NAMED the lowest and the highest."""
    each = [list(x.values()) for x in own.values()]
    spans = [max(e.value for e in x) - min(e.value for e in x) for x in zip(*each, strict=True)]
    sensor = spans.index(max(spans))
    ranked = sorted(zip(own, each, strict=True), key=lambda x: x[1][sensor].value)
    shown = ranked if len(ranked) <= NAMED else [ranked[0], ranked[-1]]
    texts = [f"{quantity(x[sensor])} in {file}" for file, x in shown]
    return f"offset of current sensor {'abc'[sensor]} {', '.join(texts)}"


def subtracted(own: ByRecording) -> str:
    """Return what to do about it."""
    each = [f"{_phases(*(e.value for e in x.values()))} in {file}" for file, x in own.items()]
    more = f"; the other {len(each) - NAMED} stand in effects.toml" if len(each) > NAMED else ""
    return (
        f"subtract from the current readings: {'; '.join(each[:NAMED])}{more}; the offsets drift, "
        "so measure them at rest before each recording, with the legs switching"
    )


def _phases(*offsets: float) -> str:
    each = zip("abc", offsets, strict=True)
    return ", ".join(f"{said.quantity(x, 'A')} from phase {p}" for p, x in each)
