"""Are several orders of a harmonic, or of the cogging torque, found at once?

Recordings come from the switched bench (practice cycles), which has the orders in lists of its own
and shares no code with the plant: the magnets' flux with orders 6, 12 and 18; with order 12 alone,
which no effect
begins with; cogging of 4, 18 and 36 a turn; inductances of order 18 whose amplitudes grow with the
current, as slots make them.  Table: results/several_orders.md.

Run: python -m experiments.several_orders [CASE ...]
    (all: 8 min of one core; other rows stay as they are)
"""

from __future__ import annotations

import dataclasses
import datetime
import sys
from collections.abc import Mapping, Sequence

from experiments.drawing import RESULTS
from model.effects.library import load_effect
from sandbox.gap.diagnose import Diagnosis, diagnosis_of, verdict
from sandbox.recordings.campaign import Campaign
from sandbox.withheld.making.case_list import Case
from sandbox.withheld.making.draw import Drawn, draw
from sandbox.withheld.making.make import campaign_of

SEED = 777
FLUX = {  # of the magnet flux
    "flux_harmonics.psi_d6": 0.01,
    "flux_harmonics.psi_q6": 0.006,
    "flux_harmonics.2.psi_d": 0.004,
    "flux_harmonics.2.psi_q": -0.003,
    "flux_harmonics.3.psi_d": 0.003,
}
TORQUE = {  # of the rated torque
    "cogging_torque.amplitude": 0.03,
    "cogging_torque.2.amplitude": 0.015,
    "cogging_torque.3.amplitude": 0.02,
}
# of the scales on the effect's card: 1 / L_d, and rated current over the square of its flux
SLOTS = {
    "back": 0.01,
    "alpha_30": 0.02,
    "alpha_12": -0.02,
    "alpha_21": 0.02,
    "alpha_03": 0.015,
}


def planted(name: str, drawn: Drawn) -> dict[str, float]:
    """Return the orders of a case (SI)."""
    flux, torque = drawn.true.motor.magnet_flux, drawn.true.motor.rated_torque
    if name == "flux 6, 12, 18":
        orders = {"flux_harmonics.2.order": 12.0, "flux_harmonics.3.order": 18.0}
        return {k: x * flux for k, x in FLUX.items()} | orders
    if name == "flux 12":
        sizes = {"flux_harmonics.2.psi_d": 0.008 * flux, "flux_harmonics.2.psi_q": 0.005 * flux}
        return {**sizes, "flux_harmonics.2.order": 12.0}
    if name == "inductance 18, growing with the current":
        part = {p.name: p for p in load_effect("inductance_harmonics").part(2).parameters}
        sizes = {
            k: x / part[k].typical * part[k].typical_for(drawn.true.motor, drawn.true.converter)
            for k, x in SLOTS.items()
        }
        return {f"inductance_harmonics.2.{k}": x for k, x in sizes.items()} | {
            "inductance_harmonics.2.order": 18.0
        }
    shapes = {
        "cogging_torque.order_mech": 18.0,
        "cogging_torque.phase": 0.7,
        "cogging_torque.2.order_mech": 36.0,
        "cogging_torque.2.phase": -1.1,
        "cogging_torque.3.order_mech": 4.0,
        "cogging_torque.3.phase": 2.0,
    }
    return {k: x * torque for k, x in TORQUE.items()} | shapes


CASES = (
    "flux 6, 12, 18",
    "flux 12",
    "cogging 4, 18, 36",
    "inductance 18, growing with the current",
)
HEAD = [
    "# Several orders at once",
    "",
    "By `python -m experiments.several_orders`. *Planted* is what the bench has, *found* what the "
    "diagnosis says, each after its order. Flux in Wb, torque in N m, phase in rad; `gamma`, "
    "`back` and `pulse` in 1/H, `alpha` in A/Wb².",
    "",
    "| on the bench | hypothesis | J held out | planted | found | simulations | date |",
    "|---|---|---|---|---|--:|---|",
]


def recorded(name: str) -> tuple[Campaign, dict[str, float]]:
    """Return a campaign of the switched bench with a case's orders, and these."""
    drawn = draw(Case(CASES.index(name), "none", "ipm_exchanged", "practice"), SEED)
    own = planted(name, drawn)
    return campaign_of(dataclasses.replace(drawn, plant={**drawn.plant, **own})), own


def by_order(values: Mapping[str, float]) -> list[tuple[float, str]]:
    """Return orders with what belongs to each, in words; the first part of flux harmonics is the
    sixth."""
    parts: dict[str, dict[str, float]] = {}
    for name, x in values.items():
        effect, *k, number = name.split(".")
        if effect in ("flux_harmonics", "cogging_torque", "inductance_harmonics"):
            parts.setdefault(".".join((effect, *k)), {})[
                number.removesuffix("6").removesuffix("_")
            ] = x
    rows = []
    for own in parts.values():
        order = own.pop("order_mech", own.pop("order", 6.0))
        numbers = (f"{n} {x:.4g}" for n, x in sorted(own.items()) if n != "phase" or x)
        rows.append((order, ", ".join(numbers)))
    return sorted(rows)


def row(name: str) -> str:
    """Return the table's row of a case."""
    campaign, own = recorded(name)
    d: Diagnosis = diagnosis_of(
        campaign, workers=1, report=lambda words: print(f"{name}: {words}", flush=True)
    )
    found = {k: e.value for k, e in d.parameters[0].items()}
    cells = [
        name,
        f"{' + '.join(d.best.effects)} ({d.best.probability:.3f}), {verdict(d)}",
        f"{d.size.before:.2f} → {d.size.after:.3f}",
        *("; ".join(f"{n:g}: {rows}" for n, rows in by_order(x)) for x in (own, found)),
        str(d.simulations),
    ]
    return "| " + " | ".join(cells) + " |"


def main(names: Sequence[str]) -> None:
    """Record, diagnose and write the table; rows of other cases are kept."""
    place = RESULTS / "several_orders.md"
    rows = {
        x.split(" | ")[0][2:]: x
        for x in place.read_text(encoding="utf-8").splitlines()
        if x.startswith("| ")
    }
    for name in names or CASES:
        rows[name] = f"{row(name)[:-1]}| {datetime.date.today()} |"
        text = "\n".join([*HEAD, *(rows[x] for x in CASES if x in rows)]) + "\n"
        place.write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main(sys.argv[1:])
