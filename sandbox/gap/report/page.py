"""What a person sees: the answers printed, and `report.html`, one file with its figures inside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from model.effects import library
from model.names import html_text
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.report import answers, listed
from sandbox.gap.report.answers import Answers
from sandbox.gap.report.decompose import Decomposition, decompose
from sandbox.gap.report.diagnosis_json import closed_by
from sandbox.gap.report.distinguishability import Alike
from sandbox.gap.report.words import label, names, quantity, words
from sandbox.gap.search.estimates import Estimate
from sandbox.gap.search.posterior import UNKNOWN
from sandbox.output.files import version
from sandbox.output.plots import bars_svg, lines_svg
from sandbox.output.tables import print_table
from sandbox.replay.replay import Residual

FEWEST = 0.001  # probability below which a hypothesis stays in the folded part
POINTS = 1200  # drawn of a line
TITLES = {
    "explained": "Explained",
    "ambiguous": "Ambiguous",
    "unknown": "Not in the library",
    "no_gap": "No gap",
}
FLAT = 3.0  # log likelihood: a fall of less is none that decides
PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title><style>
:root {{ color-scheme: light; --ink: #1d2430; --soft: #5b6573; --line: #d9dee5; --mark: #2e86de; --warm: #de6210; }}
* {{ box-sizing: border-box; }}
body {{ margin: 0 auto; padding: 1rem; max-width: 62rem; color: var(--ink); background: #fff;
  font: 16px/1.45 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; overflow-wrap: anywhere; }}
h1 {{ font-size: 1.3rem; margin: 0 0 .6rem; }} h2 {{ font-size: 1.1rem; margin: 1.6rem 0 .4rem; }}
.badge {{ display: inline-block; padding: .1rem .6rem; border-radius: 1rem; color: #fff; background: var(--mark);
  font-size: .9rem; vertical-align: middle; }}
.unknown, .ambiguous {{ background: var(--warm); }}
.answer {{ border-left: .3rem solid var(--mark); padding: .1rem .8rem; margin: .7rem 0; break-inside: avoid; }}
.answer b {{ display: block; color: var(--soft); font-size: .85rem; font-weight: 600; }}
.wide {{ overflow-x: auto; }} .soft {{ color: var(--soft); }}
table {{ border-collapse: collapse; width: 100%; font-size: .92rem; }}
th, td {{ text-align: left; padding: .3rem .5rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }}
th {{ color: var(--soft); font-weight: 600; }} td.n, th.n {{ text-align: right; white-space: nowrap; }}
td.file {{ overflow-wrap: anywhere; }}
.bar {{ background: var(--mark); height: .55rem; border-radius: .2rem; min-width: 1px; }}
pre {{ white-space: pre-wrap; font-size: .85rem; }}
figure {{ margin: .6rem 0; break-inside: avoid; }} figure svg {{ width: 100%; height: auto; max-width: 34rem; }}
@media (min-width: 50rem) {{ .pair {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }} }}
figcaption {{ color: var(--soft); font-size: .9rem; }}
details {{ margin: .8rem 0; }} summary {{ cursor: pointer; color: var(--mark); }}
@media print {{ body {{ font-size: 10pt; max-width: none; padding: 0; }} h2 {{ break-after: avoid; }}
  tr {{ break-inside: avoid; }} figure svg {{ max-height: 10.5cm; }} figure {{ margin: .3rem 0; }}
  .pair {{ display: grid; grid-template-columns: 1fr 1fr; gap: 1rem; }} }}
</style></head><body>
{body}
<script>
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(d => d.open = true));
</script>
</body></html>
"""


