"""What a judged motion says: `diagnosis.json` as for any campaign, sentences, a page."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from model.drive_files import load_drive
from model.effects.advice import what_to_do
from model.effects.library import parameters as library_parameters
from model.effects.library import title as title_of
from model.effects.said import percent
from sandbox.gap.motion.judging import HELD_OUT, ORDINARY, Motion, Weighed
from sandbox.gap.motion.shaft import STUDENT
from sandbox.gap.motion.torques import COGGING, DRY, INERTIA, LAG, VISCOUS, numbers, users
from sandbox.output.document import answer, bullets, figure, prose, table
from sandbox.output.refitted import Refitted
from sandbox.output.sentences import VERDICTS, capital, stopped
from sandbox.recordings.motion_axis import LINEAR

UNKNOWN = "unknown"
OF_LINEAR = {
    DRY.effect: "add {:.4g} N to the force's reference in the direction of motion",
    VISCOUS.effect: "set viscous_friction = {:.4g} (N s/m) in the motor's file",
    INERTIA.effect: "set mass = {:.4g} (kg) in the motor's file and the speed control",
}
LEAST = 0.01  # share of the gap that is told as a number
PAIRS = 100  # of the stand-in for a motor: its torque constant alone is asked for


def verdict(m: Motion) -> str:
    """Return 'no_gap', 'explained', 'ambiguous' or 'unknown'."""
    if m.unknown > 0.5:
        return "unknown"
    if not m.best.effects:
        return "no_gap"
    return (
        "explained"
        if m.best.probability * (1.0 - m.unknown) > 0.5 and len(_set(m)) == 1
        else "ambiguous"
    )


def _set(m: Motion) -> list[list[str]]:
    total, out = 0.0, []
    for effects, p, _ in _hypotheses(m):
        out.append(effects)
        total += p
        if total >= 0.95:
            break
    return out


def _hypotheses(m: Motion) -> list[tuple[list[str], float, Weighed]]:
    """Return effects (with `unknown` where something is left), probability and fit, the most
    probable first."""
    rows = [(list(w.effects), w.probability * (1.0 - m.unknown), w) for w in m.weighed]
    rows += [([*w.effects, UNKNOWN], w.probability * m.unknown, w) for w in m.weighed]
    return sorted(rows, key=lambda r: -r[1])


def undecided(m: Motion) -> dict[str, str]:
    """Return why the verdict is ambiguous: of each effect that some of the probable sets hold and
    others do not, how probable it is, and what it may be instead."""
    sets = [set(effects) for effects in _set(m)]
    if verdict(m) != "ambiguous":
        return {}
    some = sets[0].union(*sets) - sets[0].intersection(*sets) - {UNKNOWN}
    return {e: _undecided(m, e) for e in numbers() if e in some}


def _undecided(m: Motion, effect: str) -> str:
    chance = f"{100.0 * m.inclusion(effect):.0f} % probable as an effect"
    stated = {INERTIA.effect: (INERTIA, m.campaign.inertia), VISCOUS.effect: (VISCOUS, None)}
    n, said = stated.get(effect, (None, None))
    if n is None or not said:
        return f"{chance}; without it the others explain what was read almost as well"
    off = m.best.shaft.value(n.size) / said - 1.0
    given = m.campaign.deviations.get(n.stated)
    usual = f"{100.0 * (ORDINARY if given is None else given):.3g} %"
    whose = "is usual; state in [uncertainty] how well you know it" if given is None else "stated"
    return (
        f"{chance}; {percent(off)} from the stated value may also be an ordinary deviation "
        f"({usual} {whose}), and its value is the same"
    )


def ranked(m: Motion) -> list[str]:
    """Return the effects of the best set, the largest share of the gap first."""
    return sorted(m.best.effects, key=lambda e: -m.shares.get(e, 0.0))


def values(m: Motion) -> dict[str, dict[str, Any]]:
    """Return the fitted values of the shaft itself, effects or not: inertia, viscous friction and
    the constant torque along the motion beside the recorded one, each with 95 % interval and unit.

    Viscous friction is not there where none is stated and none found.
    """
    s, unit = m.best.shaft, m.campaign.axis.unit
    sizes = {INERTIA.size: INERTIA.unit, VISCOUS.size: VISCOUS.unit, "offset": DRY.unit}
    names = {INERTIA.size: INERTIA.effect, VISCOUS.size: VISCOUS.effect, "offset": "offset"}
    return {
        names[size]: {"value": s.value(size), "ci95": list(s.ci95(size)), "unit": unit(of)}
        for size, of in sizes.items()
        if size != VISCOUS.size or s.value(size)
    }


def parameters(m: Motion, w: Weighed) -> dict[str, dict[str, Any]]:
    """Return the library's parameters of a set's effects, each with value, 95 % interval and
    unit."""
    s, unit = w.shaft, m.campaign.axis.unit
    units = {name: p.unit for name, p in library_parameters().items()}
    out: dict[str, dict[str, Any]] = {
        n.parameter: {"value": s.value(n.size), "ci95": list(s.ci95(n.size)), "unit": unit(n.unit)}
        for n in (DRY, VISCOUS, INERTIA, LAG, *users())
        if n.effect in w.effects
    }
    if COGGING.effect in w.effects:
        lead = orders(m, w)[0]
        order = {"value": lead["order"], "ci95": [lead["order"]] * 2}
        for key, found in (
            ("amplitude", lead["amplitude"]),
            ("phase", lead["phase"]),
            ("order_mech", order),
        ):
            name = COGGING.card.public(1, key)
            out[name] = {**found, "unit": units[name]}
    return out


def orders(m: Motion, w: Weighed) -> list[dict[str, Any]]:
    """Return the orders of cogging, the largest first: amplitude (N m), as a current (A; None where
    nothing says which makes a torque), phase of the torque on the rotor (rad), each with a 95 %
    interval."""
    rows, constant = [], m.campaign.torque_constant
    for n in w.shaft.terms.orders if COGGING.effect in w.effects else ():
        size, sd, phase, turn = w.shaft.amplitude(n)
        half, around = STUDENT * sd, STUDENT * turn
        rows.append(
            {
                "order": n,
                "amplitude": {"value": size, "ci95": [size - half, size + half]},
                "current": None
                if constant is None
                else {
                    "value": size / constant,
                    "ci95": [(size - half) / constant, (size + half) / constant],
                },
                "phase": {"value": phase, "ci95": [phase - around, phase + around]},
            }
        )
    return sorted(rows, key=lambda r: -r["amplitude"]["value"])


def refitted(m: Motion) -> Refitted:
    """Return the shaft's effects as a file for the simulator; the motor is not known, a late
    reading is the log's."""
    found, ci95 = dict[str, float](), dict[str, tuple[float, float]]()
    s, card = m.best.shaft, COGGING.card
    for n in (DRY, VISCOUS, INERTIA, *users()):
        if n.effect in m.best.effects:
            found[n.parameter], ci95[n.parameter] = s.value(n.size), s.ci95(n.size)
    if DRY.effect in m.best.effects and s.terms.dry:
        found[DRY.card.public(1, "width")] = s.terms.dry
    for k, row in enumerate(orders(m, m.best)[: card.repeats], start=1):
        found[card.public(k, "order_mech")] = float(row["order"])
        for key in ("amplitude", "phase"):
            name = card.public(k, key)
            found[name], ci95[name] = row[key]["value"], (row[key]["ci95"][0], row[key]["ci95"][1])
    found[INERTIA.parameter], ci95[INERTIA.parameter] = s.value(INERTIA.size), s.ci95(INERTIA.size)
    units = {name: m.campaign.axis.unit(p.unit) for name, p in library_parameters().items()}
    said = (
        f"Fitted to the motion of '{m.campaign.name}' by diagnose: the shaft alone, no "
        "voltages were recorded"
    )
    if m.campaign.axis is LINEAR:
        said += "; of a linear axis, which the simulator turns: m, N, kg stand for rad, N m, kg m^2"
    return Refitted(None, found, {}, ci95, units, {}, said)


