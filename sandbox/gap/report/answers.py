"""A diagnosis in words: where, which, how far, what next; the same sentences for terminal and
report."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from model.effects import library
from model.effects.said import quantity
from model.errors import BadInput
from model.mapped import ALPHAS, MappedMotor
from sandbox.gap.diagnose import Diagnosis, diagnosis_of, verdict
from sandbox.gap.evidence.gap_size import FEWEST, Size
from sandbox.gap.evidence.regression import Remains, remains
from sandbox.gap.evidence.spectrum import shown
from sandbox.gap.location.curves import CurveFound, curves_found
from sandbox.gap.location.map_found import MapFound, map_found
from sandbox.gap.location.outside import OddPhase, odd_phase
from sandbox.gap.location.where import Finding, SubsystemPart, parts, percent, summary, where
from sandbox.gap.planning.next_recording import Next, recommend
from sandbox.gap.planning.todo import todo
from sandbox.gap.posterior.hypotheses import UNKNOWN
from sandbox.gap.report import which
from sandbox.gap.report.bounds import sentence
from sandbox.gap.report.distinguishability import Alike, alike
from sandbox.gap.report.position import PositionError, compared
from sandbox.gap.report.ranking import Ranking, ranking
from sandbox.gap.shortened import share, shortened
from sandbox.gap.words import likely, listing, names, percent_fine, times, words
from sandbox.output.sentences import capital, stopped
from sandbox.recordings.campaign import NO_LIMITS, Campaign
from sandbox.recordings.checks.mistakes import Unanswered
from sandbox.replay.memory import USUAL

MET = 1.1  # times the noise: a recording that is met so well contradicts nothing any more
# times the noise on recordings held out that ordinary deviations explain when fitted to all
FEW = 1.2


@dataclass(frozen=True)
class Answers:
    """A diagnosis with what a person asks of it; parts: the subsystems' parts of the gap that
    `where` speaks of;
    no_position: why there is no position error."""

    diagnosis: Diagnosis
    where: tuple[Finding, ...]
    position: PositionError | None
    following: Next | None
    remains: Remains | None
    alike: Alike | None = None
    ranking: Ranking | None = None
    odd_phase: OddPhase | None = None
    parts: tuple[SubsystemPart, ...] = ()
    no_position: str = ""
    map_found: MapFound | None = None
    curves: tuple[CurveFound, ...] = ()

    @property
    def verdict(self) -> str:
        """Return the verdict."""
        return verdict(self.diagnosis)

    @property
    def shares(self) -> dict[str, float]:
        """Return effects' shares of the gap, as far as they are known."""
        return (
            {} if self.ranking is None else {e: s.value for e, s in self.ranking.shares.of.items()}
        )

    @property
    def badge(self) -> str:
        """Return what stands at the page's head, a key of VERDICTS."""
        return which.badge(self.diagnosis)


# of absurd sets: nothing is probable there
@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def answer(
    campaign: Campaign,
    *,
    exclude: Sequence[str] = (),
    rivals: Sequence[tuple[str, ...]] = (),
    workers: int = 2,
    memory: float = USUAL,
    report: Callable[[str], None] = lambda _: None,
) -> Answers:
    """Return a campaign's diagnosis and all answers; BadInput for an unknown effect or a campaign
    that is none.

    rivals, memory (GB): as `diagnose`.
    """
    for name in exclude:
        library.load_effect(name)
    d = diagnosis_of(
        campaign, exclude=exclude, rivals=rivals, workers=workers, memory=memory, report=report
    )
    report("where it lies")
    apart = parts(d)
    found = where(d, apart)
    report("position estimate")
    position = compared(d)
    report("what to record next")
    following = next_recording(d, workers)
    report("what remains")
    left = remains(shortened(d.after.point), d.held_out, d.size.before)
    report("all effects")
    listed = ranking(d, workers)
    left_before = shown(d.before.point)
    odd = odd_phase(d.before.point, left_before)
    flux_map = map_found(d.best.evaluated.fit)
    error, why = (None, position) if isinstance(position, str) else (position, "")
    drawn = curves_found(d.best.evaluated)
    return Answers(
        d, found, error, following, left, alike(d), listed, odd, apart, why, flux_map, drawn
    )