def print_answers(a: Answers) -> None:
    """Print the answers and what is left in sentences, the hypotheses and the gap per recording as tables."""
    d = a.diagnosis
    print(f"{d.campaign.name}: {TITLES[a.verdict].lower()}")
    for head, text in _three(a):
        print(f"{head:<10} {text}")
    print(f"{'Left?':<10} {answers.remains_text(a)}")
    rows = [[label(h), f"{h.probability:.3f}", _share(closed_by(d, h))] for h in d.hypotheses[:6]]
    print_table("hypotheses", ["effects", "probability", "gap closed"], rows)
    if d.parameters[0]:
        heads = ["name", "value [95 % interval]", "nominal"]
        print_table("parameters", heads, _parameters(a, d.parameters[0]))
    rows = [[f + (" (held out)" if h else ""), f"{b:.2f}", f"{x:.2f}"] for f, b, x, h in d.size.recordings]
    print_table("residual over its noise floor (rms)", ["recording", "before", "after"], rows)
    for text in answers.caveats(a):
        print(f"note: {text}")
    print(f"{d.simulations} simulations in {d.seconds:.1f} s")


def write_report(path: Path, a: Answers) -> None:
    """Write the report as one self-contained page."""
    title = f"{a.diagnosis.campaign.name}: where simulation and recordings part"
    path.write_text(PAGE.format(title=html_text(title), body="\n".join(_body(a, title))), encoding="utf-8")


def _three(a: Answers) -> list[tuple[str, str]]:
    return [
        ("Where?", answers.where_text(a)),
        ("Which?", answers.which_text(a)),
        ("How far?", answers.far_text(a)),
        ("Next?", answers.next_text(a)),
    ]


def _body(a: Answers, title: str) -> Iterator[str]:
    d = a.diagnosis
    yield f'<h1>{_html(title)} <span class="badge {a.verdict}">{TITLES[a.verdict]}</span></h1>'
    heads = {
        "Where?": "Where does the gap lie?", "Which?": "Which effect causes it?",
        "How far?": "How far does the gap shrink?", "Next?": "What next?",
    }  # fmt: skip
    for head, text in _three(a):
        yield f'<div class="answer"><b>{heads[head]}</b>{_html(text)}</div>'
    yield "<h2>Hypotheses</h2>" + _hypotheses(a, [h for h in d.hypotheses if h.probability >= FEWEST])
    told = ", or ".join(names(h.effects) for h in d.ambiguity_set)
    yield f'<p class="soft">With at least 95 % probability it is {_html(told)}.</p>'
    yield from _listed(a)
    if a.alike is not None:
        yield from _why_alike(a.alike)
    for h, own in zip(d.hypotheses, d.parameters, strict=True):
        if own and h in d.ambiguity_set:
            yield f"<h2>Parameters of {_html(names(h.effects))}</h2>"
            yield table(["parameter", "value [95 % interval]", "nominal"], _parameters(a, own))
    before, after = shown(d.before.point), shown(d.after.point)
    part, rest = decompose(d.before.point, before), decompose(d.after.point, after)
    yield "<h2>The gap, recording by recording</h2>"
    yield _figure(_by_recording(a), "rms of the residual over its noise floor; 1 is noise. ● held out of the fit.")
    yield fold("All figures", table(["recording", "before", "after", "share of the gap"], _recordings(a, part)))
    if a.where:
        yield "<h2>Where it lies</h2><ul>"
        yield "".join(f"<li>{_html(f.text)}</li>" for f in a.where) + "</ul>"
        yield f"<div class='pair'>{''.join(_spectrum(part, rest))}</div>"
    yield from _waves(a, part, before, after)
    yield "<h2>What remains</h2><p>" + _html(answers.remains_text(a)) + "</p>"
    notes = answers.caveats(a)
    if notes:
        yield "<h2>Before you rely on it</h2><ul>" + "".join(f"<li>{_html(t)}</li>" for t in notes) + "</ul>"
    yield from _detail(a)


def _hypotheses(a: Answers, chosen: Sequence) -> str:
    rows = [
        f"<tr><td>{_html(label(h))}<div class='bar' style='width:{100.0 * h.probability:.1f}%'></div></td>"
        f"<td class='n'>{100.0 * h.probability:.1f} %</td><td class='n'>{_share(closed_by(a.diagnosis, h))}</td></tr>"
        for h in chosen
    ]
    head = "<tr><th>effects</th><th class='n'>probability</th><th class='n'>gap closed</th></tr>"
    return f"<div class='wide'><table>{head}{''.join(rows)}</table></div>"


