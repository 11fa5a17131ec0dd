"""A sweep as it is asked for: what is the same in all runs, what is combined, what is drawn; from
TOML or a dict.

    [run]             the same in all runs
    [grid]            lists of values: every combination of them
    [random]          design = "sobol", points, seed; [random.draw] what is drawn together, once a point

Run number = point x cells + cell, the grid's last key fastest, so that runs of one point stand
together.
"""  # noqa: E501

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from model.errors import BadInput, as_toml, brief, unknown
from model.given import named_by, read_toml
from model.names import check_name, fitting
from sandbox.evaluation.sweep.keys import (
    USUAL,
    Value,
    check_key,
    check_names,
    check_value,
    flat,
    keys,
)
from sandbox.output.provenance import digest_of as digest_of_file

DESIGNS = ("sobol", "latin_hypercube", "independent")
CUT = 4.0  # standard deviations at which a normal distribution ends
FILES = ("motor", "scenario", "estimator")
TABLES = ("sweep", "run", "grid", "random", "traces", "scenario", "segment")
MOST_POINTS, MOST_VALUES = 10_000_000, 100_000
MOST_DRAWN = 50_000_000  # numbers: 400 MB
OWN = "own"
# these change how long a run is
LENGTHS = ("duration", "motor_value.", "drive_value.", "injection_value.")


@dataclass(frozen=True)
class Draw:
    """A distribution: uniform [low, high], log_uniform [low, high], normal [mean, standard
    deviation] (ends at 4 of them), integers [low, high] (both included).
    """

    kind: str
    a: float
    b: float

    def at(self, share: float) -> float:
        """Return the value at a share in [0, 1) of the probability."""
        if self.kind == "integers":
            return self.a + math.floor(share * (self.b - self.a + 1.0))
        if self.kind == "log_uniform":
            return self.a * (self.b / self.a) ** share
        if self.kind == "normal":
            from scipy.special import ndtr, ndtri

            tail = float(ndtr(-CUT))
            return self.a + self.b * float(ndtri(tail + share * (1.0 - 2.0 * tail)))
        return self.a + share * (self.b - self.a)

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value."""
        return (
            (self.a - CUT * self.b, self.a + CUT * self.b)
            if self.kind == "normal"
            else (self.a, self.b)
        )


DRAWS = ("uniform", "log_uniform", "normal", "integers")


@dataclass(frozen=True)
class Traces:
    """Which channels of each run are kept, every stride-th sample of them."""

    channels: tuple[str, ...]
    stride: int = 1


@dataclass(frozen=True)
class Sweep:
    """A checked sweep; `text` is all of it as JSON, from which any process makes it again."""

    name: str
    text: str
    fixed: Mapping[str, Value]
    grid: Mapping[str, tuple[Value, ...]]
    draws: Mapping[str, Draw]
    design: str
    points: int
    seed: int
    traces: Traces | None
    scene: Mapping[str, Any] | None = field(repr=False)

    @property
    def cells(self) -> int:
        """Combinations of the grid."""
        return math.prod(len(values) for values in self.grid.values())

    @property
    def runs(self) -> int:
        """How many runs there are."""
        return self.points * self.cells

    @cached_property
    def shares(self) -> NDArray[np.float64]:
        """The random design in the unit cube: (points, draws)."""
        return shares_of(self.design, self.points, len(self.draws), self.seed)

    def case(self, run: int) -> dict[str, Value]:
        """Return every key's value of a run."""
        point, cell = divmod(run, self.cells)
        found = dict(self.fixed)
        for name in reversed(list(self.grid)):
            cell, place = divmod(cell, len(self.grid[name]))
            found[name] = self.grid[name][place]
        for k, (name, draw) in enumerate(self.draws.items()):
            value = draw.at(float(self.shares[point, k]))
            found[name] = int(value) if keys()[name].kind is int else value
        return found

    def values(self, name: str) -> tuple[Value, ...]:
        """Return what a key that is not drawn takes in the sweep."""
        return (
            self.grid[name]
            if name in self.grid
            else (self.fixed[name],)
            if name in self.fixed
            else ()
        )

    @property
    def varied(self) -> tuple[str, ...]:
        """Every key that the sweep names, and the usual ones, in the order of a table's columns."""
        return tuple(dict.fromkeys([*USUAL, *self.fixed, *self.grid, *self.draws]))