def next_recording(d: Diagnosis, workers: int = 1) -> Next | None:
    """Return the recording that would tell the named hypotheses of an ambiguity set apart; None
    with one of them, or where nothing but slight effects might be there beside ordinary
    deviations."""
    rivals = [(h.probability, h.evaluated) for h in d.ambiguity_set if UNKNOWN not in h.effects]
    fitted = {id(j) for j in d.evaluated}
    if d.best.effects in ((), (UNKNOWN,)) and sum(id(j) in fitted for _, j in rivals) < 2:
        return None
    return recommend(d.campaign, rivals, d.variance, workers=workers)


def linear(campaign: Campaign) -> Campaign:
    """Return a campaign whose nominal model believes in no saturation, and in that with certainty.

    BadInput where the nominal model is a flux map, which has no coefficients to leave out.
    """
    motor = campaign.drive.motor
    if not all(hasattr(motor, a) for a in ALPHAS) or getattr(motor, "flux_map", None):
        raise BadInput(
            "--nominal linear needs a [motor] with the five alphas; this one is a flux "
            "map, give it without --nominal"
        )
    changes: dict[str, Any] = dict.fromkeys(ALPHAS, 0.0)
    drive = dataclasses.replace(campaign.drive, motor=dataclasses.replace(motor, **changes))
    uncertainty = {k: v for k, v in campaign.uncertainty.items() if k not in ALPHAS}
    return dataclasses.replace(campaign, drive=drive, uncertainty=uncertainty)


def where_text(a: Answers) -> str:
    """Return where the gap lies, in one sentence; one more where a single phase misses more than
    the others."""
    drifts, counts = a.diagnosis.drifting, a.diagnosis.counted
    named = a.diagnosis.offsets_named
    known = "" if drifts is None else drifts.text_of_sum if named else drifts.text
    found = [known, "" if counts is None else counts.text, held_text(a.diagnosis)]
    found = [x for x in found if x]
    if (every := _unpredicted(a)) is not None:
        text = (
            "Nowhere that these recordings show: fitted to all of them, ordinary deviations leave "
            f"{times(every)} the noise floor."
        )
        return " ".join([*found, text])
    text = summary(a.diagnosis, a.where)
    if found:
        text = f"{' '.join(found)} What is left: {text}"
    return text if a.verdict == "no_gap" or a.odd_phase is None else f"{text} {a.odd_phase.text}"


def held_text(d: Diagnosis) -> str:
    """Return that readings hold all replays and why, as a sentence; empty where they do not."""
    if not d.held_by:
        return ""
    motor, converter = d.campaign.drive.motor, d.campaign.drive.converter
    longest = max(motor.inductance_d, motor.inductance_q) / d.held_by
    samples = max(1, round(longest / converter.sampling_period))
    return (
        "Around zero current the legs give back more volts than the winding's "
        f"{quantity(motor.resistance, 'ohm')} takes, as where a dead time is compensated too much: "
        "there the current runs to one side or the other on what is too small to be known. So "
        "readings hold all predictions, which forget within some "
        f"{samples} samples what they missed."
    )


def which_text(a: Answers) -> str:
    """Return which effect causes it, or that none does, or that it cannot be told; and which were
    no candidates."""
    if a.ranking is None:
        return which.which_text(a.diagnosis, a.shares)
    rivals = {key: {e: s.value for e, s in of.items()} for key, of in a.ranking.rivals.items()}
    chances = a.ranking.inclusion.chances
    return which.which_text(a.diagnosis, a.shares, chances, rivals, a.ranking.by_recording)


def todo_texts(a: Answers) -> list[str]:
    """Return what to do about the named effects, a sentence each."""
    return todo(a.diagnosis, a.ranking)


