"""Every kind of result page in a browser, as wide as a telephone and a desk: nothing cut, no letter too small."""

from __future__ import annotations

import shutil

import pytest

import sandbox
from tests import screens
from tests.sandbox.public.naming import ROOT, SHORT

pytestmark = pytest.mark.skipif(screens.browser() is None, reason="no Chromium here: pages are not rendered")


def test_pages_of_results_fit_a_telephone_and_a_desk(run, tmp_path):
    """The diagnosis is the kept one, of many recordings; the others are made here."""
    pages = tmp_path / "pages"
    pages.mkdir()
    shutil.copy(ROOT / "docs" / "stored" / "report.html", pages / "diagnose.html")
    run.to_html(pages / "simulate.html")
    sandbox.compare("ipm_exchanged", SHORT, ["qnull", "ekf"]).to_html(pages / "compare.html")
    sandbox.protocol(["qnull"], ["ipm_exchanged"], ["load_step"]).to_html(pages / "protocol.html")
    assert screens.findings(pages, sorted(p.name for p in pages.iterdir()), tmp_path) == []