def shares_of(design: str, points: int, draws: int, seed: int) -> NDArray[np.float64]:
    """Return a design in the unit cube, (points, draws)."""
    rng = np.random.default_rng(seed)
    if draws == 0 or design == "independent":
        return rng.random((points, draws))
    from scipy.stats import qmc

    if design == "sobol":  # a power of 2 is drawn, the first points of it are taken
        found = qmc.Sobol(draws, scramble=True, seed=rng).random_base2(
            max(0, (points - 1).bit_length())
        )
        return np.asarray(found[:points])
    return np.asarray(qmc.LatinHypercube(draws, seed=rng).random(points))


def read_sweep(path: str | Path) -> Sweep:
    """Return the sweep of a TOML file; files that it names are looked for beside it.  BadInput says
    what is wrong."""
    path = Path(path)
    tables = read_toml(path)
    if tables and set(tables) <= {"scenario", "segment"}:
        raise BadInput(
            f"{path.name} is a scenario, which is one run; add a table [run], [grid] or [random], "
            "or run it by `sensorless simulate --scenario`"
        )
    if not tables:
        raise BadInput(f"{path.name} says nothing; name what is run in [run], [grid] or [random]")
    try:
        return sweep_of(tables, fitting(path.stem, "sweep"), path.parent)
    except BadInput as error:
        raise BadInput(f"{path.name}: {error}") from None


def sweep_of(tables: Mapping[str, Any], name: str = "sweep", folder: Path | None = None) -> Sweep:
    """Return the sweep of tables laid out as in a TOML file, everything checked that can be before
    it runs; BadInput for the first thing that is wrong."""
    for table in tables:
        if table not in TABLES:
            from model.effects.library import effect_names

            if table in effect_names():
                raise BadInput(
                    f"'{table}' is an effect and stands in no table; put it under [run] or [grid]"
                )
            raise unknown("table", table, TABLES)
    head = _table(tables, "sweep", ("name", "description"))
    fixed = {k: check_value(k, v, "run") for k, v in flat(_table(tables, "run")).items()}
    grid = {k: _list(k, v) for k, v in flat(_table(tables, "grid")).items()}
    random = _table(tables, "random", ("design", "points", "seed", "draw"))
    draws = {k: _draw(k, v) for k, v in flat(_table(random, "draw"), _is_draw).items()}
    scene = {k: tables[k] for k in ("scenario", "segment") if k in tables} or None
    if scene is not None and "scenario" not in grid:
        fixed.setdefault("scenario", OWN)
    fixed = {k: v for k, v in USUAL.items() if k not in grid and k not in draws} | fixed
    _check_once(fixed, grid, draws, scene)
    folder = Path() if folder is None else folder
    fixed = {k: _found(k, v, folder) for k, v in fixed.items()}
    grid = {k: tuple(_found(k, v, folder) for v in values) for k, values in grid.items()}
    design, points, seed = _random(random, draws)
    traces = _traces(tables, draws)
    whole = {
        "name": check_name(head.get("name", name), "[sweep] name"),
        "fixed": fixed,
        "grid": grid,
        "draws": {k: {d.kind: [d.a, d.b]} for k, d in draws.items()},
        "design": design,
        "points": points,
        "seed": seed,
        "traces": None if traces is None else [list(traces.channels), traces.stride],
        "scene": scene,
    }
    try:
        text = json.dumps(whole, allow_nan=False)
    except (TypeError, ValueError):
        raise BadInput(
            "[[segment]] and [scenario] hold texts, numbers and truth values only"
        ) from None
    sweep = again(text)
    if sweep.points * len(draws) > MOST_DRAWN:
        raise BadInput(
            f"{points} points of {len(draws)} draws are more than {MOST_DRAWN} numbers; "
            "take fewer points"
        )
    if scene is not None:
        scene_of(sweep)
    check_names({k: sweep.values(k) for k in FILES})
    return sweep


