"""`sensorless verify RESULT`: what a result says of its making is done once more, and the numbers
are compared."""

from __future__ import annotations

import inspect
import json
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, NamedTuple

from model.errors import BadInput, brief, shown
from model.given import MOST_JSON, given_bytes
from sandbox.output.files import plain
from sandbox.output.provenance import digest_of, libraries, made_by
from sandbox.output.tables import print_prose
from sandbox.public.calls import EFFECTS, LEFT_OUT, hashes
from sandbox.public.loading import use_effects
from sandbox.public.result import Result

HEADER = (
    "schema",
    "command",
    "version",
    "made_by",
    "figure",
    "table",
    "trace",
    "arrays",
    "rows",
    "page",
)
COSTS = {  # what a run costs is never the same twice
    "cpu_seconds",
    "kernel_seconds",
    "step_ns",
    "cpu_s_per_s",
    "cpu_to_peer",
    "cost.seconds",
}
CLOSE = 1e-6  # of a number: what another machine or another library may change
NOTHING = 1e-12  # in any unit
LARGEST = 2**1000  # a whole number beyond is none of ours, and no float
MAX_DIFFERENCES = 50  # differences that are told
SCORED = "withheld score"


def functions() -> dict[str, Callable[..., Any]]:
    """Return the functions whose results can be made once more, by name."""
    from sandbox.public.campaigns.diagnosed import diagnose
    from sandbox.public.campaigns.identified import identify
    from sandbox.public.campaigns.replayed import replay
    from sandbox.public.converting import convert_motor
    from sandbox.public.exports.drive import export_drive
    from sandbox.public.exports.estimator import export_estimator
    from sandbox.public.motor import audit, maps
    from sandbox.public.protocols import protocol
    from sandbox.public.runs import compare, simulate
    from sandbox.public.sweeps import sweep, tolerances

    runs = (simulate, compare, tolerances, sweep, protocol)
    of_motor, of_campaign = (audit, maps, convert_motor), (identify, diagnose, replay)
    found = (*runs, *of_motor, *of_campaign, export_estimator, export_drive)
    return {function.__name__: function for function in found}


class Difference(NamedTuple):
    """One value that is not as stated: where it stands, what the result says, what is found now."""

    where: str
    stated: Any
    found: Any


