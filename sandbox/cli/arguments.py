"""How the command line reads its words: types of arguments with their help, what many commands take
in common."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from model.errors import brief
from sandbox.output.files import check_output
from sandbox.output.tables import print_prose

LARGEST_COUNT = 1_000_000  # of anything that is counted on the command line
Words = tuple[str, ...]


def read_by(parse: Callable[[str], Any]) -> Parameter:
    """Return how an argument of one word is read: `parse` raises ValueError with what is wrong."""
    return Parameter(
        converter=lambda _, tokens: parse(tokens[0].value), n_tokens=1, accepts_keys=False
    )


def number(text: str) -> float:
    """Parse a number as people write it (not 1_000)."""
    if "_" not in text and text.isascii():
        try:
            return float(text)
        except ValueError:
            pass
    point = text[:40].replace(",", ".")
    hint = f"; write {point}, with a point" if text.count(",") == 1 and _is_number(point) else ""
    alone = re.fullmatch(r"([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?) ?[^\W\d_]{1,4}", text)
    if alone and _is_number(alone[1]):
        hint = f"; write {alone[1]}, without a unit (--help says which it is in)"
    raise ValueError(f"'{text[:40]}' is no number{hint}")


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def positive_int(text: str) -> int:
    """Parse a whole number of at least 1."""
    if not _whole(text) or not 1 <= int(text) <= LARGEST_COUNT:
        raise ValueError(
            f"{brief(text)} is no whole number of at least 1 and at most {LARGEST_COUNT}"
        )
    return int(text)


def seed_number(text: str) -> int:
    """Parse a whole number of at least 0."""
    if not _whole(text):
        raise ValueError(f"{brief(text)} is no whole number of at least 0 and at most 18 digits")
    return int(text)


def _whole(text: str) -> bool:
    return text.isascii() and text.isdecimal() and len(text) <= 18


def names_of(text: str) -> Words:
    """Return names separated by commas."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def listed(kind: str) -> Parameter:
    """Return how a shell completes an argument: the names of `sensorless list KIND`, each with its
    line.

    The last of several names with commas between them is completed. A kind in capitals is the
    argument that has it.
    """

    def complete(context: Any) -> dict[str, str]:
        """Return names and lines; the package is loaded when a shell asks."""
        import sandbox

        named = context[kind.lower()].raw if kind.isupper() else kind
        found: dict[str, str] = getattr(sandbox, f"list_{named}")()
        before = "".join(context.incomplete.rpartition(",")[:2])
        return {before + name: line for name, line in found.items()}

    return Parameter(completer=complete)


def usual(text: str | bool, metavar: str | None = None) -> Parameter:
    """Return how help names what is taken where an argument is left out, and an argument's
    value."""
    return (
        Parameter(show_default=text, metavar=metavar) if metavar else Parameter(show_default=text)
    )


def several(metavar: str, text: str) -> Parameter:
    """Return an argument that may be repeated, with its help."""
    return Parameter(metavar=metavar, show_default=False, help=text)


# Arguments of one word
Flag = Annotated[bool, usual(False)]
Number = Annotated[float, read_by(number)]
Count = Annotated[int, read_by(positive_int)]
Seed = Annotated[int, read_by(seed_number)]
Names = Annotated[Words, read_by(names_of), Parameter(metavar="A,B")]
Percents = Annotated[
    Words | None, Parameter(consume_multiple=(0, 1)), usual("no such runs", "PERCENT,...")
]
Share = Annotated[Number, Parameter(metavar="SHARE")]

