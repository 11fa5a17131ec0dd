"""The schema of each JSON file that a command writes: one file a command, in `schemas/`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from model.errors import unknown

FOLDER = Path(__file__).parent / "schemas"
SHARED = "shared"
OPTIONAL = ("made_by",)  # of the header: earlier versions wrote none
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def schema_names() -> list[str]:
    """Return the names of the JSON files that have a schema, without `.json`."""
    return sorted(path.stem for path in FOLDER.glob("*.json") if path.stem != SHARED)


def shared_parts() -> dict[str, Any]:
    """Return what files share: the `header` that every one begins with, and `$defs` that schemas
    refer to."""
    return _read(SHARED)


def json_schema(name: str) -> dict[str, Any]:
    """Return the whole schema of `<name>.json`, its header and shared parts included; BadInput for
    an unknown name."""
    if name not in schema_names():
        raise unknown("JSON file", name, schema_names())
    shared, own = shared_parts(), _read(name)
    own["properties"] = shared["header"] | own["properties"]
    own["required"] = [*(key for key in shared["header"] if key not in OPTIONAL), *own["required"]]
    return {"$schema": DIALECT, **own, "$defs": shared["$defs"]}


def _read(name: str) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))
    return found
