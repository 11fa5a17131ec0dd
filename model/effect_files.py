"""Effects as people hand them over: a line, a file, a mapping.

dead_time.time=2e-6,current_offset.offset_a=0.01         a line

[effects]                                                a file (`effects.toml`, as `sensorless diagnose` writes it)
dead_time.time = 2e-6                                    # SI units
[bench]                                                  # ordinary deviations of a bench (`bench.*`)
soft_current = 0.02
[angles]                                                 # rad by which a recording's angle is turned: replay only
"locked_d.parquet" = 1e-4
[offsets]                                                # A that a recording's i_a, i_b, i_c read too much: replay only
"locked_d.parquet" = [1e-3, -2e-3, 1e-3]
"""  # noqa: E501

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from model.effects.library import checked, effect_names, parse
from model.errors import BadInput, as_toml, brief, unknown
from model.given import read_toml
from model.parameters import finite, table_of

TABLES = ("effects", "bench", "angles", "offsets", "provenance", "residual", "ci95")
Given = Mapping[str, float] | str | Path | None


class EffectFile(NamedTuple):
    """What a file of effects says: parameters by public name, and by recording how far its angle is
    turned (rad) and what its three currents read too much (A)."""

    effects: dict[str, float]
    angles: dict[str, float]
    offsets: dict[str, tuple[float, float, float]]


def effects_of(given: Given) -> dict[str, float]:
    """Return effects from a line, the path of a file (`.toml`) or a mapping; BadInput says what is
    wrong."""
    return effects_and_angles(given).effects


def effects_and_angles(given: Given) -> EffectFile:
    """Return the same with a file's angles, none of a line or a mapping; BadInput where it is none
    of these."""
    if isinstance(given, Path) or (
        isinstance(given, str) and given.strip().lower().endswith(".toml")
    ):
        return read_effect_file(Path(str(given).strip()))
    if given is None or isinstance(given, str):
        return EffectFile(parse(given or ""), {}, {})
    if not isinstance(given, Mapping):
        raise BadInput(
            f"effects = {brief(given)} are neither a mapping nor a line nor a .toml "
            "file; give one of them"
        )
    return EffectFile(dict(given), {}, {})


def read_effect_file(path: Path) -> EffectFile:
    """Return what a file of effects says; BadInput names file, table and key."""
    data = read_toml(path)
    try:
        for table in data:
            if table not in TABLES:
                if table in effect_names() or table.partition(".")[0] in effect_names():
                    raise BadInput(
                        f"'{table}' is an effect and stands in no table of effects; write "
                        f"[effects] above {table}.PARAMETER = VALUE, or [effects.{table}]"
                    )
                raise unknown("table", table, TABLES)
        effects = {name: checked(name, number) for name, number in _numbers(data, "effects")}
        effects |= {f"bench.{name}": number for name, number in _numbers(data, "bench")}
        angles = {
            file: _number("angles", file, value) for file, value in table_of(data, "angles").items()
        }
        offsets = {file: _three(file, value) for file, value in table_of(data, "offsets").items()}
    except BadInput as error:
        raise BadInput(f"{path.name}: {error}") from None
    return EffectFile(effects, angles, offsets)


def _three(file: str, value: Any) -> tuple[float, float, float]:
    """Return the offsets of a recording's three currents."""
    if not isinstance(value, list) or len(value) != 3:
        raise BadInput(
            f"[offsets] {file} = {as_toml(value)} is no list of three currents; give "
            "[i_a, i_b, i_c] in A"
        )
    a, b, c = (_number("offsets", file, x) for x in value)
    return a, b, c


def _numbers(data: dict[str, Any], table: str) -> Iterator[tuple[str, float]]:
    """Yield the numbers of a table by dotted name, however deep TOML has nested them."""
    rest = list(reversed(table_of(data, table).items()))
    while rest:
        name, value = rest.pop()
        if isinstance(value, dict):
            rest += [(f"{name}.{key}", inner) for key, inner in reversed(value.items())]
        else:
            yield name, _number(table, name, value)


def _number(table: str, name: str, value: Any) -> float:
    number = finite(value)
    if number is None:
        raise BadInput(
            f"[{table}] {name} = {as_toml(value)} is no finite number; give one in SI units"
        )
    return number
