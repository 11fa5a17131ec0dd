"""Drawings for pages: their fonts, lines that lie on each other; prose as HTML."""

import re

from sandbox.output import document, vector


def test_figures_of_a_report_need_one_font_only(caplog, monkeypatch, request):
    """A machine without the fonts of powers and Greek letters gets the same figures, and no warning
    about fonts."""
    from matplotlib import font_manager

    manager = font_manager.fontManager
    monkeypatch.setattr(
        manager, "ttflist", [f for f in manager.ttflist if f.fname.endswith("DejaVuSans.ttf")]
    )
    manager._findfont_cached.cache_clear()
    request.addfinalizer(manager._findfont_cached.cache_clear)
    svg = vector.dots_svg(
        ["run_a ●", "b"], {"before": [20.0, 3.0], "after": [1.0, 1.1]}, "residual"
    )
    wide = vector.dots_svg(["a"], {"before": [2e4]}, "residual")
    bars = vector.bars_svg(["0", "6"], {"before": [20.0, 3.0]}, "share", ylabel="order")
    lines = vector.lines_svg([("i_a", {"before": ([0.0, 1.0], [2.0, 1.0])})], "t (s)")
    assert all(s.startswith("<svg") for s in (svg, wide, bars, lines))
    assert not caplog.records


def test_prose_shows_calls_as_code_and_stays_text():
    assert document.prose("see `list` of <b> 5 %") == "see <code>list</code> of &lt;b&gt; 5&nbsp;%"


def test_a_line_on_another_leaves_it_in_sight():
    """Drawn first is wider than drawn last, so it looks out on both sides; elsewhere all lines are
    thin."""
    same = {"linear": ([0.0, 1.0], [2.0, 1.0]), "saturated": ([0.0, 1.0], [2.0, 1.0])}
    colours = ["#de6210", "#2e86de"]

    def drawn(**how):
        svg = vector.lines_svg([("i_q (A)", same)], "time (s)", colours=colours, **how)
        return {
            c: {float(w) for w in re.findall(f"stroke: {c}; stroke-width: ([0-9.]+)", svg)}
            for c in colours
        }

    alike, usual = drawn(alike=True), drawn()
    assert min(alike["#de6210"]) >= max(alike["#2e86de"]) + 1.0
    assert usual["#2e86de"] == usual["#de6210"]
