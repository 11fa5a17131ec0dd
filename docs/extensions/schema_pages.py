"""The page of all JSON files, from their schemas."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from markdown import cell, code, table

from sandbox.output.schema import json_schema, schema_names, shared_parts

HEAD = """# JSON files

Every command that writes results writes a JSON file (`compare --tolerances` two). Each file has a schema ([JSON
Schema](https://json-schema.org), draft 2020-12), and the tests check real files against it;
`sandbox.output.schema.json_schema("compare")` returns it. Numbers are in SI units unless the name ends in `_deg` or
`_rpm`; a number that is not defined is `null`. Names of other files are relative to the folder. A `[]` stands for each
entry of a list, `<name>` for each name in a table.

"""


def resolved(schema: dict[str, Any], whole: dict[str, Any]) -> dict[str, Any]:
    """Return a schema with its reference followed; its own description counts before that of what
    it refers to."""
    if "$ref" in schema:
        found = whole["$defs"][schema["$ref"].rpartition("/")[2]]
        return {**resolved(found, whole), **{k: v for k, v in schema.items() if k != "$ref"}}
    if "anyOf" in schema:
        own = next(s for s in schema["anyOf"] if s.get("type") != "null")
        return {
            **resolved(own, whole),
            "null": True,
            **{k: v for k, v in schema.items() if k != "anyOf"},
        }
    return schema


def kind(schema: dict[str, Any]) -> str:
    """Return what a value is, in a word or two."""
    types = schema.get("type", "any")
    types = [types] if isinstance(types, str) else list(types)
    if schema.get("null"):
        types.append("null")
    said = {"object": "table", "array": "list", "boolean": "true, false", "integer": "whole number"}
    return " or ".join(said.get(t, t) for t in types)


def keys(
    schema: dict[str, Any], whole: dict[str, Any], path: str = ""
) -> Iterator[tuple[str, str, str, str]]:
    """Yield path, kind, unit and meaning of every key below a schema."""
    for name, value in schema.get("properties", {}).items():
        yield from entry(f"{path}.{name}" if path else name, resolved(value, whole), whole)
    more = schema.get("additionalProperties")
    if isinstance(more, dict) and more:
        yield from entry(f"{path}.<name>" if path else "<name>", resolved(more, whole), whole)


def entry(
    path: str, schema: dict[str, Any], whole: dict[str, Any]
) -> Iterator[tuple[str, str, str, str]]:
    """Yield a key and those below it."""
    text = schema.get("description", "")
    if "enum" in schema:
        text += " One of " + ", ".join(code(v) for v in schema["enum"]) + "."
    if text or schema.get("properties"):
        yield path, kind(schema), schema.get("unit", ""), text
    yield from keys(schema, whole, path)
    items = resolved(schema.get("items", {}), whole)
    if items.get("properties"):
        yield from keys(items, whole, f"{path}[]")


def described(schema: dict[str, Any], whole: dict[str, Any]) -> str:
    """Return the table of all keys below a schema."""
    rows = [(code(p), k, cell(u), cell(t)) for p, k, u, t in keys(schema, whole)]
    return table(("key", "is", "unit", "meaning"), rows) + "\n"


def page() -> str:
    """Return the whole page: what every file begins with, then file by file."""
    text, header = HEAD, shared_parts()["header"]
    text += "Every file begins with\n\n" + described({"properties": header}, {})
    for name in schema_names():
        whole = json_schema(name)
        own = {
            **whole,
            "properties": {k: v for k, v in whole["properties"].items() if k not in header},
        }
        text += (
            f"## `{name}.json`\n\n{cell(whole['description'])} [Schema](schemas/{name}.json)\n\n"
        )
        text += described(own, whole)
    return text


def files() -> dict[str, str]:
    """Return every whole schema as a file to download."""
    return {
        f"{n}.json": json.dumps(json_schema(n), indent=1, ensure_ascii=False) + "\n"
        for n in schema_names()
    }
