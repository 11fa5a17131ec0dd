"""What does `sensorless diagnose` say of real drives with a published answer, and should one
believe it?

One row a case: what was published, what the diagnosis says, how well it predicts recordings that no
fit has seen, what it costs.  Each case is kept with its date; the others stay as they are when some
are run.

Run: python -m experiments.real_cases [CASE ...]
    (all: a quarter of an hour; needs SENSORLESS_DATA or the shared
folder; `odrive` is taken from the record of `experiments.odrive_cogging`)
"""

from __future__ import annotations

import datetime
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from experiments import diagnosed_cases as diagnosed
from experiments.drawing import RESULTS, save


class Case(NamedTuple):
    """A case: how it is diagnosed, what was published, what to believe in a few words, and why."""

    answer_of: Callable[[Path], dict[str, Any]]
    published: str
    believe: str
    why: str


CASES: dict[str, Case] = {
    "synrm_quartic": Case(
        diagnosed.synrm_quartic,
        "standstill square waves; the authors' flux map (its current grid is not published)",
        "`unknown`",
        "Believe `unknown`: the quartic energy misses this map by 0.24 A rms at its own "
        "points, 53 floors.",
    ),
    "synrm_own_map": Case(
        diagnosed.synrm_own_map,
        "the same, its own flux map as nominal model; currents 250 µs late by "
        "`experiments.synrm_standstill`",
        "delay; angle, on all three tests; `unknown`",
        "Believe the delay (240 µs; the identification says 250 µs): alone, and fitted without "
        "the cross test, it closes two thirds of the reducible gap there (J 82.2 to 47.7). "
        "Believe the angle with care. The eccentricity is an offset where a rotor stands (0.033 "
        "rad; `synrm_as_integrated` finds 0.039 by another way), but only the cross test shows "
        "it: single-axis tests are filed with exactly no current across, so a fit to them puts it "
        "near zero, and it closes nothing of the gap held out. Believe `unknown`: what else is at "
        "work stands under `synrm_as_integrated`. Between 2026-11-22 (27a6c21) and 2026-11-24 "
        "neither was named: beside `unknown` a current offset is not worth its place, and what "
        "stays was fitted from no delay at all, from where slopes do not lead to 2.4 periods. Now "
        "it is fitted from its own values, too.",
    ),
    "synrm_as_integrated": Case(
        diagnosed.synrm_as_integrated,
        "the same after four corrections that the files themselves give: delay, R and voltage "
        "offsets of the authors' own flux, angle of the cross test",
        "`unknown`",
        "Believe `unknown`, which is small now: most of the gap was in how the files were read. "
        "On the half of the cross test that is held out the map misses 94 floors as filed, 98 "
        "with currents 250 µs earlier, 50 with the R (10.28 ohm) and voltage offsets (up to 1 V) "
        "of the authors' own flux, 16 with the cross test turned by 2.3°, which the points of its "
        "first half propose ([figures](synrm_as_integrated.json), `python -m "
        "experiments.synrm_as_integrated`). Before any effect, and before ordinary deviations are "
        "refitted: 15.3 on the cross test, 12.7 over all (single-axis tests 7.7 and 11.0); "
        "refitted to the single-axis tests they foretell the cross test worse (18.1). Below 10 it "
        "does not get. Delays of each test, the angle, the resistance of the cross test and gains "
        "of its sensors, fitted to all but the second half, bring what is fitted to 10 (9.8 with "
        "gains), but that half from 16 to 20 and all to 13.4 (`experiments.synrm_refitted`): no "
        "one angle serves both halves, whose flux drifts apart. A delay of each test alone, "
        "chosen in the same way, leaves 12.4. What is left is in i_q of the cross test (82 mA; "
        "i_d 53 mA), whose noise is 11 mA by the same fourth differences that give the 4.5 mA of "
        "the floor; functions of currents, fluxes and their rates take 12 % off it, hysteresis "
        "(play operators) nothing, flux corrected for drift nothing, and offsets fitted to the "
        "first half double it on the second.",
    ),
    "thor_quartic": Case(
        diagnosed.thor_quartic,
        "finite elements over (i_d, i_q, angle): slots, orders 6 to 18; no inverter, no "
        "sensor at fault",
        "`unknown`",
        "Believe `unknown`: the quartic energy misses these tables by 0.2 A, more than "
        "the slots make.",
    ),
    "thor_own_map": Case(
        diagnosed.thor_own_map,
        "the same, the tables' mean over the angle as nominal flux map",
        "orders 18, 6, 12, 36; `unknown`; not saturation",
        "Believe the orders: 18 is the slots', and with 6, 12 and 36 these are the largest of the "
        "tables. Their sizes were judged on the tables themselves, without a simulation: they "
        "explain 82 %, 34 %, 80 % and 49 % of the orders' energy at the currents recorded, where "
        "one amplitude for all currents explains 30 %, 17 %, 8 % and 12 % "
        "([figures](thor_orders.json), `python -m experiments.thor_orders`). Believe `unknown`, "
        "too: order 6 depends on the currents by terms of fourth degree (66 % of it, 22 % up to "
        "the third), which the library does not have. Not saturation, which stands in for that: "
        "the nominal map is the tables' own mean.",
    ),
    "laas_motion": Case(
        diagnosed.laas_motion,
        "cogging: `experiments.real_cogging` has order 72 (18 slots, 24 poles) at 5.0 to "
        "5.3 mN m from holding "
        "currents, then 18 (1.2) and 12 (0.8); `experiments.real_friction` 2.3 to 2.7 mN m",
        "order 72, friction",
        "Believe order 72 and the dry friction: the slow scan gives 5.0 to 5.3 mN m by another "
        "way, without a model of the motion (holding currents, up against down), and so does the "
        "friction of the acceleration runs. All of it depends on the torque constant, which is "
        "not measured. Most of what tells is one file, a slow run at 6 rad/s: with the scan and "
        "the runs at 50 rad/s alone (until 2026-11-23) the answer was `unknown`. The scan alone "
        "is refused: the loop steps and holds, and between two pauses the rotor turns by 0.03 rad "
        "at most. Orders 18 and 12, a fifth of 72, are not named.",
    ),
    "laas_rolling": Case(
        diagnosed.laas_rolling,
        "the same drive, three runs at 50 rad/s with u_q (open-loop, friction and order "
        "18 by the slow scan)",
        "`unknown`",
        "Believe `unknown`, not more: residuals are those of stamps rounded to 1 ms.",
    ),
    "emps": Case(
        diagnosed.emps,
        "mass 95.11 kg, viscous 203.5 N s/m, dry 20.39 N, offset -3.16 N (by force and motion of "
        "the same file); here N m stands for N, rad for m",
        "friction, viscous friction; `unknown`",
        "Believe both: 21.2 N and 196 N s/m are within 5 % of what was published, and so are the "
        "mass (94.8 kg) and the offset (3.2 N), which the answer fits but does not print "
        "(`tests/sandbox/gap/motion/test_judging_emps.py`). Nothing else is named. Believe "
        "`unknown`: three floors are left, and nothing is known beyond these four numbers.",
    ),
    "sew_map": Case(
        diagnosed.sew_map,
        "a measured map whose i_q and -i_q halves differ; ψ_q from -34 to +22 mWb",
        "yes",
        "Yes: one angle explains the asymmetry, and the fit on points held out improves, which an "
        "angle that is none would not do.",
    ),
    "odrive": Case(
        diagnosed.odrive,
        "holding-current maps: order 7, 28, 14, 36, 12, 84, 21, 56",
        "orders, phases",
        "Orders, phases and the late current: yes; friction to a factor of two "
        "([page](odrive_cogging.md)).",
    ),
    "moteus": Case(
        diagnosed.moteus,
        "R and flux of the drive's own fit",
        "yes, the refusal",
        "Right to refuse: steady points, no time series. The voltage along the current "
        "is in the points.",
    ),
    "inverter_table_nominal": Case(
        diagnosed.inverter_table_nominal,
        "a table of measured voltage errors (0 to 6.2 V a leg over 4.5 A) in [drive]",
        "yes",
        "The bench is simulated (another plant); the table is what "
        "`model/inverter_table.py` shows.",
    ),
    "inverter_table_missing": Case(
        diagnosed.inverter_table_missing,
        "the same bench, the table left out of the nominal model",
        "the curve",
        "Believe the curve: up to the rated current (1.2 A) it and what the resistance is off "
        "(0.03 ohm) lie within 0.15 V of the table. Beyond, no recording went. Until 2026-11-28 "
        "the answer was a device drop of 5 V with `unknown` beside it, and J = 1.42. Recordings "
        "at one link voltage cannot tell what share of it is dead time. J held out is above 1 "
        "where a recording goes to currents that the others do not.",
    ),
}


