"""Equations as MathML, which browsers draw by themselves: no script, nothing fetched from a
network."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def inline(writer: Any, node: nodes.Element) -> None:
    """Write an equation inside a sentence."""
    writer.body.append(convert(node.astext(), display="inline"))
    raise nodes.SkipNode


def block(writer: Any, node: nodes.Element) -> None:
    """Write an equation on a line of its own; where it does not fit, it is broken at wide
    spaces."""
    drawn = "".join(convert(piece, display="block") for piece in pieces(node.astext()))
    writer.body.append(f'<div class="math">{drawn}</div>')
    raise nodes.SkipNode


def pieces(latex: str) -> list[str]:
    """Return the parts between `\\qquad`s that stand outside of braces and environments."""
    out = [""]
    for part in latex.split(r"\qquad"):
        out[-1] += part
        if out[-1].count("{") == out[-1].count("}") and out[-1].count(r"\begin") == out[-1].count(
            r"\end"
        ):
            out.append("")
        else:
            out[-1] += r"\qquad"
    return [part for part in out if part.strip()]


def setup(app: Sphinx) -> dict[str, Any]:
    """Tell Sphinx that equations are drawn so."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}