def document(m: Motion) -> dict[str, Any]:
    """Return what `diagnosis.json` holds beyond its header; `motion` is more than other campaigns'
    have."""
    return {
        "campaign": m.campaign.name,
        "verdict": verdict(m),
        "gap": _gap(m),
        "where": where(m),
        "hypotheses": [
            {
                "effects": effects,
                "probability": p,
                "closed": _closed(m) if w is m.best else (None if effects else 0.0),
                "parameters": parameters(m, w),
            }
            for effects, p, w in _hypotheses(m)[:12]
        ],
        "effects": _effects(m),
        "unknown": {"probability": m.unknown, "share": None, "where": "torque"},
        "ambiguity_set": _set(m),
        "next_recording": following(m),
        "excluded": list(m.excluded),
        "motion": {
            "electrical": m.campaign.why,
            "torque_constant": m.campaign.torque_constant,
            "axis": m.campaign.axis.name,
            **{VISCOUS.effect: None, **values(m)},
            "stated_inertia": m.campaign.inertia,
            "dry_friction_width": m.best.shaft.terms.dry,
            "orders": orders(m, m.best),
            "undecided": undecided(m),
            "cannot": m.cannot,
            "stamp_jitter": {a.file: a.jitter for a in m.design.averages},
        },
        "simulator": refitted(m).as_json(),
        "cost": {"simulations": len(m.weighed), "seconds": m.seconds},
    }