EXPLAINED = """Each row is a drive or a machine that others measured or computed. *Published* is what is known of it
without our diagnosis. *Verdict* and *named* are what `sensorless diagnose` says. *J* says how far simulation and
recordings differ, in noise floors (rms; 1 is noise), on recordings that no fit has seen: before and after the effects
that are named. *Cost* is the number of simulations and the seconds of processor time (older rows: by the clock); where
motion alone is judged, it is the number of sets of effects that were weighed. *Believe* is what we think of the answer.
The reasons stand below, case by case."""  # noqa: E501


def page(kept: dict[str, dict[str, Any]]) -> str:
    """Return the results as a page."""
    lines = ["Real drives with a published answer, by `python -m experiments.real_cases`.", ""]
    lines += [EXPLAINED, ""]
    lines += ["| case | published | verdict | named | J before → after | cost | believe | date |"]
    lines += ["|---|---|---|---|---|--:|---|---|"]
    lines += [row(name, c) for name, c in kept.items()]
    for name, c in kept.items():
        lines += ["", f"## {name}", ""]
        lines += [f"> {line}  " for line in c["lines"]] + [""] * bool(c["lines"])
        if orders := c.get("orders"):
            shares = ", ".join(f"{n} ({share:.0%})" for n, share in orders.items())
            lines += [f"Orders of the residual in the rotor's frame, of the gap: {shares}.", ""]
        if values := c.get("parameters"):
            lines += ["Values (SI units):", "", *listed(values), ""]
        lines += [f"**Believe it?** {CASES[name].why}"]
    return "\n".join(lines) + "\n"