def _listed(a: Answers) -> Iterator[str]:
    """Yield the whole list of effects, what cannot be parted, and how the gap shrinks from effect to effect."""
    r = a.ranking
    own = [] if r is None else listed.rows(r)
    if r is None or not own:
        return
    yield "<h2>All effects that may be there</h2>"
    yield table(["effect", "probability", "share of the gap [95 %]", "size [95 % interval]"], own)
    told = list(listed.group_sentences(r))
    if told:
        yield "<ul>" + "".join(f"<li>{_html(t)}</li>" for t in told) + "</ul>"
    labels, levels = listed.waterfall(a)
    if len(labels) > 3:
        yield _figure(
            bars_svg(labels, {"residual / noise floor": levels}, "residual / noise floor", log_from=0.5),
            "Residual on the recordings held out (or all) as effects are added one after the other, the largest first.",
        )


def _why_alike(x: Alike) -> Iterator[str]:
    """Yield why an ambiguity is one: how alike its effects look, and how flat the likelihood is between both."""
    yield "<h2>Why it cannot be told</h2><ul>"
    for effect, cosine in x.cosines.items():
        own, other = (x.first, x.second) if effect in x.first else (x.second, x.first)
        rival = [e for e in other if e not in own]
        others = names(rival) if rival else "what ordinary deviations can do"
        text = f"On these recordings {words(effect)} looks like {others}: cosine {cosine:.4f}."
        yield f"<li>{_html(text)}</li>"
    fall = max(x.log_likelihood) - min(x.log_likelihood)
    what = f"0: {names(x.second)}, 1: {names(x.first)}. "
    if fall < FLAT:
        what += "Flat: the recordings cannot choose."
    else:
        what += f"It falls by {fall:.0f} on the straight way: recordings choose there, priors between its ends."
    line = (list(x.share), list(x.log_likelihood))
    panels = [("log likelihood", {"all parameters going along": line})]
    yield "</ul>" + _figure(lines_svg(panels, "share of the way between both fits"), what)


def _share(x: float | None) -> str:
    return "–" if x is None else f"{100.0 * x:.1f} %"


def _parameters(a: Answers, own: Mapping[str, Estimate]) -> list[list[str]]:
    """Return rows of name, value with interval, and what the nominal model has."""
    neutral = library.neutral(a.diagnosis.campaign.drive.motor)
    nominal = {k: replace(e, value=neutral[k], low=neutral[k], high=neutral[k]) for k, e in own.items()}
    return [[k, quantity(e), quantity(nominal[k])] for k, e in own.items()]


def _recordings(a: Answers, part: Decomposition) -> list[list[str]]:
    return [
        [file + (" (held out)" if held else ""), f"{b:.2f}", f"{x:.2f}", f"{100.0 * part.recordings[file]:.0f} %"]
        for file, b, x, held in a.diagnosis.size.recordings
    ]


def _by_recording(a: Answers) -> str:
    rows = a.diagnosis.size.recordings
    labels = [Path(f).stem + (" ●" if held else "") for f, _, _, held in rows]
    series = {"before": [r[1] for r in rows]}
    if a.diagnosis.after.effects:
        series["after"] = [r[2] for r in rows]
    return bars_svg(labels, series, "residual / noise floor", log_from=0.5)


def _spectrum(part: Decomposition, rest: Decomposition) -> Iterator[str]:
    """Yield the shares by direction, region and order that stand out, before and after."""
    scale = rest.excess / part.excess
    labels, before, after = [], [], []
    groups = ("directions", "speeds", "currents")
    for group in groups:
        for name, share in getattr(part, group).items():
            labels.append(name)
            before.append(100.0 * share)
            after.append(100.0 * scale * getattr(rest, group)[name])
    yield _figure(
        bars_svg(labels, {"before": before, "after": after}, "share of the gap before (%)"),
        "Direction of the missing voltage, speed, current. Directions of one frame add up to at most 100 %.",
    )
    orders = sorted({abs(n) for n in part.electrical})
    both = [[100.0 * sum(x.electrical.get(s, 0.0) for s in {n, -n}) for n in orders] for x in (part, rest)]
    if max(both[0]) > 1.0:
        yield _figure(
            bars_svg([str(n) for n in orders], {"before": both[0], "after": [scale * x for x in both[1]]},
                     "share of the gap before (%)"),
            "Electrical orders of the currents in the rotor's frame, turning recordings (0: turns with the rotor).",
        )  # fmt: skip


