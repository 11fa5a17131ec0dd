"""A scenario: what load and speed are asked for, segment by segment; built-in or a user's TOML
file."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import Any

from model.drive_files import is_file_name
from model.errors import BadInput, as_toml, brief, unknown
from model.given import read_toml
from model.names import fitting
from model.parameters import build, check, finite, quantity

SCENARIOS = Path(__file__).parent / "scenarios"
LONGEST = 3600.0  # s of simulated time


@dataclass(frozen=True)
class Segment:
    """A part of a scenario at one load and one speed, reached by a linear ramp from those of the
    segment before.

    Parameters
    ----------
    duration : float
        s, 0.001 to 3600: how long it lasts, the ramp included.
    load : float, default 0.0
        of rated current, -10 to 10: at its end, i_q over rated current (under speed control the
        torque that this i_q gives).
    speed : float, default 0.0
        of rated speed, -2 to 2: at its end, the speed of a driven rotor, or the reference of the
        speed controller.
    ramp : float, default 0.0
        s, 0 to 3600: time in which load and speed go from those of the segment before to these; at
        most `duration`.
    settle : float, optional
        s, shorter than `duration`: how long to wait before its position errors count; the
        scenario's by default.
    score : bool, default True
        Whether its position errors count.
    current_d : float, default 0.0
        of rated current, -3 to 3: reference of i_d, where the scenario's `reference` is 'current'.
    blocked : bool, default False
        Whether the inverter's gates are blocked: no switch conducts and currents die away through
        the diodes. The next segment is then a flying start.

    Raises
    ------
    BadInput
        For a value outside its range.

    Examples
    --------
    120 % load, reached in 0.1 s; the errors of the last 0.3 s count.

    >>> from sandbox import Segment
    >>> Segment(0.5, load=1.2, ramp=0.1, settle=0.2).load
    1.2
    """

    duration: float = quantity("s", 1e-3, LONGEST)
    load: float = quantity("of rated current", -10, 10, default=0.0)
    speed: float = quantity("of rated speed", -2, 2, default=0.0)
    ramp: float = quantity("s", 0, LONGEST, default=0.0)
    settle: float | None = None
    score: bool = True
    current_d: float = quantity("of rated current", -3, 3, default=0.0)
    blocked: bool = False

    def __post_init__(self) -> None:
        check(self, "segment")
        if self.ramp > self.duration:
            raise BadInput(
                f"[[segment]] ramp = {self.ramp:g} s is longer than its duration = "
                f"{self.duration:g} s"
            )
        settle = self.settle
        wait = finite(settle)
        if settle is not None and (wait is None or not 0.0 <= wait < self.duration):
            raise BadInput(
                f"[[segment]] settle = {as_toml(settle)} must lie in [0, duration = "
                f"{self.duration:g}) s"
            )
        for name in ("score", "blocked"):
            if not isinstance(getattr(self, name), bool):
                raise BadInput(
                    f"[[segment]] {name} = {as_toml(getattr(self, name))} is neither true nor false"
                )
        if self.blocked and self.current_d:
            raise BadInput(
                "[[segment]] current_d needs gates that switch; leave it or blocked = true away"
            )


@dataclass(frozen=True, repr=False)
class Scenario:
    """What a drive is asked to do: segments one after another, how the rotor is held, and what is
    controlled.

    Parameters
    ----------
    name : str
        As results call it; it must do as a file's name.
    segments : tuple of Segment
        One after another; at least one, at most 3600 s together.
    rotor : {'locked', 'driven', 'free'}, default 'locked'
        What is done with the rotor: it cannot turn, its speed is imposed, or it turns as the torque
        makes it.
    reference : {'current', 'speed'}, default 'current'
        What is controlled: i_d and i_q, or the speed of a free rotor (`load` is then the load's
        torque).
    settle : float, default 0.0
        s, 0 to 3600: time to wait in a segment before its errors count, where the segment does not
        say it; at most half of a segment.
    description : str, default ''
        One line for people.
    start_angle : float, default 1.0
        rad, -10 to 10: true electrical angle at the beginning.
    start_up : bool, default True
        Whether the estimator has to find the position first; otherwise it is told.
    start_error : float, default 0.0
        rad, -3.2 to 3.2: by how much it is told the position wrong; only without starting up.

    Raises
    ------
    BadInput
        For a value outside its range, and for values that contradict each other, such as a locked
        rotor with a speed.

    Examples
    --------
    >>> from sandbox import Scenario, Segment
    >>> parts = (Segment(0.3), Segment(0.5, load=1.2, ramp=0.1, settle=0.2))
    >>> Scenario("steps", parts, rotor="locked").duration
    0.8
    """

    name: str
    segments: tuple[Segment, ...]
    rotor: str = "locked"
    reference: str = "current"
    settle: float = quantity("s", 0, LONGEST, default=0.0)
    description: str = ""
    start_angle: float = quantity("rad", -10, 10, default=1.0)
    start_up: bool = True
    start_error: float = quantity("rad", -3.2, 3.2, default=0.0)

    def __post_init__(self) -> None:
        check(self, "scenario")
        if self.rotor not in ("locked", "driven", "free"):
            raise unknown("rotor", self.rotor, ("locked", "driven", "free"))
        if self.reference not in ("current", "speed"):
            raise unknown("reference", self.reference, ("current", "speed"))
        if self.reference == "speed" and self.rotor != "free":
            raise BadInput(
                f"reference = 'speed' needs rotor = 'free', not '{self.rotor}'; a held "
                "rotor has no speed to control"
            )
        if self.rotor == "locked" and any(s.speed for s in self.segments):
            raise BadInput("a locked rotor cannot follow a speed; give rotor = 'driven' or 'free'")
        if self.reference == "speed" and any(s.current_d for s in self.segments):
            raise BadInput(
                "current_d goes with reference = 'current'; under speed control i_d is kept at 0"
            )
        if self.start_error and self.start_up:
            raise BadInput(
                "start_error needs start_up = false: what starting up finds cannot be told wrong"
            )
        if not isinstance(self.start_up, bool):
            raise BadInput(
                f"[scenario] start_up = {as_toml(self.start_up)} is neither true nor false"
            )
        if not any(s.score for s in self.segments) and self.segments:
            raise BadInput(
                f"scenario '{self.name}' scores no segment; leave score = false away in "
                "at least one"
            )
        if not self.segments:
            raise BadInput(
                f"scenario '{self.name}' has no [[segment]]; add at least one with a duration in s"
            )
        if self.duration > LONGEST:
            raise BadInput(
                f"scenario '{self.name}' lasts {self.duration:g} s; at most {LONGEST:g} "
                "s are simulated"
            )

    def __repr__(self) -> str:
        parts = f"{len(self.segments)} segment{'s' * (len(self.segments) > 1)}"
        return (
            f"<Scenario: {self.name}, {parts}, {self.duration:g} s, rotor {self.rotor}, "
            f"{self.reference} controlled>"
        )

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
        if isinstance(duration, bool) or not isinstance(duration, Real):
            raise BadInput(f"duration = {brief(duration)} is no number; give s")
        if not 1e-3 <= duration <= self.duration * (1.0 + 1e-9):
            raise BadInput(
                f"duration {duration} s is out of range; '{self.name}' has [0.001, "
                f"{self.duration:g}] s"
            )
        kept: list[Segment] = []
        left = duration
        for s in self.segments:
            if left <= 1e-9:
                break
            length = min(s.duration, left)
            settle = None if s.settle is None else min(s.settle, 0.5 * length)
            kept.append(
                dataclasses.replace(s, duration=length, ramp=min(s.ramp, length), settle=settle)
            )
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
    """Return the scenario of a file's tables, named so where it gives no name; BadInput says what
    is wrong."""
    for table in data:
        if table not in ("scenario", "segment"):
            raise unknown("table", table, ("scenario", "segment"))
    head, rows = data.get("scenario", {}), data.get("segment", [])
    if (
        not isinstance(head, dict)
        or not isinstance(rows, list)
        or not all(isinstance(r, dict) for r in rows)
    ):
        raise BadInput(
            "a scenario is one [scenario] table and one [[segment]] table for each segment"
        )
    if "segments" in head:
        raise unknown("key in [scenario]", "segments", ("settle", "rotor", "reference"))
    if "like" in head:
        head, rows = _like(head, rows)
    segments = tuple(build(Segment, dict(r), "segment") for r in rows)
    scenario: Scenario = build(Scenario, {"name": name, **head, "segments": segments}, "scenario")
    return scenario


def _like(head: dict[str, Any], rows: list[Any]) -> tuple[dict[str, Any], list[Any]]:
    """Return [scenario] and [[segment]] of a file that changes one of ours: its keys in their
    place, its segments instead of all."""
    name = head["like"]
    if name not in scenario_names():
        raise unknown("scenario in like", str(name), scenario_names())
    base = read_toml(SCENARIOS / f"{name}.toml")
    kept = {k: v for k, v in base["scenario"].items() if k != "name"}
    return {**kept, **{k: v for k, v in head.items() if k != "like"}}, rows or base["segment"]
