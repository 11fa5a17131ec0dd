"""Whether a JSON file that a command wrote is what its schema says."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator

from sandbox.output.schema import json_schema


def misfits(name: str, content: dict[str, Any] | Path) -> list[str]:
    """Return where a file's content leaves the schema of `<name>.json`, a line each; a key without
    a schema counts."""
    found = (
        json.loads(content.read_text(encoding="utf-8")) if isinstance(content, Path) else content
    )
    errors = Draft202012Validator(json_schema(name)).iter_errors(found)
    return [f"{'/'.join(map(str, e.absolute_path))}: {e.message[:200]}" for e in errors]