def listed(values: dict[str, float]) -> list[str]:
    """Return one line an effect, or further part of one, with its values."""
    parts: dict[str, list[str]] = {}
    for name, x in values.items():
        part, _, number = name.rpartition(".")
        parts.setdefault(part, []).append(f"{number} {x:.4g}")
    return [f"- `{part}`: {', '.join(own)}" for part, own in parts.items()]


def row(name: str, c: dict[str, Any]) -> str:
    """Return a case's row of the table."""
    sizes = f"{c['before']:.3g} → {c['after']:.3g}" if c.get("before") is not None else "–"
    if "held_out_before_Wb" in c:
        sizes = f"{1e3 * c['held_out_before_Wb']:.2g} → {1e3 * c['held_out_after_Wb']:.2g} mWb"
    time_of = (
        f"{c['processor_seconds']:.0f} s"
        if "processor_seconds" in c
        else f"{c.get('seconds', 0.0):.0f} s (clock)"
    )
    cost = f"{c['simulations']}, {time_of}" if "simulations" in c else "–"
    named, case = ", ".join(c.get("effects", [])) or "–", CASES[name]
    cells = [name, case.published, c["verdict"], named, sizes, cost, case.believe, c["date"]]
    return f"| {' | '.join(cells)} |"


def main(names: list[str]) -> None:
    """Run the named cases (all), keep each with its date, write the page."""
    place = RESULTS / "real_cases.json"
    kept: dict[str, dict[str, Any]] = {}
    for name in names or CASES:
        begun, used = time.perf_counter(), time.process_time()
        with tempfile.TemporaryDirectory() as folder:
            found = CASES[name].answer_of(Path(folder))
        found = {"simulations": 0, "seconds": time.perf_counter() - begun} | found
        if "date" not in found:  # not taken from another record
            found["processor_seconds"] = time.process_time() - used
        kept = json.loads(place.read_text())["cases"] if place.is_file() else {}
        kept[name] = {"date": datetime.date.today().isoformat()} | found
        kept = {case: kept[case] for case in CASES if case in kept}
        save("real_cases", {"cases": kept})
        (RESULTS / "real_cases.md").write_text(page(kept), encoding="utf-8")
    print(page(kept))


if __name__ == "__main__":
    main(sys.argv[1:])