def far_text(a: Answers) -> str:
    """Return how far the gap shrinks, and what that does to the position error."""
    d, s = a.diagnosis, a.diagnosis.size
    count = len(d.held_out)
    on = (
        f"on {count} recording{'s' * (count > 1)} held out of the fit"
        if count
        else "on the recordings it was fitted to"
    )
    if a.verdict == "no_gap":
        text = f"There is nothing to close: residuals are {times(s.before)} the noise floor {on}."
        if (every := _unpredicted(a)) is not None:
            text = (
                f"Fitted to all recordings ordinary deviations leave {times(every)} the "
                "noise floor, but "
                f"{times(s.before)} {on}: too few recordings to predict one from the others."
            )
    elif s.closed is None:
        text = (
            f"Residuals are {times(s.before)} the noise floor {on}; no effect of the library "
            "lowers them."
        )
    elif not math.isfinite(s.after):
        text = (
            f"Not at all: what was fitted to the others predicts nothing finite {on} "
            f"({times(s.before)} before)."
        )
    elif s.closed <= 0.0:
        text = (
            f"Not at all: residuals grow from {times(s.before)} to {times(s.after)} the "
            f"noise floor {on}."
        )
    else:
        text = (
            f"{percent_fine(s.closed)} of the reducible gap closes {on} "
            f"({_between(s)}); residuals fall from {s.before:.3g} to {times(s.after)} "
            "the noise floor (rms of the noise). The reducible gap is what squared residuals have "
            "above the noise."
        )
    return f"{capital(text)} {position_text(a)}".strip()


def _made(d: Diagnosis) -> list[str]:
    """Return of what angles were made that a log does not hold."""
    return list(
        dict.fromkeys(r.made.of for r in d.campaign.recordings if r.made is not None and r.made.of)
    )


def _recording(a: Answers) -> str:
    """Return the recording that is recommended, and what it will tell."""
    if a.following is None:
        return ""
    separated, chance = (
        "; ".join(names(s) for s in a.following.separates),
        likely(a.following.power),
    )
    text = f"Record: {a.following.description}, for {a.following.seconds:g} s."
    return f"{text} That it leaves only the true one of these is {chance}: {separated}."


def _unpredicted(a: Answers) -> float | None:
    """Return what ordinary deviations fitted to all recordings leave (times the noise), where
    they explain all recordings but do not predict those held out; None elsewhere."""
    d = a.diagnosis
    if a.verdict != "no_gap" or d.size.before <= FEW:
        return None
    return math.sqrt(max(0.0, 1.0 + d.remainder.before))


def _between(size: Size) -> str:
    """Return the interval of the share closed in words, or why there is none."""
    if size.closed_ci95 is None and size.blocks < FEWEST:
        return (
            f"no interval: the recordings are too short, {size.blocks} blocks of time where it "
            f"takes {FEWEST}"
        )
    if size.closed_ci95 is None:
        return "no interval: the gap is too near the noise floor"
    # no more than all of a gap closes
    low, high = (percent_fine(min(x, 1.0)) for x in size.closed_ci95)
    return f"95 % interval: {low if low == high else f'{low} to {high}'}"


def position_text(a: Answers) -> str:
    """Return the position error in degrees, or nothing where no recording shows it."""
    p = a.position
    if p is None:
        return ""
    text = (
        f"Position error (rms, electrical) of the estimator '{p.estimator}': {p.recorded:.2f}° on "
        "the recorded currents; the simulator "
    )
    if a.verdict == "no_gap":
        return f"{text}says {p.simulated_before:.2f}°."
    text += f"said {p.simulated_before:.2f}° before and says {p.simulated_after:.2f}° now."
    if p.believing_after is not None:
        text += (
            f" An estimator that believes the fitted motor errs by {p.believing_after:.2f}° "
            "on the recorded currents."
        )
    return text