def _gap(m: Motion) -> dict[str, Any]:
    return {
        "raw": m.nominal_nrmse,
        "before": m.before,
        "after": m.after,
        "floor": 1.0,
        "closed": _closed(m),
        "closed_ci95": None,
        "recordings": [
            {"file": f, "before": b, "after": a, "held_out": h} for f, b, a, h in m.by_recording
        ],
        "position_error_deg": None,
        "remains": None,
    }


def _effects(m: Motion) -> list[dict[str, Any]]:
    """Return what is said of each effect that was looked for, the most probable first."""
    own = parameters(m, m.best)
    return [
        {
            "name": e,
            "probability": m.inclusion(e),
            "share": {"value": m.shares.get(e, 0.0), "ci95": None},
            "parameters": {k: v for k, v in own.items() if k.startswith(f"{e}.")},
            "group": None,
            "do": todo(m).get(e),
        }
        for e in sorted(
            (e for e in numbers() if m.looked_for(e)),
            key=lambda e: (-round(m.inclusion(e), 3), -m.shares.get(e, 0.0)),
        )
    ]


def _closed(m: Motion) -> float | None:
    """Return how much of the gap the best set closes; None where it names nothing, or there is
    none."""
    if not m.best.effects or not m.before > 1.0:
        return None
    return (m.before**2 - m.after**2) / (m.before**2 - 1.0)


def where(m: Motion) -> list[dict[str, Any]]:
    """Return which torques make the gap, the largest first."""
    rows, known = [], numbers()
    some = {e: x for e, x in m.shares.items() if x >= LEAST} or m.shares
    for e, share in sorted(some.items(), key=lambda x: -x[1]):
        order = orders(m, m.best)[0]["order"] if e == COGGING.effect else None
        text = m.campaign.axis.words(f"{known[e].shows} ({_share(m, e)})")
        rows.append(
            {
                "subsystem": known[e].card.subsystem,
                "channel": "torque",
                "region": "whole motion",
                "order": order,
                "share": share,
                "text": text,
            }
        )
    return rows


def _share(m: Motion, effect: str) -> str:
    """Return an effect's share of the gap in words; of one that has none, why it is named."""
    share = m.shares.get(effect, 0.0)
    if share >= LEAST:
        return f"{round(100.0 * share)} % of the gap"
    stated = {INERTIA.effect: m.campaign.inertia, VISCOUS.effect: m.campaign.viscous_friction}
    if said := stated.get(effect):
        off = percent(m.best.shaft.value(numbers()[effect].size) / said - 1.0)
        return f"{off} from the stated value; the gap is counted after stated values are refitted"
    if effect == LAG.effect:
        return "the gap is counted after a lag of half a row is allowed for"
    return f"less than {100.0 * LEAST:.0f} % of the gap"


def following(m: Motion) -> dict[str, Any] | None:
    """Return the recording that would tell what this motion cannot, None where nothing is
    missing."""
    asked = [
        (e, why)
        for e, why in m.cannot.items()
        if ";" in why and e not in m.excluded and e != INERTIA.effect
    ]
    if not asked:
        return None
    effect, why = asked[0]
    return {"description": why.rpartition("; ")[2], "separates": [[effect], []], "gain": None}


def todo(m: Motion) -> dict[str, str]:
    """Return what to do about each effect of the best set, the largest share of the gap first, by
    its card; of a linear axis, of which no card speaks, the value to set."""
    if m.campaign.axis is LINEAR:
        return {e: OF_LINEAR[e].format(*_of(m, e)) for e in ranked(m) if e in OF_LINEAR}
    # stands in for what a motion does not say and no card of the shaft asks for
    drive = load_drive("ipm_exchanged")
    # a torque was recorded: which current makes it is unknown
    constant = m.campaign.torque_constant or 0.0
    found = {k: v["value"] for k, v in parameters(m, m.best).items()}
    found |= {k: x for k, x in refitted(m).effects.items() if k.startswith(f"{COGGING.effect}.")}
    motor = replace(
        drive.motor,
        pole_pairs=PAIRS,
        magnet_flux=min(constant / (1.5 * PAIRS), 100.0),
        inertia=m.campaign.inertia or m.best.shaft.value(INERTIA.size),
        rated_speed_rpm=max(float(np.max(np.abs(a.speed))) for a in m.design.averages)
        * 30.0
        / math.pi,
    )
    return what_to_do(ranked(m), found, motor, drive.converter)


def _of(m: Motion, effect: str) -> list[float]:
    """Return the values of an effect's parameters."""
    found = parameters(m, m.best).items()
    return [v["value"] for k, v in found if k.startswith(f"{effect}.")]


