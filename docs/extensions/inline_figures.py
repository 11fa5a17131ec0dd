"""Figures stand in the page itself: SVG takes the page's ink, so it follows light and dark; a
narrow one on telephones.

A picture `NAME.svg` is written into the page. Where `NAME.narrow.svg` lies beside it
(`experiments/screens.py` writes both), the page holds both, and its width says which one is seen.
"""

from __future__ import annotations

import html
import os
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.transforms.post_transforms import SphinxPostTransform

LINK = re.compile(r'href="doc:([^#"]+)')  # a drawing's link to a page of the documentation


def inlined(file: Path, said: str, kind: str) -> str:
    """Return a drawing as it stands in a page; said: what it shows, in words."""
    text = file.read_text(encoding="utf-8")
    text = re.sub(
        r"<style>svg\{color.*?</style>", "", text[text.index("<svg") :], count=1, flags=re.S
    )
    opening, rest = text.split(">", 1)
    width = re.search(r'\bwidth="([\d.]+)(pt|px|)"', opening)
    opening = re.sub(r'\s(?:width|height|class|role|aria-label)="[^"]*"', "", opening)
    most = f' style="max-width:{width[1]}{width[2] or "px"}"' if width else ""
    return (
        f'{opening} class="drawing {kind}" role="img" aria-label="{html.escape(said)}"{most}>{rest}'
    )


def drawing(file: Path, said: str) -> str:
    """Return a picture's drawings: one, or one for each width."""
    narrow = file.with_suffix(".narrow.svg")
    if not narrow.is_file():
        return inlined(file, said, "only")
    return inlined(file, said, "desk") + inlined(narrow, said, "phone")


class Inline(SphinxPostTransform):
    """Put every SVG into its page."""

    default_priority = 5
    formats = ("html",)

    def run(self, **options: Any) -> None:
        """Replace the pictures of a page."""
        for node in list(self.document.findall(nodes.image)):
            file = Path(self.app.srcdir) / node["uri"]
            if file.suffix == ".svg" and file.is_file() and "/thumb/" not in node["uri"]:
                # these lead to a page
                text = f'<div class="draw">{drawing(file, node.get("alt", ""))}</div>'
                text = LINK.sub(lambda m: f'href="{self._address(m[1])}', text)
                node.replace_self(nodes.raw("", text, format="html"))

    def _address(self, page: str) -> str:
        return str(self.app.builder.get_relative_uri(self.env.docname, page))


def depends(app: Any, document: nodes.document) -> None:
    """Tell that a page hangs on the narrow drawings, too; the builder knows the others."""
    for node in document.findall(nodes.image):
        narrow = Path(app.srcdir) / Path(node["uri"]).with_suffix(".narrow.svg")
        if narrow.is_file():
            app.env.note_dependency(os.path.relpath(narrow, app.srcdir))


def setup(app: Any) -> dict[str, Any]:
    """Take part in writing every page; pages are made anew where a drawing has changed."""
    app.add_post_transform(Inline)
    app.connect("doctree-read", depends)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