@dataclass(frozen=True, repr=False)
class Verification(Result):
    """What became of a result when it was made once more.

    values: how many were compared; largest: relative difference of numbers (0: the same to the
    bit); differences: those beyond the tolerance (at most MAX_DIFFERENCES), files of the result
    that were changed included; changed: what parts this machine from the one that made it.
    """

    command: ClassVar[str] = "verify"
    kinds: ClassVar[tuple[str, ...]] = ()
    result: Path
    function: str
    values: int
    largest: float
    differences: tuple[Difference, ...]
    changed: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether every value is as stated."""
        return not self.differences

    def summary(self) -> str:
        """Return the outcome in a sentence."""
        exact = "to the bit" if self.largest == 0.0 else f"to {self.largest:.1g} of a number"
        if self.same:
            return f"{self.result}: {self.values} values of '{self.function}' are the same {exact}"
        first = self.differences[0]
        said = f"{shown(first.where)} is {brief(first.found)}, stated {brief(first.stated)}"
        count, verb = len(self.differences), "differs" if len(self.differences) == 1 else "differ"
        return f"{self.result}: {count} of {self.values} values of '{self.function}' {verb}; {said}"

    def as_json(self) -> dict[str, Any]:
        """Return what `verify.json` holds beyond its header."""
        listed = [d._asdict() for d in self.differences]
        return {
            "result": self.result.as_posix(),
            "function": self.function,
            "values": self.values,
            "largest": self.largest,
            "differences": listed,
            "changed": self.changed,
            "same": self.same,
        }

    def report(self) -> None:
        """Print the outcome, and what is not as it was when the result was made."""
        print_prose(self.summary())
        for change in self.changed:
            print_prose(f"not as then: {change}")


def verify(result: str | Path, tolerance: float = CLOSE) -> Verification:
    """Make a result once more as it says it was made, and compare: files, inputs, every number.

    Parameters
    ----------
    result : str or Path
        A folder that a command or `.save` has written (the JSON in it, where it holds several
        results). Files that its call names are looked for from the present folder.
    tolerance : float
        Relative difference up to which numbers agree; on the machine and with the libraries that
        made it, a result comes out the same to the bit.

    Returns
    -------
    Verification
        `.same`, `.largest`, `.differences`, `.changed`.

    Raises
    ------
    BadInput
        For what is no result or does not say how it was made, and for inputs that are missing or
        were changed.

    Examples
    --------
    >>> import tempfile
    >>> from sandbox import audit, verify
    >>> with tempfile.TemporaryDirectory() as place:
    ...     verify(audit("ipm").save(place)).same
    True
    """
    if not 0.0 <= tolerance < 1.0:
        raise BadInput(
            f"tolerance = {tolerance} is out of range; give a share of a number, from 0 to 1"
        )
    path = _json_of(Path(result))
    stated = _read(path)
    made = stated["made_by"]
    found = _again(path, made["call"])
    pairs = list(_pairs(_recomputed(stated, found), found))
    apart = [Difference(where, a, b) for where, a, b in pairs if not _agree(a, b, tolerance)]
    apart = [*_damaged(path.parent, made["files"]), *apart]
    largest = max((_distance(a, b) for _, a, b in pairs), default=0.0)
    return Verification(
        path,
        made["call"]["function"],
        len(pairs),
        largest,
        tuple(apart[:MAX_DIFFERENCES]),
        _changed(made),
    )


def _json_of(place: Path) -> Path:
    """Return the JSON of a result folder, or the one that is named."""
    if place.is_file():
        return place
    found = (
        [p for p in sorted(place.glob("*.json")) if p.name != f"{Verification.command}.json"]
        if place.is_dir()
        else []
    )
    found = [p for p in found if p.stem != "schema"]  # of a sweep
    if not found:
        raise BadInput(
            f"no result at '{place}'; give a folder that a command has written, or its JSON"
        )
    if len(found) > 1:
        named = ", ".join(p.name for p in found[:3]) + (", ..." if len(found) > 3 else "")
        raise BadInput(
            f"'{place}' holds {len(found)} results ({named}); give one of them, such as {found[0]}"
        )
    return found[0]


def _read(path: Path) -> dict[str, Any]:
    """Return a result's JSON; BadInput unless it says how it was made in a way that can be done
    again."""
    text = given_bytes(path, MOST_JSON, "give what a command has written")
    try:
        stated = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadInput(
            f"'{path}' cannot be read as JSON ({error}); give what a command has written"
        ) from None
    made = stated.get("made_by") if isinstance(stated, dict) else None
    call = made.get("call") if isinstance(made, dict) else None
    if not isinstance(made, dict) or not isinstance(call, dict):
        raise BadInput(
            f"'{path}' does not say how it was made; run its command once more and keep "
            "what that writes"
        )
    parts = [
        (call, "function", str),
        (call, "arguments", dict),
        (call, "objects", list),
        (call, "inputs", dict),
    ]
    for part, key, kind in [*parts, (made, "files", dict), (made, "libraries", dict)]:
        if not isinstance(part.get(key), kind):
            raise BadInput(f"'{path}' is damaged at made_by, '{key}'; run its command once more")
    if call["objects"]:
        named = shown(", ".join(map(str, call["objects"])))
        raise BadInput(
            f"'{path}' was made from Python objects ({named}), which no file holds; "
            "verify what names files"
        )
    return dict(stated)


def _again(path: Path, call: Mapping[str, Any]) -> Any:
    """Return what the call's result says now, as JSON."""
    function, arguments = call["function"], dict(call["arguments"])
    if function == SCORED:
        return _scored(path.parent, call["inputs"])
    known = functions()
    if function not in known:
        raise BadInput(
            f"a result of {brief(function)} cannot be made once more; verify {', '.join(known)}"
        )
    if foreign := sorted(set(arguments) & set(LEFT_OUT)):
        raise BadInput(
            f"'{path}' is damaged: no result keeps the argument '{foreign[0]}'; run its "
            "command once more"
        )
    _check_inputs(call["inputs"], hashes(arguments))
    files = arguments.pop(EFFECTS, [])
    if not isinstance(files, list) or not all(isinstance(x, str) and "\0" not in x for x in files):
        raise BadInput(
            f"'{path}' is damaged: {EFFECTS} = {brief(files)} is no list of files; run "
            "its command anew"
        )
    for file in files:
        use_effects(file)
    run = known[function]
    with TemporaryDirectory() as place:
        if function == "sweep":
            arguments |= {"folder": place, "yes": True}
        if arguments.get("record"):  # a run that is recorded is that of a bench
            arguments["record"] = f"{place}/recorded"
        try:
            inspect.signature(run).bind(**arguments)
        except TypeError as error:
            raise BadInput(
                f"'{path}' was made by another version of '{function}' ({error}); run it anew"
            ) from None
        found = _called(path, run, arguments)
        return _swept(found, path.parent) if function == "sweep" else plain(found.as_json())