def sentences(m: Motion) -> list[tuple[str, str]]:
    """Return the answers, each with its question, in whole sentences."""
    return [(question, stopped(capital(text))) for question, text in _answers(m)]


def _unseen(m: Motion) -> str:
    """Return in words which rows are held out of the fit."""
    files = [file for file, _, _, held_out in m.by_recording if held_out]
    return ", ".join(files) or f"the last {100.0 * HELD_OUT:.0f} % of each recording"


def _answers(m: Motion) -> list[tuple[str, str]]:
    w, p = m.best, parameters(m, m.best)
    words, of_effect = m.campaign.axis.words, {e: f"{e.replace('_', ' ')}" for e in w.effects}
    named = [f"{of_effect[e]} ({_share(m, e)})" for e in ranked(m)]
    left = m.unknown > 0.5
    order = sorted(p, key=lambda k: ranked(m).index(k.partition(".")[0]))
    sizes = "; ".join(f"{words(title_of(k))} {_value(p[k])}" for k in order)
    out = [
        ("Where?", "; ".join(r["text"] for r in where(m)[:3]) or "nowhere above the noise"),
        (
            "Which?",
            f"{' + '.join(named) or 'no effect'}{' and something unknown' if left else ''}: set "
            f"{100.0 * w.probability:.0f} % probable among mechanical effects. {sizes}".rstrip(),
        ),
        ("Motor?", _motor(m)),
        (
            "How far?",
            words("residual torque: ")
            + f"{m.before:.3g} times the noise floor (rms of the noise alone) "
            f"before, {m.after:.3g} after, on {_unseen(m)}, which no fit has seen",
        ),
        ("Electrical?", f"not judged: {m.campaign.why}"),
    ]
    if open_ := undecided(m):
        listed = "; ".join(f"{e.replace('_', ' ')}: {words(why)}" for e, why in open_.items())
        out.append(("Ambiguous?", listed))
    out += [("Do?", f"{e.replace('_', ' ')}: {text}") for e, text in todo(m).items()]
    if m.cannot:
        out.append(
            (
                "Not told?",
                "; ".join(f"{e.replace('_', ' ')}: {words(why)}" for e, why in m.cannot.items()),
            )
        )
    return out


def _motor(m: Motion) -> str:
    """Return the fitted values of the shaft itself beside the stated ones, and whose units."""
    c, found = m.campaign, values(m)
    stated = {INERTIA.effect: c.inertia, VISCOUS.effect: c.viscous_friction or None}
    out = []
    for name, said in stated.items():
        if name in found:
            as_stated = f"stated {said:.4g}" if said is not None else "none stated"
            out.append(f"{name.replace('_', ' ')} {_value(found[name])} ({as_stated})")
    push = f"constant torque along the motion beside the recorded one {_value(found['offset'])}"
    of = f"values are those of {c.axis.what}"
    return c.axis.words("; ".join([*out, f"{push} (a load, or the current's offset)"])) + f"; {of}"


def _value(v: dict[str, Any]) -> str:
    return f"{v['value']:.4g} {v['unit']}".rstrip() + _interval(v)


def _interval(v: dict[str, Any]) -> str:
    low, high = v["ci95"]
    return f" [{low:.4g}, {high:.4g}]" if math.isfinite(low) and low != high else ""


def cogging_rows(m: Motion) -> list[list[str]]:
    """Return a row of order, torque (N m), the same as i_q (A) and phase (rad) for each order of
    cogging found."""
    return [
        [
            str(r["order"]),
            f"{r['amplitude']['value']:.4g}",
            f"{r['current']['value']:.4g}" if r["current"] else "–",
            f"{r['phase']['value']:.3f}",
        ]
        for r in orders(m, m.best)
    ]


def page(m: Motion, title: str, picture: str) -> Iterator[str]:
    """Yield the parts of the report's page; picture: an SVG."""
    yield f"<h1>{prose(title)} <span class='badge {verdict(m)}'>{VERDICTS[verdict(m)]}</span></h1>"
    for question, text in sentences(m):
        yield answer(question, text)
    rows = cogging_rows(m)
    if rows:
        yield "<h2>Cogging</h2>" + table(
            ["order per turn", "N m", "as i_q (A)", "phase (rad)"], rows
        )
    yield "<h2>Residual of each recording</h2>" + figure(
        picture,
        f"{m.campaign.axis.torque.capitalize()} left unexplained, in noise floors (1: rms of the "
        "noise alone). After: with the effects named above.",
    )
    if m.campaign.findings:
        yield "<h2>Notes</h2>" + bullets(f.text for f in m.campaign.findings)