# Arguments of several commands
Motor = Annotated[
    str,
    listed("motors"),
    Parameter(metavar="NAME|FILE", help="a motor of `sensorless list motors`, or a file of yours"),
]
Scenario = Annotated[
    str,
    listed("scenarios"),
    Parameter(
        metavar="NAME|FILE",
        help="what is asked of the drive: `sensorless list scenarios`, or a file",
    ),
]
Estimator = Annotated[str | None, listed("estimators"), usual("qnull", "NAME|FILE")]
Estimators = Annotated[
    Words,
    listed("estimators"),
    several("NAME|FILE", "one of them, as in `simulate` (may be repeated)"),
]
Library = Annotated[
    Path | None,
    several("FILE.so", "an estimator in C instead, a shared library (see estimators/c/README.md)"),
]
Libraries = Annotated[
    tuple[Path, ...],
    several(
        "FILE.so",
        "an estimator in C, a shared library (may be repeated; see estimators/c/README.md)",
    ),
]
Belief = Annotated[
    Literal["saturated", "linear"], Parameter(help="the model of the motor inside the estimator")
]
Effects = Annotated[
    str,
    several(
        "NAME.PARAM=VALUE,...|FILE",
        "what the plant has and the model lacks: effect.parameter=value,... or a file "
        "such as effects.toml",
    ),
]
QuietBelow = Annotated[
    Number | None,
    several("DB", "recommend only what stays below so much in the proxy for the injection's sound"),
]
LossBelow = Annotated[
    Number | None,
    several("W", "recommend only what adds less copper and core loss by its injection"),
]
EffectsFrom = Annotated[
    tuple[Path, ...],
    several(
        "FILE.py",
        "a Python file with effects of your own (may be repeated), beside those of the library",
    ),
]
Campaign = Annotated[
    Path, Parameter(metavar="CAMPAIGN", help="folder with campaign.toml and its tables")
]
Columns = Annotated[
    Path | None,
    several(
        "FILE.toml",
        "names and units of recordings from elsewhere (see sandbox/recordings/IMPORTING.md)",
    ),
]
Preset = Annotated[
    str | None,
    listed("presets"),
    several(
        "PROGRAM", "a program whose column names and units are known: `sensorless list presets`"
    ),
]
Result = Annotated[
    Path, Parameter(metavar="RESULT", help="folder that a command has written, or its JSON")
]
Radius = Annotated[Number | None, usual("180 % of rated", "A")]
Speed = Annotated[Number | None, usual("twice rated speed", "RPM")]
Dask = Annotated[
    str | None,
    several(
        "ADDRESS", "address of a dask scheduler, tcp://...: its workers do the work (extra `dask`)"
    ),
]
Peer = Annotated[Flag, Parameter(help="measure the reference programs in the same run, too")]
Anchors = Annotated[Path, Parameter(help="folder of the reference programs")]
PeerPython = Annotated[
    str | None,
    Parameter(help="Python >= 3.12 that has motulator 0.18; left out: one is made, in the cache"),
]
Jobs = Annotated[
    Count | None, Parameter(show=True, show_default="all cores", help="threads or processes")
]
Threads = Annotated[Count, Parameter(show=True, help="threads")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """What every command takes that writes results; `--jobs`, `--seed` and `--csv` are told where
    they do something."""

    out: Annotated[Path | None, usual("sensorless-out/COMMAND", "DIR")] = None
    "folder for results"
    jobs: Annotated[Count | None, Parameter(show=False)] = None
    seed: Annotated[Seed, Parameter(show=False)] = 0
    csv: Flag = False
    "the table as CSV, too"
    quiet: Flag = False
    "print nothing but errors"
    offline: Flag = False
    "download nothing: say which file is missing and where to put it (or SENSORLESS_OFFLINE=1)"

    def folder(self, command: str) -> Path:
        """Return the folder for results."""
        return self.out or Path("sensorless-out") / command

    def checked(self, command: str) -> Path:
        """Return the folder for results; BadInput, before anything runs, where they could not be
        written."""
        folder = self.folder(command)
        check_output(folder, {"diagnose": "diagnosis"}.get(command, command))
        return folder

    def finish(self, result: Any, folder: Path, said: str = "", **asked: bool) -> None:
        """Save a result, then `say` it."""
        result.save(folder, csv=self.csv, **asked)
        self.say(result, folder, said)

    def say(self, result: Any, folder: Path, said: str = "") -> None:
        """Print a result, where its files are, and what else is to be said, unless --quiet."""
        if not self.quiet:
            result.report()
            print_prose(f"results in {folder}{f'; {said}' if said else ''}")


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Tableless(Output):
    """Of commands that write no table: --csv changes nothing."""

    csv: Annotated[Flag, Parameter(show=False)] = False

    def finish(self, result: Any, folder: Path, said: str = "", **asked: bool) -> None:
        """Save a result, then `say` it."""
        result.save(folder, **asked)
        self.say(result, folder, said)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Noisy(Output):
    """Of commands that draw the sensors' noise."""

    seed: Annotated[Seed, Parameter(show=True, help="seed of the sensors' noise")] = 0


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Short(Output):
    """Of commands that are done before a second thread would pay, unless more are asked for."""

    jobs: Threads = 1


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Parallel(Output):
    """Of commands that use all cores."""

    jobs: Jobs = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class NoisyParallel(Noisy):
    """Of commands that do both."""

    jobs: Jobs = None