@lru_cache(maxsize=4)
def again(text: str) -> Sweep:
    """Return the sweep of a `Sweep.text`, which has been checked before."""
    whole = json.loads(text)
    return Sweep(
        whole["name"],
        text,
        whole["fixed"],
        {k: tuple(v) for k, v in whole["grid"].items()},
        {k: Draw(kind, *ends) for k, v in whole["draws"].items() for kind, ends in v.items()},
        whole["design"],
        whole["points"],
        whole["seed"],
        None if whole["traces"] is None else Traces(tuple(whole["traces"][0]), whole["traces"][1]),
        whole["scene"],
    )


def scene_of(sweep: Sweep) -> Any:
    """Return the scenario that stands in the sweep's own file."""
    from sandbox.drive.scenario import scenario_of

    return scenario_of(dict(sweep.scene or {}), sweep.name)


def label(name: str, value: Value) -> Value:
    """Return a value as a table shows it: a file by its own name, not by its place."""
    return Path(str(value)).name if name in FILES else value


def digest_of(sweep: Sweep) -> str:
    """Return a hash of the sweep with the content of every file that it names, wherever these
    lie."""
    text = sweep.text
    for name in FILES:
        for value in sweep.values(name):
            path = Path(str(value))
            if not path.is_absolute():
                continue
            content = path.read_bytes() + _files_named(path)
            text = text.replace(json.dumps(str(value)), f'"{hashlib.sha256(content).hexdigest()}"')
    return hashlib.sha256(text.encode()).hexdigest()


def _files_named(path: Path) -> bytes:
    """Return names and hashes of the files that a TOML file names: a flux map, an inverter's
    table."""
    return b"".join(
        f"{file.name} {digest_of_file(file)}\n".encode() for file in named_by(path, path.parent)
    )


def _table(tables: Mapping[str, Any], name: str, known: tuple[str, ...] = ()) -> dict[str, Any]:
    found = tables.get(name, {})
    if not isinstance(found, Mapping):
        raise BadInput(f"'{name}' is not a table; write [{name}]")
    for key in found:
        if known and key not in known:
            raise unknown(f"key in [{name}]", key, known)
    return dict(found)


def _list(name: str, values: object) -> tuple[Value, ...]:
    if not isinstance(values, (list, tuple)) or not values:
        raise BadInput(
            f"[grid] {name} = {as_toml(values)} is no list of values; write {name} = "
            "[1.0, 2.0], or see [run]"
        )
    if len(values) > MOST_VALUES:
        raise BadInput(
            f"[grid] {name} has {len(values)} values; at most {MOST_VALUES} are taken, "
            "draw them instead"
        )
    found = tuple(check_value(name, v, "grid") for v in values)
    if len(set(found)) < len(found):
        raise BadInput(f"[grid] {name} names a value twice; give each once")
    return found


def _is_draw(value: Mapping[str, Any]) -> bool:
    return any(isinstance(ends, (list, tuple)) for ends in value.values())


def _draw(name: str, value: object) -> Draw:
    key, table = check_key(name, "random.draw"), "random.draw"
    said = f"[{table}] {name} = {as_toml(value)}"
    if not isinstance(value, Mapping) or len(value) != 1:
        raise BadInput(
            f"{said} is no distribution; write {name} = {{uniform = [0.9, 1.1]}} "
            f"({', '.join(DRAWS)})"
        )
    kind, ends = next(iter(value.items()))
    if kind not in DRAWS:
        raise unknown(f"distribution of {name}", kind, DRAWS)
    if key.kind not in (int, float) or (key.kind is int) != (kind == "integers"):
        fit = {int: "integers = [low, high]", float: "uniform, log_uniform or normal"}
        raise BadInput(
            f"{said}: '{name}' is "
            f"{f'drawn by {fit[key.kind]}' if key.kind in fit else 'put in [grid]'}"
        )
    if not isinstance(ends, (list, tuple)) or len(ends) != 2:
        raise BadInput(f"{said} needs two numbers, {kind} = [a, b]")
    if any(
        isinstance(x, bool) or not isinstance(x, (int, float)) or not math.isfinite(x) for x in ends
    ):
        raise BadInput(f"{said} needs two finite numbers, {kind} = [a, b]")
    draw = Draw(kind, float(ends[0]), float(ends[1]))
    if (kind == "normal" and draw.b < 0.0) or (kind != "normal" and draw.b < draw.a):
        raise BadInput(
            f"{said}: the second number must not be below "
            f"{'0' if kind == 'normal' else 'the first'}"
        )
    if kind == "log_uniform" and draw.a <= 0.0:
        raise BadInput(f"{said}: a logarithm needs numbers above 0")
    for end in draw.ends:
        check_value(name, end, table)
    return draw


