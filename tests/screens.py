"""Pages as a browser lays them out: tables and figures wider than the page, letters too small to
read.

`findings(folder, pages)` opens every page in headless Chromium at the widths of a telephone and of
a desk.
"""

from __future__ import annotations

import html
import json
import shutil
import subprocess
import threading
from collections.abc import Sequence
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

WIDTHS = (390, 1280)  # CSS pixels
LEAST = 8.0  # points of a letter in a figure
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
HARNESS = """<!doctype html><body><pre id="out"></pre><script>
const pages = PAGES, widths = WIDTHS, found = [];
const size = (node, units) => { const m = node.getScreenCTM(); return 0.75 * units * Math.hypot(m.a, m.b); };
const look = (page, width, d) => {
  const say = text => found.push(`${page} at ${width}: ${text}`);
  const shown = node => node.getClientRects().length && node.getBoundingClientRect().width > 0;
  d.querySelectorAll("details").forEach(x => { x.open = true; });
  d.querySelectorAll("table").forEach(t => {
    if (!shown(t) || t.closest(".highlight")) return;
    const over = Math.max(t.scrollWidth, t.offsetWidth) - t.parentElement.clientWidth;
    if (over > 1) say(`table ${over} px too wide: ${t.innerText.slice(0, 60).replace(/\\s+/g, " ")}`);
  });
  d.querySelectorAll("img, svg").forEach(s => {
    if (shown(s) && s.getBoundingClientRect().right > width + 1 && !s.closest("aside, header, .draw"))
      say(`figure cut: ${s.getAttribute("src") || s.getAttribute("aria-label")}`);
  });
  d.querySelectorAll("figure svg, svg.drawing").forEach(s => {
    if (!shown(s)) return;
    if (s.getBoundingClientRect().right > width + 1) say(`drawing cut: ${s.getAttribute("aria-label")}`);
    let least = 99;
    const page = s.getBoundingClientRect();
    const within = (node, name) => {
      const own = node.getBoundingClientRect();
      const over = Math.max(page.left - own.left, own.right - page.right, page.top - own.top, own.bottom - page.bottom);
      if (over > 2) say(`letters ${over.toFixed(0)} px beyond their figure: ${name}`);
    };
    s.querySelectorAll("text, tspan").forEach(t => {
      if (![...t.childNodes].some(n => n.nodeType == 3 && n.data.trim())) return;
      least = Math.min(least, size(t.closest("text"), parseFloat(getComputedStyle(t).fontSize)));
      within(t, t.textContent);
    });
    s.querySelectorAll("g[id*=text_] > g").forEach(g => {
      least = Math.min(least, size(g, 100));
      within(g, s.closest("figure")?.innerText.slice(0, 60));
    });
    if (least < LEAST) say(`letters of ${least.toFixed(1)} pt: ${s.getAttribute("aria-label")}`);
  });
  if (d.documentElement.scrollWidth > width + 1) say(`page ${d.documentElement.scrollWidth} px wide`);
};
const open = (page, width) => new Promise(done => {
  const frame = document.createElement("iframe");
  frame.style.cssText = `border:0;width:${width}px;height:900px`;
  frame.onload = () => { look(page, width, frame.contentDocument); frame.remove(); done(); };
  frame.src = page; document.body.append(frame);
});
(async () => {
  for (const page of pages) for (const width of widths) await open(page, width);
  document.getElementById("out").textContent = JSON.stringify(found);
  document.body.append(Object.assign(document.createElement("i"), {id: "done"}));
})();
</script></body>
"""  # noqa: E501


def browser() -> str | None:
    """Return the program of a browser that runs without a display, None where there is none."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


class _Quiet(SimpleHTTPRequestHandler):
    """A server of files that says nothing."""

    def log_message(self, *_: object) -> None:
        """Say nothing."""


def findings(folder: Path, pages: Sequence[str], scratch: Path) -> list[str]:
    """Return what does not fit on pages (paths below a folder), a sentence each; scratch: for the
    browser's profile."""
    program = browser()
    assert program is not None
    harness = folder / "_screens.html"
    text = HARNESS.replace("PAGES", json.dumps(list(pages))).replace("WIDTHS", json.dumps(WIDTHS))
    harness.write_text(text.replace("LEAST", str(LEAST)), encoding="utf-8")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(folder)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    call = [
        program,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        f"--user-data-dir={scratch / 'browser'}",
        "--virtual-time-budget=600000",
        "--dump-dom",
        f"http://127.0.0.1:{server.server_port}/{harness.name}",
    ]
    try:
        done = subprocess.run(call, capture_output=True, text=True, check=False, timeout=600)
    finally:
        server.shutdown()
        server.server_close()
        harness.unlink()
    assert 'id="done"' in done.stdout, f"the browser did not come to the end: {done.stderr[-500:]}"
    out = done.stdout.partition('<pre id="out">')[2].partition("</pre>")[0]
    return [str(text) for text in json.loads(html.unescape(out))]
