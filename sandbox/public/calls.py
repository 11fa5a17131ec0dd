"""A result says how it was called: `records_call` keeps a function's arguments, and the hashes of
the files they name."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from functools import wraps
from numbers import Real
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from model.datasets import locate
from model.drive_files import fetched, load_drive, mapped_names, motor_file
from model.effects import own
from model.errors import BadInput, PhysicsError, brief
from model.given import is_file, is_folder, named_by, read_toml
from model.parameters import Drive
from model.ratings import cautions
from sandbox.output.provenance import Call, digest_of
from sandbox.recordings.foreign import SUFFIXES

P = ParamSpec("P")
R = TypeVar("R")
# results do not depend on them
LEFT_OUT = ("jobs", "cluster", "progress", "keep", "folder", "yes", "again")
EFFECTS = "effects_from"  # beside the arguments: files of effects that were taken over before


class _Object(Exception):
    """Raised where an argument is a Python object."""


def records_call(function: Callable[P, R]) -> Callable[P, R]:
    """Let a function's result (a dataclass with a field `call`) say how it was called, and its
    refusal what about the motor's ratings cannot be meant (as notes)."""
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> R:
        """Return the function's result with its call."""
        bound = signature.bind(*args, **kwargs)
        _check_numbers(signature, bound.arguments)
        try:
            result: Any = function(*args, **kwargs)
        except (BadInput, PhysicsError) as error:
            for text in _doubts(bound.arguments.get("motor")):
                error.add_note(f"caution: {text}")
            raise
        bound.apply_defaults()
        found: R = dataclasses.replace(result, call=call_of(function.__name__, bound.arguments))
        return found

    return call


def _doubts(motor: Any) -> tuple[str, ...]:
    """Return what about a motor's ratings cannot be meant, nothing of one that cannot be read
    here."""
    try:
        if isinstance(motor, (str, Path)) and not fetched(motor):
            motor = load_drive(motor)
        return cautions(motor) if isinstance(motor, Drive) else ()
    except (BadInput, PhysicsError, OSError):
        return ()


def _check_numbers(signature: inspect.Signature, given: Mapping[str, Any]) -> None:
    """Raise BadInput for an argument that should be a number and is none; its range is the
    function's own to check."""
    for name, value in given.items():
        kinds = str(signature.parameters[name].annotation).split(" | ")
        if not {"int", "float"} & set(kinds) or (value is None and "None" in kinds):
            continue
        if isinstance(value, bool) or not isinstance(value, Real):
            whole = "" if "float" in kinds else "whole "
            raise BadInput(f"{name} = {brief(value)} is no {whole}number; give one")


def call_of(function: str, given: Mapping[str, Any]) -> Call:
    """Return a call that went well as a result tells it; the files are read once more, for their
    hashes."""
    arguments: dict[str, Any] = {}
    objects = []
    for name, value in given.items():
        if name in LEFT_OUT:
            continue
        try:
            arguments[name] = _plain(value)
        except _Object:
            objects.append(name)
    if own.FILES:
        arguments[EFFECTS] = list(own.FILES)
    return Call(function, arguments, hashes(arguments), tuple(objects))


def hashes(arguments: Mapping[str, Any]) -> dict[str, str]:
    """Return the SHA-256 of every file that arguments name, and of those that these name, as far as
    they are there."""
    found = dict[str, str]()
    for name, value in arguments.items():
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, str) and one:
                found |= {
                    said: digest_of(path)
                    for said, path in _files(name, one, arguments)
                    if is_file(path)
                }
    return dict(sorted(found.items()))


def _plain(value: Any) -> Any:
    if value is None or isinstance(value, (str, bool, int, float)):
        return value
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    raise _Object


def _files(name: str, text: str, arguments: Mapping[str, Any]) -> Iterator[tuple[str, Path]]:
    """Yield what an argument's text names: how it is told, and where it lies."""
    path = Path(text)
    if name == "campaign":
        yield from ((p.as_posix(), p) for p in _campaign(path, arguments.get("columns")))
    elif name in ("motor", "motors"):
        yield from _motor(text)
    elif path.suffix or len(path.parts) > 1:
        # a name is not taken for a file that happens to lie here
        yield path.as_posix(), path
        yield from ((p.as_posix(), p) for p in named_by(path, path.parent))


def _motor(text: str) -> Iterator[tuple[str, Path]]:
    """Yield a motor's own file, its flux map, its inverter's table; a built-in motor has at most a
    data set."""
    try:
        path = motor_file(text)
        table = read_toml(path).get("flux_map")
        if text not in mapped_names() and path.stem != text:
            yield path.as_posix(), path
            yield from ((p.as_posix(), p) for p in named_by(path, path.parent))
        if isinstance(table, dict) and "dataset" in table:
            folder = locate(str(table["dataset"]))
            if folder is not None:
                yield f"{table['dataset']}/{table['file']}", folder / str(table["file"])
    except BadInput:  # changed since it was read
        return


def _campaign(folder: Path, columns: Any) -> Iterator[Path]:
    """Yield a campaign's description and tables: those it names, or all that lie in its folder."""
    if is_file(folder):
        yield folder
        folder = folder.parent
    elif not is_folder(folder):
        return
    whole = folder / "campaign.toml"
    texts = [whole] if columns is None else [whole, Path(str(columns))]
    yield from texts
    named = [path for text in texts for path in named_by(text, folder)]
    yield from named or sorted(p for p in folder.glob("*") if p.suffix.lower() in SUFFIXES)