def _random(table: Mapping[str, Any], draws: Mapping[str, Draw]) -> tuple[str, int, int]:
    design, points, seed = (
        table.get("design", "sobol"),
        table.get("points", 1),
        table.get("seed", 0),
    )
    if design not in DESIGNS:
        raise unknown("random design", design, DESIGNS)
    for name, value, low, high in (("points", points, 1, MOST_POINTS), ("seed", seed, 0, 10**18)):
        if type(value) is not int or not low <= value <= high:
            raise BadInput(
                f"[random] {name} = {as_toml(value)} is out of range; give a whole "
                f"number in [{low}, {high}]"
            )
    if table and not draws:
        raise BadInput(
            "[random] draws nothing; add [random.draw] with a distribution, or leave [random] away"
        )
    return design, points, seed


def _traces(tables: Mapping[str, Any], draws: Mapping[str, Draw]) -> Traces | None:
    if "traces" not in tables:
        return None
    for name in draws:
        if name.startswith(LENGTHS):
            raise BadInput(
                f"[traces] need runs of a few lengths, but '{name}' is drawn; leave one "
                "of both away"
            )
    from sandbox.drive.recording import CHANNELS

    table, known = _table(tables, "traces", ("channels", "stride")), (*CHANNELS, "error")
    channels, stride = table.get("channels", ["error"]), table.get("stride", 1)
    if not isinstance(channels, (list, tuple)) or not channels:
        raise BadInput(
            f"[traces] channels = {as_toml(channels)} is no list of channels; write "
            'channels = ["error"]'
        )
    for channel in channels:
        if channel not in known:
            raise unknown("channel", channel, known)
    if type(stride) is not int or stride < 1:
        raise BadInput(
            f"[traces] stride = {as_toml(stride)} is out of range; keep every stride-th "
            "sample, at least 1"
        )
    return Traces(tuple(dict.fromkeys(channels)), stride)


def _check_once(
    fixed: Mapping[str, Any], grid: Mapping[str, Any], draws: Mapping[str, Any], scene: Any
) -> None:
    for one, other, tables in (
        (fixed, grid, "[run] and [grid]"),
        (fixed, draws, "[run] and [random.draw]"),
        (grid, draws, "[grid] and [random.draw]"),
    ):
        for name in one:
            if name in other:
                raise BadInput(f"'{name}' stands in {tables}; give it once")
    named = [fixed["scenario"]] if "scenario" in fixed else grid["scenario"]
    if (OWN in named) != (scene is not None):
        raise BadInput(
            "scenario = 'own' means the [[segment]] tables of the sweep's own file; give "
            "both, or neither"
        )


def _found(name: str, value: Value, folder: Path) -> Value:
    """Return a file's name as a full path, looked for beside the sweep's file."""
    text = str(value)
    if name not in FILES or not (
        Path(text).suffix in (".toml", ".py") or len(Path(text).parts) > 1
    ):
        return value
    if "\0" in text:
        raise BadInput(
            f"{name} file {brief(text)} holds a NUL, which no file's name does; give its path"
        )
    path = (folder / text).resolve()
    if not path.is_file():
        raise BadInput(
            f"{name} file '{text}' does not exist beside the sweep's file; give its path from there"
        )
    return str(path)


def tables_of(scenario: Any) -> dict[str, Any]:
    """Return a Scenario as the tables of a file."""
    whole = {k: v for k, v in dataclasses.asdict(scenario).items() if k != "segments"}
    rows = [
        {k: v for k, v in dataclasses.asdict(s).items() if v is not None} for s in scenario.segments
    ]
    return {"scenario": whole, "segment": rows}
