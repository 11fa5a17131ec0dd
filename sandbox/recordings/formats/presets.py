"""Presets: what other programs call their columns, in which units and with which signs; one TOML
file a program.

A preset's [columns] fill what the campaign's own map does not say; its other tables (never a
motor's numbers) give way to the campaign's, key by key.  Each file cites the vendor's documents it
was written from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from model.errors import unknown
from model.given import read_toml
from model.plugins import brought, place_of
from sandbox.recordings.column_map import Column, parse_columns

FOLDER = Path(__file__).parent / "vendors"


def preset_names() -> list[str]:
    """Return the names of the presets, those of other packages among them."""
    return sorted({*_own(), *brought("presets")})


def _own() -> list[str]:
    return [p.stem for p in FOLDER.glob("*.toml")]


def preset_line(name: str) -> str:
    """Return what a preset's file says it is for, one line."""
    return str(_read(name)["preset"]["title"])


def preset_notes(name: str) -> tuple[str, ...]:
    """Return what a person who uses a preset should know, each one sentence."""
    return tuple(f"preset {name}: {text}" for text in _read(name)["preset"].get("notes", ()))


def with_preset(
    name: str, data: Mapping[str, Any], mapped: Mapping[str, Column]
) -> tuple[dict[str, Any], dict[str, Column]]:
    """Return a campaign's tables and column map with a preset behind them; BadInput for an unknown
    name."""
    preset = _read(name)
    names = {k: v.pop("names") for k, v in preset["columns"].items() if "names" in v}
    plain = parse_columns(preset, f"preset {name}")
    columns = {k: replace(c, others=tuple(names.get(k, (c.column,)))) for k, c in plain.items()}
    tables = {k: v for k, v in preset.items() if k not in ("preset", "columns")}
    behind = {
        k: {**v, **data[k]} if k in data and isinstance(data[k], dict) else v
        for k, v in tables.items()
    }
    return {**data, **behind}, {**columns, **mapped}


def check_preset(name: str) -> None:
    """Raise BadInput for an unknown name."""
    if name not in preset_names():
        raise unknown("preset", name, preset_names())


def _read(name: str) -> dict[str, Any]:
    check_preset(name)
    folder = FOLDER if name in _own() else place_of(brought("presets")[name]).parent
    return read_toml(folder / f"{name}.toml")