def next_text(a: Answers) -> str:
    """Return what to record or do next; first to read what was made up, where something outside may
    be due to that."""
    outside = which.chance_of_unknown(a.diagnosis) >= which.HALF
    if outside and (made := _made(a.diagnosis)):
        return (
            f"Log the rotor's angle: what one made from {listing(made)} misses counts as "
            "something outside the library."
        )
    if a.odd_phase is not None and outside:
        return f"{a.odd_phase.exchange} {'' if a.following is None else _recording(a)}".rstrip()
    if a.following is not None:
        return _recording(a)
    if _unpredicted(a) is not None:
        return (
            "Record more operating points (`sensorless plan` says which): these recordings do not "
            "foretell each other, so a small effect could pass for an ordinary deviation."
        )
    if a.verdict == "no_gap":
        return (
            "Nothing is needed, as far as these recordings see: the nominal model explains them "
            f"once {allowed_text(a.diagnosis.campaign)} is refitted."
        )
    if a.verdict == "explained":
        return (
            "Nothing is needed to name the cause. `motor.toml` and `effects.toml`, beside this "
            "result, hold the values for the simulator. To see how near it comes to the "
            "recordings: `sensorless replay CAMPAIGN --motor motor.toml --effects effects.toml`. "
            "To simulate this drive: `sensorless simulate --motor motor.toml --effects "
            "effects.toml`."
        )
    sets: list[set[str]] = [set(h.effects) - {UNKNOWN} for h in a.diagnosis.ambiguity_set]
    disputed = which.doubtful(a.diagnosis)[: which.FEW] or sorted(sets[0])
    if a.verdict == "ambiguous" and sets[0] and all(s == sets[0] for s in sets):
        named = listing([words(e) for e in which.by_share(sorted(sets[0]), a.shares)])
        return (
            f"Nothing is needed to name {named}. Whether something outside the library "
            "acts beside, no recording of a "
            "known effect tells: record operating points that are not in the campaign yet."
        )
    advice = "; for ".join(f"{words(e)}: {library.load_effect(e).separated_by}" for e in disputed)
    if not advice:
        return "No effect is known that a recording could confirm."
    held = a.verdict == "ambiguous" and a.diagnosis.campaign.limits != NO_LIMITS
    none = (
        "Within [limits] no recording of the menu is likely to leave one of them. " if held else ""
    )
    return f"{none}Recordings that show more, for {advice}."


def allowed_text(campaign: Campaign) -> str:
    """Return what may deviate without a fault, and that nobody stated it where that is so."""
    tables = {"[uncertainty]": campaign.uncertainty, "[background]": campaign.background}
    stated = [name for name, table in tables.items() if table]
    if not stated:
        return "what usually deviates (the campaign states no [uncertainty] or [background])"
    return f"what {' and '.join(stated)} {'allow' if len(stated) > 1 else 'allows'}"


def caveats(a: Answers) -> list[str]:
    """Return what a reader has to know before believing the rest, one sentence each; assumed values
    are last."""
    d = a.diagnosis
    return [
        *findings_of(d),
        *_of_noise(d),
        *_of_the_fit(a),
        *_of_columns(d),
        *_of_held_out(a),
        *_of_what_is_stated(d.campaign),
        *_of_excerpts(d),
        *_of_what_cannot_be_asked(a),
        *_of_the_model(d.campaign.drive.provenance),
    ]


def _of_the_fit(a: Answers) -> Iterator[str]:
    """Yield what is odd about what was found, and what was never looked for."""
    d = a.diagnosis
    motor = d.campaign.drive.motor
    if a.odd_phase is not None and a.verdict == "no_gap":
        yield a.odd_phase.text
    if text := sentence(d.at_bound):
        yield text
    if a.map_found is not None:
        yield a.map_found.text(motor.rated_current)
    if d.excluded:
        yield f"Excluded by the user, so never named: {', '.join(words(e) for e in d.excluded)}."
    if not isinstance(motor, MappedMotor) and all(getattr(motor, x) == 0.0 for x in ALPHAS):
        yield "The nominal model has no saturation (all five alphas are 0)."


def _of_columns(d: Diagnosis) -> Iterator[str]:
    """Yield what recordings lack: an encoder's angle, a load's torque."""
    if made := _made(d):
        beyond = " beyond the noise" if d.campaign.unseen else ""
        yield (
            f"The angle was made from {listing(made)}: what it misses{beyond} counts as "
            "something outside the library."
        )
    blind = [
        r.origin
        for r in d.campaign.recordings
        if r.rotor == "free" and "load_torque" not in r.columns
    ]
    if blind := list(dict.fromkeys(blind)):
        said = "no column 'load_torque', so a free rotor's load is taken as none."
        yield f"{', '.join(blind)}: {said}"


def _of_held_out(a: Answers) -> Iterator[str]:
    """Yield which figures are of recordings that no fit has seen."""
    d = a.diagnosis
    if not d.held_out:
        yield (
            "No recording was held out (each kind of rotor is there only once), so the "
            "figures are those of the fit."
        )
    elif a.verdict != "no_gap":
        yield (
            "Residuals before and after are of fits without the recordings held out. The listed "
            "values are fitted to all recordings, and the choice among hypotheses saw them all."
        )
    if d.held_out and d.offsets_named:
        yield "What a recording's offsets differ by was measured on it, held out or not."