def _called(path: Path, run: Callable[..., Any], arguments: Mapping[str, Any]) -> Any:
    """Return what a function gives; BadInput where a result states arguments that it cannot
    take."""
    try:
        return run(**arguments)
    except (TypeError, ValueError, AttributeError, LookupError, ArithmeticError) as error:
        if isinstance(error, BadInput):
            raise
        said = f"{type(error).__name__}: {brief(' '.join(str(error).split()))}"
        raise BadInput(
            f"'{path}' states a call that cannot be made ({said}); run its command once more"
        ) from None


def _check_inputs(stated: Mapping[str, Any], found: Mapping[str, str]) -> None:
    for name, digest in stated.items():
        if name not in found:
            raise BadInput(
                f"input '{name}' of the result is not here; go to the folder from which it was made"
            )
        if found[name] != digest:
            raise BadInput(
                f"input '{name}' is not the file that the result was made from; restore "
                "it, or run anew"
            )
    if more := sorted(set(found) - set(stated)):
        raise BadInput(
            f"the call would now read '{more[0]}', which the result was not made from; take it away"
        )


def _scored(folder: Path, inputs: Mapping[str, Any]) -> Any:
    """Return the figures that follow from a check's rows; nothing is diagnosed again."""
    from sandbox.withheld.scoring.blind import opened
    from sandbox.withheld.scoring.rows import FILE, check_seal, read_rows
    from sandbox.withheld.scoring.tables_of_rows import by_method, content_of

    _check_inputs(
        inputs, {name: digest_of(folder / name) for name in inputs if (folder / name).is_file()}
    )
    rows = read_rows(folder / FILE)
    check_seal(rows, opened(folder))
    return plain(content_of(by_method(rows)))


def _swept(found: Any, folder: Path) -> Any:
    """Return what a sweep made again says, with the number of its runs that are not those of a
    folder."""
    from sandbox.evaluation.sweep.store import read_table

    content = plain(found.as_json())
    try:
        kept = read_table(folder)
    except (OSError, ValueError, LookupError, TypeError) as error:
        if isinstance(error, BadInput):
            raise
        said = brief(" ".join(str(error).split()))
        raise BadInput(
            f"'{folder}' has a damaged block or journal ({said}); run the sweep again with it"
        ) from None
    same = found.to_table().equals(kept)
    return content if same else content | {"runs of the table": "changed"}


def _damaged(folder: Path, files: Mapping[str, Any]) -> Iterator[Difference]:
    """Yield the files of a result that are missing or not as they were written."""
    for name, digest in files.items():
        path = folder / Path(name).name
        found = digest_of(path) if path.is_file() else None
        if found != digest:
            yield Difference(f"file '{shown(name)}'", digest, found)


def _changed(made: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what parts this machine from the one that made a result."""
    here = made_by()
    said = [
        f"{k} {made.get(k)} -> {here[k]}"
        for k in ("code", "python", "machine")
        if made.get(k) != here[k]
    ]
    old, new = made["libraries"], libraries()
    return tuple(
        shown(s)
        for s in [*said, *(f"{k} {old.get(k)} -> {new[k]}" for k in new if old.get(k) != new[k])]
    )


def _recomputed(stated: Mapping[str, Any], found: Any) -> dict[str, Any]:
    """Return what of a result's JSON is recomputed: no header, no names of files."""
    return {k: v for k, v in stated.items() if k not in HEADER or k in found}


def _pairs(a: Any, b: Any, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield every value of two JSON trees beside each other; costs are left out."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in dict.fromkeys([*a, *b]):
            place = f"{where}.{key}" if where else str(key)
            if not {key, ".".join(place.split(".")[-2:])} & COSTS:
                yield from _pairs(a.get(key), b.get(key), place)
    elif isinstance(a, list) and isinstance(b, list) and len(a) == len(b):
        for k, (one, other) in enumerate(zip(a, b, strict=True)):
            yield from _pairs(one, other, f"{where}[{k}]")
    else:
        yield where, a, b


def _is_number(x: Any) -> bool:
    if isinstance(x, int):
        return not isinstance(x, bool) and abs(x) < LARGEST
    return isinstance(x, float) and math.isfinite(x)


def _distance(a: Any, b: Any) -> float:
    """Return the relative difference of two numbers; 0 for anything else."""
    if not (_is_number(a) and _is_number(b)) or a == b or abs(a - b) <= NOTHING:
        return 0.0
    return float(abs(a - b) / max(abs(a), abs(b)))


def _agree(a: Any, b: Any, tolerance: float) -> bool:
    if _is_number(a) and _is_number(b):
        return math.isclose(a, b, rel_tol=tolerance, abs_tol=NOTHING if tolerance else 0.0)
    return bool(a == b)