def _waves(a: Answers, part: Decomposition, before: Sequence[Residual], after: Sequence[Residual]) -> Iterator[str]:
    """Yield the residual of the recording that holds most of the gap, over time."""
    files = [r.file for r in a.diagnosis.start.prepared.recordings]
    k = max(range(len(files)), key=lambda k: part.recordings[files[k]])
    r = a.diagnosis.start.prepared.recordings[k]
    period = a.diagnosis.campaign.drive.converter.sampling_period
    width = max(1, r.samples // POINTS)
    t = (np.arange(r.samples // width) * width * period).tolist()

    def peaks(x) -> list[float]:
        """Return the largest value of each stretch, with its sign."""
        own = np.asarray(x)[: len(t) * width].reshape(len(t), width)
        return own[np.arange(len(t)), np.argmax(np.abs(own), axis=1)].tolist()

    panels = [
        (f"i_{p}", {"before": (t, peaks(before[k].current[:, j, 0])), "after": (t, peaks(after[k].current[:, j, 0]))})
        for j, p in enumerate("abc")
    ]
    own, rest = before[k].motion, after[k].motion
    if own is not None and rest is not None:
        panels.append(("motion", {"before": (t, peaks(own[:, 0])), "after": (t, peaks(rest[:, 0]))}))
    yield f"<h2>Residuals in {_html(r.file)}</h2>"
    yield _figure(
        lines_svg(panels, "t (s)"), "Read less predicted, in units of the noise floor; peaks of each stretch."
    )


def _detail(a: Answers) -> Iterator[str]:
    d = a.diagnosis
    rest = [h for h in d.hypotheses if h.probability < FEWEST]
    if rest:
        yield fold("Hypotheses that were tried and dropped", _hypotheses(a, rest))
    for effect in dict.fromkeys(e for h in d.ambiguity_set for e in h.effects if e != UNKNOWN):
        yield fold(
            f"The effect {words(effect)}",
            f"<pre>{html_text(library.card_text(library.load_effect(effect)))}</pre>",
        )
    rows = [[k, f"{v:g}" if isinstance(v, (int, float)) else str(v)] for k, v in vars(d.campaign.drive.motor).items()]
    yield fold("The nominal model", table(["[motor]", "value"], [r for r in rows if r[1]]))
    held = ", ".join(d.start.prepared.recordings[k].file for k in d.held_out) or "none"
    facts = [
        ["residual of the nominal model as given", f"{d.size.raw:.3g} noise floors"],
        ["ordinary deviations refitted", f"{d.size.before:.3g}"], ["best hypothesis", f"{d.size.after:.3g}"],
        ["held out", held], ["simulations", str(d.simulations)], ["seconds", f"{d.seconds:.1f}"],
        ["version", version()],
    ]  # fmt: skip
    yield fold("How it was made", table(["", ""], facts))


def _html(text: str) -> str:
    """Return text for the page: percentages kept together, names with underscores free to break."""
    return html_text(text).replace(" %", "&nbsp;%").replace("_", "_<wbr>")


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table; the first column is text, the others numbers where there are more than two."""
    kind = " class='n'" if len(heads) > 2 else ""
    head = "".join(f"<th{kind if k else ''}>{_html(h)}</th>" for k, h in enumerate(heads))
    body = "".join(
        "<tr>" + "".join(f"<td{kind if k else ''}>{_html(x)}</td>" for k, x in enumerate(row)) + "</tr>" for row in rows
    )
    return f"<div class='wide'><table><tr>{head}</tr>{body}</table></div>"


def fold(head: str, content: str) -> str:
    """Return a part that opens on demand (and when printed)."""
    return f"<details><summary>{_html(head)}</summary>{content}</details>"


def _figure(svg: str, caption: str) -> str:
    return f"<figure role='img'>{svg}<figcaption>{_html(caption)}</figcaption></figure>"