def _of_what_is_stated(campaign: Campaign) -> Iterator[str]:
    """Yield what the campaign's file leaves open, and what stands in for it."""
    own = campaign.drive.provenance
    if stand_ins := [f"{k} ({own[k].rpartition(': ')[2]})" for k in campaign.stand_ins if k in own]:
        yield f"Not stated, so that something stands in: {', '.join(stand_ins)}."
    if missing := [k for k in ("uncertainty", "background") if not getattr(campaign, k)]:
        yield (
            f"No [{'], ['.join(missing)}] is stated: usual values of a careful "
            "identification are assumed."
        )


def _of_what_cannot_be_asked(a: Answers) -> Iterator[str]:
    """Yield which questions these recordings leave without an answer, or with a weaker one."""
    d = a.diagnosis
    if {r.rotor for r in d.start.prepared.recordings} == {"locked"}:
        yield (
            "The rotor never turned, so effects that need speed (flux, encoder, iron "
            "loss) can hardly be seen."
        )
    if a.position is None:
        why = a.no_position or "it was not asked for"
        yield stopped(f"The position error cannot be compared: {why}")
    if d.variance > 2.0:
        yield (
            f"When hypotheses were compared, the data got {d.variance:,.3g} times less weight than "
            "independent samples have: what the best fit leaves is alike over many samples."
        )


def _of_excerpts(d: Diagnosis) -> list[str]:
    """Return which part of the samples was used, where it was not all of them."""
    out: list[str] = []
    if (cut := d.campaign.excerpts) is not None:
        why = []
        if cut.samples_within_map < cut.samples_recorded:
            why.append(
                "those in which currents stay within the motor's flux map, beyond which nothing is "
                "known of it"
            )
        if cut.samples_used < cut.samples_within_map:
            why.append(
                "those that differ most, and some spread evenly (--samples inf uses all samples)"
            )
        out.append(
            f"Of {cut.samples_recorded:,} samples {cut.samples_used:,} were used, in "
            f"{len(cut.parts)} parts of the recordings: {'; of them '.join(why)}. Parts held out "
            "may be of the same recordings as parts that were fitted."
        )
        if cut.unused:
            out.append(f"No part was used of {', '.join(cut.unused)}.")
    if (part := share(d.start)) < 1.0:
        out.append(
            f"To stay within --memory, free regressions were made on {percent(part)} of "
            "the samples."
        )
    return out


def findings_of(d: Diagnosis) -> list[str]:
    """Return what is suspicious in recordings; not that one contradicts the nominal model where its
    gap is closed."""
    origin = {r.file: r.origin for r in d.campaign.recordings}
    after: dict[str, float] = {}
    for r in d.size.recordings:
        file = origin.get(r.file, r.file)
        after[file] = max(after.get(file, 0.0), r.after)
    kept = [
        f
        for f in d.campaign.findings
        if not isinstance(f, Unanswered) or after.get(f.file, math.inf) >= MET
    ]
    return [stopped(f.text if f.text.startswith(f.file) else f"{f.file}: {f.text}") for f in kept]


def _of_noise(d: Diagnosis) -> list[str]:
    """Return what there is to say of the sensors' noise; that only the file knows it, where
    `unknown` hangs on it."""
    out = [d.caution] if d.caution else []
    if d.noise is not None and d.noise.seen is None and which.chance_of_unknown(d) >= which.OPEN:
        out.append(
            f"The readings do not show the sensors' own noise, so the stated {d.noise.stated:.3g} "
            "A counts alone. If it is stated a few per cent too small, something outside the "
            "library looks more probable than it is."
        )
    return out


def _of_the_model(provenance: Mapping[str, str]) -> list[str]:
    """Return what of a nominal model's provenance limits the answers; the whole of it stands with
    the model."""
    assumed = [what for what, text in provenance.items() if text.startswith("assumed")]
    out = [
        f"Cannot show: {text}"
        for what, text in provenance.items()
        if what.startswith("cannot show")
    ]
    return out + (
        [
            (
                "Values of the nominal model that are assumed, as no source states them: "
                f"{', '.join(assumed)}."
            )
        ]
        if assumed
        else []
    )
