"""Pages of the reference that follow from the package itself: written anew into docs/reference/made
at each build."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import api_pages
import card_pages
import command_pages
import drive
import field_pages
import goal_table
import repository_pages
import schema_pages
from sphinx.application import Sphinx

PAGES: dict[str, Callable[[], str]] = {
    "api.md": api_pages.page,
    "commands.md": command_pages.page,
    "effects.md": card_pages.effects,
    "estimators.md": card_pages.estimators,
    "json.md": schema_pages.page,
    "fields.md": field_pages.page,
}


def put(path: Path, text: str) -> None:
    """Write a file where its text has changed: what is the same is not read again by Sphinx."""
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def write(app: Sphinx) -> None:
    """Write every page, and the schemas as files to download."""
    made = Path(app.srcdir) / "reference" / "made"
    for name, page in PAGES.items():
        put(made / name, page())
    for name, text in drive.drawings().items():
        put(made / name, text)
    for name in repository_pages.PAGES:
        put(Path(app.srcdir) / f"{name}.md", repository_pages.page(name))
    # included by a page
    put(Path(app.srcdir) / "results" / "made" / "goals.txt", goal_table.goals())
    for name, text in schema_pages.files().items():
        put(made / "schemas" / name, text)


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the pages before Sphinx looks for its sources."""
    app.connect("builder-inited", write)
    app.connect("autodoc-process-docstring", api_pages.linked)
    return {"parallel_read_safe": True}
