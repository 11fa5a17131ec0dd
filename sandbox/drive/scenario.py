"""A scenario: what load and speed are asked for, segment by segment; built-in or a user's TOML file."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from model.drive_files import is_file_name
from model.errors import BadInput, brief, unknown
from model.names import fitting
from model.parameters import build, check, finite, quantity, read_toml

SCENARIOS = Path(__file__).parent / "scenarios"
LONGEST = 3600.0  # s of simulated time


@dataclass(frozen=True)
class Segment:
    """A stretch at one load and speed, reached by a linear ramp from the one before."""

    duration: float = quantity("s", 1e-3, LONGEST)  # how long it lasts, the ramp included
    # at its end; i_q over rated current, or the torque that this i_q gives
    load: float = quantity("of rated current", -10, 10, default=0.0)
    # at its end; of a driven rotor, or the reference of a speed controller
    speed: float = quantity("of rated speed", -2, 2, default=0.0)
    # time in which load and speed go from the segment before to these
    ramp: float = quantity("s", 0, LONGEST, default=0.0)
    settle: float | None = None  # s before its errors count; None: the scenario's
    score: bool = True  # whether its position errors count
    current_d: float = quantity("of rated current", -3, 3, default=0.0)  # reference of i_d; with reference = current

    def __post_init__(self) -> None:
        check(self, "segment")
        if self.ramp > self.duration:
            raise BadInput(f"[[segment]] ramp = {self.ramp:g} s is longer than its duration = {self.duration:g} s")
        settle = self.settle
        wait = finite(settle)
        if settle is not None and (wait is None or not 0.0 <= wait < self.duration):
            raise BadInput(f"[[segment]] settle = {brief(settle)} must lie in [0, duration = {self.duration:g}) s")
        if not isinstance(self.score, bool):
            raise BadInput(f"[[segment]] score = {brief(self.score)} is neither true nor false")


@dataclass(frozen=True)
class Scenario:
    """Segments one after another, how the rotor is held, and what the drive controls.

    rotor: locked, driven (speed imposed) or free; reference: `current` (i_d = 0, i_q = load x rated current) or
    `speed` (speed controller; load is the torque that this i_q gives).  start_up: find the position first
    (otherwise the estimator is told it, wrong by start_error).
    """

    name: str  # as results call it
    segments: tuple[Segment, ...]  # one after another
    rotor: str = "locked"  # locked, driven (its speed imposed) or free
    reference: str = "current"  # current (i_d and i_q are controlled) or speed
    # time after a segment's ramp before its errors count, where the segment says nothing
    settle: float = quantity("s", 0, LONGEST, default=0.0)
    description: str = ""  # one line for people
    start_angle: float = quantity("rad", -10, 10, default=1.0)  # true electrical angle at the beginning
    start_up: bool = True  # whether the estimator has to find the position first
    # by how much it is told the position wrong, without starting up
    start_error: float = quantity("rad", -3.2, 3.2, default=0.0)

    def __post_init__(self) -> None:
        check(self, "scenario")
        if self.rotor not in ("locked", "driven", "free"):
            raise unknown("rotor", self.rotor, ("locked", "driven", "free"))
        if self.reference not in ("current", "speed"):
            raise unknown("reference", self.reference, ("current", "speed"))
        if self.reference == "speed" and self.rotor != "free":
            raise BadInput(
                f"reference = 'speed' needs rotor = 'free', not '{self.rotor}'; a held rotor has no speed to control"
            )
        if self.rotor == "locked" and any(s.speed for s in self.segments):
            raise BadInput("a locked rotor cannot follow a speed; give rotor = 'driven' or 'free'")
        if self.reference == "speed" and any(s.current_d for s in self.segments):
            raise BadInput("current_d goes with reference = 'current'; under speed control i_d is kept at 0")
        if self.start_error and self.start_up:
            raise BadInput("start_error needs start_up = false: what starting up finds cannot be told wrong")
        if not isinstance(self.start_up, bool):
            raise BadInput(f"[scenario] start_up = {brief(self.start_up)} is neither true nor false")
        if not any(s.score for s in self.segments) and self.segments:
            raise BadInput(f"scenario '{self.name}' scores no segment; leave score = false away in at least one")
        if not self.segments:
            raise BadInput(f"scenario '{self.name}' has no [[segment]]; add at least one with a duration in s")
        if self.duration > LONGEST:
            raise BadInput(f"scenario '{self.name}' lasts {self.duration:g} s; at most {LONGEST:g} s are simulated")

    @property
    def duration(self) -> float:
        """Length without starting up, s."""
        return sum(s.duration for s in self.segments)

    def settle_of(self, segment: Segment) -> float:
        """Return how long (s) to wait in a segment before its errors count."""
        wait = self.settle if segment.settle is None else segment.settle
        return min(wait, 0.5 * segment.duration) if segment.settle is None else wait

    def cut(self, duration: float) -> Scenario:
        """Return the scenario ended after `duration` s; BadInput where it is not that long."""
        if not 1e-3 <= duration <= self.duration * (1.0 + 1e-9):
            raise BadInput(f"duration {duration} s is out of range; '{self.name}' has [0.001, {self.duration:g}] s")
        kept: list[Segment] = []
        left = duration
        for s in self.segments:
            if left <= 1e-9:
                break
            length = min(s.duration, left)
            settle = None if s.settle is None else min(s.settle, 0.5 * length)
            kept.append(dataclasses.replace(s, duration=length, ramp=min(s.ramp, length), settle=settle))
            left -= length
        kept[-1] = dataclasses.replace(kept[-1], score=True)
        return dataclasses.replace(self, segments=tuple(kept))


def scenario_names() -> list[str]:
    """Return the names of the scenarios that come with the package."""
    return sorted(p.stem for p in SCENARIOS.glob("*.toml"))


def load_scenario(name: str | Path) -> Scenario:
    """Return a scenario by name or from a TOML file; BadInput names what is wrong."""
    path = Path(name)
    if not is_file_name(path):
        if str(name) not in scenario_names():
            raise unknown("scenario", name, scenario_names())
        path = SCENARIOS / f"{name}.toml"
    data = read_toml(path)
    try:
        return scenario_of(data, fitting(path.stem, "scenario"))
    except BadInput as error:
        raise BadInput(f"{path.name}: {error}") from None


def scenario_of(data: dict[str, Any], name: str) -> Scenario:
    """Return the scenario of a file's tables, named so where it gives no name; BadInput says what is wrong."""
    for table in data:
        if table not in ("scenario", "segment"):
            raise unknown("table", table, ("scenario", "segment"))
    head, rows = data.get("scenario", {}), data.get("segment", [])
    if not isinstance(head, dict) or not isinstance(rows, list) or not all(isinstance(r, dict) for r in rows):
        raise BadInput("a scenario is one [scenario] table and one [[segment]] table for each stretch")
    if "segments" in head:
        raise unknown("key in [scenario]", "segments", ("settle", "rotor", "reference"))
    segments = tuple(build(Segment, dict(r), "segment") for r in rows)
    scenario: Scenario = build(Scenario, {"name": name, **head, "segments": segments}, "scenario")
    return scenario
