"""A page on a telephone: names stay whole, and an enlarged figure can be zoomed with fingers or
buttons."""

import re

import pytest

from sandbox.output.document import figure, write_page


@pytest.fixture(scope="module")
def text(tmp_path_factory):
    path = tmp_path_factory.mktemp("page") / "p.html"
    write_page(path, "A page", [figure("<svg viewBox='0 0 1 1'></svg>", "A figure.")])
    return path.read_text(encoding="utf-8")


def rules(text):
    """Return {selector: declarations} of a page's rules outside of @media."""
    css = re.search(r"<style>(.*)</style>", text, re.DOTALL)[1]
    css = re.sub(r"@media[^{]*\{(?:[^{}]|\{[^{}]*\})*\}", "", css)
    found = {}
    for selectors, own in re.findall(r"([^{}]+)\{([^{}]*)\}", css):
        for s in selectors.split(","):
            found[s.strip()] = found.get(s.strip(), "") + own
    return found


def test_names_do_not_break_in_mid_word(text):
    """`anywhere` counts letters as places to break when a column's least width is found, so a
    table's column gets as narrow as a letter; `break-word` does not, and breaks what is longer than
    a whole line alone.  Files' names may."""
    found = rules(text)
    anywhere = {s for s, own in found.items() if re.search(r"overflow-wrap:\s*anywhere", own)}
    assert anywhere == {"td.file"}
    assert "overflow-wrap: break-word" in found["body"]
    assert "overflow-wrap: normal" in found["td"]
    assert "overflow-wrap: normal" in found["th"]
    assert "word-break" not in text
    assert "hyphens" not in text
    assert "overflow-x: auto" in found[".wide"]  # what is wider than the page is scrolled


def test_an_enlarged_figure_is_zoomed_without_a_wheel(text):
    """The browser leaves fingers to the page there; two of them zoom, buttons do the same and
    close."""
    assert "touch-action: none" in rules(text)["figure svg.big"]
    for event in ("pointerdown", "pointermove", "pointerup", "pointercancel"):
        assert f'"{event}"' in text
    for name in ("closer", "wider", "close"):
        assert f'"{name}"' in text
    assert "two fingers" in text
    assert "{{" not in text  # braces of the template are single on the page
