"""A result as one page: HTML with its figures inside, light and dark, on a telephone's width and on paper."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from model.names import html_text
from sandbox.output.files import write_whole

PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
:root {{ color-scheme: light dark; --ink: #1d2430; --paper: #fff; --soft: #5b6573; --line: #d9dee5; --mark: #1f6fbf;
  --bar: #2e86de; --warm: #c2540c; --good: #d5ecda; --bad: #f6d6d1; --none: #eef0f3; }}
@media (prefers-color-scheme: dark) {{ :root {{ --ink: #e3e7ed; --paper: #14181f; --soft: #9fabba; --line: #343c48;
  --mark: #6db3f2; --warm: #e8853f; --good: #1d4429; --bad: #582a25; --none: #232933; }} }}
@media print {{ :root {{ color-scheme: light; --ink: #1d2430; --paper: #fff; --soft: #5b6573; --line: #d9dee5;
  --mark: #1f6fbf; --warm: #c2540c; --good: #d5ecda; --bad: #f6d6d1; --none: #eef0f3; }} }}
* {{ box-sizing: border-box; }}
body {{ margin: 0 auto; padding: 1rem; max-width: 62rem; color: var(--ink); background: var(--paper);
  font: 16px/1.45 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; overflow-wrap: break-word; }}
h1 {{ font-size: 1.3rem; margin: 0 0 .6rem; }} h2 {{ font-size: 1.1rem; margin: 1.6rem 0 .4rem; }}
h3 {{ font-size: 1rem; margin: 1rem 0 .3rem; }}
.badge {{ display: inline-block; padding: .1rem .6rem; border-radius: 1rem; color: var(--paper);
  background: var(--mark); font-size: .9rem; vertical-align: middle; }}
.unknown, .ambiguous, .explained_in_part {{ background: var(--warm); }}
.answer {{ border-left: .3rem solid var(--mark); padding: .1rem .8rem; margin: .7rem 0; break-inside: avoid; }}
.answer b {{ display: block; color: var(--soft); font-size: .85rem; font-weight: 600; }}
.wide, .draw {{ overflow-x: auto; overflow-y: hidden; }}
.over {{ border-right: .2rem solid var(--bar); }}
.over::before {{ content: "scroll sideways →"; position: sticky; left: 0; display: block; width: max-content;
  color: var(--soft); font-size: .8rem; }} .soft {{ color: var(--soft); }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; }}
th, td {{ text-align: left; padding: .3rem .5rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }}
th {{ color: var(--soft); font-weight: 600; }} td.n, th.n {{ text-align: right; white-space: nowrap; }}
td, th {{ overflow-wrap: normal; }} td.long {{ white-space: normal; min-width: 15rem; }}
td.file {{ overflow-wrap: anywhere; }} .wide td:first-child {{ min-width: 8rem; }}
td.good, td.bad, td.none {{ padding: .3rem .5rem; border: 2px solid var(--paper); white-space: nowrap; }}
td.good {{ background: var(--good); }} td.bad {{ background: var(--bad); }} td.none {{ background: var(--none); }}
td small {{ display: block; color: var(--soft); }}
@media screen and (max-width: 40rem) {{ .stacked tr {{ display: grid; grid-template-columns: 1fr auto; padding: .3rem 0;
  border-bottom: 1px solid var(--line); }} .stacked td {{ border: 0; padding: 0; }} .stacked tr:first-child,
  .stacked td:nth-child(n+3):not([data-head]) {{ display: none; }} .stacked td:nth-child(n+3) {{ grid-column: 1 / -1;
  text-align: left; white-space: normal; }} .stacked td:nth-child(n+3)::before {{ content: attr(data-head) ": ";
  color: var(--soft); }} }}
.marks td:first-child, .marks th:first-child {{ position: sticky; left: 0; background: var(--paper);
  white-space: nowrap; }} .marks th {{ padding-left: .5rem; white-space: nowrap; }}
.bar {{ background: var(--bar); height: .55rem; border-radius: .2rem; min-width: 1px; }}
code {{ font-size: .9em; }} pre {{ white-space: pre-wrap; font-size: .85rem; }}
figure {{ margin: .6rem 0; break-inside: avoid; }}
figure svg {{ width: 100%; height: auto; max-width: 34rem; min-width: 27rem; color: var(--ink); fill: var(--ink); }}
figure svg {{ cursor: zoom-in; }} figure svg.big {{ position: fixed; inset: 0; z-index: 9; width: 100vw; height: 100vh;
  max-width: none; min-width: 0; padding: 1rem; background: var(--paper); cursor: move; touch-action: none; }}
.tools {{ position: fixed; top: .5rem; right: .5rem; z-index: 10; }} .tools button {{ width: 2.8rem; height: 2.8rem;
  margin-left: .3rem; font-size: 1.4rem; color: var(--ink); background: var(--paper); border: 1px solid var(--soft);
  border-radius: .4rem; }} @media print {{ .tools {{ display: none; }} }}
@media (min-width: 50rem) {{ .pair {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }} }}
figcaption {{ color: var(--soft); font-size: .9rem; }}
details {{ margin: .8rem 0; }} summary {{ cursor: pointer; color: var(--mark); }}
@media print {{ .wide, .draw {{ overflow: visible; }} .over {{ border: 0; }} .over::before {{ display: none; }}
  figure svg {{ min-width: 0; }} body {{ font-size: 10pt; max-width: none; padding: 0; }} h2 {{ break-after: avoid; }}
  tr {{ break-inside: avoid; }} figure svg {{ max-height: 10.5cm; }} figure {{ margin: .3rem 0; }}
  .pair {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }} }}
</style></head><body>
{body}
<script>
const wider = new ResizeObserver(all => all.forEach(({{target: w}}) =>
  w.classList.toggle("over", w.scrollWidth > w.clientWidth + 1)));
document.querySelectorAll(".wide, .draw").forEach(w => wider.observe(w));
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => d.open = true));
const tools = document.body.appendChild(document.createElement("div")); tools.className = "tools";
document.querySelectorAll("figure svg").forEach(s => {{
  const home = s.getAttribute("viewBox"), box = () => s.getAttribute("viewBox").split(" ").map(Number);
  const held = new Map();  // fingers, or the mouse's button, by id
  const big = () => s.classList.contains("big"), show = b => s.setAttribute("viewBox", b.join(" "));
  const zoom = (f, at) => {{ const [x, y, w, h] = box(), p = new DOMPoint(at.x, at.y).matrixTransform(s.getScreenCTM()
    .inverse()); show([p.x - f * (p.x - x), p.y - f * (p.y - y), f * w, f * h]); }};
  const move = (a, b) => {{ const [x, y, w, h] = box(), c = s.getScreenCTM();
    show([x - (b.x - a.x) / c.a, y - (b.y - a.y) / c.d, w, h]); }};
  const middle = {{ get x() {{ return innerWidth / 2; }}, get y() {{ return innerHeight / 2; }} }};
  const close = () => {{ s.classList.remove("big"); show(home.split(" ")); held.clear(); tools.replaceChildren(); }};
  const button = (sign, name, act) => {{ const b = document.createElement("button"); b.textContent = sign;
    b.setAttribute("aria-label", name); b.addEventListener("click", act); return b; }};
  s.addEventListener("click", () => {{ if (big()) return; s.classList.add("big");
    tools.replaceChildren(button("+", "closer", () => zoom(0.7, middle)), button("−", "wider", () => zoom(1.4, middle)),
      button("×", "close", close)); }});
  s.addEventListener("dblclick", () => {{ if (big()) close(); }});
  addEventListener("keydown", e => {{ if (e.key === "Escape" && big()) close(); }});
  s.addEventListener("wheel", e => {{ if (!big()) return; e.preventDefault(); zoom(e.deltaY > 0 ? 1.25 : 0.8, e); }},
    {{passive: false}});
  s.addEventListener("pointerdown", e => {{ if (big()) held.set(e.pointerId, e); }});
  ["pointerup", "pointercancel"].forEach(k => addEventListener(k, e => held.delete(e.pointerId)));
  s.addEventListener("pointermove", e => {{ const last = held.get(e.pointerId); if (!last) return;
    const other = [...held.values()].find(p => p !== last), far = p => Math.hypot(p.x - other.x, p.y - other.y);
    if (!other) move(last, e);
    else if (far(e) > 1) zoom(far(last) / far(e), {{x: (e.x + other.x) / 2, y: (e.y + other.y) / 2}});
    held.set(e.pointerId, e); }});
}});
</script>
</body></html>
"""
ENLARGE = "Click to enlarge; then wheel, two fingers or + and − zoom, dragging moves, × or Escape closes."
LONG = 36  # letters: a cell with more is broken between words
MARKS = {"✓": "good", "✗": "bad", "○": "none"}  # ○: as it should be, but not good


