"""What a person sees: the answers printed, and `report.html`, one file with its figures inside."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path

from model.effects import library
from model.names import html_text
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.decompose import Decomposition, decompose
from sandbox.gap.pages import charts, listed, signals
from sandbox.gap.posterior.estimates import Estimate
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.report import answers, left
from sandbox.gap.report.answers import Answers
from sandbox.gap.report.diagnosis_json import closed_by
from sandbox.gap.report.distinguishability import Alike
from sandbox.gap.words import SIGNS, amperes, names, percent_fine, quantity, words
from sandbox.output.document import answer as answered
from sandbox.output.document import bullets, figure, fold, prose, table, write_page
from sandbox.output.files import version
from sandbox.output.sentences import VERDICTS, capital
from sandbox.output.tables import print_prose, print_table
from sandbox.output.vector import dots_svg, lines_svg
from sandbox.recordings.campaign import Excerpts

FEWEST = 0.001  # probability below which a hypothesis stays in the folded part
FLOOR = (
    "Noise floor: rms of what the sensors' noise alone makes. A residual of 1 noise floor is "
    "noise, nothing else."
)
GAP = (
    "Gap closed: (before² − after²) / (before² − 1), with the residuals before and after in noise "
    "floors. The 1 is the noise, which no effect can close; before² − 1 is the reducible gap."
)
FLAT = 3.0  # log likelihood: a fall of less is none that decides


def print_answers(a: Answers) -> None:
    """Print the answers and what is left in sentences, the hypotheses and the gap per recording as
    tables."""
    d = a.diagnosis
    print_prose(f"{d.campaign.name}: {VERDICTS[a.badge].lower()}")
    for head, text in _three(a):
        print_prose(text, f"{head:<10} ")
    for text in answers.todo_texts(a):
        print_prose(text, f"{'Do?':<10} ")
    for c in a.curves:
        print_prose(f"{capital(words(c.effect))}: {c.text}", f"{'Curve?':<10} ")
    print_prose(left.remains_text(a), f"{'Left?':<10} ")
    rows = [
        [
            listed.against_first(h, d.best, a.shares),
            f"{h.probability:.3f}",
            share_text(closed_by(d, h)),
        ]
        for h in d.hypotheses[:6]
    ]
    print_table("hypotheses", ["effects", "probability", "gap closed"], rows)
    if own := [] if a.ranking is None else listed.rows(a.ranking):
        print_table(
            "effects that may be there",
            ["effect", "probability", "share of the gap"],
            [r[:3] for r in own],
        )
    if d.parameters[0]:
        heads = ["name", "value [95 % interval]", "nominal"]
        print_table("parameters", heads, parameter_rows(a, d.parameters[0]))
    rows = [
        [f + (" (held out)" if h else ""), f"{b:.2f}", f"{x:.2f}"]
        for f, b, x, h in d.size.recordings
    ]
    print_table("residual over its noise floor (rms)", ["recording", "before", "after"], rows)
    for text in answers.caveats(a):
        print_prose(f"note: {text}")
    print_prose(
        f"{d.simulations} simulations in {d.seconds:.1f} s; compiling, what to record next and "
        "files come on top"
    )


def write_report(path: Path, a: Answers) -> None:
    """Write the report as one self-contained page."""
    title = f"{a.diagnosis.campaign.name}: where simulation and recordings part"
    write_page(path, title, page_body(a, title))


def _three(a: Answers) -> list[tuple[str, str]]:
    return [
        ("Where?", answers.where_text(a)),
        ("Which?", answers.which_text(a)),
        ("How far?", answers.far_text(a)),
        ("Next?", answers.next_text(a)),
    ]


def page_body(a: Answers, title: str) -> Iterator[str]:
    """Yield the parts of the report, answers first."""
    d = a.diagnosis
    yield f'<h1>{prose(title)} <span class="badge {a.badge}">{VERDICTS[a.badge]}</span></h1>'
    heads = {
        "Where?": "Where does the gap lie?",
        "Which?": "Which effect causes it?",
        "How far?": "How far does the gap shrink?",
        "Next?": "What next?",
    }
    for head, text in _three(a):
        yield answered(heads[head], text)
    if todo := answers.todo_texts(a):
        yield "<h2>What to do</h2>" + bullets(todo)
    yield "<h2>Hypotheses</h2>" + _hypotheses(
        a, [h for h in d.hypotheses if h.probability >= FEWEST]
    )
    likely = ", or ".join(listed.short(h, d.hypotheses) for h in d.ambiguity_set)
    yield f'<p class="soft">With at least 95 % probability it is {prose(likely)}.</p>'
    yield f'<p class="soft">{prose(f"{GAP} {FLOOR}")}</p>'
    yield from _listed(a)
    if a.alike is not None:
        yield from why_alike(a.alike)
    for h, own in zip(d.hypotheses, d.parameters, strict=True):
        if own and h in d.ambiguity_set:
            yield f"<h2>Parameters of {prose(listed.short(h, d.hypotheses))}</h2>"
            rows = [
                [f"{capital(library.title(k))} `{k}`", *rest] for k, *rest in parameter_rows(a, own)
            ]
            yield table(["parameter", "value [95 % interval]", "nominal"], rows)
    yield from charts.of_curves(a.curves)
    before, after = shown(d.before.point), shown(d.after.point)
    part, rest = decompose(d.before.point, before), decompose(d.after.point, after)
    yield "<h2>The gap, recording by recording</h2>"
    yield figure(_by_recording(a), _noise_caption(a))
    yield fold(
        "All figures",
        table(["recording", "before", "after", "share of the gap"], _recordings(a, part)),
    )
    if d.campaign.excerpts is not None:
        period = d.campaign.drive.converter.sampling_period
        columns = ["part", "of the recording", "from s", "to s", "of s"]
        yield fold(
            "Parts of recordings that were used",
            table(columns, part_rows(d.campaign.excerpts, period)),
        )
    if a.where:
        yield "<h2>Where it lies</h2>" + bullets(f.text for f in a.where)
        yield from charts.of_parts(a.parts, part, rest)
    yield from signals.waves(a, part, before, after)
    yield "<h2>What remains</h2><p>" + prose(left.remains_text(a)) + "</p>"
    notes = answers.caveats(a)
    if notes:
        yield "<h2>Before you rely on it</h2>" + bullets(notes)
    yield from _detail(a)


def _hypotheses(a: Answers, chosen: Sequence) -> str:
    rows = [
        f"<tr><td>{prose(listed.against_first(h, a.diagnosis.best, a.shares))}"
        f"<div class='bar' style='width:{100.0 * h.probability:.1f}%'></div></td>"
        f"<td class='n'>{100.0 * h.probability:.1f}&nbsp;%</td>"
        f"<td class='n'>{prose(share_text(closed_by(a.diagnosis, h)))}</td></tr>"
        for h in chosen
    ]
    head = "<tr><th>effects</th><th class='n'>probability</th><th class='n'>gap closed</th></tr>"
    return f"<div class='wide'><table>{head}{''.join(rows)}</table></div>"


def _listed(a: Answers) -> Iterator[str]:
    """Yield the whole list of effects, what cannot be parted, and how the gap shrinks from effect
    to effect."""
    r = a.ranking
    own = [] if r is None else listed.rows(r)
    if r is None or not own:
        return
    yield "<h2>All effects that may be there</h2>"
    yield table(
        ["effect", "probability", "share of the gap [95 %]", "size [95 % interval]"],
        own,
        stacked=True,
    )
    if less_sure := listed.less_sure_sentence(a):
        yield f"<p>{prose(less_sure)}</p>"
    if hidden := listed.hidden_sentence(r):
        yield f"<p>{prose(hidden)}</p>"
    notes = [listed.LIST_NOTE, *([listed.FREE_REGRESSION] if r.with_regression else [])]
    yield f'<p class="soft">{prose(" ".join(notes))}</p>'
    if lies := r.where.text() if r.where is not None else "":
        yield f"<p>{prose(lies)}</p>"
    neutral = library.neutral(a.diagnosis.campaign.drive.motor)
    yield bullets([*listed.group_sentences(r, a.following), *listed.confused_sentences(r, neutral)])
    heads, moves = listed.position_rows(r)
    if moves:
        yield "<h3>What each does to the position estimate</h3>" + table(heads, moves)
        yield (
            "<p "
            f'class="soft">{prose(" ".join([listed.POSITION_NOTE, *listed.not_run_sentences(r)]))}</p>'  # noqa: E501
        )
    labels, levels = listed.waterfall(a)
    if len(labels) > 2:
        yield figure(
            dots_svg(labels, {"residual": levels}, "residual (noise floors)"),
            listed.waterfall_caption(a),
        )


def why_alike(x: Alike) -> Iterator[str]:
    """Yield why an ambiguity is one: how alike its effects look, and how flat the likelihood is
    between both."""
    yield "<h2>Why it cannot be told</h2><ul>"
    for effect, cosine in x.cosines.items():
        own, other = (x.first, x.second) if effect in x.first else (x.second, x.first)
        rival = [e for e in other if e not in own]
        others = names(rival) if rival else "what ordinary deviations can do"
        text = f"On these recordings {words(effect)} looks like {others}: cosine {cosine:.4f}."
        yield f"<li>{prose(text)}</li>"
    what = f"0: {names(x.second)}, 1: {names(x.first)}. {way_text(x)}"
    line = (list(x.share), list(x.log_likelihood))
    panels = [("log likelihood", {"all parameters going along": line})]
    yield "</ul>" + figure(lines_svg(panels, "share of the way between both fits"), what)


def way_text(x: Alike) -> str:
    """Return what a likelihood along the way between two fits says: which end it prefers, whether
    it falls between."""
    fall = max(x.log_likelihood) - min(x.log_likelihood)
    if fall < FLAT:
        return "Flat: the recordings cannot choose."
    ends = {
        share: own
        for share, own in zip(x.share, x.log_likelihood, strict=True)
        if share in (0.0, 1.0)
    }
    apart = ends[1.0] - ends[0.0] if len(ends) == 2 else 0.0
    if abs(apart) >= FLAT:
        first, second = (x.first, x.second) if apart > 0.0 else (x.second, x.first)
        return (
            f"By {abs(apart):.0f} the recordings prefer {names(first)}. That {names(second)} is "
            "still left is due to the priors: how large effects and ordinary deviations usually "
            "are, and how many effects there are."
        )
    if len(ends) < 2:
        return f"It falls by {fall:.0f} where a drive can be simulated; at one end none can."
    return (
        f"It falls by {fall:.0f} on the straight way: recordings choose there, priors "
        "between its ends."
    )


def share_text(x: float | None) -> str:
    """Return a share in percent, a dash where there is none."""
    return "–" if x is None else percent_fine(x)


def parameter_rows(a: Answers, own: Mapping[str, Estimate]) -> list[list[str]]:
    """Return rows of name, value with interval, and what the nominal model has."""
    neutral = library.neutral(a.diagnosis.campaign.drive.motor)
    nominal = {
        k: replace(e, value=neutral[k], low=neutral[k], high=neutral[k], at_bound=False)
        for k, e in own.items()
    }
    return [[k, quantity(e), quantity(nominal[k])] for k, e in own.items()]


def _recordings(a: Answers, part: Decomposition) -> list[list[str]]:
    return [
        [
            file + (" (held out)" if held else ""),
            f"{b:.2f}",
            f"{x:.2f}",
            f"{100.0 * part.recordings[file]:.0f} %",
        ]
        for file, b, x, held in a.diagnosis.size.recordings
    ]


def _noise_caption(a: Answers) -> str:
    own = amperes(a.diagnosis.start.prepared.noise_std)
    return (
        f"Rms of the residual, in noise floors; 1 is noise alone ({own} for currents). ● "
        "held out of the fit."
    )


def _by_recording(a: Answers) -> str:
    rows = a.diagnosis.size.recordings
    labels = [Path(f).stem + (" ●" if held else "") for f, _, _, held in rows]
    series = {"before": [r.before for r in rows]}
    if a.diagnosis.after is not a.diagnosis.before:
        series["after"] = [r.after for r in rows]
    return dots_svg(labels, series, "residual (noise floors)")


def part_rows(cut: Excerpts, period: float) -> list[list[str]]:
    """Return a line a part: its name, the recording's, where it begins and ends there and how long
    that is (s)."""
    return [
        [e.file, e.of, *(f"{period * row:.2f}" for row in (e.first, e.first + e.rows, e.of_rows))]
        for e in cut.parts
    ]


def _detail(a: Answers) -> Iterator[str]:
    d = a.diagnosis
    rest = [h for h in d.hypotheses if h.probability < FEWEST]
    if rest:
        yield fold("Hypotheses that were tried and dropped", _hypotheses(a, rest))
    for effect in dict.fromkeys(e for h in d.ambiguity_set for e in h.effects if e != UNKNOWN):
        card = library.card_text(library.load_effect(effect)).split("\n")
        yield fold(
            f"The effect {words(effect)}", "<pre>" + "\n".join(map(html_text, card)) + "</pre>"
        )
    motor = d.campaign.drive.motor
    units = {f.name: f.metadata.get("unit", "") for f in fields(motor)}
    rows = [
        [
            k,
            f"{v:.7g}" if isinstance(v, (int, float)) else str(v),
            SIGNS.get(units.get(k, ""), units.get(k, "")),
        ]
        for k, v in vars(motor).items()
    ]
    origins = [[what, text] for what, text in d.campaign.drive.provenance.items()]
    sources = (
        f"<h3>Where its values come from</h3>{table(['value', 'source'], origins)}"
        if origins
        else ""
    )
    yield fold(
        "The nominal model",
        table(["[motor]", "value", "unit"], [r for r in rows if r[1]]) + sources,
    )
    held = ", ".join(d.start.prepared.recordings[k].file for k in d.held_out) or "none"
    facts = [
        ["residual of the nominal model as given", f"{d.size.nominal_nrmse:.3g} noise floors"],
        ["ordinary deviations refitted", f"{d.size.before:.3g}"],
        ["best hypothesis", f"{d.size.after:.3g}"],
        ["held out", held],
        ["simulations", str(d.simulations)],
        ["seconds", f"{d.seconds:.1f}"],
        ["version", version()],
    ]
    yield fold("How it was made", table(["", ""], facts))
