"""Every kind of result page in a browser, as wide as a telephone and a desk: nothing cut, no letter
too small."""

from __future__ import annotations

import pytest

import sandbox
from sandbox.evaluation.protocol import TESTS
from sandbox.output import document, vector
from tests import screens
from tests.sandbox.public.naming import SHORT

pytestmark = pytest.mark.skipif(
    screens.browser() is None, reason="no Chromium here: pages are not rendered"
)


def test_pages_of_results_fit_a_telephone_and_a_desk(run, tmp_path):
    """The page of a diagnosis takes minutes to make: here are drawings such as it has, with its
    longest names."""
    pages = tmp_path / "pages"
    pages.mkdir()
    names, found = (
        ["across the voltage command", "around rated current and above"],
        {"before": [20.0, 3.0]},
    )
    bars = vector.bars_svg(names, found, "share of the gap before (%)", ylabel="electrical order")
    dots = vector.dots_svg(
        ["locked_q_inject_d ●", "+ winding asymmetry"], found, "residual (noise floors)"
    )
    pair = document.pairs(document.figure(x, "Drawing.") for x in (bars, dots))
    document.write_page(
        pages / "diagnose.html", "Drawings", [*pair, document.figure(bars, "Alone.")]
    )
    heads = ["estimator", *(t for t in TESTS if t != "reversal")]
    cells = ["17.35 (18.2), 3 lost ○ as theory ±0.3°"] * (len(heads) - 2) + [
        "1532 ns, 8.7/8.8 %, 0.69 W, 38 dB"
    ]
    verdicts = document.verdicts(heads, [["random_frequency sat.", *cells]])
    document.write_page(pages / "verdicts.html", "All tests", [verdicts])
    run.to_html(pages / "simulate.html")
    sandbox.compare("ipm_exchanged", SHORT, ["qnull", "ekf"]).to_html(pages / "compare.html")
    sandbox.protocol(["qnull"], ["ipm_exchanged"], ["load_step"]).to_html(pages / "protocol.html")
    assert screens.findings(pages, sorted(p.name for p in pages.iterdir()), tmp_path) == []