def write_page(path: Path, title: str, parts: Iterable[str]) -> None:
    """Write parts (HTML) as one self-contained page; the title is plain text.  BadInput without the page's folder."""
    write_whole(path, PAGE.format(title=html_text(title), body="\n".join(parts)).encode())


def prose(text: str) -> str:
    """Return text for a page: percentages kept together, `words` as code."""
    plain = html_text(text).replace(" %", "&nbsp;%")
    return re.sub("`([^`]+)`", r"<code>\1</code>", plain)


def answer(question: str, text: str) -> str:
    """Return a question with its answer, set off from the rest."""
    return f'<div class="answer"><b>{prose(question)}</b>{prose(text)}</div>'


def bullets(texts: Iterable[str]) -> str:
    """Return sentences as a list, nothing where there is none."""
    items = "".join(f"<li>{prose(text)}</li>" for text in texts)
    return f"<ul>{items}</ul>" if items else ""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], stacked: bool = False) -> str:
    """Return a table; the first column is text, the others numbers where there are more than two; long ones wrap.

    stacked: where the screen is narrow, a row's third cell and the further ones stand below its first two, each behind
    its column's head; those that hold nothing ("–") are left out there.
    """
    kind = " class='n'" if len(heads) > 2 else ""
    wraps = " class='n long'" if len(heads) > 2 else " class='long'"
    head = "".join(f"<th{kind if k else ''}>{prose(h)}</th>" for k, h in enumerate(heads))

    def cell(k: int, x: str) -> str:
        """Return the k-th cell of a row."""
        told = f' data-head="{html_text(heads[k])}"' if stacked and x != "–" else ""
        return f"<td{'' if not k else wraps if len(x) > LONG else kind}{told}>{prose(x)}</td>"

    body = "".join(f"<tr>{''.join(cell(k, x) for k, x in enumerate(row))}</tr>" for row in rows)
    return f"<div class='wide{' stacked' if stacked else ''}'><table><tr>{head}</tr>{body}</table></div>"


def verdicts(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of texts with a verdict in them, such as '0.1 (0.4) ✓ ≤ 1': coloured by MARKS, the goal below."""
    head = "".join(f"<th>{prose(h)}</th>" for h in heads)
    body = "".join(f"<tr><td>{prose(row[0])}</td>{''.join(map(_verdict, row[1:]))}</tr>" for row in rows)
    return f"<div class='wide marks'><table><tr>{head}</tr>{body}</table></div>"


def _verdict(text: str) -> str:
    mark = next((m for m in MARKS if f" {m}" in text), "")
    seen, _, goal = text.partition(f" {mark} ") if mark else (text, "", "")
    below = f"<small>{mark} {prose(goal)}</small>" if mark else ""
    return f"<td class='{MARKS.get(mark, 'none')}'>{prose(seen) or '–'}{below}</td>"


def fold(head: str, content: str) -> str:
    """Return a part that opens on demand (and when printed)."""
    return f"<details><summary>{prose(head)}</summary>{content}</details>"


def figure(svg: str, caption: str) -> str:
    """Return a drawing (SVG) with a caption in plain text."""
    drawing = f"<div class='draw'>{svg}</div>"
    return f"<figure role='img' title='{ENLARGE}'>{drawing}<figcaption>{prose(caption)}</figcaption></figure>"


def pairs(figures: Iterable[str]) -> Iterator[str]:
    """Yield figures side by side where the screen is wide enough."""
    yield f"<div class='pair'>{''.join(figures)}</div>"
